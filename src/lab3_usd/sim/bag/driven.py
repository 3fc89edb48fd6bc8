"""What a recording drove: the legs of its commands, the path of its robot, and its joints."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import Literal

from msgspec.structs import replace

from lab3_usd.model.dry_run import Place
from lab3_usd.sim.commands import follows_to_its_side
from lab3_usd.sim.execution.drive import RATE, STEERED, Leg, leg_name
from lab3_usd.sim.execution.recording import JointStates, Message, Pose
from lab3_usd.sim.judge.expectations import RunFault, Trial, angle

_LONG = 1.0  # seconds of one command, from which on it is judged
_SAME = 1e-3  # m/s and rad/s between commands
VARIED = "varied"
HELD = 1.0  # seconds of a command to joints, from which on it is judged
NEAR = (0.05, 0.1)  # radians or metres, and part of the way, by which a joint may miss it
_Command = tuple[float, float, float]  # forward, to the left, turning


def legs(
    commands: Sequence[tuple[float, _Command]], seconds: float, limits: tuple[float, float]
) -> tuple[Leg, ...]:
    """Return the legs of a drive: a command holds until the next, as in Isaac Sim."""
    drive: list[Leg] = []
    end, first = round(seconds * RATE), 0
    current: _Command | None = None
    changes = [change for change in commands if round(change[0] * RATE) < end]
    for at, command in [*changes, (end / RATE, None)]:
        if current is not None and command is not None:
            steps = (abs(a - b) for a, b in zip(current, command, strict=True))
            if all(step < _SAME for step in steps):
                continue
        frame = max(first, round(at * RATE))
        if frame > first:
            drive.append(_leg(current, (frame - first) / RATE, limits))
        first, current = frame, command
    return tuple(drive)


def _leg(command: _Command | None, seconds: float, limits: tuple[float, float]) -> Leg:
    if command is None:
        return Leg("idle", seconds)
    if seconds < _LONG:
        return Leg(VARIED, seconds, command)
    aside = command[1] and not command[0] and not command[2]
    return Leg("sideways" if aside else leg_name(command[0], command[2], limits), seconds, command)


def leg_of_any_base(leg: Leg, *, is_steered: bool) -> Leg:
    """Return a leg of any robot: one that is commanded sideways may go there."""
    if is_steered and leg.turn:
        return replace(leg, name=STEERED if leg.seconds >= HELD else "varied")
    return replace(leg, name="varied") if leg.name == "sideways" else leg


def follows_side(trial: Trial) -> Iterator[RunFault]:
    """It goes and turns as commanded; about which point it turns is up to the robot."""
    for stretch in trial.stretches(STEERED):
        if stretch.leg.turn and stretch.turned * stretch.leg.turn <= 0:
            text = f"steered to turn to the {'left' if stretch.leg.turn > 0 else 'right'}, turned"
            yield RunFault(f"{text} {math.degrees(stretch.turned):+.0f} degrees", "wrong-arc")
            break
    yield from (each for each in follows_to_its_side(trial) if each.kind != "turn-off-centre")


def path(places: Sequence[tuple[float, Place]], drive: Sequence[Leg]) -> Iterator[Pose]:
    """Yield a pose for each frame of the drive, between what odometry reports."""
    if not places:
        return
    ahead, frame = 0, 0
    for leg in drive:
        for _ in range(round(leg.seconds * RATE)):
            frame += 1
            at = frame / RATE
            while ahead + 1 < len(places) and places[ahead + 1][0] <= at:
                ahead += 1
            before, after = places[ahead], places[min(ahead + 1, len(places) - 1)]
            yield Pose(0, at, leg.name, *_between(before, after, at))


def _between(before: tuple[float, Place], after: tuple[float, Place], at: float) -> Place:
    span = after[0] - before[0]
    part = min(1.0, max(0.0, (at - before[0]) / span)) if span > 0 else 0.0
    (x, y, turned), (u, v, later) = before[1], after[1]
    return (x + part * (u - x), y + part * (v - y), turned + part * angle(later - turned))


def turning_joints(
    poses: Sequence[Pose], states: Sequence[Message]
) -> tuple[tuple[str, ...], list[Pose]]:
    """Return the joints that turn by their states, and the poses with how fast they do."""
    told = _told(states, "velocities")
    names = tuple(dict.fromkeys(n for _, speeds in told for n, speed in speeds.items() if speed))
    speeds = (tuple(_state(told, name, pose.at) or 0.0 for name in names) for pose in poses)
    return names, [replace(pose, wheels=each) for pose, each in zip(poses, speeds, strict=True)]


def _told(
    messages: Sequence[Message], part: Literal["positions", "velocities"]
) -> list[tuple[float, dict[str, float]]]:
    """Return what messages of joint states say of joints by name, with when they do."""
    said = ((each.at, each.data) for each in messages if isinstance(each.data, JointStates))
    return [(at, dict(zip(data.names, getattr(data, part), strict=False))) for at, data in said]


def joints_there(
    commanded: Sequence[Message], sent: Sequence[Message], end: float
) -> Iterator[RunFault]:
    """Each joint is where it is commanded to, at the end of each command of a second or more."""
    states, looked = _told(sent, "positions"), False
    held: dict[str, tuple[float, float]] = {}  # since when each joint is commanded where
    for at, places in [*_told(commanded, "positions"), (end, {})]:
        for name, (since, place) in [*held.items()]:
            if at < end and places.get(name, place) == place:
                continue
            del held[name]
            if at - since < HELD:
                continue
            before, after = _state(states, name, since), _state(states, name, at - 1.0 / RATE)
            if before is None or after is None:
                continue
            looked = True
            if abs(after - place) > NEAR[0] + NEAR[1] * abs(place - before):
                text = f"{name} is commanded to {place:.3f} and is at {after:.3f}"
                yield RunFault(text, "joint-off-target")
                return
        for name, place in places.items():
            if math.isfinite(place):
                held.setdefault(name, (at, place))
    if not looked:
        yield RunFault("no joint is commanded for a second", "joint-off-target", sure=False)


def _state(states: list[tuple[float, dict[str, float]]], name: str, at: float) -> float | None:
    """Return what was last said of a joint at a time."""
    number = bisect_right(states, at, key=lambda state: state[0])
    return states[max(0, number - 1)][1].get(name) if states else None
