"""Unpacks the archive of a whole class; every student with an entry in it keeps a row."""

from __future__ import annotations

import contextlib
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.archives import ArchiveError, is_archive, unpack
from lab3_usd.grade.intake.entries import (
    ARCHIVE_END,
    Entry,
    entries_in,
    is_leftover,
    is_submission_part,
)
from lab3_usd.grade.intake.file_filter import RefusedFile
from lab3_usd.grade.intake.limits import Limits, TooLargeError
from lab3_usd.grade.intake.remote import archive_at
from lab3_usd.grade.intake.scratch import scratch_folder
from lab3_usd.grade.intake.submission_copy import SubmissionCopy
from lab3_usd.grade.intake.submissions import ClassLocation
from lab3_usd.judge.folder import is_submission

# A class in one archive holds many submissions.
_CLASS = Limits(files=200_000, total_size=16 << 30, file_size=1 << 30)
_PASSED_OVER = "its name begins with a dot"
_LeftOut = list[tuple[tuple[str, ...], str]]  # parts of a path, and why it was not unpacked


@contextmanager
def submissions_in(place: Path | str) -> Iterator[ClassLocation]:
    """Yield where the submissions lie; an archive of a whole class is unpacked first.

    Raises:
        UsageError: there is no such place, or the archive is damaged or too large.
    """
    with scratch_folder("lab3-class-") as scratch:
        path = place if isinstance(place, Path) else archive_at(place, scratch, _CLASS)
        if path is None:
            yield ClassLocation(place, str(place))
        elif stat.S_ISDIR(_mode(path, str(place))):
            yield ClassLocation(path, str(place))
        else:
            yield _unpacked(path, str(place), scratch)


def _mode(path: Path, given: str) -> int:
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        message = f"{given}: there is no such folder or archive of submissions"
        raise UsageError(message) from error
    except OSError as error:
        message = f"{given}: cannot be read ({error.strerror})"
        raise UsageError(message) from error


def _unpacked(archive: Path, given: str, scratch: Path) -> ClassLocation:
    if not archive.is_file() or not is_archive(archive.name):
        message = f"{given}: is neither a folder nor an archive of submissions"
        raise UsageError(message)
    folder, empty_folder = scratch / "class", scratch / "empty_folder"
    for each in (folder, empty_folder):
        each.mkdir()
    copy = SubmissionCopy(folder, _CLASS, archives=True)
    try:
        unpack(archive, "", copy)
    except (ArchiveError, TooLargeError) as error:
        message = f"{given}: {str(error).removeprefix(f'{archive.name}: ')}"
        raise UsageError(message) from error
    left_out = _left_out(copy)
    _make_folders(folder, left_out)
    wrapper = _wrapper(folder, left_out)
    entries = tuple(_entries(left_out, wrapper))
    name = ARCHIVE_END.sub("", archive.name) or archive.name
    return ClassLocation(folder / wrapper, given, name, entries, empty_folder)


def _left_out(copy: SubmissionCopy) -> _LeftOut:
    """Return what was not unpacked, by what its path would be inside the archive.

    The last part is that of a file, and empty for a folder.
    """
    found = []
    for path, reason in [
        *((each.path, each.reason) for each in copy.refused),
        *((path, _PASSED_OVER) for path in copy.hidden),
    ]:
        parts = path.replace("\\", "/").split("/")
        if len(parts[0]) > 1 and parts[0][1] == ":":
            parts = parts[1:]
        own = [part for part in parts if part not in {"", ".", ".."}]
        if path.endswith("/"):
            own.append("")
        if any(own) and not is_leftover(own[0]):
            found.append((tuple(own), reason))
    return found


def _entries(left_out: _LeftOut, wrapper: str) -> Iterator[tuple[Entry, RefusedFile]]:
    """Yield which entry of the class each of them belongs to, and what to say of it."""
    for parts, reason in left_out:
        inside = parts[1:] if wrapper and parts[0] == wrapper and len(parts) > 1 else parts
        entry = (inside[0], len(inside) > 1)
        # What is passed over without a word in a student's folder is so in an archive too.
        if inside[0] and (reason != _PASSED_OVER or inside[0].startswith(".")):
            name = "/".join(inside[1:]) or inside[0]
            yield entry, RefusedFile(name.encode("utf-8", "backslashreplace").decode(), reason)


def _make_folders(place: Path, left_out: _LeftOut) -> None:
    """Make the folders of students of whom nothing was unpacked, and of what they lie in."""
    for parts, _ in left_out:
        with contextlib.suppress(OSError, ValueError):  # names that no file system takes
            place.joinpath(*parts[:-1][:2]).mkdir(parents=True, exist_ok=True)


def _wrapper(place: Path, left_out: _LeftOut) -> str:
    """Return the one folder that an archive wraps its students' folders in, '' for none."""
    tops = {name for name, is_folder in entries_in(place) if is_submission_part((name, is_folder))}
    tops |= {parts[0] for parts, _ in left_out if is_submission_part((parts[0], len(parts) > 1))}
    if len(tops) != 1:
        return ""
    (top,) = tops
    inside = place / top
    if not inside.is_dir() or is_submission(inside):
        return ""
    students = {name for name, is_folder in entries_in(inside) if _is_student(name, is_folder)}
    students |= {
        parts[1]
        for parts, _ in left_out
        if parts[0] == top and len(parts) > 1 and _is_student(parts[1], bool(parts[2:]))
    }
    return top if len(students) > 1 else ""


def _is_student(name: str, is_folder: bool) -> bool:  # noqa: FBT001 - an entry's two halves
    return is_submission_part((name, is_folder)) and (is_folder or is_archive(name))
