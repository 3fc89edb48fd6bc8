"""Opens compounds: nodes that hold a graph, and through whose ports wires pass.

What a graph does is what the nodes do of which its compounds are made. So these are read as nodes
of the graph, and wires as they are behind the ports of compounds. A compound whose graph is not in
the file stays a node. Source: the page CompoundNodes of Kit's documentation of OmniGraph.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TypeVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.dry_run import Input, SceneNode
from lab3_usd.model.stage import Node, PortState

_T = TypeVar("_T")
_DEEPEST = 32  # compounds in compounds: a wire that comes back to its own port ends


class Compounds(Struct, frozen=True):
    """The compounds of a stage: the graph in each, and what is wired to each of their ports."""

    graphs: Mapping[str, str]
    fed: Mapping[str, tuple[str, ...]]

    def move(self, by_graph: dict[str, list[_T]]) -> None:
        """Let what stands in the graphs of compounds stand in the graph that holds them all."""
        for graph in self.graphs.values():
            if graph in by_graph:
                by_graph[self.graph_around(graph, by_graph)] += by_graph.pop(graph)

    def graph_around(self, graph: str, graphs: Collection[str]) -> str:
        """Return the graph that holds a compound with this graph, and is that of none."""
        while graph not in graphs or graph in self.graphs.values():
            graph = graph.rpartition("/")[0]
        return graph

    def within(self, graph: str, graphs: Collection[str]) -> tuple[str, ...]:
        """Return the graphs of the compounds that a graph holds."""
        inner = self.graphs.values()
        return tuple(own for own in inner if self.graph_around(own, graphs) == graph)

    def is_port(self, source: str) -> bool:
        """Whether a port is one of a compound."""
        return source.rpartition(".")[0] in self.graphs

    def behind(self, sources: Iterable[str], depth: int = _DEEPEST) -> tuple[str, ...]:
        """Return the ports that feed an input, beyond those of compounds.

        One of a compound stays where it is not connected: its own value passes.
        """
        ports: list[str] = []
        for source in sources:
            fed = self.fed.get(source, ()) if depth else ()
            ports += self.behind(fed, depth - 1) if fed else (source,)
        return tuple(ports)

    def through(self, sources: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
        """Return what feeds an input, or else the port of a compound whose own value does."""
        if not any(map(self.is_port, sources)):
            return sources, ""
        feeding = self.behind(sources)
        wired = tuple(source for source in feeding if not self.is_port(source))
        return wired, "" if wired else feeding[0]


def compounds_of(
    graphs: Collection[str], types: Mapping[str, str], compound_type: str
) -> dict[str, str]:
    """Return the graph in each compound, of these graphs and nodes, by path with their types."""
    inner = {graph.rpartition("/")[0]: graph for graph in graphs}
    return {path: inner[path] for path in types if path in inner and types[path] == compound_type}


def opened_nodes(nodes: Iterable[Node], compounds: Compounds) -> list[Node]:
    """Return nodes without the compounds among them, wired through their ports."""
    by_path = {node.path: node for node in nodes}

    def of_compound(path: str, name: str, state: PortState) -> PortState:
        return replace(by_path[path].ports.get(name, PortState(name)), name=state.name)

    return [
        replace(node, ports=_opened(node.ports, compounds, of_compound))
        for node in by_path.values()
        if node.path not in compounds.graphs
    ]


def opened_scene_nodes(nodes: Iterable[SceneNode], compounds: Compounds) -> list[SceneNode]:
    """Return nodes of a scene as `opened_nodes` does."""
    by_path = {node.path: node for node in nodes}

    def of_compound(path: str, name: str, given: Input) -> Input:
        return by_path[path].inputs.get(name) or replace(given, sources=())

    return [
        replace(node, inputs=_opened(node.inputs, compounds, of_compound))
        for node in by_path.values()
        if node.path not in compounds.graphs
    ]


_State = TypeVar("_State", PortState, Input)


def _opened(
    ports: Mapping[str, _State],
    compounds: Compounds,
    of_compound: Callable[[str, str, _State], _State],
) -> dict[str, _State]:
    """Return ports as what is behind compounds feeds them.

    `of_compound` returns a port as the own value of a port of a compound feeds it, which is given
    by its path and name.
    """
    opened: dict[str, _State] = {}
    for name, state in ports.items():
        sources, port = compounds.through(state.sources)
        if port:
            path, _, own_name = port.rpartition(".")
            opened[name] = of_compound(path, own_name, state)
        else:
            opened[name] = state if sources == state.sources else replace(state, sources=sources)
    return opened
