"""Waiting for what other processes do."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


def eventually(holds: Callable[[], bool]) -> bool:
    until = time.monotonic() + 60  # far beyond what a busy machine takes
    while not holds():
        if time.monotonic() > until:
            return False
        threading.Event().wait(0.05)
    return True
