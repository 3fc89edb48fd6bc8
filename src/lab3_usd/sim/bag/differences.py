"""Compares a recording with the dry run of its stage; either may be wrong."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.model.dry_run import Behaviour, Difference

RATES = 0.2  # part by which rates may differ


def differences(recorded: Behaviour, dry: Behaviour) -> tuple[Difference, ...]:
    """Return where a recording and the dry run of its stage differ; either may be wrong."""
    return (*_topics(recorded, dry), *_frames(recorded, dry))


def _topics(recorded: Behaviour, dry: Behaviour) -> Iterator[Difference]:
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


def _frames(recorded: Behaviour, dry: Behaviour) -> Iterator[Difference]:
    """Compare who is the parent of each frame that the stage publishes."""
    came: dict[str, set[str]] = {}
    for frame in recorded.frames:
        came.setdefault(frame.child, set()).add(frame.parent)
    for frame in dry.frames:
        parents = came.get(frame.child, set())
        if frame.parent not in parents:
            place = f"is below {', '.join(sorted(parents))}" if parents else "never comes"
            yield Difference(frame.child, f"{place}, in the dry run below {frame.parent}")
