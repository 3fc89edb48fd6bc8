"""The TF frames that a stage publishes, computed as Isaac Sim 6.0.1 would.

Prims become frames in two ways: a node computes them and a publisher sends the arrays it is
given, or a publisher (as before 6.0) looks at prims of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

from msgspec import Struct

from lab3_usd.check.computed_frames import Pair, computed_pairs, tf_ports
from lab3_usd.check.model import Node, StageModel
from lab3_usd.check.running import (
    Nodes,
    effective,
    live_nodes,
    live_sources,
    running_nodes,
    signal_inputs,
)
from lab3_usd.check.topics import message_type, namespace_of, resolve
from lab3_usd.spec.catalog import NodeType, TfPorts
from lab3_usd.spec.spec import Lab

if TYPE_CHECKING:
    import networkx as nx


class Edge(Struct, frozen=True):
    """One transform that a stage publishes.

    `publisher` sends it, `cause` is the node whose settings name it (the same one, or the node
    that computes the frames). `target` is the target prim it comes from, None for a transform
    between named frames; `expanded` where the target stands for all links of a robot, and `prim`
    is the prim whose frame the child is.
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


class _Scene(Struct, frozen=True):
    """What the computation looks things up in."""

    stage: StageModel
    lab: Lab
    live: Nodes
    running: Nodes


@lru_cache(maxsize=1)  # every rule of one stage asks for the same
def published_edges(stage: StageModel, lab: Lab) -> tuple[Edge, ...]:
    """Return every transform that the stage publishes on a topic of the TF tree.

    All graphs count. A node publishes when an event reaches it over execution wires; the order
    is that of the nodes and their targets.
    """
    scene = _Scene(stage, lab, live_nodes(stage, lab), running_nodes(stage, lab))
    return tuple(
        edge for node, topic in _tree_publishers(scene) for edge in _edges(node, topic, scene) or ()
    )


@lru_cache(maxsize=1)  # every rule of one stage asks for the same
def unknown_publishers(stage: StageModel, lab: Lab) -> tuple[str, ...]:
    """Return the nodes that publish transforms between frames that the stage does not tell."""
    scene = _Scene(stage, lab, live_nodes(stage, lab), running_nodes(stage, lab))
    return tuple(
        node.path for node, topic in _tree_publishers(scene) if _edges(node, topic, scene) is None
    )


def tree(edges: Iterable[Edge]) -> nx.DiGraph[str]:
    """Return the edges as a networkx graph from parent to child frame.

    Each edge of the graph carries its publisher under `publisher`, and under `edges` every `Edge`
    it stands for: more than one where several nodes publish the same transform.
    """
    import networkx as nx  # noqa: PLC0415 - only explanations and drawings need a graph

    together: dict[tuple[str, str], list[Edge]] = {}
    for edge in edges:
        together.setdefault((edge.parent, edge.child), []).append(edge)
    graph: nx.DiGraph[str] = nx.DiGraph()
    for (parent, child), same in together.items():
        graph.add_edge(parent, child, publisher=same[0].publisher, edges=tuple(same))
    return graph


def _tree_publishers(scene: _Scene) -> Iterator[tuple[Node, str]]:
    """Yield the running nodes that publish transforms, with the topic they publish on."""
    for node in scene.running.values():
        kind = node.type
        if kind is None or kind.role != "publisher":
            continue
        written = effective(node, kind.topics[0], scene.live)
        space = namespace_of(node, scene.stage, scene.lab, scene.live)
        topic = resolve(space, written) if isinstance(written, str) else None
        if topic in scene.lab.policy.tree_topics and _sends_transforms(node, kind, scene):
            yield node, str(topic)


def _sends_transforms(node: Node, kind: NodeType, scene: _Scene) -> bool:
    if kind.tf is not None:
        return True
    known = {t.message[""] for t in scene.lab.catalog.types.values() if t.tf and t.role}
    return message_type(node, kind, kind.topics[0], scene.live) in known


def _edges(node: Node, topic: str, scene: _Scene) -> list[Edge] | None:
    """Return the transforms of one publisher, None where nobody can know them."""
    ports = tf_ports(node)
    static = ports.static is not None and effective(node, ports.static, scene.live) is True
    if ports.names:
        parent, child = (effective(node, port, scene.live) for port in ports.names)
        if not isinstance(parent, str) or not isinstance(child, str):
            return None
        return [Edge(parent, child, node.path, node.path, topic, static)]
    found = _sent_arrays(node, ports, scene) if ports.prims else None
    if found is None:
        return None
    cause, pairs = found
    return [
        Edge(p.parent, p.child, node.path, cause, topic, static, p.target, p.prim, p.expanded)
        for p in pairs
    ]


def _sent_arrays(node: Node, ports: TfPorts, scene: _Scene) -> tuple[str, list[Pair]] | None:
    """Return the node that computes the frames, and the frames.

    All arrays of the publisher must be as long as its array of parents: an array that is left
    alone is empty, and then nothing is sent. Without parents it looks at its own targets.
    """
    every = {} if node.type is None else node.type.ports
    arrays = [port.name for port in every.values() if port.usd_type.endswith("[]")]
    makers = {port: list(_filled(node, port, scene)) for port in arrays}
    first = makers.get(ports.arrays[0]) if ports.arrays else []
    if not first:
        return node.path, _own_pairs(node, ports, scene)
    if not all(makers.values()):
        return node.path, []
    maker = first[0][0]
    gives = tf_ports(maker).gives
    sources = [makers[port][0] for port in ports.arrays]
    if not gives or any(source.path != maker.path or out not in gives for source, out in sources):
        return None
    pairs = computed_pairs(maker, scene.stage, scene.lab)
    return maker.path, [_crossed(pair, [out for _, out in sources], gives) for pair in pairs]


def _filled(node: Node, port: str, scene: _Scene) -> Iterator[tuple[Node, str]]:
    """Yield what feeds an array: a node that waits for a signal in vain leaves it empty."""
    for source, out in live_sources(node, port, scene.live):
        if source.path in scene.running or not any(signal_inputs(source)):
            yield source, out


def _crossed(pair: Pair, outs: list[str], gives: tuple[str, ...]) -> Pair:
    """Take parent and child from the outputs that are wired, crossed wires included."""
    names = dict(zip(gives, (pair.parent, pair.child), strict=True))
    return Pair(names[outs[0]], names[outs[1]], pair.target, pair.prim, pair.expanded)


def _own_pairs(node: Node, ports: TfPorts, scene: _Scene) -> list[Pair]:
    """Return what a publisher finds at prims of its own: nothing at all if one is not there."""
    targets = node.targets(ports.prims[1]) if ports.prims else ()
    stage = scene.stage
    if any(not stage.prim(path) and not stage.unresolved_above(path) for path in targets):
        return []
    return computed_pairs(node, scene.stage, scene.lab)
