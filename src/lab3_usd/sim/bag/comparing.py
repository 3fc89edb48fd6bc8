"""A recording against the dry run of its stage, topic by topic and frame by frame."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.model.dry_run.behaviour import Behaviour, Difference, Topic

RATES = 0.2  # part by which rates may differ


def differences(recorded: Behaviour, dry: Behaviour) -> tuple[Difference, ...]:
    """Return where a recording and the dry run of its stage differ; either may be wrong."""
    return (*_topics(recorded, dry), *_frames(recorded, dry))


def _topics(recorded: Behaviour, dry: Behaviour) -> Iterator[Difference]:
    """Compare what the stage publishes; other nodes may publish more."""
    came = {each.name: each for each in recorded.topics}
    for expected in dry.topics:
        found = came.get(expected.name)
        if found is None:
            yield Difference(expected.name, "comes in the dry run only")
            continue
        for text in _parts(found, expected):
            yield Difference(expected.name, text)


def _parts(found: Topic, expected: Topic) -> Iterator[str]:
    if found.type != expected.type:
        yield f"is {found.type}, in the dry run {expected.type}"
    if abs(found.hz - expected.hz) > RATES * max(found.hz, expected.hz):
        yield f"comes at {found.hz:.1f} Hz, in the dry run at {expected.hz:.1f}"
    if found.frame not in expected.frame.split(", "):
        yield f"is in '{found.frame}', in the dry run in '{expected.frame}'"


def _frames(recorded: Behaviour, dry: Behaviour) -> Iterator[Difference]:
    """Compare who is the parent of each frame that the stage publishes."""
    came: dict[str, set[str]] = {}
    for each in recorded.frames:
        came.setdefault(each.child, set()).add(each.parent)
    for each in dry.frames:
        parents = came.get(each.child, set())
        if each.parent not in parents:
            said = f"is below {', '.join(sorted(parents))}" if parents else "never comes"
            yield Difference(each.child, f"{said}, in the dry run below {each.parent}")
