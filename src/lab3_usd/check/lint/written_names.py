"""The names of topics and frames as nodes write them, and what becomes of them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.ros.running import effective_value
from lab3_usd.check.ros.topics import namespace_of, resolve, used_topics
from lab3_usd.model.stage import Node

_WHOLE = re.compile(r"^/?([A-Za-z0-9].*[A-Za-z0-9]|[A-Za-z0-9])$")


class WrittenTopic(Struct, frozen=True, eq=False):
    """The name of a topic; `resolved` is None where ROS 2 refuses it."""

    node: Node
    port: str
    written: str
    resolved: str | None

    @property
    def is_changed(self) -> bool:
        """Whether more is stripped off than what everybody writes: a slash before."""
        return _WHOLE.match(self.written) is None


def written_topics(subject: LintSubject) -> Iterator[WrittenTopic]:
    """Yield the topics and services that live nodes name."""
    for node in subject.live.values():
        kind = node.type
        if kind is None or not kind.role:
            continue
        for port in (*used_topics(node, kind, subject.live), *kind.services):
            value = effective_value(node, port, subject.live)
            if isinstance(value, str):
                yield WrittenTopic(node, port, value, resolve("", value))


def written_frames(subject: LintSubject) -> Iterator[tuple[Node, str, str]]:
    """Yield the frames that live nodes name: the node, the port and the name."""
    for node in subject.live.values():
        kind = node.type
        if kind is None or not kind.topics or not subject.runs(node.path):
            continue
        used = set(used_topics(node, kind, subject.live))
        for port in kind.frames:
            right = port.endswith("Right")
            value = effective_value(node, port, subject.live)
            if isinstance(value, str) and (not right or any(t.endswith("Right") for t in used)):
                yield node, port, value


def refused_namespaces(subject: LintSubject) -> Iterator[tuple[Node, str]]:
    """Yield each namespace that ROS 2 refuses, with the first node whose topics are in it."""
    told: set[str] = set()
    for node in subject.live.values():
        if node.type is None or not node.type.role:
            continue
        namespace = namespace_of(node, subject.stage, subject.lab, subject.live)
        if namespace and namespace not in told and resolve(namespace, "topic") is None:
            told.add(namespace)
            yield node, namespace
