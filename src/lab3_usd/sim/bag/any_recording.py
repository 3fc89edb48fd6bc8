"""Judges a recording by what came in it: nothing of a lab is asked, any robot may be in it.

Each odometry is a robot. It is driven by the commands, seen by the TF and told the joints of the
topics that are nearest to it by their namespaces.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import RecordingError
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import CLOCK, JOINT_STATES, ODOMETRY, SCAN, STEERING, TRANSFORMS, TWIST
from lab3_usd.sim.bag.decoder import is_read
from lab3_usd.sim.bag.driven import follows_side
from lab3_usd.sim.bag.judge import (
    Recorded,
    judged_drives,
    of_recording,
    read_by_name,
    recorded_drive,
    unread,
)
from lab3_usd.sim.bag.reader import Gathered, Topics
from lab3_usd.sim.bag.recording_files import Bounds, Offered, layout_at, opened
from lab3_usd.sim.execution.recording import Odometry
from lab3_usd.sim.judge.checks import ASKED
from lab3_usd.sim.judge.expectations import Look
from lab3_usd.sim.judge.topics import tree
from lab3_usd.sim.outcome import DryRun
from lab3_usd.sim.robots import expected_of

Kinds = Mapping[tuple[str, str], tuple[Offered, ...]]


class RecordedRobot(Struct, frozen=True):
    """The topics of one robot in a recording, '' for none."""

    odometry: str
    commands: str
    transforms: str
    scan: str
    joints: str
    joint_commands: str

    @property
    def name(self) -> str:
        """The topic by which it is told from others."""
        return self.odometry or self.joints or self.transforms


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
        robots = {robot.name if recorded[1:] else "": robot for robot in recorded}
        asked = {name: _topics_of(each, kinds, len(robots)) for name, each in robots.items()}
        readings = read_by_name(layout, bounds, asked)
    except (RecordingError, OSError) as error:
        return unread(recording, "", error)
    drives = {name: _drive_of(robots[name], *reading) for name, reading in readings.items()}
    run = of_recording(judged_drives(drives, next(iter(drives.values()))), recording, layout)
    if run.behaviour.topics:
        return run
    nothing = replace(run.behaviour, verdict="not judged", missing="nothing was recorded")
    return replace(run, behaviour=nothing)


def robots_in(kinds: Kinds, commanded: Collection[str]) -> tuple[RecordedRobot, ...]:
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
        robots.append(
            RecordedRobot(
                odometry,
                nearest(base, [*told, *steered], bases) if odometry else "",
                nearest(base, trees),
                nearest(base, named(SCAN), bases),
                nearest(base, states, bases),
                nearest(base, commands, bases),
            )
        )
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


def _topics_of(robot: RecordedRobot, kinds: Kinds, robots: int) -> Topics:
    """Return what is read of a recording for one of its robots."""
    clocks = sorted((topic for topic, of in kinds if of == CLOCK), key=lambda name: name.count("/"))
    static = frozenset(
        topic
        for topic, kind in kinds
        if kind == TRANSFORMS and _is_static(kinds[topic, kind])
        if nearest(topic, _trees(kinds)) == robot.transforms
    )
    wanted = replace(
        expected_of(None),
        types={topic: kind for topic, kind in kinds if is_read(kind)},
        commands=robot.commands,
        joint_commands=robot.joint_commands,
        clock=next(iter(clocks), ""),
        odometry=robot.odometry,
        transforms=robot.transforms,
        scan=robot.scan,
        static=static,
        is_car=(robot.commands, STEERING) in kinds,
        has_rollers=True,  # a robot that nothing is known of may go to any side
        trees=robots,
    )
    return Topics(wanted, "", joints=robot.joints)


def _drive_of(robot: RecordedRobot, topics: Topics, gathered: Gathered) -> Recorded:
    """Return what was recorded of a robot, as its drive."""
    wanted = topics.wanted
    sent = gathered.recording.topic(wanted.odometry, 0)
    told = next((message for message in sent if isinstance(message.data, Odometry)), None)
    wanted = replace(wanted, types={})  # of which none is asked for
    if told is not None:
        wanted = replace(wanted, root=told.frame, base=told.data.child)
    drive = recorded_drive(gathered, replace(topics, wanted=wanted))
    drive.own_checks = {
        # How often a transform comes is up to its node.
        "tree": Look(
            lambda seen: (fault for fault in tree(seen) if fault.kind != "transform-ends"),
            ASKED["tree"],
        ),
        "follows": Look(follows_side, ASKED["follows"]),
    }
    pairs = (robot.odometry, robot.commands), (robot.joints, robot.joint_commands)
    drive.recording.remarks += [
        f"{shown} is held against the commands on {told}" for shown, told in pairs if told
    ]
    return drive
