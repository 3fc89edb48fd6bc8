"""Do topics come, of their types, and do their stamps follow one clock?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from lab3_usd.sim.behaviour.evidence import Evidence, Fault
from lab3_usd.sim.execution.drive import RATE


def topics(evidence: Evidence) -> Iterator[Fault]:
    """Each topic is there, of its type, from one node, in each session, on the lab's domain."""
    wanted, recording = evidence.wanted, evidence.recording
    sessions = range(len(evidence.drive))
    for topic, kind in wanted.types.items():
        silent = [each for each in sessions if not recording.topic(topic, each)]
        if silent:
            yield _silence(evidence, topic, kind, silent)
        messages = recording.topic(topic)
        odd = next((each for each in messages if each.type != kind), None)
        if odd is not None:
            yield Fault(f"{topic} is {odd.type}, not {kind}", "Q02", odd.node)
        senders = list(dict.fromkeys(each.node for each in messages))
        if topic != wanted.transforms and len(senders) > 1:
            yield Fault(f"{len(senders)} nodes publish {topic}", "Q01", senders[1])


def _silence(evidence: Evidence, topic: str, kind: str, sessions: Sequence[int]) -> Fault:
    said = f"nothing on {topic}{evidence.when(sessions)}"
    cause = evidence.causes.of_silence(topic, kind) if evidence.causes is not None else None
    return (
        Fault(said, "N01") if cause is None else Fault(said, cause.rule, cause.prim, cause.reason)
    )


def clock(evidence: Evidence) -> Iterator[Fault]:
    """The clock runs at the speed of the simulation, and never back."""
    messages = evidence.recording.topic(evidence.wanted.clock)
    for one, other in pairwise(messages):
        if other.stamp < one.stamp:
            back = one.stamp - other.stamp
            said = f"{evidence.wanted.clock} jumps back by {back:.2f} s"
            yield Fault(said, "P02", other.node)
            return
    first = [each for each in messages if not each.session]
    if first:
        ran, passed = first[-1].stamp - first[0].stamp, first[-1].at - first[0].at
        if abs(ran - passed) > evidence.tolerance.lag:
            said = f"{evidence.wanted.clock} runs {ran:.1f} s in {passed:.1f} s"
            yield Fault(said, "W01", first[0].node)


def stamps(evidence: Evidence) -> Iterator[Fault]:
    """All stamps are of the clock; those of the sensors may start anew after Stop."""
    wanted = evidence.wanted
    for topic in wanted.types:
        late = topic in {wanted.odometry, wanted.transforms}
        for session in range(len(evidence.drive) if late else 1):
            fault = next(_late(evidence, topic, session), None)
            if fault is not None:
                yield fault
                break


def _late(evidence: Evidence, topic: str, session: int) -> Iterator[Fault]:
    clocks = {
        round(each.at * RATE): each.stamp
        for each in evidence.recording.topic(evidence.wanted.clock, session)
    }
    for message in evidence.recording.topic(topic, session):
        now = clocks.get(round(message.at * RATE))
        if (
            now is not None
            and not message.static
            and abs(now - message.stamp) > evidence.tolerance.lag
        ):
            when = evidence.when([session])
            said = f"{topic} is stamped {message.stamp:.1f} s at {now:.1f} s{when}"
            yield Fault(said, "W01", message.node)
