"""A progress line on the terminal: how many are done, the rate, and the time left."""

from __future__ import annotations

import time
from typing import TextIO

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


def line(done: int, total: int, seconds: float) -> str:
    """Return `grading [#####-----] 50/100  2.5/s  20 s left`."""
    filled = _WIDTH * done // max(total, 1)
    bar = "#" * filled + "-" * (_WIDTH - filled)
    text = f"grading [{bar}] {done}/{total}"
    if not done or seconds <= 0:
        return text
    rate = done / seconds
    return f"{text}  {rate:.1f}/s  {_duration((total - done) / rate)} left"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02} s" if minutes else f"{rest} s"
