"""What the robot is told to do: sessions between Play and Stop, each with legs."""

from __future__ import annotations

import math

from msgspec import Struct

RATE = 60.0  # frames a second


class Leg(Struct, frozen=True):
    """A time with one command on /cmd_vel; None sends nothing."""

    name: str
    seconds: float
    command: tuple[float, float, float] | None = None  # forward, to the left, turning


class Session(Struct, frozen=True):
    """From Play to Stop, with the ROS_DOMAIN_ID that the process has."""

    legs: tuple[Leg, ...]
    environment: str = ""


def _turn(angle: float, speed: float) -> Leg:
    return Leg("left", angle / speed, (0.0, 0.0, speed))


def fixed_drive(slow: float = 1.0) -> tuple[Session, ...]:
    """Return the drive that every stage is judged by; `slow` makes it longer."""
    ahead, rest = 0.15 / slow, 0.3 * slow
    legs = (
        Leg("idle", 0.5 * slow),
        Leg("ahead", 0.3 / ahead, (ahead, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("back", 0.3 / ahead, (-ahead, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        _turn(math.pi / 2, 0.8 / slow),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("sideways", rest, (0.0, 0.2, 0.0)),
        Leg("fast", 0.4, (1.0, 0.0, 0.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
        Leg("spin", 0.4, (0.0, 0.0, 4.0)),
        Leg("stop", rest, (0.0, 0.0, 0.0)),
    )
    again = (Leg("idle", rest), Leg("ahead", 0.5, (0.15, 0.0, 0.0)))
    return (Session(legs), Session(again), Session(again, "7"))
