"""Who does already what a new graph would do: topics, frames, joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from msgspec import Struct

from lab3_usd.facts.articulations import commands, named_joints
from lab3_usd.facts.domains import may_meet
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.frames import all_edges
from lab3_usd.isaac.topics import TRANSFORMS
from lab3_usd.model.stage import StageModel


class Rival(Struct, frozen=True):
    """A node that does already what a new one would: what, in words, and its path."""

    what: str
    path: str
    new: str


def rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    """Yield who does already what the new nodes of a stage do, each by its path."""
    yield from _topic_rivals(new, stage)
    yield from _frame_rivals(new, stage)
    yield from _joint_rivals(new, stage)


def _topic_rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    sent = [end for end in endpoints(stage) if end.direction == "publishes" and end.topic]
    for own in sent:
        if own.node.path not in new or own.type == TRANSFORMS:
            continue
        for other in sent:
            is_other = other.node.path not in new and other.topic == own.topic and other.runs
            if is_other and may_meet(own.domain, other.domain):
                yield Rival(f"publishes {own.topic} already", other.node.path, own.node.path)


def _frame_rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    edges = all_edges(stage)
    for own in edges:
        if own.publisher not in new:
            continue
        for other in edges:
            is_other = other.publisher not in new and other.topic == own.topic
            if is_other and other.child == own.child and may_meet(own.domain, other.domain):
                yield Rival(
                    f"sends the frame {own.child} already, below {other.parent}",
                    other.publisher,
                    own.publisher,
                )


def _joint_rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    named = [(command, named_joints(command, stage)) for command in commands(stage)]
    for own, names in named:
        if own.node.path not in new or not names:
            continue
        for other, joint_names in named:
            if other.node.path in new or not joint_names or not set(own.roots) & set(other.roots):
                continue
            shared = [name for name in names if name in joint_names]
            if shared:
                yield Rival(f"commands {', '.join(shared)} already", other.node.path, own.node.path)
