"""The TF frames that a stage publishes, computed as Isaac Sim 6.0.1 would, and cycles of frames.

Prims become frames in two ways: a node computes them and a publisher sends the arrays it is
given, or a publisher (as before 6.0) looks at prims of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.ros.contexts import Domain, domain_of
from lab3_usd.check.ros.running import (
    Nodes,
    effective_value,
    live_nodes,
    live_sources,
    running_nodes,
    severity_if_uncertain,
    signal_inputs,
)
from lab3_usd.check.ros.topics import message_type, namespace_of, resolve
from lab3_usd.check.tf.targets import (
    Pair,
    UnresolvedFrames,
    computed_pairs,
    listed_targets,
    parent_frame,
    tf_ports,
    unknown_target,
    unresolved_frames_of,
)
from lab3_usd.model.stage import Node, StageModel, is_acyclic, once_per_stage
from lab3_usd.spec.catalog import TfPorts
from lab3_usd.spec.lab import Lab


def frames_in_cycles(edges: Iterable[Edge]) -> list[str]:
    """Return the frames of cycles, and of what lies between two of them, as the edges name them."""
    pairs = [(edge.parent, edge.child) for edge in edges]
    if is_acyclic(pairs):
        return []
    import networkx as nx

    graph = nx.DiGraph(pairs)
    parts = nx.strongly_connected_components(graph)
    rings = {name for part in parts if len(part) > 1 for name in part}
    rings.update(nx.nodes_with_selfloops(graph))
    below = rings.union(*(nx.descendants(graph, name) for name in rings))
    above = rings.union(*(nx.ancestors(graph, name) for name in rings))
    return [name for name in graph if name in above and name in below]


class Edge(Struct, frozen=True):
    """One transform that a stage publishes.

    `publisher` sends it, `cause` is the node whose settings name it (the same one, or the node
    that computes the frames). `target` is the target prim it comes from, None for a transform
    between named frames; `expanded` where the target stands for all links of a robot, and `prim`
    is the prim whose frame the child is. `sure` tells whether the nodes run for certain, `domain`
    who hears of it.
    """

    parent: str
    child: str
    publisher: str
    cause: str
    topic: str
    static: bool = False
    target: str | None = None
    prim: str | None = None
    expanded: bool = False
    sure: bool = True
    domain: Domain = Domain()


def tf2_name(written: str) -> str:
    """Return the name of a frame as tf2 takes it from a transform: without a slash before it.

    Source: ros2/geometry2 (humble), tf2/src/buffer_core.cpp, `setTransformImpl`.
    """
    return written.removeprefix("/")


class _Scene(Struct, frozen=True):
    """What the computation looks things up in."""

    stage: StageModel
    lab: Lab
    live_nodes: Nodes
    running: Nodes


class PublishedTransforms(Struct, frozen=True):
    """What one publisher sends on a topic of the TF tree.

    `edges` is None where the names of its frames are unknown; `hidden` are the frames that an
    asset could tell which cannot be found.
    """

    publisher: Node
    edges: tuple[Edge, ...] | None = ()
    hidden: tuple[UnresolvedFrames, ...] = ()


@once_per_stage
def published_transforms(stage: StageModel, lab: Lab) -> tuple[PublishedTransforms, ...]:
    """Return what each publisher of the TF tree sends.

    All graphs count. A node publishes when an event reaches it over execution wires; the order
    is that of the nodes and their targets.
    """
    scene = _Scene(stage, lab, live_nodes(stage, lab), running_nodes(stage, lab))
    tree = lab.policy.tree_topics
    senders = _transform_publishers(stage, lab)
    return tuple(_published_by(node, topic, scene) for node, topic in senders if topic in tree)


@once_per_stage
def moved_edges(stage: StageModel, lab: Lab) -> tuple[Edge, ...]:
    """Return every transform that a namespace or another name moves off the topics of the tree."""
    scene = _Scene(stage, lab, live_nodes(stage, lab), running_nodes(stage, lab))
    tree = lab.policy.tree_topics
    senders = _transform_publishers(stage, lab)
    sent = (_published_by(node, topic, scene) for node, topic in senders if topic not in tree)
    return tuple(edge for transforms in sent for edge in transforms.edges or ())


def published_edges(stage: StageModel, lab: Lab) -> tuple[Edge, ...]:
    """Return every transform that the stage publishes on a topic of the TF tree."""
    return tuple(edge for sent in published_transforms(stage, lab) for edge in sent.edges or ())


def unknown_publishers(stage: StageModel, lab: Lab) -> tuple[str, ...]:
    """Return the nodes that publish transforms between frames that the stage does not define."""
    return tuple(
        sent.publisher.path for sent in published_transforms(stage, lab) if sent.edges is None
    )


def unresolved_frames(stage: StageModel, lab: Lab) -> tuple[UnresolvedFrames, ...]:
    """Return the frames that would be published, and that only a missing asset could tell."""
    return tuple(hidden for sent in published_transforms(stage, lab) for hidden in sent.hidden)


def certain_edges(edges: Iterable[Edge]) -> list[Edge]:
    """Return the transforms that are sent for certain, not only perhaps."""
    return [edge for edge in edges if edge.sure]


@once_per_stage
def _transform_publishers(stage: StageModel, lab: Lab) -> tuple[tuple[Node, str], ...]:
    """Return the running nodes that publish transforms, with the topic they publish on."""
    live, senders = live_nodes(stage, lab), list[tuple[Node, str]]()
    for node in running_nodes(stage, lab).values():
        kind = node.type
        if kind is None or kind.role != "publisher":
            continue
        message = message_type(node, kind, kind.topics[0], live)
        if kind.tf is None and message not in _transform_messages(lab):
            continue
        written = effective_value(node, kind.topics[0], live)
        topic = (
            resolve(namespace_of(node, stage, lab, live), written)
            if isinstance(written, str)
            else None
        )
        if topic is not None:
            senders.append((node, topic))
    return tuple(senders)


@lru_cache(maxsize=16)
def _transform_messages(lab: Lab) -> frozenset[str]:
    """Return the types of the messages that nodes which publish transforms send."""
    types = lab.catalog.types.values()
    return frozenset(kind.message[""] for kind in types if kind.tf and kind.role)


def _published_by(node: Node, topic: str, scene: _Scene) -> PublishedTransforms:
    ports = tf_ports(node)
    static = (
        ports.static is not None and effective_value(node, ports.static, scene.live_nodes) is True
    )
    if ports.names:
        parent, child = (effective_value(node, port, scene.live_nodes) for port in ports.names)
        if not isinstance(parent, str) or not isinstance(child, str):
            return PublishedTransforms(node, None)
        parent, child = tf2_name(parent), tf2_name(child)
        edge = Edge(parent, child, node.path, node.path, topic, static)
        domain = domain_of(node, scene.live_nodes)
        return PublishedTransforms(
            node, (replace(edge, sure=_is_sure(scene, node), domain=domain),)
        )
    arrays = _arrays(node, ports, scene) if ports.prims else None
    if arrays is None:
        return PublishedTransforms(node, None)
    maker = arrays.maker
    is_sure, domain = _is_sure(scene, node, maker), domain_of(node, scene.live_nodes)
    edges = []
    for pair in arrays.pairs:
        parent, child = ((pair.parent, pair.child)[place] for place in arrays.order)
        edge = Edge(
            parent, child, node.path, maker.path, topic, static, pair.target, pair.prim,
            expanded=pair.expanded, sure=is_sure, domain=domain,
        )  # fmt: skip
        edges.append(edge)
    top = parent_frame(maker, scene.stage, scene.lab)
    hidden = tuple(
        replace(frames, parent=top, publisher=node.path, cause=maker.path, topic=topic)
        for frames in (unresolved_frames_of(maker, scene.stage) if arrays.is_filled else ())
    )
    return PublishedTransforms(node, tuple(edges), hidden)


def _is_sure(scene: _Scene, *nodes: Node) -> bool:
    return severity_if_uncertain(scene.stage, scene.lab, *(node.path for node in nodes)) is None


class _Arrays(Struct, frozen=True):
    """The frames in the arrays of a publisher and who makes them: itself, or another node.

    `order` says which of a pair is sent as parent and which as child, for wires may be crossed.
    """

    maker: Node
    pairs: Sequence[Pair] = ()
    order: tuple[int, ...] = (0, 1)
    is_filled: bool = True


def _arrays(node: Node, ports: TfPorts, scene: _Scene) -> _Arrays | None:
    """Return what fills the arrays of a publisher, None where it is unknown.

    All of them must be as long as its array of parents: an array that is left alone is empty, and
    then nothing is sent. Without parents it looks at its own targets, and sends nothing at all if
    one of them does not exist.
    """
    stage = scene.stage
    inputs = {} if node.type is None else node.type.ports
    # A node that waits for a signal in vain leaves the arrays that it feeds empty.
    makers = {
        port.name: [
            (source, out)
            for source, out in live_sources(node, port.name, scene.live_nodes)
            if source.path in scene.running or not any(signal_inputs(source))
        ]
        for port in inputs.values()
        if port.usd_type.endswith("[]")
    }
    first = makers.get(ports.arrays[0]) if ports.arrays else []
    if not first:
        targets = listed_targets(node)
        if any(not stage.prim(path) and not unknown_target(path, stage) for path in targets):
            return _Arrays(node, is_filled=False)
        return _Arrays(node, computed_pairs(node, stage, scene.lab))
    if not all(makers.values()):
        return _Arrays(node, is_filled=False)
    maker = first[0][0]
    gives = tf_ports(maker).gives
    sources = [makers[port][0] for port in ports.arrays]
    if not gives or any(source.path != maker.path or out not in gives for source, out in sources):
        return None
    pairs = computed_pairs(maker, stage, scene.lab)
    return _Arrays(maker, pairs, tuple(gives.index(out) for _, out in sources))
