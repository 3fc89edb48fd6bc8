"""Sums up a run: topics with rates, frames, checks, the path, and what was not simulated."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lab3_usd.model.dry_run.behaviour import Behaviour, Check, Frame, Leg, Topic, Unknown
from lab3_usd.sim.behaviour.evidence import Evidence, displacement
from lab3_usd.sim.behaviour.judge import judge
from lab3_usd.sim.behaviour.sensors import rate_of
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.record import Message

EVERY = 6  # frames of the path, of which one is kept


def outcome(stage: str, checkpoint: str, evidence: Evidence) -> Behaviour:
    """Return what a run comes to, judged by what its checkpoint asks for."""
    checks = tuple(each for each in judge(evidence) if is_asked(each.name, evidence))
    recording = evidence.recording
    return Behaviour(
        stage,
        checkpoint,
        recording.seconds,
        "bad" if any(each.verdict == "bad" for each in checks) else "ok",
        tuple(_topics(evidence)),
        tuple(_frames(evidence)),
        checks,
        tuple(path_rows(evidence)),
        _unknown(evidence),
        tuple(told_legs(evidence)),
        tuple(_remarks(evidence, checks)),
    )


def is_asked(name: str, evidence: Evidence) -> bool:
    """Whether a checkpoint has what a check looks at, and something came to look at."""
    wanted = evidence.wanted
    topics = {
        "clock": (wanted.clock,),
        "stamps": (wanted.clock,),
        "odometry": (wanted.odometry,),
        "tree": (wanted.transforms,),
        "moving frames": (wanted.odometry, wanted.transforms),
        "mounted": (wanted.transforms, wanted.scan or wanted.image),
        "scan": (wanted.scan,),
        "camera": (wanted.image, wanted.info),
    }
    if name in topics:
        return all(each and evidence.recording.topic(each) for each in topics[name])
    if name == "topics":
        return bool(wanted.types)
    return bool(wanted.commands) and (name != "again" or len(evidence.drive) > 1)


def _topics(evidence: Evidence) -> Iterator[Topic]:
    """Yield the topics of the first session on the lab's domain, by name."""
    streams: dict[tuple[str, str], list[Message]] = {}
    for each in evidence.recording.messages:
        if each.away is None and not each.session:
            streams.setdefault((each.topic, each.type), []).append(each)
    for (topic, kind), messages in sorted(streams.items()):
        frames = dict.fromkeys(each.frame for each in messages if each.frame)
        yield Topic(topic, kind, round(rate_of(messages), 2), ", ".join(frames))


def _frames(evidence: Evidence) -> Iterator[Frame]:
    """Yield each transform once, in the order in which they are sent."""
    seen: dict[Frame, None] = {}
    for message in evidence.recording.messages:
        if message.away is None and isinstance(message.data, tuple):
            for each in message.data:
                seen.setdefault(Frame(each.parent, each.child, message.static))
    yield from seen


def path_rows(evidence: Evidence) -> Iterator[tuple[float, float, float, float]]:
    """Yield where the robot was, in seconds since the first Play."""
    for number, each in enumerate(evidence.recording.path):
        if number % EVERY == 0:
            seconds = (number + 1) / RATE
            yield (round(seconds, 3), round(each.x, 4), round(each.y, 4), round(each.heading, 4))


def _unknown(evidence: Evidence) -> tuple[Unknown, ...]:
    recording = evidence.recording
    said = {**recording.not_simulated, **recording.assumed}
    return tuple(Unknown(prim, said[prim]) for prim in sorted(said))


def told_legs(evidence: Evidence) -> Iterator[Leg]:
    """Yield what was told and done in each leg of the first session, if commands are asked for."""
    if not evidence.wanted.commands:
        return
    for leg, before, poses in evidence.stretches(*{each.name for each in evidence.drive[0].legs}):
        if leg.command is None or not any(leg.command):
            continue
        ahead, _, turned = displacement(before, poses[-1])
        told = (leg.forward * leg.seconds, math.degrees(leg.turn * leg.seconds))
        done = (round(ahead, 3) + 0.0, round(math.degrees(turned), 1) + 0.0)
        yield Leg(leg.name, leg.seconds, told, done)


def _remarks(evidence: Evidence, checks: tuple[Check, ...]) -> Iterator[str]:
    """Say what else is to be known of the robot."""
    blocked = next((each for each in evidence.recording.path if each.blocked), None)
    if blocked is not None:
        yield f"a wall stops the robot while it is told to go {blocked.leg}"
    yield from evidence.recording.remarks
    if evidence.recording.not_simulated and any(each.verdict != "ok" for each in checks):
        yield "what looks wrong may come from what is not simulated, and is no fault"
