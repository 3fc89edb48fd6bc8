"""Judges a recording by what came in it: nothing of a lab is asked, any robot may be in it.

Each odometry is a robot. It is driven by the commands, seen by the TF and told the joints of the
topics that are nearest to it by their namespaces.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.errors import RecordingError
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import CLOCK, JOINT_STATES, ODOMETRY, SCAN, STEERING, TRANSFORMS, TWIST
from lab3_usd.sim.bag.decoder import is_read
from lab3_usd.sim.bag.judge import (
    Recorded,
    judged_drives,
    of_recording,
    read_by_name,
    recorded_drive,
    unread,
)
from lab3_usd.sim.bag.reader import Gathered
from lab3_usd.sim.bag.recording_files import Bounds, Offered, layout_at, opened
from lab3_usd.sim.execution.recording import Odometry
from lab3_usd.sim.judge.checks import CHECKS
from lab3_usd.sim.judge.expectations import Expected, Look
from lab3_usd.sim.judge.topics import tree
from lab3_usd.sim.outcome import DryRun
from lab3_usd.sim.robots import expected_of

Kinds = Mapping[tuple[str, str], tuple[Offered, ...]]


def judge_any_recording(
    recording: Path, platform: Platform, commanded: Collection[str] = ()
) -> DryRun:
    """Judge a recording by itself.

    `commanded` are topics of joint states that are known to be commands; others are so by the name
    that Isaac Sim's subscriber gives them.
    """
    try:
        layout, bounds = layout_at(recording), Bounds()
        with opened(layout, bounds) as bag:
            kinds = dict(bag.topics)
        recorded = robots_in(kinds, {*commanded, *_usual_commands(platform, kinds)})
        asked = {
            robot.odometry or robot.joint_states or robot.transforms if recorded[1:] else "": robot
            for robot in recorded
        }
        asked = {name: _asked_of(robot, kinds, len(asked)) for name, robot in asked.items()}
        readings = read_by_name(layout, bounds, asked)
    except (RecordingError, OSError) as error:
        return unread(recording, "", error)
    drives = {name: _drive_of(*reading) for name, reading in readings.items()}
    run = of_recording(judged_drives(drives, next(iter(drives.values()))), recording, layout)
    if run.behaviour.topics:
        return run
    nothing = replace(run.behaviour, verdict="not judged", missing="nothing was recorded")
    return replace(run, behaviour=nothing)


def robots_in(kinds: Kinds, commanded: Collection[str]) -> tuple[Expected, ...]:
    """Return the robots of a recording by its topics; at least one, which may have none."""

    def named(kind: str) -> list[str]:
        return [topic for topic, of in kinds if of == kind]

    told, steered = named(TWIST), named(STEERING)
    states = [topic for topic in named(JOINT_STATES) if topic not in commanded]
    commands = [topic for topic in named(JOINT_STATES) if topic in commanded]
    trees = _trees(kinds) or named(TRANSFORMS)
    bases = named(ODOMETRY) or states or trees or [""]
    robots = []
    for base in bases:
        odometry = base if base in named(ODOMETRY) else ""
        robot = replace(
            expected_of(None),
            odometry=odometry,
            commands=nearest(base, [*told, *steered], bases) if odometry else "",
            transforms=nearest(base, trees),
            scan=nearest(base, named(SCAN), bases),
            joint_states=nearest(base, states, bases),
            joint_commands=nearest(base, commands, bases),
        )
        robots.append(robot)
    return tuple(robots)


def nearest(base: str, topics: Collection[str], bases: Collection[str] = ()) -> str:
    """Return the topic that shares most of the namespace of a robot's; '' where none fits.

    One that another robot is nearer to is not taken.
    """

    def shared(one: str, other: str) -> int:
        names = zip(one.split("/")[1:-1], other.split("/")[1:-1], strict=False)
        count = 0
        for first, second in names:
            if first != second:
                break
            count += 1
        return count

    fitting = [
        topic
        for topic in topics
        if shared(base, topic) == max((shared(other, topic) for other in bases), default=0)
        or not bases
    ]
    return max(fitting, key=lambda topic: (shared(base, topic), -topic.count("/")), default="")


def _trees(kinds: Kinds) -> list[str]:
    """Return the topics of transforms that move."""
    sent = [key for key in kinds if key[1] == TRANSFORMS]
    return [topic for topic, kind in sent if not _is_static(kinds[topic, kind])]


def _is_static(offers: Iterable[Offered]) -> bool:
    return any(offer.durability == "transient_local" for offer in offers)


def _usual_commands(platform: Platform, kinds: Kinds) -> Iterator[str]:
    """Yield the topics of joint states that end as those of Isaac Sim's subscriber."""
    names = {
        port.default
        for kind in platform.types.values()
        if kind.role == "subscriber" and JOINT_STATES in kind.message.values()
        for port in map(kind.port, kind.topics)
        if port is not None
    }
    yield from (
        topic for topic, of in kinds if of == JOINT_STATES and topic.split("/")[-1] in names
    )


def _asked_of(robot: Expected, kinds: Kinds, robots: int) -> Expected:
    """Return all that is read of a recording for one of its robots."""
    clocks = sorted((topic for topic, of in kinds if of == CLOCK), key=lambda name: name.count("/"))
    static = frozenset(
        topic
        for topic, kind in kinds
        if kind == TRANSFORMS and _is_static(kinds[topic, kind])
        if nearest(topic, _trees(kinds)) == robot.transforms
    )
    return replace(
        robot,
        types={topic: kind for topic, kind in kinds if is_read(kind)},
        clock=next(iter(clocks), ""),
        static=static,
        is_car=(robot.commands, STEERING) in kinds,
        has_rollers=True,  # a robot that nothing is known of may go to any side
        trees=robots,
    )


def _drive_of(wanted: Expected, gathered: Gathered) -> Recorded:
    """Return what was recorded of a robot, as its drive."""
    sent = gathered.recording.topic(wanted.odometry, 0)
    told = next((message for message in sent if isinstance(message.data, Odometry)), None)
    wanted = replace(wanted, types={})  # of which none is asked for
    if told is not None:
        wanted = replace(wanted, root=told.frame, base=told.data.child)
    drive = recorded_drive(gathered, wanted)
    drive.own_checks = drive.own_checks | {
        # How often a transform comes is up to its node.
        "tree": Look(
            lambda seen: (fault for fault in tree(seen) if fault.kind != "transform-ends"),
            CHECKS["tree"].is_asked,
        ),
    }
    pairs = (wanted.odometry, wanted.commands), (wanted.joint_states, wanted.joint_commands)
    drive.recording.remarks += [
        f"{shown} is held against the commands on {told}" for shown, told in pairs if told
    ]
    return drive
