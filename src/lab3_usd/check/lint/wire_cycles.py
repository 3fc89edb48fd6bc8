"""Cycles of wires: of execution wires and of data wires."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.check.lint.connections import Connection, connections
from lab3_usd.check.lint.subject import LintSubject
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
        yield from _rings(kind, wires)


def _rings(kind: Kind, wires: list[Connection]) -> Iterator[WireCycle]:
    into: dict[str, list[Connection]] = {}
    for wire in wires:
        into.setdefault(wire.node.path, []).append(wire)
    told: set[str] = set()
    for wire in wires:
        way = _way(wire.node.path, wire.source_prim, into)
        if way is not None and told.isdisjoint(way):
            told.update(way)
            yield WireCycle(kind, wire.node, wire.port, tuple(way))


def _way(first: str, last: str, into: dict[str, list[Connection]]) -> list[str] | None:
    """Return the nodes from `first` to `last` along the wires, None where no way leads there."""
    before: dict[str, str] = {last: ""}
    ahead = [last]
    while ahead:
        path = ahead.pop(0)
        if path == first:
            way = [path]
            while before[way[-1]]:
                way.append(before[way[-1]])
            return way
        for wire in into.get(path, ()):
            if wire.source_prim not in before:
                before[wire.source_prim] = path
                ahead.append(wire.source_prim)
    return None
