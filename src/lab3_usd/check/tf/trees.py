"""The trees of frames that any stage publishes, and names as nodes write them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.ros.running import LintSubject, effective_value, live_sources
from lab3_usd.check.ros.topics import namespace_of, resolve, used_topics
from lab3_usd.check.tf.frames import (
    Edge,
    published_edges,
    tf2_name,
    unknown_publishers,
    unresolved_frames,
)
from lab3_usd.check.tf.targets import tf_ports
from lab3_usd.model.stage import Node

_POSE = ("inputs:position", "inputs:translation")
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
    refused: set[str] = set()
    for node in subject.live.values():
        if node.type is None or not node.type.role:
            continue
        namespace = namespace_of(node, subject.stage, subject.lab, subject.live)
        if namespace and namespace not in refused and resolve(namespace, "topic") is None:
            refused.add(namespace)
            yield node, namespace


def all_edges(subject: LintSubject) -> tuple[Edge, ...]:
    """Return every transform that the stage publishes."""
    return published_edges(subject.stage, subject.lab)


def is_tree_known(subject: LintSubject) -> bool:
    """Whether all frames are known: no node and no asset hides some, and every publisher works.

    The fault of a publisher that sends nothing is reported at that publisher.
    """
    stage, lab = subject.stage, subject.lab
    sending = {edge.publisher for edge in all_edges(subject)}
    idle = [
        node
        for node in subject.live.values()
        if node.type is not None and node.type.tf is not None and node.type.role
        if node.path not in sending
    ]
    return not (unknown_publishers(stage, lab) or unresolved_frames(stage, lab) or idle)


def edges_by_domain(subject: LintSubject) -> dict[str, list[Edge]]:
    """Return the transforms that the stage publishes by the domain in which they are heard."""
    domains: dict[str, list[Edge]] = {}
    for edge in all_edges(subject):
        domains.setdefault(edge.domain.name, []).append(edge)
    return domains


def frame_sets(published: list[Edge]) -> list[tuple[list[Edge], frozenset[str]]]:
    """Return the trees that nothing connects: their transforms and frames, the largest first."""
    trees: list[tuple[list[Edge], set[str]]] = []
    for edge in published:
        touched = [tree for tree in trees if {edge.parent, edge.child} & tree[1]]
        joined = ([edge], {edge.parent, edge.child})
        for tree in touched:
            trees.remove(tree)
            joined = (tree[0] + joined[0], tree[1] | joined[1])
        trees.append(joined)
    ordered = sorted(trees, key=lambda tree: -len(tree[1]))
    return [(edges, frozenset(frames)) for edges, frames in ordered]


def message_frames(subject: LintSubject) -> Iterator[tuple[Node, str, str]]:
    """Yield the frames that messages name, but those of transforms themselves."""
    for node, port, value in written_frames(subject):
        if node.type is not None and node.type.tf is None and node.type.role != "subscriber":
            yield node, port, value


class OdometryPair(Struct, frozen=True, eq=False):
    """A message and a transform that tell the same pose, with the frames of both."""

    publisher: Node
    port: str
    message: tuple[str, str]
    tree: Node
    transform: tuple[str, str]


class _SentPose(Struct, frozen=True, eq=False):
    """A pose that a node sends: the port that names the child, both frames, and who computes it."""

    node: Node
    port: str
    frames: tuple[str, str]
    maker: str
    is_transform: bool


def odometry_pairs(subject: LintSubject) -> Iterator[OdometryPair]:
    """Yield messages and transforms whose pose comes from one node."""
    poses = [pose for node in subject.live.values() if (pose := _sent_pose(node, subject))]
    for message in poses:
        for transform in poses:
            if message.maker != transform.maker:
                continue
            if transform.is_transform and not message.is_transform:
                yield OdometryPair(
                    message.node, message.port, message.frames, transform.node, transform.frames
                )


def _sent_pose(node: Node, subject: LintSubject) -> _SentPose | None:
    sources = (source for port in _POSE for source, _ in live_sources(node, port, subject.live))
    maker = next(sources, None)
    if node.type is None or maker is None or not subject.runs(node.path):
        return None
    names = tf_ports(node).names
    ports = names or node.type.frames
    values = [effective_value(node, port, subject.live) for port in ports]
    texts = [value for value in values if isinstance(value, str)]
    if len(texts) != len(_POSE) or len(ports) != len(_POSE):
        return None
    frames = (tf2_name(texts[0]), tf2_name(texts[1])) if names else (texts[0], texts[1])
    return _SentPose(node, ports[1], frames, maker.path, bool(names))
