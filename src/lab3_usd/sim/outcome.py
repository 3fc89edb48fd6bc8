"""The results of dry runs and recordings: what robots did, and the verdicts on it, summed up."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.dry_run import (
    FOLLOWS,
    Behaviour,
    Check,
    Difference,
    Frame,
    Leg,
    Replay,
    Scene,
    Topic,
    Unknown,
)
from lab3_usd.sim.commands import domain_of
from lab3_usd.sim.execution.drive import RATE, STEERED
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.checks import asked_checks, judge, of_all, whole_verdict
from lab3_usd.sim.judge.expectations import Stretch, Trial, displacement
from lab3_usd.sim.judge.motion import leg_fault
from lab3_usd.sim.judge.sensors import rate_of
from lab3_usd.sim.replay import replay

EVERY = 6  # frames of the path, for each kept one


class Judged(Struct, frozen=True):
    """What one robot did, and the verdicts on it; the name is '' where there is only one."""

    name: str
    trial: Trial
    checks: tuple[Check, ...]


class DryRun(Struct, frozen=True):
    """The results of a dry run, its scene, and its plays by the robot that is driven.

    The only play has no name; an unreadable stage has none.
    """

    behaviour: Behaviour
    plays: Mapping[str, Trial] = {}
    scene: Scene | None = None

    @property
    def replays(self) -> dict[str, Replay]:
        """The data of the drawings of each play that has some."""
        drawn = {name: replay(trial) for name, trial in self.plays.items()}
        return {name: each for name, each in drawn.items() if each.moments}


def judge_each(
    trials: Mapping[str, Trial], shared: Trial
) -> tuple[list[Judged], tuple[Check, ...]]:
    """Judge the drives of robots by name, the only one by '', and what they share once."""
    of_each = () if "" in trials else of_all(trials.values())
    robots = []
    for name, trial in trials.items():
        own = {check: look for check, look in asked_checks(trial).items() if check not in of_each}
        robots.append(Judged(name, trial, judge(trial, own)))
    whole = {check: look for check, look in asked_checks(shared).items() if check in of_each}
    return robots, judge(shared, whole)


def behaviour_of(
    robots: Sequence[Judged], whole: Sequence[Check] = (), radius_of: str = ""
) -> Behaviour:
    """Return the results of the drives of robots; `whole` are verdicts on all of it.

    The path is that of the first, topics and frames are left out. `radius_of` says by which radius
    of wheels it is known how far they go.
    """
    first = robots[0].trial
    own = (replace(check, of=each.name or check.of) for each in robots for check in each.checks)
    checks = (*whole, *own)
    verdict, missing = whole_verdict(checks)
    reasons: dict[str, str] = {}
    for recording in (each.trial.recording for each in reversed(robots)):
        reasons |= {**recording.not_simulated, **recording.assumed}
    return Behaviour(
        "",
        "",
        sum(each.trial.recording.seconds for each in robots),
        verdict,
        checks=checks,
        path=tuple(_path_rows(first)),
        not_simulated=tuple(Unknown(prim, reasons[prim]) for prim in sorted(reasons)),
        legs=tuple(leg for each in robots for leg in _driven_legs(each)),
        remarks=_said({each.name: _remarks(each.trial, (*whole, *each.checks)) for each in robots}),
        missing=missing,
        fit=next((each.trial.fit for each in robots if each.trial.fit is not None), None),
        sizes=_said({each.name: _sizes(each.trial, radius_of) for each in robots}),
    )


def _said(texts: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """Return what is said of robots by name: once what is said of all, else with the name.

    A text that has the path or topic which is the name has it already.
    """
    every = {name: [*dict.fromkeys(own)] for name, own in texts.items()}
    counts = Counter(text for own in every.values() for text in own)
    told = (
        text
        if counts[text] == len(every) or ("/" in name and name in text.replace(":", " ").split())
        else _of(name, text)
        for name, own in every.items()
        for text in own
    )
    return tuple(dict.fromkeys(told))


def _of(robot: str, text: str) -> str:
    """Return a text about one of several robots."""
    return f"{robot}: {text}" if robot else text


def sent_topics(sent: Iterable[Message], trial: Trial) -> Iterator[Topic]:
    """Yield the topics of the messages of the first session, by name."""
    streams: dict[tuple[str, str, int], list[Message]] = {}
    for message in sent:
        if not message.session:
            key = (message.topic, message.type, domain_of(message, trial))
            streams.setdefault(key, []).append(message)
    for (topic, kind, domain), messages in sorted(streams.items()):
        frames = dict.fromkeys(message.frame for message in messages if message.frame)
        yield Topic(topic, kind, round(rate_of(messages), 2), ", ".join(frames), domain=domain)


def sent_frames(sent: Iterable[Message]) -> Iterator[Frame]:
    """Yield each transform once, as tf2 takes it, in the order in which they are sent."""
    seen: dict[Frame, None] = {}
    for message in sent:
        for frames in message.frames:
            seen.setdefault(Frame(*frames, message.static))
    yield from seen


def _path_rows(trial: Trial) -> Iterator[tuple[float, float, float, float]]:
    """Yield where the robot was, in seconds since the first Play."""
    for number, pose in enumerate(trial.recording.path):
        if number % EVERY == 0:
            seconds = (number + 1) / RATE
            yield (round(seconds, 3), round(pose.x, 4), round(pose.y, 4), round(pose.heading, 4))


def _driven_legs(judged: Judged) -> Iterator[Leg]:
    """Yield what was commanded and driven in each leg of the first session that has a command.

    How far a car is to turn that was steered is up to its size.
    """
    trial = judged.trial
    if not trial.wanted.commands:
        return
    stretches = list(trial.stretches(*{leg.name for leg in trial.drive[0].legs}))
    for stretch, fault in zip(stretches, _leg_faults(trial, stretches, judged.checks), strict=True):
        leg, before, poses = stretch
        if leg.command is None or not any(leg.command) or leg.name == STEERED:
            continue
        ahead, aside, _ = displacement(before, poses[-1])
        commanded = (leg.forward * leg.seconds, math.degrees(leg.turn * leg.seconds))
        if leg.name == "aside":
            commanded, ahead = (leg.command[1] * leg.seconds, 0.0), aside
        driven = (round(ahead, 3) + 0.0, round(math.degrees(stretch.turned), 1) + 0.0)
        yield Leg(_of(judged.name, leg.name), leg.seconds, commanded, driven, fault)


def _leg_faults(
    trial: Trial, stretches: Sequence[Stretch], checks: Sequence[Check]
) -> Iterator[str]:
    """Yield what is wrong with each leg, '' for nothing that a failed check speaks of."""
    messages = "; ".join(check.message for check in checks if check.verdict == "bad")
    faults = [
        leg_fault(trial, stretch) if messages and stretch.leg.command else None
        for stretch in stretches
    ]
    # A check names the first of several legs that are wrong in the same way.
    kinds = {fault.kind for fault in faults if fault is not None and fault.message in messages}
    is_all = "does not move" in messages
    for fault in faults:
        is_known = fault is not None and fault.sure and (is_all or fault.kind in kinds)
        yield fault.message if fault is not None and is_known else ""


def _sizes(trial: Trial, radius_of: str) -> Iterator[str]:
    """Yield how far wheels of another radius than their controller has take the robot."""
    if trial.recording.radii is None:
        return
    wheel, stated = trial.recording.radii
    far = wheel / stated
    if far <= 0.0:
        return  # a check says that it stands, or which way it goes
    text = f"the wheels measure {wheel:g} m and the controller has {stated:g} m: the robot goes"
    is_expected = abs(far / trial.factor - 1.0) <= FOLLOWS
    yield f"{text} {far:.2f} times as far as commanded" + (
        f", as expected{radius_of}" if is_expected else ""
    )


def _remarks(trial: Trial, checks: Sequence[Check]) -> Iterator[str]:
    """Yield what else is known of the robot."""
    blocked = next((pose for pose in trial.recording.path if pose.blocked), None)
    if blocked is not None:
        yield f"{blocked.blocked} stops the robot while it is commanded to go {blocked.leg}"
    if trial.fit is not None:
        yield trial.fit.text
    yield from trial.recording.remarks
    if trial.recording.not_simulated and any(check.verdict == "not judged" for check in checks):
        yield "faults may be caused by parts that are not simulated; such are not counted"


RATES = 0.2  # part by which rates may differ


def differences(recorded: Behaviour, dry: Behaviour) -> tuple[Difference, ...]:
    """Return where a recording and the dry run of its stage differ; either may be wrong."""
    return (*_topic_differences(recorded, dry), *_frame_differences(recorded, dry))


def _topic_differences(recorded: Behaviour, dry: Behaviour) -> Iterator[Difference]:
    """Compare what the stage publishes; other nodes may publish more."""
    came = {topic.name: topic for topic in recorded.topics}
    not_sent = {unknown.prim for unknown in recorded.not_simulated}
    for expected in dry.topics:
        topic = came.get(expected.name)
        if topic is None and expected.name in not_sent:
            continue
        if topic is None:
            yield Difference(expected.name, "is only in the dry run")
            continue
        if topic.type != expected.type:
            text = f"is {topic.type}, in the dry run {expected.type}"
            yield Difference(expected.name, text)
        if abs(topic.hz - expected.hz) > RATES * max(topic.hz, expected.hz):
            text = f"comes at {topic.hz:.1f} Hz, in the dry run at {expected.hz:.1f}"
            yield Difference(expected.name, text)
        if topic.frame not in expected.frame.split(", "):
            text = f"is in '{topic.frame}', in the dry run in '{expected.frame}'"
            yield Difference(expected.name, text)


def _frame_differences(recorded: Behaviour, dry: Behaviour) -> Iterator[Difference]:
    """Compare who is the parent of each frame that the stage publishes."""
    came: dict[str, set[str]] = {}
    for frame in recorded.frames:
        came.setdefault(frame.child, set()).add(frame.parent)
    for frame in dry.frames:
        parents = came.get(frame.child, set())
        if frame.parent not in parents:
            place = f"is below {', '.join(sorted(parents))}" if parents else "never comes"
            yield Difference(frame.child, f"{place}, in the dry run below {frame.parent}")
