"""Waiting for what other processes do."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


def eventually(holds: Callable[[], object]) -> bool:
    until = time.monotonic() + 100  # a busy machine; a test may take 120
    while not holds():
        if time.monotonic() > until:
            return False
        threading.Event().wait(0.05)
    return True
