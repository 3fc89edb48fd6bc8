"""Copies one submission to where it is judged, in temporary folders of this run."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from msgspec import Struct

from lab3_usd.grade.intake.archives import (
    OTHER_ENDINGS,
    ArchiveError,
    is_archive,
    is_no_room,
    unpack,
)
from lab3_usd.grade.intake.submission_copy import Limits, RefusedFile, SubmissionCopy
from lab3_usd.judge.folder import is_submission

_PREFIXES = ("lab3-grade-", "lab3-starter-", "lab3-class-")
_SECONDS_TO_LOCK = 10.0
_held: dict[Path, int] = {}


def make_scratch(prefix: str) -> Path:
    """Make a temporary folder that is locked for as long as this process lives.

    Folders of killed processes, which are no longer locked, are removed first.
    """
    remove_abandoned()
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    handle = _locked(folder)
    if handle is not None:
        _held[folder] = handle
    return folder


@contextmanager
def scratch_folder(prefix: str) -> Iterator[Path]:
    """Yield a temporary folder (see `make_scratch`), which is removed afterwards."""
    folder = make_scratch(prefix)
    try:
        yield folder
    finally:
        remove_scratch(folder)


def remove_scratch(folder: Path) -> None:
    """Remove a folder of `make_scratch`, and let go of its lock."""
    shutil.rmtree(folder, ignore_errors=True)
    handle = _held.pop(folder, None)
    if handle is not None:
        os.close(handle)


def remove_abandoned() -> None:
    """Remove what killed runs of the same user left; a lock tells, in other containers too."""
    for folder in list(_abandoned()):
        handle = _locked(folder)
        if handle is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(handle)


def _abandoned() -> Iterator[Path]:
    """Yield folders of this user that may be abandoned; a new one is given time to be locked."""
    with contextlib.suppress(OSError), os.scandir(tempfile.gettempdir()) as entries:
        for entry in entries:
            if not entry.name.startswith(_PREFIXES) or not hasattr(os, "geteuid"):
                continue
            with contextlib.suppress(FileNotFoundError):
                status = entry.stat(follow_symlinks=False)
                is_old = time.time() - status.st_mtime > _SECONDS_TO_LOCK
                if stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid() and is_old:
                    yield Path(entry.path)


def _locked(folder: Path) -> int | None:
    """Lock a folder and return what holds the lock; None where another process has it.

    None too on platforms whose files cannot be locked.
    """
    try:
        locks = importlib.import_module("fcntl")
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except (ImportError, OSError):
        return None
    try:
        locks.flock(handle, locks.LOCK_EX | locks.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


_DEEPEST = 4
_UNREAD = "it cannot be read"


class Source(Struct, frozen=True):
    """A file, folder or archive that a submission consists of, and its name there ('' for all).

    `address` says where it is to be fetched from when it is not on this computer, `left_out` what
    is not there because it was refused on the way here, and `fault` why nothing of it is.
    """

    path: Path
    name: str = ""
    address: str = ""
    left_out: tuple[RefusedFile, ...] = ()
    fault: str = ""


class StagedSubmission(Struct, frozen=True):
    """The copy of a submission: its folder, its digest, what was left out, and its files' digests.

    The digests are by the names of the files in the folder, '' for those whose contents are not
    judged.
    """

    folder: Path
    digest: str
    refused: tuple[RefusedFile, ...]
    digests: Mapping[str, str]


def stage_submission(sources: Iterable[Source], target: Path, limits: Limits) -> StagedSubmission:
    """Copy and unpack a submission below `target`, which holds plain files only afterwards.

    Raises:
        TooLargeError: it holds too many files or too much in them.
        ArchiveError: the one archive that it consists of cannot be unpacked, or nothing in it read.
    """
    copy = SubmissionCopy(target, limits)
    taken = list(sources)
    for source in taken:
        if source.fault:
            raise ArchiveError(f"{source.name or source.path.name}: {source.fault}")
        for file in source.left_out:
            copy.refuse(file.path, file.reason)
        if os.path.isdir(source.path) and not source.path.is_symlink():  # noqa: PTH112 - never raises
            root = source.path.resolve()
            for path, name in _files_below(root, copy):
                _take_file(path, source.name + name, copy, root=root)
        else:
            name = source.name or source.path.name
            _take_file(source.path, name, copy, alone=len(taken) == 1)
    unread = [file for file in copy.refused if file.reason.startswith(_UNREAD)]
    if unread and not copy.digests:
        raise ArchiveError(f"{unread[0].path}: {unread[0].reason.removeprefix('it ')}")
    folder = _submission_in(target)
    inside = folder.relative_to(target).as_posix()
    refused = tuple(
        RefusedFile(file.path.removeprefix(f"{inside}/"), file.reason) for file in copy.refused
    )
    start = f"{folder}{os.sep}"
    digests = {
        path.removeprefix(start): digest
        for path, digest in copy.digests.items()
        if path.startswith(start)
    }
    return StagedSubmission(folder, copy.digest(), refused, digests)


def _files_below(root: Path, copy: SubmissionCopy) -> Iterator[tuple[Path, str]]:
    """Yield what a folder holds, links not followed, in the order of the names."""
    waiting = [""]
    while waiting:
        below = waiting.pop()
        try:
            with os.scandir(root / below) as scan:
                entries = sorted(scan, key=lambda entry: entry.name)
        except OSError as error:
            copy.refuse(below.rstrip("/") or root.name, f"{_UNREAD} ({error.strerror})")
            continue
        for entry in entries:
            name = f"{below}{entry.name}"
            if not entry.is_dir(follow_symlinks=False):
                yield Path(entry.path), name
            elif name.count("/") >= copy.limits.folders:
                copy.refuse(name, f"it lies more than {copy.limits.folders} folders deep")
            elif copy.place(name) is not None:
                waiting.append(f"{name}/")


def _take_file(
    path: Path, name: str, copy: SubmissionCopy, root: Path | None = None, *, alone: bool = False
) -> None:
    """Take in one file; an archive at the top of a submission is unpacked."""
    if path.is_symlink():
        inside = _target_inside(path, root)
        if inside is None:
            copy.refuse(name, "it is a link that leads out of the submission; not opened")
            return
        path = inside
    if is_archive(name) and "/" not in name:
        _unpack(path, name, copy, alone=alone)
    elif name.lower().endswith(OTHER_ENDINGS) and "/" not in name:
        copy.refuse(name, "it is an archive of a kind that is not unpacked; hand in a .zip")
    else:
        _copy(path, name, copy)


def _target_inside(link: Path, root: Path | None) -> Path | None:
    """Return what a link leads to when that is in the submission."""
    try:
        target = link.resolve(strict=True)
    except (OSError, RuntimeError):
        return None
    return target if root is not None and target.is_relative_to(root) else None


def _unpack(path: Path, name: str, copy: SubmissionCopy, *, alone: bool) -> None:
    try:
        is_file = stat.S_ISREG(path.lstat().st_mode)
    except OSError as error:
        copy.refuse(name, f"{_UNREAD} ({error.strerror})")
        return
    if not is_file:
        copy.refuse(name, "it is no file but a pipe, socket or device; not opened")
        return
    try:
        unpack(path, "", copy)
    except ArchiveError as error:
        if alone:
            raise
        copy.refuse(name, str(error).partition(": ")[2])


def _copy(path: Path, name: str, copy: SubmissionCopy) -> None:
    try:
        with _opened(path) as (stream, size):
            if stream is None:
                copy.refuse(name, "it is no file but a pipe, socket or device; not opened")
            else:
                copy.take(name, size, stream)
    except OSError as error:
        if is_no_room(error):
            raise
        copy.refuse(name, f"{_UNREAD} ({error.strerror})")


@contextmanager
def _opened(path: Path) -> Iterator[tuple[BinaryIO | None, int]]:
    """Open a plain file; a pipe or device yields None and is never waited for."""
    if not stat.S_ISREG(path.lstat().st_mode):
        yield None, 0
        return
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    handle = os.open(path, flags | getattr(os, "O_BINARY", 0))
    with open(handle, "rb") as file:  # noqa: PTH123 - a handle, not a path
        status = os.fstat(handle)
        # The file may have been replaced since it was looked at.
        yield (file if stat.S_ISREG(status.st_mode) else None), status.st_size


def _submission_in(target: Path) -> Path:
    """Return the folder in which the submission begins: the topmost that looks like one."""
    level = [target]
    for _ in range(_DEEPEST):
        for folder in level:
            if is_submission(folder):
                return folder
        level = [path for folder in level for path in sorted(folder.iterdir()) if path.is_dir()]
    return target
