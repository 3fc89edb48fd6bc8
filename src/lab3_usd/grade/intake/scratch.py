"""Temporary folders of runs. What a killed run left is removed by the next, and nothing else is.

They lie in one folder of the user, `lab3-scratch-<uid>` in the system's folder for temporary files.
That folder and each one in it have a marker with their name and inode, written when they were made.
A folder without its marker is not ours, whatever it is called: neither one that a person made,
copied or renamed, nor a link. Of our own, `files` and the marker are removed, and nothing beside.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lab3_usd.grade.lock import take_lock

MARKER = ".lab3-scratch"
_FILES = "files"
_NOTE = "A temporary folder of lab3. Keep nothing here: it is removed with the run that made it.\n"
_MOST_PARENTS = 9  # somebody else may have made folders of these names
_made: dict[Path, int | None] = {}  # by the folder, what holds its lock
_making = threading.Lock()


def make_scratch(prefix: str) -> Path:
    """Make a temporary folder that is locked for as long as this process lives.

    Where folders cannot be locked, or ours cannot be made, it lies among other temporary files, and
    no later run removes it.

    Raises:
        OSError: there is no room, or no folder for temporary files.
    """
    with _making, _shared_parent() as parent:
        top = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        handle = None if parent is None else _opened(top)
        if handle is None:
            _made[top] = None
            return top
        folder = top / _FILES
        _made[folder] = handle
        try:
            if take_lock(handle):  # first, or it would seem to be abandoned
                _mark(handle, top)
            folder.mkdir()
        except OSError:
            remove_scratch(folder)
            raise
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
    """Remove a folder that `make_scratch` made in this process, and let go of its lock."""
    if folder not in _made:
        return
    handle = _made.pop(folder)
    if handle is None:
        shutil.rmtree(folder, ignore_errors=True)
        return
    top = folder.parent
    if _is_at(handle, top):
        _remove(top)
    os.close(handle)
    _remove_parent(top.parent)


def remove_abandoned(given: Iterable[Path]) -> None:
    """Remove what killed runs of this user left; a lock tells, in other containers too.

    Nothing is removed that holds, or lies in, what this run was `given`.
    """
    kept = [Path(os.path.realpath(path)) for path in given]
    for parent in _parents():
        with _own(parent, "LOCK_SH") as is_ours:
            for top in list(parent.resolve().iterdir()) if is_ours else ():
                if any(path.is_relative_to(top) or top.is_relative_to(path) for path in kept):
                    continue
                with _own(top, "LOCK_EX") as is_abandoned:
                    if is_abandoned:
                        _remove(top)
        _remove_parent(parent)


def _parents() -> Iterator[Path]:
    """Yield where the folder of this user may be, in order; nowhere without users and locks."""
    try:
        importlib.import_module("fcntl")
    except ImportError:
        return
    top = Path(tempfile.gettempdir(), f"lab3-scratch-{os.geteuid()}")
    yield top
    yield from (top.with_name(f"{top.name}-{number}") for number in range(2, _MOST_PARENTS + 1))


@contextmanager
def _shared_parent() -> Iterator[Path | None]:
    """Yield the folder of this user, made where there is none, which is not removed meanwhile."""
    for parent in _parents():
        _make_parent(parent)
        with _own(parent, "LOCK_SH") as is_ours:
            if is_ours:
                yield parent
                return
    yield None


def _make_parent(parent: Path) -> None:
    """Make the folder of this user and its marker, where nothing has that name."""
    try:
        parent.mkdir(0o700)
    except OSError:
        return
    handle = _opened(parent)
    if handle is None:
        return
    try:
        _mark(handle, parent)
    except OSError:  # the disk is full
        _unmark(parent)
    finally:
        os.close(handle)


def _remove_parent(parent: Path) -> None:
    """Remove the folder of this user, where it holds nothing but its marker and nobody uses it."""
    with _own(parent, "LOCK_EX") as is_ours:
        if is_ours and [path.name for path in parent.iterdir()] == [MARKER]:
            _unmark(parent)


def _remove(top: Path) -> None:
    """Remove what we made in a folder of ours, and the folder, where there is nothing else."""
    shutil.rmtree(top / _FILES, ignore_errors=True)
    if not os.path.lexists(top / _FILES):
        _unmark(top)


def _unmark(folder: Path) -> None:
    with contextlib.suppress(OSError):
        (folder / MARKER).unlink(missing_ok=True)
        folder.rmdir()  # which removes empty ones only


@contextmanager
def _own(folder: Path, lock: str) -> Iterator[bool]:
    """Lock a folder, and yield whether that went and the folder is one that we made."""
    handle = _opened(folder)
    if handle is None:
        yield False
        return
    try:
        is_locked = take_lock(handle, lock) is True
        yield is_locked and _is_marked(handle, folder) and _is_at(handle, folder)
    finally:
        os.close(handle)


def _opened(folder: Path) -> int | None:
    """Open a folder of this user that nobody else may write to; None for a link and all else."""
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    status = os.fstat(handle)
    if status.st_uid == os.geteuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return handle
    os.close(handle)
    return None


def _is_at(handle: int, folder: Path) -> bool:
    """Whether an open folder is still the one of this path."""
    try:
        return os.path.samestat(os.fstat(handle), folder.lstat())
    except OSError:
        return False


def _mark(handle: int, folder: Path) -> None:
    """Write the marker of a folder that was just made."""
    marker = os.open(MARKER, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600, dir_fd=handle)
    with open(marker, "wb") as file:  # noqa: PTH123 - a handle, not a path
        file.write(_marked(handle, folder))


def _is_marked(handle: int, folder: Path) -> bool:
    try:
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK
        marker = os.open(MARKER, flags, dir_fd=handle)
    except OSError:
        return False
    with open(marker, "rb") as file:  # noqa: PTH123 - a handle, not a path
        return file.read() == _marked(handle, folder)


def _marked(handle: int, folder: Path) -> bytes:
    """Return what the marker of a folder holds: it is not that of a copy or under another name."""
    return os.fsencode(f"{folder.name} {os.fstat(handle).st_ino}\n{_NOTE}")
