"""Time that passes while this process runs: no sleep of the machine, and no Ctrl-Z."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

_POLL_INTERVAL = 1.0  # seconds that count at most, of those since the last look


@dataclass(slots=True)
class AwakeClock:
    """Counts seconds for somebody who looks several times a second.

    Where nobody has looked for longer, this process was stopped, and what it waits for perhaps too.
    `now` returns seconds that never go back.
    """

    now: Callable[[], float] = time.monotonic
    awake: float = 0.0
    looked: float = field(init=False)

    def __post_init__(self) -> None:
        self.looked = self.now()

    def seconds(self) -> float:
        """Return for how long this process has been awake since the clock was made."""
        now = self.now()
        self.awake += min(now - self.looked, _POLL_INTERVAL)
        self.looked = now
        return self.awake
