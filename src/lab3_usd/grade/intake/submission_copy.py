"""The copy of a submission that is judged: plain files only, by their names, and never too much."""

from __future__ import annotations

import errno
import hashlib
import io
import os
import re
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import BinaryIO

from msgspec import Struct

from lab3_usd.deliverables.plain_yaml import bracket_depth
from lab3_usd.errors import Lab3Error
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint

MEGABYTE = 1024 * 1024


class TooLargeError(Lab3Error):
    """A submission holds more than the limits allow; none of it is judged."""


class UnreachedError(Lab3Error):
    """A submission did not reach the judge, by a fault of a computer, and not of the student."""


# What a file may bring about by its name, kind or size; all else is the fault of the computer.
_OF_FILES = (
    errno.ELOOP, errno.ENAMETOOLONG, errno.EINVAL, errno.EILSEQ, errno.ENOTDIR, errno.EISDIR,
    errno.EEXIST, errno.ENXIO, errno.EFBIG,
)  # fmt: skip


def check_reached(name: str, error: Exception) -> None:
    """Raise UnreachedError where a computer, and nothing in a file, keeps it from being copied."""
    if isinstance(error, OSError) and error.errno is not None and error.errno not in _OF_FILES:
        raise UnreachedError(f"{name}: cannot be read ({error.strerror})") from error


class Limits(Struct, frozen=True):
    """Limits of one submission.

    `seconds` of processor time without progress end the judging of a file, `all_seconds` that of
    the submission: no other work on the machine changes them. `by_clock` ends what hangs, after
    `clock_times` as long, which on a busy machine is at least `clock_least` seconds. `memory`
    is in bytes beyond what a worker needs to begin with, `answer_size` what a worker may answer,
    reports included. Files beyond `file_size` bytes are not opened; `ratio` is how many times
    larger a packed file may become, `nesting` how deep prims and values may lie in one another.
    """

    seconds: float = 20.0
    memory: int = 2048 * MEGABYTE
    files: int = 4000
    file_size: int = 64 * MEGABYTE
    total_size: int = 512 * MEGABYTE
    ratio: int = 200
    folders: int = 24
    nesting: int = 200
    prims: int = 100_000
    answer_size: int = 64 * MEGABYTE
    all_times: float = 10.0  # a submission has more than one file
    clock_times: float = 10.0
    clock_least: float = 60.0

    @property
    def all_seconds(self) -> float:
        """Processor time that a submission may take; fetching it takes as long by the clock."""
        return self.all_times * self.seconds

    def by_clock(self, seconds: float) -> float:
        """Return how long work of so much processor time may take; pauses do not count."""
        return max(self.clock_times * seconds, self.clock_least)

    def check_count(self, files: int) -> None:
        """Raise TooLargeError where a submission holds more files than it may."""
        if files > self.files:
            raise TooLargeError(f"holds more than {self.files} files")

    def check_size(self, total: int) -> None:
        """Raise TooLargeError where the files of a submission hold more bytes than they may."""
        if total > self.total_size:
            raise TooLargeError(f"holds more than {self.total_size >> 20} MB")


_LONGEST_NAME = 200  # bytes; file systems end at 255
_LONGEST_OF_CLASS = 255
_LONGEST_PATH = 1000
# Files that operating systems, editors and Isaac Sim leave behind.
LEFTOVERS = ("__MACOSX", "__pycache__", "Thumbs.db", "desktop.ini")
YAML = (".yaml", ".yml")
LARGEST_YAML = 8 << 20  # saved messages may be long; maps and parameters are some kilobytes
_ALIAS = re.compile(rb"(?<![^\s\[{,:-])\*\w")
_MOST_ALIASES = 50  # a few lines of aliases of aliases unfold to gigabytes
_MOST_BRACKETS = 60
# Their contents are not judged; their names count as deliverables.
_ONLY_NAMES = (
    ".mp4", ".mov", ".mkv", ".webm", ".avi", ".png", ".jpg", ".jpeg", ".webp", ".gif", ".bmp",
    ".tif", ".tiff", ".heic", ".pdf", ".doc", ".docx", ".odt",
)  # fmt: skip
_MAPS_MAY_BE = (".png", ".bmp")
_SMALL_PICTURE = 4 << 20


# What version control, environments and builds (colcon's `build`, `install`, `log`) are called.
_MADE = (".git", ".venv", "venv", "build", "install", "log", "node_modules", "__pycache__")
_PASSED_OVER = "programs fill folders of this name; its content is not judged"
_CLOUD_FILE = re.compile(r"^\.(?P<name>.+)\.icloud$")
_IN_THE_CLOUD = "it is a placeholder of iCloud, not the file itself"
FILE_LEFT_OUT, FILE_PASSED_OVER = "Z01", "Z05"  # the rules that say so to a student
_LATEST = 2**32  # seconds, beyond which not every file system counts


class RefusedFile(Struct, frozen=True):
    """A file or folder of a submission that is not copied, by its path there, and why.

    `rule` is the one that says so to the student.
    """

    path: str
    reason: str
    rule: str = FILE_LEFT_OUT


def path_parts(name: str) -> list[str]:
    """Return the parts of a path in a submission, whichever system wrote it."""
    return [part for part in name.replace("\\", "/").split("/") if part not in {"", "."}]


def is_hidden(parts: list[str]) -> bool:
    """Whether a file is passed over without a word: hidden files, and what programs leave."""
    if parts and _CLOUD_FILE.match(parts[-1]):
        parts = parts[:-1]
    return any((part.startswith(".") and part != "..") or part in LEFTOVERS for part in parts)


def stage_seeker(files_in: Callable[[str], Iterable[str]]) -> Callable[[str], bool]:
    """Return what tells whether a folder holds stages of checkpoints, from the names of its files.

    `files_in` lists the files of a folder by its path, and is asked once for each.
    """
    lab = load_lab()

    @cache
    def holds_stages(folder: str) -> bool:
        places = (folder, f"{folder}/{lab.submission.folders.stages}")
        files = (file for place in places for file in files_in(place))
        return any(named_checkpoint(file, lab.files) for file in files)

    return holds_stages


def made_folder(name: str, holds_stages: Callable[[str], bool]) -> str:
    """Return the topmost folder above a file that programs generate, '' for none.

    A folder that holds stages of checkpoints, or that the lab requires, belongs to the student,
    whatever its name.
    """
    own = load_lab().submission.folders
    asked = {own.stages, own.starter, own.maps, *own.shown}
    parts = path_parts(name)
    for index, part in enumerate(parts[:-1], start=1):
        folder = "/".join(parts[:index])
        if part in _MADE and part not in asked and not holds_stages(folder):
            return folder
    return ""


def is_made_name(name: str) -> bool:
    """Whether a file lies below a folder that is called as those that programs fill."""
    return not set(_MADE).isdisjoint(path_parts(name)[:-1])


def name_fault(name: str, limits: Limits, *, of_class: bool = False) -> str:
    """Say why a file of this name is not copied; '' for a name that is fine.

    The files of a class are looked at again as the student's own, without the student's name.
    """
    parts = path_parts(name)
    if ".." in parts or name.startswith(("/", "\\")) or (len(name) > 1 and name[1] == ":"):
        return "its name leads out of the submission; it is not unpacked"
    if "\0" in name or not (of_class or all(part.isprintable() for part in parts)):
        return "its name holds characters that do not print"
    lengths = [len(part.encode(errors="surrogateescape")) for part in parts]
    longest = _LONGEST_OF_CLASS if of_class else _LONGEST_NAME
    if max(lengths) > longest or sum(lengths) + len(lengths) > _LONGEST_PATH:
        return "its name is too long"
    if len(parts) > limits.folders:
        return f"it lies more than {limits.folders} folders deep"
    return ""


def only_name_counts(name: str, size: int) -> bool:
    """Whether the contents of a file are not judged: pictures, videos and documents."""
    lower = name.lower()
    if lower.endswith(_MAPS_MAY_BE) and size <= _SMALL_PICTURE:
        return False
    return lower.endswith(_ONLY_NAMES)


def is_content_read(name: str, size: int, limits: Limits) -> bool:
    """Whether the contents of a file are read: they are judged, and not too large."""
    return size <= limits.file_size and not only_name_counts(name, size)


def yaml_fault(data: bytes) -> str:
    """Say why YAML is not opened; it may have more aliases or brackets than maps and parameters."""
    if len(data) > LARGEST_YAML:
        return f"it is larger than {LARGEST_YAML >> 20} MB; not opened"
    if len(_ALIAS.findall(data)) > _MOST_ALIASES or bracket_depth(data) > _MOST_BRACKETS:
        return "it expands to far more than its size; not opened"
    return ""


_CHUNK = 1 << 20
_AS_LARGE = 8 << 20  # bytes of the placeholder of a large file in the copy of a class
LEADS_OUT = "it is a link that leads out of the submission; not opened"
LEADS_TO_NO_FILE = "it is a link to something outside the judged files; not opened"
_TWICE = "it exists twice; the other one counts"
_CLASH = "a file and a folder have the same name"
_CLASHES = (FileExistsError, NotADirectoryError, IsADirectoryError)


@dataclass(slots=True)
class SubmissionCopy:
    """The copy of a submission that is judged: plain files below `target`, and nothing else.

    With `archives`, the files of a class come in as they are, and archives in an archive too:
    those of a class are students', and are looked into one by one. `hidden` are the names of what
    is passed over there without a word, and `is_nested` holds while an archive that lay in another
    is unpacked. `unpacked` are the folders that stand for archives, the outer ones first, and
    `links` those of a class, with what they lead to.
    """

    target: Path
    limits: Limits
    archives: bool = False
    digests: dict[str, str] = field(default_factory=dict)
    refused: list[RefusedFile] = field(default_factory=list)
    hidden: list[str] = field(default_factory=list)
    passed_over: dict[str, None] = field(default_factory=dict)
    unpacked: list[str] = field(default_factory=list)
    links: dict[str, str] = field(default_factory=dict)
    taken: int = 0
    is_nested: bool = False

    def pass_over(self, folder: str) -> None:
        """Leave a folder aside that programs fill."""
        self.passed_over[folder] = None

    def say_passed_over(self) -> None:
        """Record the folders that were passed over; in a submission each name of them once."""
        by_name: dict[str, list[str]] = {}
        for folder in sorted(self.passed_over):
            own = folder if self.archives else folder.rpartition("/")[2]
            by_name.setdefault(own, []).append(folder)
        for first, *further in by_name.values():
            more = f" (and in {len(further)} more of this name)" if further else ""
            self.refuse(first, f"{_PASSED_OVER}{more}", FILE_PASSED_OVER)
        self.passed_over.clear()

    def refuse(self, name: str, reason: str, rule: str = FILE_LEFT_OUT) -> None:
        """Record that a file is not taken in."""
        path = name.encode("utf-8", "backslashreplace").decode()
        self.refused.append(RefusedFile(path, reason, rule))
        self.limits.check_count(len(self.digests) + len(self.refused))

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

    def take_link(self, name: str, target: str) -> None:
        """Copy in again, under another name, a file that was taken in."""
        path = self.target.joinpath(*path_parts(target))
        if str(path) not in self.digests:
            self.refuse(name, LEADS_TO_NO_FILE)
            return
        status = path.stat()
        with path.open("rb") as stream:
            self.take(name, status.st_size, stream, status.st_mtime)

    def take(self, name: str, size: int, stream: BinaryIO, changed: float = 0.0) -> None:
        """Copy one file in, never more than `size` bytes of it, the size it says it has.

        Of a picture or video, whose contents are not judged, the name alone is taken in. `changed`
        is when it was last changed, in seconds, as the archive or file system says.

        Raises:
            TooLargeError: the submission holds too many files or too much in them.
        """
        path = self.place(name)
        if path is None:
            return
        cloud_file = _CLOUD_FILE.match(path.name)
        if cloud_file and not self.archives:
            parent, slash, _ = name.rpartition("/")
            self.refuse(f"{parent}{slash}{cloud_file['name']}", _IN_THE_CLOUD)
            return
        if str(path) in self.digests:
            self.refuse(name, _TWICE)
            return
        self.limits.check_count(len(self.digests) + len(self.refused) + 1)
        is_read = not only_name_counts(name, size)
        if is_read:
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
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as file:
                if is_read:
                    digest = _copied(stream, size, file)
                else:  # in the copy of a class it keeps a size, by which it is recognised
                    file.truncate(min(size, _AS_LARGE) if self.archives else 1)
                    digest = ""
        except _CLASHES:
            self.refuse(name, _CLASH)
            return
        self.digests[str(path)] = digest
        if is_read:
            os.utime(path, (0.0, changed if 0 <= changed <= _LATEST else 0.0))

    @property
    def names(self) -> list[str]:
        """The names of the files that were taken in, below `target`."""
        return [Path(path).relative_to(self.target).as_posix() for path in self.digests]

    def move(self, name: str, goal: str) -> None:
        """Move a file that was taken in to where no other one is."""
        path, new = (self.target.joinpath(*path_parts(at)) for at in (name, goal))
        digest = self.digests.pop(str(path))
        if str(new) in self.digests:
            self.refuse(goal, _TWICE)
            return
        try:
            if new.is_dir():
                raise IsADirectoryError(goal)
            new.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(path, new)  # Landlock lets nobody rename into another folder
        except _CLASHES:
            self.refuse(goal, _CLASH)
            return
        self.digests[str(new)] = digest

    def forget(self, name: str, reason: str) -> None:
        """Drop a file whose contents turned out to be damaged half-way, and say so."""
        path = self.place(name)
        if path is not None and str(path) not in self.digests:
            path.unlink(missing_ok=True)
            self.refuse(name, reason)

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
        for refused in sorted(self.refused, key=lambda entry: (entry.path, entry.reason)):
            digest.update(f"{refused.path}\0{refused.reason}\n".encode())
        return digest.hexdigest()


def _copied(stream: BinaryIO, size: int, file: BinaryIO) -> str:
    """Copy so many bytes, or as many as there are, and return their digest."""
    digest = hashlib.sha256()
    while data := stream.read(min(size, _CHUNK)):
        size -= len(data)
        digest.update(data)
        file.write(data)
    return digest.hexdigest()
