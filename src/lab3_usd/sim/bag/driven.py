"""What a recorded robot was told, and where it went, frame by frame like a dry run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.model.behaviour import Place
from lab3_usd.sim.behaviour.evidence import angle
from lab3_usd.sim.drive import RATE, Leg, leg_name
from lab3_usd.sim.record import Pose

LONG = 1.0  # seconds of one command, from which on it is judged
SAME = 1e-3  # m/s and rad/s between commands
VARIED = "varied"
Told = tuple[float, float, float]  # forward, to the left, turning


def legs(
    commands: Sequence[tuple[float, Told]], seconds: float, limits: tuple[float, float]
) -> tuple[Leg, ...]:
    """Return what was told: a command holds until the next, as Isaac Sim's subscriber has it."""
    return tuple(_legs(commands, round(seconds * RATE), limits))


def _legs(
    commands: Sequence[tuple[float, Told]], end: int, limits: tuple[float, float]
) -> Iterator[Leg]:
    first, told = 0, None
    changes = [each for each in commands if round(each[0] * RATE) < end]
    for at, command in [*changes, (end / RATE, None)]:
        if told is not None and command is not None and _same(told, command):
            continue
        frame = max(first, round(at * RATE))
        if frame > first:
            yield _leg(told, (frame - first) / RATE, limits)
        first, told = frame, command


def _same(one: Told, other: Told) -> bool:
    return all(abs(a - b) < SAME for a, b in zip(one, other, strict=True))


def _leg(told: Told | None, seconds: float, limits: tuple[float, float]) -> Leg:
    if told is None:
        return Leg("idle", seconds)
    if seconds < LONG:
        return Leg(VARIED, seconds, told)
    aside = told[1] and not told[0] and not told[2]
    return Leg("sideways" if aside else leg_name(told[0], told[2], limits), seconds, told)


def path(places: Sequence[tuple[float, Place]], drive: Sequence[Leg]) -> Iterator[Pose]:
    """Yield a pose for each frame of the drive, between what odometry says."""
    if not places:
        return
    ahead, frame = 0, 0
    for leg in drive:
        for _ in range(round(leg.seconds * RATE)):
            frame += 1
            at = frame / RATE
            while ahead + 1 < len(places) and places[ahead + 1][0] <= at:
                ahead += 1
            here, there = places[ahead], places[min(ahead + 1, len(places) - 1)]
            yield Pose(0, at, leg.name, *_between(here, there, at))


def _between(one: tuple[float, Place], other: tuple[float, Place], at: float) -> Place:
    span = other[0] - one[0]
    part = min(1.0, max(0.0, (at - one[0]) / span)) if span > 0 else 0.0
    (x, y, turned), (u, v, later) = one[1], other[1]
    return (x + part * (u - x), y + part * (v - y), turned + part * angle(later - turned))
