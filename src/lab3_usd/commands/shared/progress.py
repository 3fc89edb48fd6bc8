"""The line on a terminal that shows how far a long run is."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

from lab3_usd.commands.shared.options import understands_ansi

_SECONDS_BETWEEN = 0.1
_WIDTH = 30


class Rate:
    """Draws the line again whenever something is done, at most ten times a second."""

    def __init__(self, stream: TextIO) -> None:
        """Start the clock at the first call of `show`."""
        self._stream = stream
        self._started = 0.0
        self._drawn = 0.0

    def show(self, done: int, total: int) -> None:
        """Draw how many of how many are done; the last call ends the line."""
        now = time.monotonic()
        self._started = self._started or now
        if done < total and now - self._drawn < _SECONDS_BETWEEN:
            return
        self._drawn = now
        self._stream.write(f"\r\x1b[K{line(done, total, now - self._started)}")
        if done >= total:
            self._stream.write("\n")
        self._stream.flush()


def progress_line() -> Callable[[int, int], None]:
    """Show how many are done, how fast, and how long it takes, on a terminal only."""
    if not understands_ansi(sys.stderr):
        return lambda _done, _total: None
    return Rate(sys.stderr).show


def line(done: int, total: int, seconds: float) -> str:
    """Return `grading [#####-----] 50/100  2.5/s  20 s left`."""
    filled = _WIDTH * done // max(total, 1)
    bar = "#" * filled + "-" * (_WIDTH - filled)
    text = f"grading [{bar}] {done}/{total}"
    if not done or seconds <= 0:
        return text
    rate = done / seconds
    minutes, rest = divmod(round((total - done) / rate), 60)
    duration = f"{minutes} min {rest:02} s" if minutes else f"{rest} s"
    return f"{text}  {rate:.1f}/s  {duration} left"
