"""What matching a graph with its spec gives: who plays which role, and which wires are faulty."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct, field

from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import node_title, short_source
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.graph import Wire

Kind = Literal[
    "missing", "moved", "wrong", "bypass", "foreign", "forbidden", "dead", "swapped",
    "second", "leftover", "unasked", "cycle", "incompatible",
]  # fmt: skip


class Roles(Struct, frozen=True):
    """Which node of a stage plays which role of a graph spec.

    `graph` is None when the stage holds nothing that could be the graph. `equivalents` maps a node
    that does the work of another (a second context with the same settings) to the role it may stand
    in for; `retyped` holds, for a role without a node, the node of another type that stands in its
    place; `extra` are the nodes that play no role. `merged_graphs` names the graphs of the lab that
    one graph of the stage holds, where it holds several.
    """

    graph: GraphModel | None
    node_of: Mapping[str, Node | None]
    role_of: Mapping[str, str]
    equivalents: Mapping[str, str] = field(default_factory=dict)
    extra: tuple[Node, ...] = ()
    retyped: Mapping[str, Node] = field(default_factory=dict)
    merged_graphs: tuple[str, ...] = ()


class WireFault(Struct, frozen=True):
    """One faulty wire at the input where it ends.

    `expected` and `actual` are property paths; `wire` the wire of the spec that is not met, None
    where nothing is asked for; `elsewhere` a second input that belongs to the same mistake.
    """

    kind: Kind
    node: Node
    port: str
    expected: str | None = None
    actual: str | None = None
    wire: Wire | None = None
    elsewhere: str | None = None


def wire_problem(fault: WireFault, message: str, hint: str | None = None) -> Problem:
    """Return a problem at the faulty input."""
    return Problem(
        prim=fault.node.path,
        property=fault.port,
        message=message,
        expected=fault.expected,
        actual=fault.actual,
        handout=None if fault.wire is None else fault.wire.handout,
        related=() if fault.elsewhere is None else (fault.elsewhere,),
        hint=hint,
    )


def source_shown(fault: WireFault) -> str:
    """Return the source that is there, with its whole path when it stands in another graph."""
    graph = fault.node.path.rpartition("/")[0]
    is_here = fault.actual is None or fault.actual.startswith(f"{graph}/")
    return short_source(fault.actual) if is_here else str(fault.actual)


def connect_hint(fault: WireFault) -> str:
    """Say which wire to draw."""
    port = fault.port.partition(":")[2]
    return f"drag a wire from {short_source(fault.expected)} to {port} of {node_title(fault.node)}"
