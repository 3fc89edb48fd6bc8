"""The wires of a stage: what is at the source of each, what is wrong with it, and wire cycles."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.isaac.node_types import NUMBERS, Port, shape_of
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.stage import Node, StageModel, absence_reason, is_acyclic


class Connection(Struct, frozen=True, eq=False):
    """A wire into a node; `source` is None where no live node is there."""

    node: Node
    port: str
    path: str
    source: Node | None

    @property
    def source_prim(self) -> str:
        """The path of the prim that the wire comes from."""
        return self.path.rpartition(".")[0]

    @property
    def source_port(self) -> str:
        """The full name of the port that the wire comes from."""
        return self.path.rpartition(".")[2]

    @property
    def is_live(self) -> bool:
        """Whether the application keeps this wire."""
        return (
            self.source is not None
            and self.source.has_port(self.source_port)
            and self.node.has_port(self.port)
        )

    @property
    def ports(self) -> tuple[Port, Port] | None:
        """The ports at both ends, None where one of them is not known."""
        if self.source is None or self.source.type is None or self.node.type is None:
            return None
        source, target = self.source.type, self.node.type
        if not (source.is_known_port(self.source_port) and target.is_known_port(self.port)):
            return None
        ends = (source.port(self.source_port), target.port(self.port))
        return (ends[0], ends[1]) if ends[0] is not None and ends[1] is not None else None


def connections(stage: StageModel, platform: Platform) -> Iterator[Connection]:
    """Yield every wire into a live node, in the order of nodes and ports."""
    live = live_nodes(stage, platform)
    for node in live.values():
        for name, state in node.ports.items():
            for path in state.sources:
                yield Connection(node, name, path, live.get(path.rpartition(".")[0]))


def differ_in_role(source: Port, target: Port) -> bool:
    """Whether two types hold the same for another purpose, as a vector and three numbers do.

    OmniGraph can compare types without their roles; which wires it takes so, no public source says.
    """
    (one, shape), (other, other_shape) = (_without_role(port.ogn_type) for port in (source, target))
    are_numbers = one in NUMBERS and other in NUMBERS
    are_texts = {one, other} <= {"string", "token"}
    return shape == other_shape and (are_numbers or are_texts)


_ROLES = re.compile(r"(color|normal|point|texcoord|vector|quat|matrix|frame|transform)([dfh]?)")
_PRECISIONS = {"d": "double", "f": "float", "h": "half", "": "double"}


def _without_role(ogn_type: str) -> tuple[str, str]:
    """Split a type as `shape_of`, with numbers for a role: `vectord[3]` is `double[3]`."""
    element, shape = shape_of(ogn_type)
    known = _ROLES.fullmatch(element)
    if known is None:
        return "string" if element == "path" else element, shape
    if known[1] in {"matrix", "frame", "transform"}:
        rows = int(shape[1])
        shape = f"[{rows * rows}]{shape[3:]}"
    return _PRECISIONS[known[2]], shape


def why_dead(wire: Connection, stage: StageModel, platform: Platform) -> str | None:
    """Say why there is no node at the source of a wire, None if that is unknown."""
    path = wire.source_prim
    if stage.unknown_node(path) or platform.graph.ignores(path):
        return None
    if any(node.path == path for node in stage.orphans):
        return "is outside every graph"
    for graph in stage.graphs:
        if not graph.active and any(node.path == path for node in graph.nodes):
            return f"is in the graph {graph.path}, which is not in the scene"
        for absent in graph.absent:
            if absent.path == path:
                return f"is {absent.reason}"
    return absence_reason(stage, path) if stage.prim(path) is None else "is no node"


def sublayer_with_source(wire: Connection, stage: StageModel) -> str | None:
    """Return the missing sublayer that could hold the source of a wire, which nothing else has."""
    path = wire.source_prim
    sublayers = (asset.asset for asset in stage.unresolved if asset.kind == "sublayer")
    sublayer = next(sublayers, None)
    if sublayer is None:
        return None
    known = {node.path for graph in stage.graphs for node in graph.nodes}
    known |= {prim.path for graph in stage.graphs for prim in graph.absent}
    if path in stage.prims or path in known or any(node.path == path for node in stage.orphans):
        return None
    return sublayer


Kind = Literal["execution", "data"]


class WireCycle(Struct, frozen=True, eq=False):
    """A cycle of wires: the node and the input at which it closes, and its nodes in order."""

    kind: Kind
    node: Node
    port: str
    paths: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the nodes, the first one again at the end."""
        names = tuple(path.rpartition("/")[2] for path in self.paths)
        return (*names, *names[:1])


def find_cycles(stage: StageModel, platform: Platform) -> Iterator[WireCycle]:
    """Yield one cycle for each set of nodes that lead to each other."""
    kinds: dict[Kind, list[Connection]] = {"execution": [], "data": []}
    for wire in connections(stage, platform):
        if wire.is_live and wire.ports is not None:
            kinds["execution" if wire.ports[1].is_execution else "data"].append(wire)
    for kind, wires in kinds.items():
        yield from _cycles(kind, wires)


def _cycles(kind: Kind, wires: list[Connection]) -> Iterator[WireCycle]:
    pairs = [(wire.source_prim, wire.node.path) for wire in wires]
    if is_acyclic(pairs):
        return
    import networkx as nx

    graph, reported = nx.DiGraph(pairs), set[str]()
    for wire in wires:
        if not nx.has_path(graph, wire.node.path, wire.source_prim):
            continue
        cycle = nx.shortest_path(graph, wire.node.path, wire.source_prim)
        if reported.isdisjoint(cycle):
            reported.update(cycle)
            yield WireCycle(kind, wire.node, wire.port, tuple(cycle))
