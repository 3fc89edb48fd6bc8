"""Temporary folders of students' files: this run's, and those that a killed run left behind."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

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
                old = time.time() - status.st_mtime > _SECONDS_TO_LOCK
                if stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid() and old:
                    yield Path(entry.path)


def _locked(folder: Path) -> int | None:
    """Lock a folder and return what holds the lock; None where another process has it."""
    locks = _locks()
    if locks is None:
        return None
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        locks.flock(handle, locks.LOCK_EX | locks.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def _locks() -> ModuleType | None:
    """Return the module that locks files, None on platforms without it."""
    try:
        return importlib.import_module("fcntl")
    except ImportError:
        return None
