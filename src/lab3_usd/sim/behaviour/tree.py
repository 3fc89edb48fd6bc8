"""Is TF one tree, with one parent and one publisher for each frame?"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from lab3_usd.sim.behaviour.evidence import Evidence, Fault
from lab3_usd.sim.execution.record import Message

STALE = 0.5  # seconds without a new transform


def tree(evidence: Evidence) -> Iterator[Fault]:
    """One parent and one publisher for each frame, one root, and every frame that is named."""
    for session in range(len(evidence.drive)):
        faults = list(_tree_faults(evidence, session))
        if faults:
            yield faults[0]
            return


def _tree_faults(evidence: Evidence, session: int) -> Iterator[Fault]:
    messages = evidence.recording.topic(evidence.wanted.transforms, session)
    parents = _parents(evidence, messages)
    for child, several in parents.items():
        own = next((node for parent, node in several if parent == child), None)
        if own is not None:
            yield Fault(f"{child} is its own parent", "T09", own)
        if len(several) > 1:
            rule = "T03" if len({parent for parent, _ in several}) > 1 else "T04"
            yield Fault(f"{child} has {len(several)} parents or publishers", rule, [*several][1][1])
        if messages and min(several.values()) < messages[-1].at - STALE:
            yield Fault(f"the transform of {child} ends", "Q03", next(iter(several))[1])
    if parents:
        up = {child: next(iter(several))[0] for child, several in parents.items()}
        yield from _loose_frames(evidence, up, session)


def _parents(
    evidence: Evidence, messages: Sequence[Message]
) -> dict[str, dict[tuple[str, str], float]]:
    """Return for each frame its parents, who says so, and when it was said last."""
    parents: dict[str, dict[tuple[str, str], float]] = {}
    for message in messages:
        for each in message.transforms:
            parents.setdefault(each.child, {})[each.parent, message.node] = message.at
    for each, node in evidence.recording.static:
        parents.setdefault(each.child, {})[each.parent, node] = math.inf
    return parents


def _loose_frames(evidence: Evidence, up: dict[str, str], session: int) -> Iterator[Fault]:
    named = _named(evidence, session)
    for frame in (*up, *sorted(named)):
        top, steps = frame, 0
        while top in up and steps <= len(up):
            top, steps = up[top], steps + 1
        if top != evidence.wanted.root:
            rule = "T06" if frame in up else "T11"
            said = f"{frame} does not hang below {evidence.wanted.root}"
            yield Fault(said, rule, named.get(frame, ""))
            return


def _named(evidence: Evidence, session: int) -> dict[str, str]:
    """Return the frames that are spoken of, with a node that does so."""
    found = {evidence.wanted.base: ""}
    for topic in evidence.wanted.types:
        for message in evidence.recording.topic(topic, session):
            if message.frame:
                found.setdefault(message.frame, message.node)
    return found
