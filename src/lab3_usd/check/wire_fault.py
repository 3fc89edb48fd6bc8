"""One faulty wire, as the diagnosis tells the rules of it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from lab3_usd.check.finding import Problem
from lab3_usd.check.model import Node
from lab3_usd.check.say import short_source, title_of
from lab3_usd.spec.spec import Wire

Kind = Literal[
    "missing", "moved", "wrong", "bypass", "foreign", "forbidden", "dead", "swapped",
    "second", "leftover", "unasked", "cycle", "incompatible",
]  # fmt: skip


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
    return f"drag a wire from {short_source(fault.expected)} to {port} of {title_of(fault.node)}"
