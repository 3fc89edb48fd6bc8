"""Unpacks untrusted archives: plain files are copied, everything else is named and left out."""

from __future__ import annotations

import contextlib
import errno
import io
import lzma
import shutil
import stat
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, cast

from lab3_usd.errors import Lab3Error
from lab3_usd.grade.intake.submission_copy import (
    SubmissionCopy,
    TooLargeError,
    is_read,
    only_name_counts,
)

ZIP_ENDINGS = (".zip",)
TAR_ENDINGS = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz")
OTHER_ENDINGS = (".rar", ".7z", ".tar.zst", ".gz", ".bz2", ".xz")
_SMALL = 1 << 20  # a file that small is no bomb, whatever its ratio
_ENCRYPTED = 0x1
_DAMAGED = (
    zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError, EOFError, OSError,
    ValueError, NotImplementedError, RuntimeError, IndexError, OverflowError,
)  # fmt: skip
_NO_ROOM = {errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)}


class ArchiveError(Lab3Error):
    """An archive that nothing can be unpacked from; the line says why."""


def is_archive(name: str) -> bool:
    """Whether a file of this name is an archive that can be unpacked."""
    return name.lower().endswith((*ZIP_ENDINGS, *TAR_ENDINGS))


def is_no_room(error: Exception) -> bool:
    """Whether the disk is full, which is not a fault of the submission."""
    return isinstance(error, OSError) and error.errno in _NO_ROOM


def _is_nested(name: str, copy: SubmissionCopy) -> bool:
    """Whether a file of a student's archive is an archive itself; those of a class stay whole."""
    return is_archive(name) and not copy.archives


def _unpack_nested(stream: BinaryIO, size: int, name: str, copy: SubmissionCopy) -> None:
    """Take in an archive that lies in an archive, as if its files lay in its place.

    One in one of those is refused.
    """
    if copy.is_nested:
        copy.refuse(name, "it is an archive in an archive in an archive; not unpacked")
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
        parent, slash, _ = name.rpartition("/")
        copy.is_nested = True
        try:
            unpack(inner, parent + slash, copy)
        except ArchiveError as error:
            copy.refuse(name, str(error).partition(": ")[2])
        finally:
            copy.is_nested = False


def unpack(archive: Path, prefix: str, copy: SubmissionCopy) -> None:
    """Take in the files of an archive under `prefix`.

    The one folder that holds everything in a student's archive is left aside.

    Raises:
        ArchiveError: it cannot be read, is damaged from the start, or is of no kind that is known.
        TooLargeError: it holds too many files or too much in them.
    """
    try:
        archive.open("rb").close()
    except OSError as error:  # which is not the fault of the archive
        raise ArchiveError(f"{archive.name}: cannot be read ({error.strerror})") from error
    reader = _from_zip if archive.name.lower().endswith(ZIP_ENDINGS) else _from_tar
    taken = len(copy.digests)
    try:
        reader(archive, prefix, copy)
    except _DAMAGED as error:
        if is_no_room(error):
            raise
        # Students would be lost with what follows in the archive of a class.
        if len(copy.digests) == taken or copy.archives:
            raise ArchiveError(
                f"{archive.name}: is damaged or no such archive; pack it again"
            ) from error
        copy.refuse(archive.name, "the archive is damaged; what follows in it is lost")


def _from_zip(archive: Path, prefix: str, copy: SubmissionCopy) -> None:
    with zipfile.ZipFile(archive) as packed:
        entries = packed.infolist()
        copy.limits.check_count(len(entries))
        names = [] if copy.archives else [info.filename for info in entries if not info.is_dir()]
        top = _common_top(names)
        for entry in entries:
            name = prefix + entry.filename.removeprefix(top)
            if entry.is_dir():
                copy.keep_folder(name)
            else:
                _zip_entry(packed, entry, name, copy)


def _zip_entry(
    packed: zipfile.ZipFile, entry: zipfile.ZipInfo, name: str, copy: SubmissionCopy
) -> None:
    reason = _zip_fault(entry, copy.limits.ratio)
    if reason:
        copy.refuse(name, reason)
        return
    # A file of which the name alone counts is not opened: it may be of any kind.
    is_opened = not only_name_counts(entry.filename, entry.file_size)
    try:
        with packed.open(entry) if is_opened else io.BytesIO() as opened:
            stream = cast("BinaryIO", opened)
            if _is_nested(name, copy):
                _unpack_nested(stream, entry.file_size, name, copy)
            else:
                copy.take(name, entry.file_size, stream)
    except _DAMAGED as error:
        if is_no_room(error):
            raise
        copy.forget(name, "it is damaged in the archive")


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
    if not copy.archives:
        with contextlib.suppress(*_DAMAGED):  # the names up to where it is damaged
            for name, member, _ in _tar_entries(archive, copy):
                if not member.isdir():
                    names.append(name)
    top = _common_top(names)
    for name, member, packed in _tar_entries(archive, copy):
        inside = prefix + name.removeprefix(top)
        if member.isdir():
            copy.keep_folder(inside)
            continue
        if not member.isreg() or member.issparse():
            copy.refuse(inside, "it is a link, pipe or device; not unpacked")
            continue
        stream = cast("BinaryIO", packed.extractfile(member))  # a plain file has one
        if _is_nested(inside, copy):
            _unpack_nested(stream, member.size, inside, copy)
        else:
            copy.take(inside, member.size, stream)


def _tar_entries(
    archive: Path, copy: SubmissionCopy
) -> Iterator[tuple[str, tarfile.TarInfo, tarfile.TarFile]]:
    total = 0
    allowed = max(_SMALL, copy.limits.ratio * archive.stat().st_size)
    with tarfile.open(archive, "r:*") as packed:
        for count, member in enumerate(packed):
            if is_read(member.name, member.size, copy.limits):
                total += max(member.size, 0)
            copy.limits.check_count(count)
            if total > copy.limits.total_size or total > allowed:
                raise TooLargeError(
                    f"grows to more than {min(total, copy.limits.total_size) >> 20} MB"
                )
            yield member.name, member, packed


def _common_top(names: Iterable[str]) -> str:
    """Return the folder that everything in an archive lies in, with its slash; '' for none."""
    parts = [name.partition("/") for name in names if not name.startswith("__MACOSX/")]
    tops = {top for top, _, _ in parts}
    if len(tops) != 1 or not all(slash for _, slash, _ in parts) or tops & {"", ".", ".."}:
        return ""
    return f"{tops.pop()}/"
