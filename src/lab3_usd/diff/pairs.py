"""Which graph and node of one stage is which of another, whatever their names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

from msgspec import Struct

from lab3_usd.model.stage import GraphModel, Node, StageModel

_ALIKE = 0.5  # the share of node types that tells a graph under another name


class GraphPair(Struct, frozen=True):
    """A graph before and after; None where there is none.

    `nodes` are its nodes before and after in the same way.
    """

    before: GraphModel | None
    after: GraphModel | None
    nodes: tuple[tuple[Node | None, Node | None], ...]


class StagePairs(Struct, frozen=True):
    """The graphs of two stages in pairs, and the new paths of what has another path now."""

    graphs: tuple[GraphPair, ...]
    paths: Mapping[str, str]

    def path(self, before: str) -> str:
        """Return the path in the second stage of what has this path in the first."""
        if before in self.paths:
            return self.paths[before]
        above, _, name = before.rpartition("/")
        return f"{self.path(above)}/{name}" if above else before

    def source(self, before: str) -> str:
        """Return a property path of the first stage as the second names it."""
        prim, _, name = before.rpartition(".")
        return f"{self.path(prim)}.{name}"


def pair_stages(before: StageModel, after: StageModel) -> StagePairs:
    """Find the graphs and nodes of one stage in another."""
    ours, theirs = _active(before), _active(after)
    pairs = list(_paired_graphs(ours, theirs))
    moved = {
        was.path: now.path
        for was, now in pairs
        if was is not None and now is not None and was.path != now.path
    }
    graphs = tuple(_graph_pair(was, now, moved) for was, now in pairs)
    found = chain.from_iterable(pair.nodes for pair in graphs)
    nodes = {was.path: now.path for was, now in found if was is not None and now is not None}
    return StagePairs(graphs, moved | nodes)


def _active(stage: StageModel) -> list[GraphModel]:
    """Return the graphs that are part of the scene, and the nodes outside of every graph as one."""
    graphs = [graph for graph in stage.graphs if graph.active]
    if stage.orphans:
        graphs.append(GraphModel("", active=True, attributes={}, nodes=stage.orphans))
    return graphs


def _paired_graphs(
    before: Sequence[GraphModel], after: Sequence[GraphModel]
) -> Iterator[tuple[GraphModel | None, GraphModel | None]]:
    left = {graph.path: graph for graph in after}
    gone = []
    for graph in before:
        if graph.path in left:
            yield graph, left.pop(graph.path)
        else:
            gone.append(graph)
    for graph in gone:
        twin = max(left.values(), key=lambda each: _likeness(graph, each), default=None)
        if twin is not None and _likeness(graph, twin) >= _ALIKE:
            yield graph, left.pop(twin.path)
        else:
            yield graph, None
    yield from ((None, graph) for graph in left.values())


def _likeness(one: GraphModel, other: GraphModel) -> float:
    """Return the share of node types that two graphs have in common; a name counts as well."""
    types = [{node.type_name for node in graph.nodes} for graph in (one, other)]
    either, both = types[0] | types[1], types[0] & types[1]
    return (len(both) / len(either) if either else 0.0) + (one.name == other.name) * _ALIKE


def _graph_pair(
    before: GraphModel | None, after: GraphModel | None, moved: Mapping[str, str]
) -> GraphPair:
    if before is None or after is None:
        nodes = [(node, None) for node in before.nodes] if before is not None else []
        added = [(None, node) for node in after.nodes] if after is not None else []
        return GraphPair(before, after, (*nodes, *added))
    folder = moved.get(before.path, before.path)
    return GraphPair(before, after, tuple(_paired_nodes(before, after.nodes, folder)))


def _paired_nodes(
    before: GraphModel, after: Iterable[Node], folder: str
) -> Iterator[tuple[Node | None, Node | None]]:
    left = {node.path: node for node in after}
    gone = []
    for node in before.nodes:
        path = folder + node.path.removeprefix(before.path)
        if path in left:
            yield node, left.pop(path)
        else:
            gone.append(node)
    for node in gone:
        same_type = [each for each in left.values() if each.type_name == node.type_name]
        twin = max(same_type, key=lambda each: _agreement(node, each), default=None)
        yield node, None if twin is None else left.pop(twin.path)
    yield from ((None, node) for node in left.values())


def _agreement(one: Node, other: Node) -> int:
    """Count the ports in which two nodes of one type agree."""
    return sum(other.state(name) == state for name, state in one.ports.items())
