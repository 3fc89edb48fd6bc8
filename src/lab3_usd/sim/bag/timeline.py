"""The time of each message, in seconds of the simulation since a recording began."""

from __future__ import annotations

from msgspec import Struct

NEAR = 0.5  # seconds from the clock within which a stamp is of that clock
_NANOSECONDS = 1e9


class Timeline(Struct):
    """The time of a recording: that of its clock, without jumps back; else that of arrival."""

    clocked: bool
    now: float = 0.0
    arrived: float = 0.0  # seconds since the first message
    clock: float | None = None
    ticks: int = 0
    first: int | None = None

    def arrive(self, nanoseconds: int) -> None:
        """Note when the next message arrives."""
        if self.first is None:
            self.first = nanoseconds
        self.arrived = max(self.arrived, (nanoseconds - self.first) / _NANOSECONDS)
        if not self.clocked:
            self.now = self.arrived

    def tick(self, clock: float) -> None:
        """Note what the clock says."""
        if self.clock is not None:
            self.now = round(self.now + max(0.0, clock - self.clock), 6)
        self.clock = clock
        self.ticks += 1

    def place(self, stamp: float | None) -> float:
        """Return when a message was made: by its stamp if that is of the clock, else now."""
        if stamp is None or self.clock is None or abs(stamp - self.clock) > NEAR:
            return self.now
        return max(0.0, round(self.now + stamp - self.clock, 6))

    @property
    def speed(self) -> float:
        """Seconds of the simulation in one second."""
        return self.now / self.arrived if self.arrived else 0.0
