"""Dry runs of stages, of a lab and of none, and what two recordings of one drive differ in."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from breaking import the_lab
from msgspec.structs import replace
from pxr import Usd

from lab3_usd.model.dry_run import Behaviour, Check
from lab3_usd.sim import plays
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.execution.drive import Session, drive_of, fixed_drive
from lab3_usd.sim.execution.recording import Message, Odometry, Recording, Scan, View
from lab3_usd.sim.judge.checks import CHECKS, judge
from lab3_usd.sim.judge.expectations import Expected, Trial
from lab3_usd.sim.plays import Play
from lab3_usd.sim.robots import drive_for
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

BRIEFLY = "0.15,0,0.6 0,0.8,0.4"  # where it is of no importance how far it drives
FIXED = None  # the drive that every stage is judged by
WHOLE = 9.0  # seconds, as long as any of its legs


def played(
    stage: Usd.Stage,
    folder: Path,
    topic: str = "",
    drive: str | None = BRIEFLY,
    longest: float = 0.5,
) -> Behaviour:
    """Play a stage; no leg lasts longer than this many seconds, or one in which joints arrive."""
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    with patch.object(plays, "drive_for", _drive_of(longest)):
        return dry_run(path, the_lab(), "", drive, topic).behaviour


def _drive_of(longest: float) -> Callable[..., tuple[Session, ...]]:
    def brief(*arguments: Any) -> tuple[Session, ...]:
        return tuple(
            replace(
                session,
                legs=tuple(
                    replace(
                        leg,
                        seconds=min(leg.seconds, max(longest, 1.0) if leg.joints else longest),
                    )
                    for leg in session.legs
                ),
            )
            for session in drive_for(*arguments)
        )

    return brief


def by_name(behaviour: Behaviour) -> dict[str, Check]:
    return {check.name: check for check in behaviour.checks}


def bad(behaviour: Behaviour) -> set[str]:
    return {check.name for check in behaviour.checks if check.verdict == "bad"}


METRES = 2e-3
RADIANS = 2e-3
SECONDS = 1e-3
RAYS = 0.02  # the part of a scan that may change
COUNT = 0.03  # the part of the messages that may be more or fewer


def differences(one: Recording, other: Recording) -> list[str]:
    """Say in what the second recording differs from the first."""
    return [*_paths(one, other), *_topics(one, other)]


def _paths(one: Recording, other: Recording) -> Iterator[str]:
    for before, after in zip(one.path, other.path, strict=True):
        gap = math.dist((before.x, before.y, before.z), (after.x, after.y, after.z))
        turned = abs(math.remainder(before.heading - after.heading, 2 * math.pi))
        if gap > METRES or turned > RADIANS:
            yield f"the robot goes elsewhere while {after.leg} in session {after.session}"
            return


def _streams(recording: Recording) -> dict[tuple[str, str, int | None, int, str], list[Message]]:
    found: dict[tuple[str, str, int | None, int, str], list[Message]] = {}
    for message in recording.messages:
        key = (message.topic, message.type, message.away, message.session, message.frame)
        found.setdefault(key, []).append(message)
    return found


def _topics(one: Recording, other: Recording) -> Iterator[str]:
    before, after = _streams(one), _streams(other)
    for key in before.keys() - after.keys():
        yield f"nothing on {key[0]} ({key[4] or key[1]}) in session {key[3]}"
    for key in after.keys() - before.keys():
        yield f"new on {key[0]}: {key[1]} {key[4]} on domain {key[2]} in session {key[3]}"
    for key in sorted(before.keys() & after.keys()):
        first, second = before[key], after[key]
        if abs(len(first) - len(second)) > max(2, COUNT * len(first)):
            yield f"{len(second)} on {key[0]} instead of {len(first)}"
        elif key[1] != "tf2_msgs/msg/TFMessage":
            yield from _contents(first, second)
        else:
            yield from _trees(first, second)


def _contents(first: list[Message], second: list[Message]) -> Iterator[str]:
    middle = min(len(first), len(second)) // 2
    for number in (0, middle, -1):
        one, other = first[number], second[number]
        if abs((one.stamp - one.at) - (other.stamp - other.at)) > SECONDS:
            yield f"{one.topic} is stamped otherwise"
            return
        said = _content(one.data, other.data)
        if said:
            yield f"{one.topic}: {said}"
            return


def _content(one: object, other: object) -> str:
    if isinstance(one, Odometry) and isinstance(other, Odometry):
        pairs = zip(
            (*one.position, *one.orientation, *one.linear, *one.angular),
            (*other.position, *other.orientation, *other.linear, *other.angular),
            strict=True,
        )
        far = any(abs(x - y) > 5 * METRES for x, y in pairs)
        return "other numbers" if far or one.child != other.child else ""
    if isinstance(one, Scan) and isinstance(other, Scan):
        return _scans(one, other)
    if isinstance(one, View) and isinstance(other, View):
        return _views(one, other)
    return ""


def _scans(one: Scan, other: Scan) -> str:
    if len(one.ranges) != len(other.ranges):
        return f"{len(other.ranges)} rays"
    if (one.range_min, one.range_max) != (other.range_min, other.range_max):
        return "other range"
    off = sum(abs(x - y) > 5 * METRES for x, y in zip(one.ranges, other.ranges, strict=True))
    return f"{off} rays differ" if off > RAYS * len(one.ranges) else ""


def _views(one: View, other: View) -> str:
    if (one.width, one.height) != (other.width, other.height):
        return "another size"
    if any(abs(x - y) > 1.0 for x, y in zip(one.matrix, other.matrix, strict=False)):
        return "another lens"
    if one.place is not None and other.place is not None:
        numbers = zip(
            (*one.place.origin, *sum(one.place.rows, ())),
            (*other.place.origin, *sum(other.place.rows, ())),
            strict=True,
        )
        if any(abs(x - y) > 5 * METRES for x, y in numbers):
            return "taken from elsewhere"
    return ""


def _trees(first: list[Message], second: list[Message]) -> Iterator[str]:
    before, after = _edges(first), _edges(second)
    for parent, child in sorted(before.keys() - after.keys()):
        yield f"no transform {parent} -> {child}"
    for parent, child in sorted(after.keys() - before.keys()):
        yield f"new transform {parent} -> {child}"
    for edge in sorted(before.keys() & after.keys()):
        pairs = zip(before[edge], after[edge], strict=True)
        if any(abs(x - y) > METRES for x, y in pairs):
            yield f"transform {edge[0]} -> {edge[1]} differs"


def _edges(messages: list[Message]) -> dict[tuple[str, str], tuple[float, ...]]:
    """Return the last of each transform, with its rotation as w >= 0, and its lag."""
    found = {}
    for message in messages:
        for each in message.data.each():
            q = each.rotation
            sign = -1.0 if q[0] < 0 else 1.0
            turned = tuple(sign * x for x in q)
            lag = message.stamp - message.at
            found[each.parent, each.child] = (*each.translation, *map(abs, turned), lag)
    return found


# Sections 1, 2 and 5 of the handout, as somebody at the other end of ROS sees them.
EXPECTED = Expected(
    types={
        "/clock": "rosgraph_msgs/msg/Clock",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/camera/image_raw": "sensor_msgs/msg/Image",
        "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    },
    domain=0,
    commands="/cmd_vel",
    clock="/clock",
    odometry="/odom",
    transforms="/tf",
    scan="/scan",
    image="/camera/image_raw",
    info="/camera/camera_info",
    root="odom",
    base="base_footprint",
    scan_rate=10.0,
    image_rate=10.0,
    limits=(0.22, 1.0),
    turn_rate=10.0,
    frames=(
        "base_footprint",
        "base_link",
        "base_scan",
        "wheel_left_link",
        "wheel_right_link",
        "caster_back_link",
        "Camera_1",
    ),
    wheel_radius=0.025,
    view=(1.0, 0.0, 0.0),
    upward=(0.0, 0.0, 1.0),
    static=frozenset({"/tf_static"}),
)


def _no_leg_longer(seconds: float) -> tuple[Session, ...]:
    """Return all that the fixed drive does, but briefly."""
    return tuple(
        replace(
            session,
            legs=tuple(replace(leg, seconds=min(leg.seconds, seconds)) for leg in session.legs),
        )
        for session in fixed_drive()
    )


DRIVE = _no_leg_longer(0.6)
TO_THE_WALL = _no_leg_longer(1.0)
SHORT = drive_of(
    "0.15,0,0.6 0,0.8,0.3", EXPECTED.limits
)  # where it is of no importance how it drives


def driven(
    stage: Usd.Stage, drive: Sequence[Session] = DRIVE, wanted: Expected = EXPECTED
) -> Trial:
    play = Play("", wanted, tuple(drive))
    return play.recorded(read_scene(stage, load_platform()), load_platform())


def faults(trial: Trial) -> list[Check]:
    return [each for each in judge(trial, CHECKS) if each.verdict != "ok"]
