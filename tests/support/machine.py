"""A disk that is full, and waiting for what other processes do."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def full_disk() -> Iterator[None]:
    """Let files be made here, and nothing be written into them ("File too large")."""
    resource = pytest.importorskip("resource", reason="this platform has no limits")
    usual, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (usual, most))


def eventually(holds: Callable[[], object]) -> bool:
    until = time.monotonic() + 100  # a busy machine; a test may take 120
    while not holds():
        if time.monotonic() > until:
            return False
        threading.Event().wait(0.01)
    return True


def has_ended(process: int) -> bool:
    """Whether a process is gone, or is there for whoever started it to ask how it ended."""
    try:
        os.kill(process, 0)
        state = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(") ")[2]
    except ProcessLookupError:
        return True
    except FileNotFoundError:  # this system has no such files, or it is gone by now
        return False
    return state.startswith("Z")
