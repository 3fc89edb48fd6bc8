"""Who does already what a new graph would do: topics, frames, joints."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from lab3_usd.facts.articulations import commands, named_joints
from lab3_usd.facts.domains import may_meet
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.frames import all_edges
from lab3_usd.isaac.topics import TRANSFORMS
from lab3_usd.model.stage import StageModel


def rivals(new: Collection[str], stage: StageModel) -> Iterator[tuple[str, str]]:
    """Yield the paths of nodes that do already what the new nodes of a stage do, and what."""
    sent = [end for end in endpoints(stage) if end.direction == "publishes" and end.topic]
    for own in sent:
        if own.node.path not in new or own.type == TRANSFORMS:
            continue
        for other in sent:
            is_other = other.node.path not in new and other.topic == own.topic and other.runs
            if is_other and may_meet(own.domain, other.domain):
                yield other.node.path, f"publishes {own.topic} already"
    edges = all_edges(stage)
    for edge in edges:
        if edge.publisher not in new:
            continue
        for there in edges:
            is_other = there.publisher not in new and there.topic == edge.topic
            if is_other and there.child == edge.child and may_meet(edge.domain, there.domain):
                text = f"sends the frame {edge.child} already, below {there.parent}"
                yield there.publisher, text
    yield from _joint_rivals(new, stage)


def _joint_rivals(new: Collection[str], stage: StageModel) -> Iterator[tuple[str, str]]:
    named = [(command, named_joints(command, stage)) for command in commands(stage)]
    for own, names in named:
        if own.node.path not in new or not names:
            continue
        for other, joint_names in named:
            if other.node.path in new or not joint_names or not set(own.roots) & set(other.roots):
                continue
            shared = [name for name in names if name in joint_names]
            if shared:
                yield other.node.path, f"commands {', '.join(shared)} already"
