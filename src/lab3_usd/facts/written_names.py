"""Names of topics, frames and namespaces as nodes write them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.facts.endpoints import namespace_of, ros_name, used_topics
from lab3_usd.facts.execution_order import is_switched_on, live_nodes, run_states
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.model.stage import Node, StageModel

_WHOLE = r"^/?([A-Za-z0-9].*[A-Za-z0-9]|[A-Za-z0-9])$"


class WrittenTopic(Struct, frozen=True, eq=False):
    """The name of a topic; `resolved` is None where ROS 2 refuses it."""

    node: Node
    port: str
    written: str
    resolved: str | None

    @property
    def is_changed(self) -> bool:
        """Whether more is stripped off than what everybody writes: a slash before."""
        return re.match(_WHOLE, self.written) is None


def written_topics(stage: StageModel) -> Iterator[WrittenTopic]:
    """Yield the topics and services that live nodes name."""
    for node in live_nodes(stage).values():
        kind = node.type
        if kind is None or not kind.role:
            continue
        for port in (*used_topics(node, kind, live_nodes(stage)), *kind.services):
            value = effective_value(node, port, live_nodes(stage))
            if isinstance(value, str):
                yield WrittenTopic(node, port, value, ros_name("", value))


def written_frames(stage: StageModel) -> Iterator[tuple[Node, str, str]]:
    """Yield the frames that live nodes name: the node, the port and the name."""
    for node in live_nodes(stage).values():
        kind = node.type
        if kind is None or not kind.topics or node.path not in run_states(stage):
            continue
        if not is_switched_on(node, live_nodes(stage)):
            continue
        used = set(used_topics(node, kind, live_nodes(stage)))
        for port in kind.frames:
            right = port.endswith("Right")
            value = effective_value(node, port, live_nodes(stage))
            if isinstance(value, str) and (not right or any(t.endswith("Right") for t in used)):
                yield node, port, value


def refused_namespaces(stage: StageModel) -> Iterator[tuple[Node, str]]:
    """Yield each namespace that ROS 2 refuses, with the first node whose topics are in it."""
    refused: set[str] = set()
    for node in live_nodes(stage).values():
        if node.type is None or not node.type.role:
            continue
        namespace = namespace_of(node, stage, live_nodes(stage))
        if namespace and namespace not in refused and ros_name(namespace, "topic") is None:
            refused.add(namespace)
            yield node, namespace
