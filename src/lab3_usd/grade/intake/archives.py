"""Unpacks untrusted archives: plain files are copied, everything else is named and left out."""

from __future__ import annotations

import calendar
import contextlib
import io
import lzma
import shutil
import stat
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from msgspec import Struct

from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.grade.intake.submission_copy import (
    LEADS_OUT,
    MEGABYTE,
    Limits,
    SubmissionCopy,
    TooLargeError,
    check_reached,
    is_content_read,
    is_hidden,
    is_made_name,
    made_folder,
    name_fault,
    only_name_counts,
    path_parts,
    stage_seeker,
)
from lab3_usd.spec.lab import CHECKPOINTS
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.yaml_file import read_foreign_yaml

# What a lab is made of: text, and a map.
_LAB_LIMITS = Limits(files=500, file_size=16 * MEGABYTE, total_size=64 * MEGABYTE, folders=6)
_CODE = (".py", ".pyc", ".pyd", ".so", ".dll", ".exe", ".sh", ".bat", ".ps1")
NO_ARCHIVE = "is damaged or not an archive; pack it again"
_BY_CONTENT = " by its content, not "
ZIP_ENDINGS = (".zip",)
TAR_ENDINGS = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz")
OTHER_ENDINGS = (".rar", ".7z", ".tar.zst", ".gz", ".bz2", ".xz")
# How files of other kinds begin: where, with what in lower case; their endings where they are
# unpacked.
_KINDS: tuple[tuple[int, bytes, str, tuple[str, ...]], ...] = (
    (0, b"pk\3\4", "a zip archive", ZIP_ENDINGS),
    (0, b"\x1f\x8b", "a gzip archive (.tar.gz)", TAR_ENDINGS),
    (0, b"bzh", "a bzip2 archive (.tar.bz2)", TAR_ENDINGS),
    (0, b"\xfd7zxz\0", "an xz archive (.tar.xz)", TAR_ENDINGS),
    (257, b"ustar", "a tar archive", TAR_ENDINGS),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive", ()),
    (0, b"rar!\x1a\x07", "a rar archive", ()),
    (0, b"\x28\xb5\x2f\xfd", "a zstd archive", ()),
    (0, b"%pdf", "a PDF document", ()),
    (0, b"<!doctype html", "a web page", ()),
    (0, b"<html", "a web page", ()),
    (0, b"pxr-usdc", "a USD stage", ()),
    (0, b"#usda", "a USD stage", ()),
)
_LONGEST_START = 512  # bytes
_SMALL = 1 << 20  # a file that small is no bomb, whatever its ratio
_ENCRYPTED = 0x1
_LONGEST_LINK = 4096  # bytes
_MOST_LINKS = 40  # one after the other
_DAMAGED = (
    zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError, EOFError, OSError,
    ValueError, NotImplementedError, RuntimeError, IndexError, OverflowError,
)  # fmt: skip


class ArchiveError(Lab3Error):
    """An archive that nothing can be unpacked from; the line says why."""


def is_archive(name: str) -> bool:
    """Whether a file of this name is an archive that can be unpacked."""
    return name.lower().endswith((*ZIP_ENDINGS, *TAR_ENDINGS))


def holds_nothing(reason: str) -> bool:
    """Whether a file is left out for this reason: it is no archive that can be unpacked."""
    return reason == NO_ARCHIVE or _BY_CONTENT in reason


def _take(stream: BinaryIO, size: int, name: str, changed: float, copy: SubmissionCopy) -> None:
    """Take in a file of an archive; one that is an archive itself in a folder of its own.

    An archive in one of those is refused; those in the archive of a class stay whole.
    """
    if copy.archives or not is_archive(name):
        copy.take(name, size, stream, changed)
        return
    if is_hidden(path_parts(name)):
        return
    if copy.is_nested:
        copy.refuse(name, "it is nested more than one archive deep; not unpacked")
        return
    if size > copy.limits.file_size:
        copy.refuse(name, f"it is larger than {copy.limits.file_size >> 20} MB; not opened")
        return
    endings = (*ZIP_ENDINGS, *TAR_ENDINGS)  # which tell what kind of archive it is
    ending = next(ending for ending in endings if name.lower().endswith(ending))
    with tempfile.TemporaryDirectory(prefix="lab3-nested-") as folder:
        inner = Path(folder, f"archive{ending}")
        with inner.open("wb") as file:
            shutil.copyfileobj(stream, file)
        copy.is_nested = True
        try:
            unpack_beside(inner, name, copy)
        except ArchiveError as error:
            copy.refuse(name, str(error).partition(": ")[2])
        finally:
            copy.is_nested = False


def unpack_beside(archive: Path, name: str, copy: SubmissionCopy) -> None:
    """Take in the files of an archive that is not alone, below a folder that stands for it.

    Raises:
        ArchiveError: see `unpack`.
        TooLargeError: see `unpack`.
    """
    parent, slash, own = name.rpartition("/")
    if name_fault(own, copy.limits):
        own = f"archive {len(copy.unpacked) + 1}"
    copy.unpacked.append(f"{parent}{slash}{own}")
    unpack(archive, f"{copy.unpacked[-1]}/", copy)


def unpack(archive: Path, prefix: str, copy: SubmissionCopy) -> None:
    """Take in the files of an archive under `prefix`.

    The one folder that holds everything in a student's archive is left out.

    Raises:
        ArchiveError: it is damaged from the start, or of no kind that is known.
        TooLargeError: it holds too many files or too much in them.
        UnreachedError: this computer cannot read it, or has no room for what it holds.
    """
    try:
        archive.open("rb").close()
    except OSError as error:  # which is not the fault of the archive
        check_reached(archive.name, error)
        raise ArchiveError(f"{archive.name}: cannot be read ({error.strerror})") from error
    reader = _from_zip if archive.name.lower().endswith(ZIP_ENDINGS) else _from_tar
    taken = len(copy.digests)
    try:
        reader(archive, prefix, copy)
    except _DAMAGED as error:
        check_reached(archive.name, error)
        # Students would be lost with what follows in the archive of a class.
        if len(copy.digests) == taken or copy.archives:
            raise ArchiveError(f"{archive.name}: {_what_it_is(archive) or NO_ARCHIVE}") from error
        copy.refuse(archive.name, "the archive is damaged; the rest of it is lost")


def _what_it_is(archive: Path) -> str:
    """Say what a file is by its content, where its ending names another kind of archive."""
    with archive.open("rb") as file:
        start = file.read(_LONGEST_START)
    own = TAR_ENDINGS if archive.name.lower().endswith(TAR_ENDINGS) else ZIP_ENDINGS
    for begin, mark, kind, endings in _KINDS:
        if start[begin:].lower().startswith(mark) and endings != own:
            ending = next(end for end in (*TAR_ENDINGS, *own) if archive.name.lower().endswith(end))
            advice = f"give it the ending {endings[0]}" if endings else "pack the work as .zip"
            return f"is {kind}{_BY_CONTENT}{ending}; {advice}"
    return ""


def _from_zip(archive: Path, prefix: str, copy: SubmissionCopy) -> None:
    with zipfile.ZipFile(archive) as packed:
        entries = packed.infolist()
        files = [info.filename for info in entries if not info.is_dir()]
        copy.limits.check_count(sum(not is_made_name(name) for name in files))
        inside = _Inside(prefix, files, copy)
        for entry in entries:
            name = inside.name(entry.filename)
            if entry.is_dir():
                copy.keep_folder(name)
            elif inside.is_made(entry.filename):
                continue
            elif stat.S_ISLNK(entry.external_attr >> 16):
                target = "/"  # a link leads to what it holds; '/' is nowhere
                if entry.file_size <= _LONGEST_LINK and not entry.flag_bits & _ENCRYPTED:
                    target = packed.read(entry).decode("utf-8", "surrogateescape")
                inside.links[_plain(entry.filename)] = _Link(target)
            else:
                _zip_entry(packed, entry, name, copy)
        inside.take_links()


def _zip_entry(
    packed: zipfile.ZipFile, entry: zipfile.ZipInfo, name: str, copy: SubmissionCopy
) -> None:
    reason = _zip_fault(entry, copy.limits.ratio)
    if reason:
        copy.refuse(name, reason)
        return
    # A file that counts by its name is not opened: it may be of any kind.
    is_opened = not only_name_counts(entry.filename, entry.file_size)
    try:
        with packed.open(entry) if is_opened else io.BytesIO() as opened:
            stream, changed = cast("BinaryIO", opened), _seconds(entry.date_time)
            _take(stream, entry.file_size, name, changed, copy)
    except _DAMAGED as error:
        check_reached(name, error)
        copy.forget(name, "it is damaged in the archive")


def _seconds(written: tuple[int, ...]) -> float:
    """Return the time of an entry of a zip file, which names no time zone; 0 for none."""
    try:
        return float(calendar.timegm((*written, 0, 0, 0)))
    except ValueError:  # month 0 is written where the time is not known
        return 0.0


def _zip_fault(entry: zipfile.ZipInfo, ratio: int) -> str:
    """Say why a file in an archive is not taken in, '' for one that is fine."""
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in {0, stat.S_IFREG}:
        return "it is a link, pipe or device; not unpacked"
    if only_name_counts(entry.filename, entry.file_size):
        return ""
    if entry.flag_bits & _ENCRYPTED:
        return "it is encrypted; hand in an archive without a password"
    if entry.file_size > max(_SMALL, ratio * max(entry.compress_size, 1)):
        return f"it would grow to more than {ratio} times its packed size; not unpacked"
    return ""


def _from_tar(archive: Path, prefix: str, copy: SubmissionCopy) -> None:
    """Read the archive twice: the names first, so that its single folder is known."""
    names: list[str] = []
    with contextlib.suppress(*_DAMAGED):  # the names up to where it is damaged
        for name, member, _ in _tar_entries(archive, copy):
            if not member.isdir():
                names.append(name)
    inside = _Inside(prefix, names, copy)
    for path, member, packed in _tar_entries(archive, copy):
        name = inside.name(path)
        if member.isdir():
            copy.keep_folder(name)
        elif inside.is_made(path):
            continue
        elif member.issym() or member.islnk():
            target = member.linkname if len(member.linkname) <= _LONGEST_LINK else "/"
            inside.links[_plain(path)] = _Link(target, from_top=member.islnk())
        elif not member.isreg() or member.issparse():
            copy.refuse(name, "it is a link, pipe or device; not unpacked")
        else:
            stream = cast("BinaryIO", packed.extractfile(member))  # a plain file has one
            _take(stream, member.size, name, member.mtime, copy)
    inside.take_links()


def _tar_entries(
    archive: Path, copy: SubmissionCopy
) -> Iterator[tuple[str, tarfile.TarInfo, tarfile.TarFile]]:
    total = 0
    allowed = max(_SMALL, copy.limits.ratio * archive.stat().st_size)
    with tarfile.open(archive, "r:*") as packed:
        count = 0
        for member in packed:
            is_made = is_made_name(member.name)
            if is_content_read(member.name, member.size, copy.limits) and (
                copy.archives or not is_made
            ):
                total += max(member.size, 0)
            count += not is_made and (copy.archives or not member.isdir())
            copy.limits.check_count(count - 1)
            if total > copy.limits.total_size or total > allowed:
                raise TooLargeError(
                    f"grows to more than {min(total, copy.limits.total_size) >> 20} MB"
                )
            yield member.name, member, packed


class _Link(Struct, frozen=True):
    """A link in an archive: where it leads to, seen from its folder or from the archive's top."""

    target: str
    from_top: bool = False


class _Inside:
    """What the names in one archive say: its single folder, folders of programs, links.

    The one folder that holds everything in a student's archive is left out, except for the folder
    of stages.
    """

    def __init__(self, prefix: str, files: Sequence[str], copy: SubmissionCopy) -> None:
        """Look at the names of all files."""
        self._prefix, self._copy = prefix, copy
        top = _common_top(files)
        is_home = top.lower() == f"{load_lab().submission.folders.stages}/".lower()
        self._top = "" if copy.archives or is_home else top
        self.links: dict[str, _Link] = {}
        by_folder: dict[str, list[str]] = {}
        for file in files:
            folder, _, name = _plain(file).rpartition("/")
            by_folder.setdefault(folder, []).append(name)
        self._holds_stages = stage_seeker(lambda folder: by_folder.get(folder, ()))

    def name(self, path: str) -> str:
        """Return what a file of the archive is called in the submission."""
        return self._prefix + path.removeprefix(self._top)

    def is_made(self, path: str) -> bool:
        """Whether a file lies in a folder that programs fill, which is passed over as a whole."""
        folder = made_folder(path, self._holds_stages)
        if not folder or (self._copy.archives and "/" not in folder):  # which is a student there
            return False
        self._copy.pass_over(self.name(folder))
        return True

    def take_links(self) -> None:
        """Take in the links to files of the archive that were taken in, as files.

        In the archive of a class it is not known yet whose they are.
        """
        for path in self.links:
            name, target = self.name(path), self._target(path)
            if target is None:
                self._copy.refuse(name, LEADS_OUT)
                continue
            if self._copy.archives:
                self._copy.links[name] = self.name(target)
            else:
                self._copy.take_link(name, self.name(target))

    def _target(self, path: str) -> str | None:
        """Return the file of the archive that a link leads to, None where it leads out of it."""
        waiting, reached, followed = path.split("/"), list[str](), 0
        while waiting:
            part = waiting.pop(0)
            if part == "..":
                if not reached:
                    return None
                reached.pop()
            elif part not in {"", "."}:
                reached.append(part)
            link = self.links.get("/".join(reached))
            if link is None or part in {"", ".", ".."}:
                continue
            followed += 1
            if followed > _MOST_LINKS or link.target.startswith("/"):
                return None
            reached = [] if link.from_top else reached[:-1]
            waiting = [*link.target.split("/"), *waiting]
        return "/".join(reached)


def _plain(path: str) -> str:
    """Return a path in an archive as every system writes it, without what leads nowhere."""
    return "/".join(path_parts(path))


def _common_top(names: Iterable[str]) -> str:
    """Return the folder that everything in an archive lies in, with its slash; '' for none."""
    parts = [name.partition("/") for name in names if not name.startswith("__MACOSX/")]
    tops = {top for top, _, _ in parts}
    if len(tops) != 1 or not all(slash for _, slash, _ in parts) or tops & {"", ".", ".."}:
        return ""
    return f"{tops.pop()}/"


@contextmanager
def unpacked_lab(archive: Path) -> Iterator[Path]:
    """Unpack the zip of a lab, and return its folder, which is there until the context is left.

    Raises:
        UsageError: it holds a program, a file that is not taken in, YAML that unfolds, or no lab.
        ArchiveError: it cannot be read, or is damaged.
        TooLargeError: it holds too many files or too much in them.
    """
    with tempfile.TemporaryDirectory(prefix="lab3-lab-") as temporary:
        target = Path(temporary, "lab")
        target.mkdir()
        copy = SubmissionCopy(target, _LAB_LIMITS)
        unpack(archive, "", copy)
        for refused in copy.refused:
            raise UsageError(f"{archive.name}: {refused.path}: {refused.reason}")
        paths = sorted(path for path in target.rglob("*") if path.is_file())
        for path in paths:
            name = path.relative_to(target).as_posix()
            if path.suffix.lower() in _CODE:
                raise UsageError(f"{archive.name}: {name} is a program; a lab contains data only")
            if path.suffix.lower() == ".yaml":
                read_foreign_yaml(path)
        if not (target / CHECKPOINTS).is_file():
            raise UsageError(f"{archive.name}: holds no {CHECKPOINTS}; pack the folder of a lab")
        yield target
