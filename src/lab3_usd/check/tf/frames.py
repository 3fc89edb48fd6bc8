"""The TF frames that a stage publishes, computed as Isaac Sim 6.0.1 would, and cycles of frames.

Prims become frames in two ways: a node computes them and a publisher sends the arrays it is
given, or a publisher (as before 6.0) looks at prims of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct
from msgspec.structs import replace

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
from lab3_usd.spec.catalog import NodeType, TfPorts
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
    is the prim whose frame the child is. `sure` tells whether the nodes run for certain.
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
    return tuple(_sent(node, topic, scene) for node, topic in _tree_publishers(scene))


def published_edges(stage: StageModel, lab: Lab) -> tuple[Edge, ...]:
    """Return every transform that the stage publishes on a topic of the TF tree."""
    return tuple(edge for sent in published_transforms(stage, lab) for edge in sent.edges or ())


def unknown_publishers(stage: StageModel, lab: Lab) -> tuple[str, ...]:
    """Return the nodes that publish transforms between frames that the stage does not tell."""
    return tuple(
        sent.publisher.path for sent in published_transforms(stage, lab) if sent.edges is None
    )


def unresolved_frames(stage: StageModel, lab: Lab) -> tuple[UnresolvedFrames, ...]:
    """Return the frames that would be published, and that only a missing asset could tell."""
    return tuple(hidden for sent in published_transforms(stage, lab) for hidden in sent.hidden)


def certain_edges(edges: Iterable[Edge]) -> list[Edge]:
    """Return the transforms that are sent for certain, not only perhaps."""
    return [edge for edge in edges if edge.sure]


def _tree_publishers(scene: _Scene) -> Iterator[tuple[Node, str]]:
    """Yield the running nodes that publish transforms, with the topic they publish on."""
    for node in scene.running.values():
        kind = node.type
        if kind is None or kind.role != "publisher":
            continue
        written = effective_value(node, kind.topics[0], scene.live_nodes)
        space = namespace_of(node, scene.stage, scene.lab, scene.live_nodes)
        topic = resolve(space, written) if isinstance(written, str) else None
        if topic in scene.lab.policy.tree_topics and _sends_transforms(node, kind, scene):
            yield node, str(topic)


def _sends_transforms(node: Node, kind: NodeType, scene: _Scene) -> bool:
    if kind.tf is not None:
        return True
    known = {t.message[""] for t in scene.lab.catalog.types.values() if t.tf and t.role}
    return message_type(node, kind, kind.topics[0], scene.live_nodes) in known


def _sent(node: Node, topic: str, scene: _Scene) -> PublishedTransforms:
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
        return PublishedTransforms(node, (replace(edge, sure=_is_sure(scene, node)),))
    arrays = _arrays(node, ports, scene) if ports.prims else None
    if arrays is None:
        return PublishedTransforms(node, None)
    is_sure = _is_sure(scene, node, arrays.maker)
    made = Edge("", "", node.path, arrays.maker.path, topic, static, sure=is_sure)
    return PublishedTransforms(
        node,
        tuple(_edge_of(pair, made, arrays.order) for pair in arrays.pairs),
        tuple(_hidden_of(arrays.maker, made, scene)) if arrays.is_filled else (),
    )


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
    then nothing is sent. Without parents it looks at its own targets.
    """
    every = {} if node.type is None else node.type.ports
    arrays = [port.name for port in every.values() if port.usd_type.endswith("[]")]
    makers = {port: list(_filled(node, port, scene)) for port in arrays}
    first = makers.get(ports.arrays[0]) if ports.arrays else []
    if not first:
        return _own_targets(node, scene)
    if not all(makers.values()):
        return _Arrays(node, is_filled=False)
    maker = first[0][0]
    gives = tf_ports(maker).gives
    sources = [makers[port][0] for port in ports.arrays]
    if not gives or any(source.path != maker.path or out not in gives for source, out in sources):
        return None
    pairs = computed_pairs(maker, scene.stage, scene.lab)
    return _Arrays(maker, pairs, tuple(gives.index(out) for _, out in sources))


def _filled(node: Node, port: str, scene: _Scene) -> Iterator[tuple[Node, str]]:
    """Yield what feeds an array: a node that waits for a signal in vain leaves it empty."""
    for source, out in live_sources(node, port, scene.live_nodes):
        if source.path in scene.running or not any(signal_inputs(source)):
            yield source, out


def _own_targets(node: Node, scene: _Scene) -> _Arrays:
    """Return what a publisher finds at prims of its own: nothing at all if one is not there."""
    stage = scene.stage
    targets = listed_targets(node)
    if any(not stage.prim(path) and not unknown_target(path, stage) for path in targets):
        return _Arrays(node, is_filled=False)
    return _Arrays(node, computed_pairs(node, stage, scene.lab))


def _edge_of(pair: Pair, made: Edge, order: Sequence[int]) -> Edge:
    parent, child = ((pair.parent, pair.child)[place] for place in order)
    return replace(
        made, parent=parent, child=child, target=pair.target, prim=pair.prim, expanded=pair.expanded
    )


def _hidden_of(maker: Node, made: Edge, scene: _Scene) -> Iterator[UnresolvedFrames]:
    stage = scene.stage
    top = parent_frame(maker, stage, scene.lab)
    for hidden in unresolved_frames_of(maker, stage):
        yield replace(
            hidden, parent=top, publisher=made.publisher, cause=made.cause, topic=made.topic
        )
