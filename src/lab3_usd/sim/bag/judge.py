"""Judges a recording by the checks of a dry run, and by those of its own.

The commands of the recording become legs, and odometry the path, as a dry run has them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.deliverables.maps import MapError, map_of_stage
from lab3_usd.errors import RecordingError
from lab3_usd.facts.tree import SentTransform, Tree, tree_of
from lab3_usd.isaac.topics import CLOCK, JOINT_STATES, STEERING, TRANSFORMS
from lab3_usd.model.dry_run import HERE, Behaviour, Topic, Unknown
from lab3_usd.sim.bag.driven import (
    follows_side,
    joints_there,
    leg_of_any_base,
    legs,
    path,
    turning_joints,
)
from lab3_usd.sim.bag.reader import Gathered, gather
from lab3_usd.sim.bag.recording_files import Bounds, Layout, layout_at, opened
from lab3_usd.sim.execution.drive import Session
from lab3_usd.sim.execution.recording import Odometry
from lab3_usd.sim.judge.checks import CHECKS as SHARED
from lab3_usd.sim.judge.expectations import (
    PHYSICAL,
    Expected,
    Look,
    RunFault,
    Trial,
    displacement,
    is_about,
)
from lab3_usd.sim.judge.localization import fit
from lab3_usd.sim.judge.sensors import SHORT
from lab3_usd.sim.judge.topics import SLOW, expected_at, expected_of_each, map_topic, reached_topics
from lab3_usd.sim.outcome import DryRun, behaviour_of, judge_each
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.ros import GoalSpec, TopicSpec

GAP = 0.5  # seconds without a transform
QUIET = 3.0  # seconds without the transform of localization
LEAST = 0.5  # metres to drive, from which on the whole way is judged
AGREES = (0.05, 0.3)  # m/s or rad/s, and part, between speeds and the way
BARELY = 0.1  # of the simulation's time in the time that passes, below which a clock stands
STUCK = 0.1  # part of the messages whose stamp may not advance
_FRAMES = ("header.frame_id", "child_frame_id")


class Recorded(Trial, kw_only=True):
    """The drive of a robot in a recording, with what is asked of topics and navigation."""

    gathered: Gathered
    interface: tuple[TopicSpec, ...] | None = None  # that a lab asks for, None without a lab
    goal: GoalSpec | None = None
    navigation: frozenset[str] = frozenset()  # the checks of it that are asked for


def unreadable(recorded: Recorded) -> Iterator[RunFault]:
    """Every message is of the type that its topic says."""
    for (topic, kind), tally in recorded.gathered.tallies.items():
        if tally.unreadable:
            text = f"{tally.unreadable} of {tally.count} messages on {topic} are not {kind}"
            yield RunFault(text, "unreadable-message")


def qos(recorded: Recorded) -> Iterator[RunFault]:
    """Each topic is offered with the durability that is asked for, by as many as are asked for."""
    for topic in recorded.interface or ():
        for tally in recorded.gathered.of_topic(topic.name):
            offered = [offer.durability for offer in tally.offered]
            odd = next((name for name in offered if topic.durability not in {None, name}), None)
            if odd is not None:
                yield RunFault(
                    f"{topic.name} is offered {odd}, not {topic.durability}", "wrong-durability"
                )
            if topic.publishers is not None and len(offered) > topic.publishers:
                yield RunFault(f"{len(offered)} publishers of {topic.name}", "extra-publisher")


def rates(recorded: Recorded) -> Iterator[RunFault]:
    """Streams that a lab asks for arrive at a plausible rate; their stamps, or all, advance.

    Several nodes may send transforms of one time, and commands may have none.
    """
    is_short = recorded.gathered.timeline.arrived < SHORT
    asked = {topic.name for topic in recorded.interface or () if topic.rate is not None}
    for (topic, kind), tally in recorded.gathered.tallies.items():
        is_command = topic == recorded.wanted.joint_commands or kind == STEERING
        is_stream = kind not in {TRANSFORMS, CLOCK} and not is_command
        if topic in asked and tally.count and not (any(tally.rates()) or is_short):
            yield RunFault(f"{topic} is received only once", "single-message")
        elif (is_stream if recorded.interface is None else topic in asked) and (
            tally.stuck > STUCK * tally.count
        ):
            text = f"{tally.stuck} of {tally.count} stamps of {topic} do not advance"
            yield RunFault(text, "stamp-not-advancing")


def headers(recorded: Recorded) -> Iterator[RunFault]:
    """The headers name the frames that are asked for."""
    for topic in recorded.interface or ():
        wanted = [(topic.fields or {})[name] for name in _FRAMES if name in (topic.fields or {})]
        for tally in recorded.gathered.of_topic(topic.name):
            odd = [frame for frame in tally.frames if frame not in wanted]
            if wanted and odd:
                text = f"{topic.name} is in {', '.join(odd)}, not {' and '.join(wanted)}"
                yield RunFault(text, "wrong-header-frame")


def clock(recorded: Recorded) -> Iterator[RunFault]:
    """The clock advances, at the speed of the simulation."""
    yield from SHARED["clock"].faults(recorded)
    timeline = recorded.gathered.timeline
    if timeline.ticks > 1 and timeline.speed < BARELY and timeline.arrived > 1.0:
        passed = f"{timeline.now:.1f} s in {timeline.arrived:.1f} s"
        yield RunFault(f"{recorded.wanted.clock} runs {passed}", "stopped-clock")


def frames(recorded: Recorded) -> Iterator[RunFault]:
    """Each frame keeps its parent to the end, and its transform comes as often as it usually does.

    Who ties the root to a map is judged by itself.
    """
    gathered = recorded.gathered
    for child, several in _heard(gathered).several_parents.items():
        yield RunFault(f"{child} has the parents {', '.join(several)}", "changing-parent")
    static = {(frame.parent, frame.child) for frame in gathered.frames if frame.static}
    moving = {
        frames: link
        for frames, link in gathered.links.items()
        if frames not in static and frames[1] != recorded.wanted.root
    }
    end = max((link.last for link in moving.values()), default=0.0)
    for (parent, child), link in moving.items():
        gap, usual = max(link.gap, end - link.last), gathered.timeline.now / max(1, link.count)
        if gap > max(GAP, SLOW * usual):
            yield RunFault(f"{parent} -> {child} is missing for {gap:.1f} s", "transform-gap")
            return


def _heard(gathered: Gathered) -> Tree[SentTransform]:
    """Return what tf2 made of the recorded transforms; a recording does not tell who sent them."""
    return tree_of(SentTransform(parent, child) for parent, child in gathered.links)


def odometry(recorded: Recorded) -> Iterator[RunFault]:
    """The velocities of odometry agree with its poses."""
    sent = recorded.recording.topic(recorded.wanted.odometry, 0)
    # Messages of other types may come on the topic as well.
    told = [(message.at, message.data) for message in sent if isinstance(message.data, Odometry)]
    end = 0.0
    for leg in recorded.drive[0].legs:
        start, end = end, end + leg.seconds
        if leg.name not in {"ahead", "back", "left", "right"}:
            continue
        inside = [data for at, data in told if start < at <= end]
        if not inside:
            continue
        stretch = next((s for s in recorded.stretches(leg.name) if s.leg is leg), None)
        if stretch is None:
            continue
        ahead, _, turned = displacement(stretch.before, stretch.poses[-1])
        linear = sum(data.linear[0] for data in inside) / len(inside)
        angular = sum(data.angular[2] for data in inside) / len(inside)
        pairs = [(linear, ahead / leg.seconds)]
        if abs(leg.turn * leg.seconds) < math.pi / 2:
            pairs.append((angular, turned / leg.seconds))
        if any(abs(a - b) > AGREES[0] + AGREES[1] * abs(b) for a, b in pairs):
            yield RunFault(
                f"the speeds of odometry do not agree with its path {leg.name}",
                "wrong-odometry-velocity",
            )
            return


def way(recorded: Recorded) -> Iterator[RunFault]:
    """In total, the robot travels about the commanded distance."""
    most = recorded.wanted.limits[0] or math.inf
    commanded = sum(min(abs(leg.forward), most) * leg.seconds for leg in recorded.drive[0].legs)
    poses = recorded.recording.path
    driven = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses))
    if commanded > LEAST and not is_about(driven, commanded):
        yield RunFault(
            f"commanded to go {commanded:.1f} m in all, went {driven:.1f} m", "wrong-distance"
        )


def localization(recorded: Recorded) -> Iterator[RunFault]:
    """Localization alone connects the map to odometry, to the end."""
    root, world, gathered = recorded.wanted.root, recorded.wanted.map_frame, recorded.gathered
    link = gathered.links.get((world, root))
    if link is None:
        yield RunFault(f"no {world} -> {root}", "no-localization")
    elif link.last < gathered.timeline.now - QUIET:
        yield RunFault(f"{world} -> {root} ends", "localization-ends")
    several = _heard(gathered).several_parents.get(root)
    if several:
        yield RunFault(f"{root} has the parents {', '.join(several)}", "changing-parent")


def goal(recorded: Recorded) -> Iterator[RunFault]:
    """The last goal is reached."""
    goals, expected = recorded.gathered.goals, recorded.goal
    if expected is None:
        return
    if not goals:
        yield RunFault("no goal was sent", "no-goal-sent")
    elif [*goals.values()][-1] != expected.succeeded:
        name = expected.name([*goals.values()][-1])
        yield RunFault(f"the last of {len(goals)} goals is {name}", "goal-not-reached")


def joints(recorded: Recorded) -> Iterator[RunFault]:
    """Joints are where they are commanded to."""
    recording = recorded.recording
    commanded = recording.topic(recorded.wanted.joint_commands, 0)
    yield from joints_there(
        commanded, recording.topic(recorded.wanted.joint_states, 0), recording.seconds
    )


def _is_interface_asked(recorded: Recorded) -> bool:
    return bool(recorded.interface)


def _has_moved(recorded: Recorded) -> bool:
    return bool(recorded.gathered.commands and recorded.recording.path)


def _and(condition: Callable[[Recorded], bool], name: str) -> Callable[[Recorded], bool]:
    """Return a condition together with that of a dry run for a check."""
    return lambda recorded: condition(recorded) and SHARED[name].is_asked(recorded)


# What is looked at of a recording beside the checks of a dry run, or in their place.
CHECKS: dict[str, Look] = {
    "messages": Look(unreadable, lambda _: True),
    "QoS": Look(qos, _is_interface_asked),
    "rates": Look(rates, lambda _: True),
    "headers": Look(headers, _is_interface_asked),
    "clock": Look(clock, SHARED["clock"].is_asked),
    "frames": Look(frames, lambda recorded: bool(recorded.gathered.links)),
    "rest": Look(SHARED["rest"].faults, _and(_has_moved, "rest")),
    "follows": Look(SHARED["follows"].faults, _and(_has_moved, "follows")),
    "limits": Look(SHARED["limits"].faults, _and(_has_moved, "limits")),
    "odometry": Look(odometry, _and(_has_moved, "odometry")),
    "way": Look(way, _has_moved),
    "mounted": Look(SHARED["mounted"].faults, _and(_is_interface_asked, "mounted")),
    "joints": Look(
        joints,
        lambda recorded: (
            bool(recorded.recording.topic(recorded.wanted.joint_commands, 0))
            and recorded.wanted.joint_states != ""
        ),
    ),
    "localization": Look(localization, lambda recorded: "localization" in recorded.navigation),
    "goal": Look(goal, lambda recorded: "goal" in recorded.navigation),
}


_TOPIC = re.compile(r"/[A-Za-z0-9_/]+")
_TYPE = re.compile(r"[A-Za-z0-9_]+/(msg|srv|action)/[A-Za-z0-9_]+")
NO_CONTENT = "not sent, since a dry run makes no images and no point clouds"


def judge_recording(
    recording: Path, lab: Lab, checkpoint: str, *, whole: bool, maps: Path | None = None
) -> DryRun:
    """Judge a recording by what the lab asks for at a checkpoint.

    `whole` asks for localization and a goal although nothing of them was recorded. `maps` is where
    the map is that scans are laid on; without it that of the recording is taken, else the lab's.
    """
    try:
        layout, bounds = layout_at(recording), Bounds()
        readings = read_by_name(layout, bounds, dict(_topics_asked(lab, checkpoint)))
    except (RecordingError, OSError) as error:
        return unread(recording, checkpoint, error)
    for wanted, gathered in readings.values():
        if wanted.map and (maps is not None or gathered.map is None):
            try:
                gathered.map = map_of_stage(recording, maps, lab)
            except MapError as error:
                gathered.map_fault = str(error)
    asked = _asking_for(readings, lambda topic: topic not in layout.not_sent)
    run = _judged(asked, (lab, checkpoint), whole=whole)
    return of_recording(run, recording, layout, checkpoint)


def judge_what_came(layout: Layout, bounds: Bounds, lab: Lab, checkpoint: str) -> Behaviour:
    """Judge recorded messages by the requirements of the lab; what was not recorded is no fault.

    Raises:
        RecordingError: it cannot be read.
    """
    readings = read_by_name(layout, bounds, dict(_topics_asked(lab, checkpoint)))
    _, gathered = readings[""]
    came = {topic for (topic, _), tally in gathered.tallies.items() if tally.count}
    seen = _asking_for(readings, lambda topic: topic in came)
    return _judged(seen, (lab, checkpoint), whole=False).behaviour


def unread(recording: Path, checkpoint: str, error: Exception) -> DryRun:
    """Return the results of a recording that cannot be read."""
    reason = (Unknown("/", str(error)),)
    name = str(recording)
    return DryRun(
        Behaviour("", checkpoint, 0.0, "unreadable", not_simulated=reason, recording=name)
    )


def of_recording(run: DryRun, recording: Path, layout: Layout, checkpoint: str = "") -> DryRun:
    """Return results with where they come from, and which topics a bag of a dry run lacks."""
    unknown = tuple(Unknown(topic, NO_CONTENT) for topic in sorted(layout.not_sent))
    name = str(recording)
    behaviour = replace(run.behaviour, recording=name, checkpoint=checkpoint, not_simulated=unknown)
    return replace(run, behaviour=behaviour)


Readings = Mapping[str, tuple[Expected, Gathered]]


def read_by_name(layout: Layout, bounds: Bounds, asked: Mapping[str, Expected]) -> Readings:
    """Read of a recording what is asked of robots by name.

    Raises:
        RecordingError: it cannot be read.
    """
    readings = {}
    for name, wanted in asked.items():
        with opened(layout, bounds) as bag:
            readings[name] = wanted, gather(bag.messages(), bag.topics, wanted, bounds)
    return readings


def _topics_asked(lab: Lab, checkpoint: str) -> Iterator[tuple[str, Expected]]:
    """Yield what the lab asks of all robots (''), and of each of several by name."""
    asked = {"": expected_at(lab, lab.checkpoints[checkpoint])}
    asked |= expected_of_each(lab, lab.checkpoints[checkpoint])
    status = "" if lab.ros.goal is None else lab.ros.goal.status
    world, frame = map_topic(lab, checkpoint)
    for name, wanted in asked.items():
        states = next((topic for topic, kind in wanted.types.items() if kind == JOINT_STATES), "")
        yield (
            name,
            replace(wanted, goal_status=status, map=world, map_frame=frame, joint_states=states),
        )


def _asking_for(readings: Readings, is_asked_for: Callable[[str], bool]) -> Readings:
    """Return what was read, asking for messages on some topics only."""
    asking = {}
    for name, (wanted, gathered) in readings.items():
        types = {topic: kind for topic, kind in wanted.types.items() if is_asked_for(topic)}
        asking[name] = replace(wanted, types=types), gathered
    return asking


def _judged(readings: Readings, asked_by: tuple[Lab, str], *, whole: bool) -> DryRun:
    """Judge what was read by what a lab asks for."""
    lab, checkpoint = asked_by
    every = {}
    for robot, (wanted, gathered) in readings.items():
        drive = every[robot] = recorded_drive(gathered, wanted)
        drive.interface, drive.goal = reached_topics(lab, checkpoint), lab.ros.goal
        drive.navigation = frozenset(_navigation(drive, checkpoint, lab, whole=whole))
    robots = {robot: drive for robot, drive in every.items() if robot}
    return judged_drives(robots or every, every[""])


def judged_drives(robots: Mapping[str, Recorded], shared: Recorded) -> DryRun:
    """Judge the drives of robots by name, the only one by '', and what they share once."""
    judged, whole = judge_each(robots, shared)
    gathered, behaviour = shared.gathered, behaviour_of(judged, whole)
    every = (frame for each in (shared, *robots.values()) for frame in each.gathered.frames)
    behaviour = replace(
        behaviour,
        seconds=gathered.timeline.now,
        topics=tuple(_topics(gathered)),
        frames=tuple(dict.fromkeys(every)),
        remarks=(*_time_remarks(gathered), *behaviour.remarks),
    )
    return DryRun(behaviour, robots)


def recorded_drive(gathered: Gathered, wanted: Expected) -> Recorded:
    """Return what was recorded of a robot, as its drive."""
    recording = gathered.recording
    recording.seconds = gathered.timeline.now
    drive = legs(gathered.commands, gathered.seconds, wanted.limits)
    own_checks = CHECKS
    if wanted.is_car or wanted.has_rollers:
        drive = tuple(leg_of_any_base(leg, is_steered=wanted.is_car) for leg in drive)
        own_checks = CHECKS | {"follows": Look(follows_side, CHECKS["follows"].is_asked)}
    states = recording.topic(wanted.joint_states, 0)
    recording.wheels, recording.path = turning_joints([*path(gathered.places, drive)], states)
    drive_of_robot = Recorded(
        recording,
        (Session(drive),),
        wanted,
        start=HERE,
        tolerance=PHYSICAL,
        own_checks=own_checks,
        gathered=gathered,
    )
    if gathered.located:
        drive_of_robot.map, drive_of_robot.map_fault = gathered.map, gathered.map_fault
        drive_of_robot.located = (gathered.located,)
        drive_of_robot.fit = fit(drive_of_robot)
    if not (gathered.commands or recording.topic(wanted.joint_commands, 0)):
        check = "joints" if wanted.joint_commands and not wanted.commands else "follows"
        recording.remarks.append(f"no command was recorded: `{check}` is not judged")
    return drive_of_robot


def _navigation(drive: Recorded, checkpoint: str, lab: Lab, *, whole: bool) -> Iterator[str]:
    """Yield the checks of navigation that a lab asks for, if it was recorded or all is asked."""
    gathered, goal, wanted = drive.gathered, lab.ros.goal, drive.wanted
    seen = {frame.child for frame in gathered.frames if frame.parent == wanted.map_frame}
    robot = () if goal is None else gathered.of_topic(goal.robot)
    if wanted.map and (whole or gathered.of_topic(wanted.map) or robot or seen):
        yield "localization"
    if goal is not None and goal.since in lab.until(checkpoint) and (whole or gathered.goals):
        yield "goal"


def _is_odd(topic: str, kind: str) -> bool:
    return not (_TOPIC.fullmatch(topic) and _TYPE.fullmatch(kind))


def _topics(gathered: Gathered) -> Iterator[Topic]:
    """Yield what came, by topic and type."""
    for (topic, kind), tally in sorted(gathered.tallies.items(), key=lambda row: row[0]):
        if not tally.count or _is_odd(topic, kind):
            continue
        by_stamp, by_arrival = (round(rate, 2) for rate in tally.rates())
        offered = tuple(offer.text for offer in tally.offered)
        frame = next(iter(tally.frames), "")
        yield Topic(topic, kind, by_stamp, frame, by_arrival, offered)


def _time_remarks(gathered: Gathered) -> Iterator[str]:
    """Say what else is to be known of the recording as a whole."""
    timeline = gathered.timeline
    if not timeline.clocked:
        yield "no clock was recorded: rates are those of arrival"
    else:
        yield f"the simulation ran at {timeline.speed:.2f} of real time"
    if gathered.until is not None:
        yield f"the first {gathered.until:.0f} s were judged message by message, the rest in total"
    odd = sum(_is_odd(topic, kind) for topic, kind in gathered.tallies)
    if odd:
        yield f"{odd} topics have an invalid name or type"
