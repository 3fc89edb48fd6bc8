"""What a correct Action Graph is: its nodes by role, their values, targets and wires."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.spec.catalog import NodeType, Value


class Setting(Struct, frozen=True):
    """A value that the handout asks for at one input."""

    port: str
    value: Value
    handout: str


class Target(Struct, frozen=True):
    """The prims that one relationship of a node must name, in the order of the handout.

    `handout_prims` are those of the handout where they do not work in a stage and `prims` do.
    """

    port: str
    prims: tuple[str, ...]
    handout: str
    handout_prims: tuple[str, ...] = ()


class NodeSpec(Struct, frozen=True):
    """One node of a graph. `role` names it in the spec; prims may be named otherwise.

    `keep` are the inputs the handout says to leave alone, `grown` the dynamic inputs it adds,
    `frames_from` the relationships that are judged by the TF frames they give. `at` is the
    position in the graph editor, in its own units.
    """

    role: str
    type: NodeType
    at: tuple[float, float]
    handout: str
    settings: tuple[Setting, ...] = ()
    targets: tuple[Target, ...] = ()
    keep: tuple[tuple[str, str], ...] = ()
    grown: tuple[str, ...] = ()
    frames_from: tuple[str, ...] = ()


class PortRef(Struct, frozen=True):
    """A port of a role; `port` is the full name in a file (`inputs:execIn`)."""

    role: str
    port: str

    @property
    def short(self) -> str:
        """`role.port` as the specs write it."""
        return f"{self.role}.{self.port.partition(':')[2]}"


class Wire(Struct, frozen=True):
    """A connection from a source port to the input that it feeds."""

    source: PortRef
    target: PortRef
    handout: str

    def __str__(self) -> str:
        """Write the wire as the specs do."""
        return f"{self.source.short} -> {self.target.short}"


class GraphSpec(Struct, frozen=True):
    """One Action Graph: its path, its nodes by role, its wires in the order of the handout."""

    name: str
    path: str
    handout: str
    nodes: Mapping[str, NodeSpec]
    wires: tuple[Wire, ...]
    optional_wires: tuple[Wire, ...] = ()
    forbidden_wires: tuple[Wire, ...] = ()

    def wires_into(self, role: str) -> Iterator[Wire]:
        """Yield the wires that end at `role`."""
        return (wire for wire in self.wires if wire.target.role == role)
