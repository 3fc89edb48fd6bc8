"""Judges a recording by what came in it: nothing of a lab is asked, any robot may be in it.

Each odometry is a robot. It is driven by the commands, seen by the TF and told the joints of the
topics that are nearest to it by their namespaces.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import RecordingError
from lab3_usd.isaac.platform import Platform
from lab3_usd.sim.any_stage import one_tree, running_clock
from lab3_usd.sim.arms import JOINTS
from lab3_usd.sim.bag.decoder import is_read
from lab3_usd.sim.bag.driven import HELD, follows_side
from lab3_usd.sim.bag.judge import (
    GAP,
    STUCK,
    CheckFunction,
    Recorded,
    odometry,
    of_recording,
    recorded_drive,
    recorded_run,
    running,
    unread,
    unreadable,
    way,
)
from lab3_usd.sim.bag.reader import Gathered, Topics, gather
from lab3_usd.sim.bag.recording_files import Bounds, Layout, Offered, layout_at, opened
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.recording import JointStates, Odometry, Recording, Scan
from lab3_usd.sim.judge.checks import judge
from lab3_usd.sim.judge.expectations import RunFault, Trial
from lab3_usd.sim.judge.motion import moving_frames, rest
from lab3_usd.sim.outcome import DryRun, Judged
from lab3_usd.sim.robots import ODOMETRY, STEERING, TWIST, expected_of
from lab3_usd.sim.streams import CLOCK, TRANSFORMS

SCAN = "sensor_msgs/msg/LaserScan"
SLOW = 5.0  # times the usual pause of a transform, from which on it is missing
NEAR = (0.05, 0.1)  # radians or metres, and part of the way, by which a joint may miss it

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
        robots = robots_in(kinds, {*commanded, *_usual_commands(platform, kinds)})
        drives = [_drive_of(layout, bounds, kinds, robot) for robot in robots]
    except (RecordingError, OSError) as error:
        return unread(recording, "", error)
    count = len(robots)
    whole = judge(drives[0], _whole_checks(drives[0], robots[0]))
    judged = [
        Judged(robot.name if count > 1 else "", each, judge(each, _checks(each, robot, count)))
        for robot, each in zip(robots, drives, strict=True)
    ]
    run = of_recording(recorded_run(drives, judged, whole), recording, layout)
    if run.behaviour.topics:
        return run
    nothing = replace(run.behaviour, verdict="not judged", missing="nothing was recorded")
    return replace(run, behaviour=nothing)


def robots_in(kinds: Kinds, commanded: Collection[str]) -> tuple[RecordedRobot, ...]:
    """Return the robots of a recording by its topics; at least one, which may have none."""

    def named(kind: str) -> list[str]:
        return [topic for topic, of in kinds if of == kind]

    told, steered = named(TWIST), named(STEERING)
    states = [topic for topic in named(JOINTS) if topic not in commanded]
    commands = [topic for topic in named(JOINTS) if topic in commanded]
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
        if kind.role == "subscriber" and JOINTS in kind.message.values()
        for port in map(kind.port, kind.topics)
        if port is not None
    }
    yield from (topic for topic, of in kinds if of == JOINTS and topic.split("/")[-1] in names)


def _drive_of(layout: Layout, bounds: Bounds, kinds: Kinds, robot: RecordedRobot) -> Recorded:
    """Read what concerns one robot, and return its drive."""
    clocks = sorted((topic for topic, of in kinds if of == CLOCK), key=lambda name: name.count("/"))
    wanted = replace(
        expected_of(None),
        types={topic: kind for topic, kind in kinds if is_read(kind)},
        commands=robot.commands,
        joint_commands=robot.joint_commands,
        clock=next(iter(clocks), ""),
        odometry=robot.odometry,
        transforms=robot.transforms,
        scan=robot.scan,
        is_car=(robot.commands, STEERING) in kinds,
        has_rollers=True,  # a robot that nothing is known of may go to any side
    )
    static = frozenset(
        topic
        for topic, kind in kinds
        if kind == TRANSFORMS and _is_static(kinds[topic, kind])
        if nearest(topic, _trees(kinds)) == robot.transforms
    )
    topics = Topics(wanted, static, "")
    with opened(layout, bounds) as bag:
        gathered = gather(bag.messages(), bag.topics, topics, bounds)
    told = next(
        (
            message
            for message in gathered.recording.topic(wanted.odometry, 0)
            if isinstance(message.data, Odometry)
        ),
        None,
    )
    if told is not None:
        topics = replace(topics, wanted=replace(wanted, root=told.frame, base=told.data.child))
    drive = recorded_drive(gathered, topics)
    _add_wheels(drive.recording, robot)
    if robot.commands:
        held = f"{robot.odometry} is held against the commands on {robot.commands}"
        drive.recording.remarks.append(held)
    if robot.joint_commands:
        held = f"{robot.joints} is held against the commands on {robot.joint_commands}"
        drive.recording.remarks.append(held)
    return drive


def _add_wheels(recording: Recording, robot: RecordedRobot) -> None:
    """Add to the poses how fast the joints turn that do."""
    states = [
        (message.at, dict(zip(message.data.names, message.data.velocities, strict=False)))
        for message in recording.topic(robot.joints, 0)
        if isinstance(message.data, JointStates)
    ]
    turning = {name: None for _, speeds in states for name, speed in speeds.items() if speed}
    if not turning or not robot.odometry:
        return
    recording.wheels = tuple(turning)
    recording.path = [
        replace(
            pose, wheels=tuple(_state(states, name, pose.at) or 0.0 for name in recording.wheels)
        )
        for pose in recording.path
    ]


def _whole_checks(recorded: Recorded, robot: RecordedRobot) -> dict[str, CheckFunction]:
    """Return the checks of all topics."""
    checks: dict[str, CheckFunction] = {
        "messages": unreadable,
        "rates": lambda seen: advancing(seen.gathered, robot),
    }
    return {**checks, "clock": _clock} if recorded.wanted.clock else checks


def _checks(recorded: Recorded, robot: RecordedRobot, robots: int) -> dict[str, CheckFunction]:
    """Return the checks of a robot for which something came."""
    wanted, gathered = recorded.wanted, recorded.gathered
    moved = bool(gathered.commands and recorded.recording.path)
    has_tree = bool(gathered.links)
    both = wanted.odometry and has_tree and recorded.recording.topic(wanted.odometry, 0)
    asked: dict[str, tuple[CheckFunction, object]] = {
        "tree": (lambda seen: _tree(seen, robots), has_tree),
        "frames": (frames, has_tree),
        "rest": (rest, moved),
        "follows": (follows_side, moved),
        "way": (way, moved),
        "odometry": (odometry, moved),
        "moving frames": (moving_frames, both),
        "scan": (returns, wanted.scan),
        "joints": (
            lambda seen: joints(seen, robot),
            robot.joint_commands and robot.joints,
        ),
    }
    return {name: check for name, (check, is_asked) in asked.items() if is_asked}


def advancing(gathered: Gathered, robot: RecordedRobot) -> Iterator[RunFault]:
    """The stamps of each stream advance; several nodes may send transforms of one time."""
    for (topic, kind), tally in gathered.tallies.items():
        if kind in {TRANSFORMS, CLOCK} or topic == robot.joint_commands or tally.stamp is None:
            continue
        if kind != STEERING and tally.stuck > STUCK * tally.count:
            text = f"{tally.stuck} of {tally.count} stamps of {topic} are not later than the one"
            yield RunFault(f"{text} before", "stamp-not-advancing")


def _clock(recorded: Recorded) -> Iterator[RunFault]:
    yield from running_clock(recorded)
    yield from running(recorded)


def _tree(trial: Trial, robots: int) -> Iterator[RunFault]:
    """Each frame has one parent; how often a transform comes is up to its node."""
    bare = replace(trial, wanted=replace(trial.wanted, types={}))
    for fault in one_tree(bare, robots):
        if fault.kind != "transform-ends":
            yield fault


def frames(recorded: Recorded) -> Iterator[RunFault]:
    """No transform is missing for long, by how often it comes."""
    gathered = recorded.gathered
    static = {(frame.parent, frame.child) for frame in gathered.frames if frame.static}
    for (parent, child), link in gathered.links.items():
        usual = gathered.timeline.now / max(1, link.count)
        if (parent, child) not in static and link.gap > max(GAP, SLOW * usual):
            yield RunFault(f"{parent} -> {child} is missing for {link.gap:.1f} s", "transform-gap")
            return


def returns(trial: Trial) -> Iterator[RunFault]:
    """Rays of scans come back."""
    scans = [m for m in trial.recording.topic(trial.wanted.scan, 0) if isinstance(m.data, Scan)]
    if scans and all(distance < 0 for m in scans for distance in m.data.ranges):
        yield RunFault(f"no ray on {trial.wanted.scan} returns", "no-ray-returns")


def joints(trial: Trial, robot: RecordedRobot) -> Iterator[RunFault]:
    """Each joint is where it is commanded to, at the end of each command of a second or more."""
    commands = [
        (message.at, message.data)
        for message in trial.recording.topic(robot.joint_commands, 0)
        if isinstance(message.data, JointStates)
    ]
    states = [
        (message.at, dict(zip(message.data.names, message.data.positions, strict=False)))
        for message in trial.recording.topic(robot.joints, 0)
        if isinstance(message.data, JointStates)
    ]
    held: dict[str, tuple[float, float]] = {}  # since when each joint is commanded where
    looked, end = False, trial.recording.seconds
    told = [(at, dict(zip(data.names, data.positions, strict=False))) for at, data in commands]
    for at, places in [*told, (end, {})]:
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
