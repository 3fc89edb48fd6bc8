"""Cycles of wires: of execution wires and of data wires."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.check.lint.connections import Connection, connections
from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.model.digraph import is_acyclic
from lab3_usd.model.stage import Node

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


def find_cycles(subject: LintSubject) -> Iterator[WireCycle]:
    """Yield one cycle for each set of nodes that lead to each other."""
    kinds: dict[Kind, list[Connection]] = {"execution": [], "data": []}
    for wire in connections(subject):
        if wire.is_live and wire.ports is not None:
            kinds["execution" if wire.ports[1].is_execution else "data"].append(wire)
    for kind, wires in kinds.items():
        yield from _cycles(kind, wires)


def _cycles(kind: Kind, wires: list[Connection]) -> Iterator[WireCycle]:
    pairs = [(wire.source_prim, wire.node.path) for wire in wires]
    if is_acyclic(pairs):
        return
    import networkx as nx  # noqa: PLC0415 - only where there is a cycle

    graph, told = nx.DiGraph(pairs), set[str]()
    for wire in wires:
        if not nx.has_path(graph, wire.node.path, wire.source_prim):
            continue
        way = nx.shortest_path(graph, wire.node.path, wire.source_prim)
        if told.isdisjoint(way):
            told.update(way)
            yield WireCycle(kind, wire.node, wire.port, tuple(way))
