"""The copy of a submission that is judged: plain files only, by their names, and never too much."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from lab3_usd.grade.intake.file_filter import (
    LARGEST_YAML,
    YAML,
    RefusedFile,
    is_hidden,
    name_fault,
    only_name_counts,
    path_parts,
    yaml_fault,
)
from lab3_usd.grade.intake.limits import Limits

_CHUNK = 1 << 20
_AS_LARGE = 8 << 20  # bytes of the placeholder of a large file in the copy of a class
_CLASH = "a file and a folder have the same name"


@dataclass(slots=True)
class SubmissionCopy:
    """The copy of a submission that is judged: plain files below `target`, and nothing else.

    With `archives`, the files of a class come in as they are, and archives in an archive too:
    those of a class are students', and are looked into one by one. `hidden` are the names of what
    is passed over there without a word, and `is_nested` holds while an archive that lay in another
    is unpacked.
    """

    target: Path
    limits: Limits
    archives: bool = False
    digests: dict[str, str] = field(default_factory=dict)
    refused: list[RefusedFile] = field(default_factory=list)
    hidden: list[str] = field(default_factory=list)
    taken: int = 0
    is_nested: bool = False

    def refuse(self, name: str, reason: str) -> None:
        """Record that a file is not taken in."""
        self.refused.append(RefusedFile(name.encode("utf-8", "backslashreplace").decode(), reason))
        self._check_count()

    def _check_count(self, more: int = 0) -> None:
        self.limits.check_count(len(self.digests) + len(self.refused) + more)

    def place(self, name: str) -> Path | None:
        """Return where a file of this name goes; None for leftovers and names that are refused."""
        parts = path_parts(name)
        if not parts or is_hidden(parts):
            if self.archives:
                self.hidden.append(name)
            return None
        reason = name_fault(name, self.limits, of_class=self.archives)
        if reason:
            self.refuse(name, reason)
            return None
        return self.target.joinpath(*parts)

    def take(self, name: str, size: int, stream: BinaryIO) -> None:
        """Copy one file in, never more than `size` bytes of it, the size it says it has.

        Raises:
            TooLargeError: the submission holds too many files or too much in them.
        """
        path = self.place(name)
        if path is None:
            return
        if str(path) in self.digests:
            self.refuse(name, "it is there twice; the other one counts")
            return
        self._check_count(1)
        if only_name_counts(name, size):
            self._keep_name(name, path, size)
            return
        if size > self.limits.file_size:
            self.refuse(name, f"it is larger than {self.limits.file_size >> 20} MB; not opened")
            return
        if name.lower().endswith(YAML) and not self.archives:
            data = stream.read(min(size, LARGEST_YAML + 1))
            reason = yaml_fault(data)
            if reason:
                self.refuse(name, reason)
                return
            stream = io.BytesIO(data)
        self.taken += size
        self.limits.check_size(self.taken)
        self._write(name, path, size, stream)

    def _write(self, name: str, path: Path, size: int, stream: BinaryIO) -> None:
        digest = hashlib.sha256()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as file:
                while size > 0:
                    data = stream.read(min(size, _CHUNK))
                    if not data:
                        break
                    size -= len(data)
                    digest.update(data)
                    file.write(data)
        except (FileExistsError, NotADirectoryError, IsADirectoryError):
            self.refuse(name, _CLASH)
            return
        self.digests[str(path)] = digest.hexdigest()

    def forget(self, name: str, reason: str) -> None:
        """Drop a file whose contents turned out to be damaged half-way, and say so."""
        path = self.place(name)
        if path is not None and str(path) not in self.digests:
            path.unlink(missing_ok=True)
            self.refuse(name, reason)

    def _keep_name(self, name: str, path: Path, size: int) -> None:
        """Take in a file by its name alone: a picture or video, whose contents are not judged.

        In the copy of a class it keeps a size, by which it is told once more.
        """
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as file:
                file.truncate(min(size, _AS_LARGE) if self.archives else 1)
        except (FileExistsError, NotADirectoryError, IsADirectoryError):
            self.refuse(name, _CLASH)
            return
        self.digests[str(path)] = ""

    def keep_folder(self, name: str) -> None:
        """Make a folder of a class, also when it is empty: a student may have handed it in."""
        path = self.place(name) if self.archives else None
        if path is not None:
            try:
                path.mkdir(parents=True, exist_ok=True)
            except OSError:
                self.refuse(name, _CLASH)

    def digest(self) -> str:
        """Return what tells this submission from every other, wherever it was copied to."""
        digest = hashlib.sha256()
        for path in sorted(self.digests):
            name = Path(path).relative_to(self.target).as_posix()
            digest.update(f"{name}\0{self.digests[path]}\n".encode())
        for refused in sorted(self.refused, key=lambda each: (each.path, each.reason)):
            digest.update(f"{refused.path}\0{refused.reason}\n".encode())
        return digest.hexdigest()
