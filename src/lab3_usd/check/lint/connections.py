"""The wires of a stage, each with what is at its source and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.model.absent_prims import absence_reason, is_unresolved
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import Port


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
        ends = (self.source.type.port(self.source_port), self.node.type.port(self.port))
        return (ends[0], ends[1]) if ends[0] is not None and ends[1] is not None else None


def connections(subject: LintSubject) -> Iterator[Connection]:
    """Yield every wire into a live node, in the order of nodes and ports."""
    live = subject.live
    for node in live.values():
        for name, state in node.ports.items():
            for path in state.sources:
                yield Connection(node, name, path, live.get(path.rpartition(".")[0]))


def why_dead(wire: Connection, subject: LintSubject) -> str | None:
    """Say why there is no node at the source of a wire, None where nobody can know."""
    stage, path = subject.stage, wire.source_prim
    if is_unresolved(stage, path) or subject.catalog.graph.ignores(path):
        return None
    if any(node.path == path for node in stage.orphans):
        return "stands outside every graph"
    there = _in_graph(path, subject)
    if there:
        return there
    return absence_reason(stage, path) if stage.prim(path) is None else "is no node"


def _in_graph(path: str, subject: LintSubject) -> str:
    """Say why a prim that is in a graph is no live node, nothing for one that is in none."""
    for graph in subject.stage.graphs:
        if not graph.active and any(node.path == path for node in graph.nodes):
            return f"is in the graph {graph.path}, which is not in the scene"
        for absent in graph.absent:
            if absent.path == path:
                return f"is {absent.reason}"
    return ""
