"""Lets one run at a time write to a gradebook: a file in it says which run that is."""

from __future__ import annotations

import contextlib
import importlib
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path

import msgspec
from msgspec import Struct

from lab3_usd.errors import UsageError, unwritten

LOCK = ".lab3-grade.lock"
_LARGEST = 4096


class Owner(Struct, frozen=True):
    """The run that a gradebook is locked by."""

    process: int
    host: str
    since: str

    def __str__(self) -> str:
        """Tell it to people."""
        return f"process {self.process} on {self.host} since {self.since}"


@contextmanager
def locked(out: Path, *, force: bool = False) -> Iterator[None]:
    """Keep other runs from writing to the gradebook `out`, which is made where there is none.

    The system frees the lock of a run that ends, however it ends; its file stays where it was
    killed, and the run that comes next takes it with `force` only.

    Raises:
        UsageError: another run writes to it, or one was killed and `force` is not set.
    """
    is_new = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
        handle = os.open(out / LOCK, flags, 0o644)
    except OSError as error:
        raise unwritten(out, error) from error
    try:
        try:
            _take(handle, out, force=force)
        except OSError as error:
            (out / LOCK).unlink(missing_ok=True)
            if is_new:
                out.rmdir()
            raise unwritten(out / LOCK, error) from error
        try:
            yield
        finally:
            (out / LOCK).unlink(missing_ok=True)  # which is ours since it was taken
            if is_new:
                with contextlib.suppress(OSError):  # it is a gradebook now
                    out.rmdir()
    finally:
        os.close(handle)


def _take(handle: int, out: Path, *, force: bool) -> None:
    is_free = take_lock(handle)
    if is_free and os.fstat(handle).st_nlink == 0:  # the run that had it has ended just now
        is_free = False
    text = os.read(handle, _LARGEST) if stat.S_ISREG(os.fstat(handle).st_mode) else b"no file"
    try:
        owner = msgspec.json.decode(text, type=Owner) if text else None  # killed before it wrote
    except msgspec.MsgspecError as error:
        raise UsageError(f"{out / LOCK}: is not a lock of a run; move it away") from error
    if is_free is False:
        by = f" by {owner}" if owner else ""
        raise UsageError(f"{out}: is being written{by}; wait for it, or choose another -o")
    if owner is not None and not force:
        ended = is_free and owner.host == socket.gethostname()
        fate = "which was killed; " if ended else "if that has ended, "
        raise UsageError(f"{out}: is locked by {owner}, {fate}give --force to take it")
    now = datetime.now(timezone.utc).isoformat(timespec="seconds")
    os.ftruncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, msgspec.json.encode(Owner(os.getpid(), socket.gethostname(), now)))


def take_lock(handle: int, kind: str = "LOCK_EX") -> bool | None:
    """Lock an open file without waiting; whether that went, None where none is locked here."""
    try:
        locks = importlib.import_module("fcntl")
    except ImportError:
        return None
    try:
        locks.flock(handle, getattr(locks, kind) | locks.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True
