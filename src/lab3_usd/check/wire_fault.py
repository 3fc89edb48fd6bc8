"""One faulty wire, as the diagnosis tells the rules of it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from lab3_usd.check.model import Node
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
