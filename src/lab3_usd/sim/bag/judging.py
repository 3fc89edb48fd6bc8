"""Judges a recording by the checks of a dry run, and by those of its own.

The commands of the recording become legs, and odometry the path, as a dry run has them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.errors import RecordingError
from lab3_usd.model.dry_run.affine import HERE
from lab3_usd.model.dry_run.behaviour import Behaviour, Check, Place, Topic, Unknown
from lab3_usd.sim.bag.checks import CHECKS, Recorded
from lab3_usd.sim.bag.files import Layout, layout_at, opened
from lab3_usd.sim.bag.gathering import Gathered, Topics, gather
from lab3_usd.sim.bag.limits import Bounds
from lab3_usd.sim.behaviour.evidence import PHYSICAL, Evidence, Fault, Interface, angle
from lab3_usd.sim.behaviour.judge import CHECKS as SHARED
from lab3_usd.sim.behaviour.judge import verdict
from lab3_usd.sim.behaviour.ros_interface import interface, map_topic, reached_topics, static_topics
from lab3_usd.sim.execution.drive import RATE, Leg, Session, leg_name
from lab3_usd.sim.execution.record import Pose
from lab3_usd.sim.outcome import is_asked, path_rows, told_legs
from lab3_usd.spec.lab import Lab

_LONG = 1.0  # seconds of one command, from which on it is judged
_SAME = 1e-3  # m/s and rad/s between commands
_VARIED = "varied"
_Told = tuple[float, float, float]  # forward, to the left, turning

_TOPIC = re.compile(r"/[A-Za-z0-9_/]+")
_TYPE = re.compile(r"[A-Za-z0-9_]+/(msg|srv|action)/[A-Za-z0-9_]+")
_MOVED = ("rest", "follows", "limits", "way")


def judge_recording(recording: Path, lab: Lab, checkpoint: str, *, whole: bool) -> Behaviour:
    """Judge a recording by what the lab asks for at a checkpoint.

    `whole` asks for localization and a goal although nothing of them was recorded.
    """
    wanted = interface(lab, lab.checkpoints[checkpoint])
    topics = _read_topics(lab, wanted)
    try:
        bounds = Bounds()
        with opened(layout_at(recording), bounds) as bag:
            found = gather(bag.messages(), bag.topics, topics, bounds.listed)
    except (RecordingError, OSError) as error:
        reason = (Unknown("/", str(error)),)
        return Behaviour(
            "", checkpoint, 0.0, "unreadable", not_simulated=reason, recording=str(recording)
        )
    return _judged(found, topics, (lab, checkpoint), whole=whole, name=str(recording))


def judge_what_came(layout: Layout, bounds: Bounds, lab: Lab, checkpoint: str) -> Behaviour:
    """Judge what was recorded by what the lab asks for; what was not is no fault.

    Raises:
        RecordingError: it cannot be read.
    """
    wanted = interface(lab, lab.checkpoints[checkpoint])
    with opened(layout, bounds) as bag:
        found = gather(bag.messages(), bag.topics, _read_topics(lab, wanted), bounds.listed)
    came = {topic for (topic, _), tally in found.tallies.items() if tally.count}
    seen = replace(
        wanted, types={each: kind for each, kind in wanted.types.items() if each in came}
    )
    return _judged(found, _read_topics(lab, seen), (lab, checkpoint), whole=False, name="")


def _read_topics(lab: Lab, wanted: Interface) -> Topics:
    goal = lab.ros.goal
    return Topics(wanted, static_topics(lab), "" if goal is None else goal.status)


def _judged(
    found: Gathered, topics: Topics, asked_by: tuple[Lab, str], *, whole: bool, name: str
) -> Behaviour:
    (lab, checkpoint), wanted = asked_by, topics.wanted
    found.recording.seconds = found.timeline.now
    drive = legs(found.commands, found.seconds, wanted.limits)
    found.recording.path = list(path(found.places, drive))
    evidence = Evidence(found.recording, (Session(drive),), wanted, start=HERE, tolerance=PHYSICAL)
    asked = reached_topics(lab, checkpoint)
    map_frame = map_topic(lab, checkpoint)[1]
    recorded = Recorded(found, topics, evidence, asked, map_frame, lab.ros.goal)
    checks = tuple(_checks(recorded, _left_out(recorded, lab, checkpoint, whole=whole)))
    return Behaviour(
        "",
        checkpoint,
        found.timeline.now,
        "bad" if any(each.verdict == "bad" for each in checks) else "ok",
        tuple(_topics(found)),
        tuple(found.frames),
        checks,
        tuple(path_rows(evidence)),
        legs=tuple(told_legs(evidence)) if found.places else (),
        remarks=tuple(_remarks(found)),
        recording=name,
    )


def _left_out(recorded: Recorded, lab: Lab, checkpoint: str, *, whole: bool) -> frozenset[str]:
    """Return the checks that nothing was recorded for, or that are not asked for."""
    found, evidence = recorded.found, recorded.evidence
    names = {each for each in SHARED if not is_asked(each, evidence)} | {"odometry"}
    if not found.commands or not evidence.recording.path:
        names |= {*_MOVED}
    map_name, _ = map_topic(lab, checkpoint)
    seen = {each.child for each in found.frames if each.parent == recorded.map_frame}
    goal = lab.ros.goal
    robot = () if goal is None else found.of_topic(goal.robot)
    came = found.of_topic(map_name) or robot or seen
    if not map_name or not (whole or came):
        names.add("localization")
    reached = goal is not None and goal.since in lab.until(checkpoint)
    if not reached or not (whole or found.goals):
        names.add("goal")
    return frozenset(names)


def _checks(recorded: Recorded, left_out: frozenset[str]) -> Iterator[Check]:
    """Yield a verdict for each check; what both have is one."""
    for name in dict.fromkeys([*SHARED, *CHECKS]):
        faults: list[Fault] = []
        looked = False
        if name in SHARED and name not in left_out:
            looked = True
            faults += SHARED[name](recorded.evidence)
        if name in CHECKS and (name == "odometry" or name not in left_out):
            looked = True
            faults += CHECKS[name](recorded)
        if looked:
            yield verdict(name, faults, recorded.evidence)


def _topics(found: Gathered) -> Iterator[Topic]:
    for (topic, kind), tally in sorted(found.tallies.items(), key=lambda each: each[0]):
        if not _TOPIC.fullmatch(topic) or not _TYPE.fullmatch(kind) or not tally.count:
            continue
        by_stamp, by_arrival = (round(each, 2) for each in tally.rates())
        offered = tuple(each.text for each in tally.offered)
        frame = next(iter(tally.frames), "")
        yield Topic(topic, kind, by_stamp, frame, by_arrival, offered)


def _remarks(found: Gathered) -> Iterator[str]:
    """Say what else is to be known of the recording."""
    timeline = found.timeline
    if not timeline.clocked:
        yield "no clock was recorded: rates are those of arrival"
    else:
        yield f"the simulation ran at {timeline.speed:.2f} of real time"
    if found.until is not None:
        yield f"the first {found.until:.0f} s were judged message by message, the rest in sum"
    odd = sum(
        not _TOPIC.fullmatch(topic) or not _TYPE.fullmatch(kind) for topic, kind in found.tallies
    )
    if odd:
        yield f"{odd} topics have a name or type that is none"
    if not found.commands:
        yield "no command was recorded, so that nothing is said of how the robot follows"


def legs(
    commands: Sequence[tuple[float, _Told]], seconds: float, limits: tuple[float, float]
) -> tuple[Leg, ...]:
    """Return what was told: a command holds until the next, as Isaac Sim's subscriber has it."""
    return tuple(_legs(commands, round(seconds * RATE), limits))


def _legs(
    commands: Sequence[tuple[float, _Told]], end: int, limits: tuple[float, float]
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


def _same(one: _Told, other: _Told) -> bool:
    return all(abs(a - b) < _SAME for a, b in zip(one, other, strict=True))


def _leg(told: _Told | None, seconds: float, limits: tuple[float, float]) -> Leg:
    if told is None:
        return Leg("idle", seconds)
    if seconds < _LONG:
        return Leg(_VARIED, seconds, told)
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
