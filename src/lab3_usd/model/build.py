"""What a script does while it builds graphs, beside the stage that it leaves: plain data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct

FaultKind = Literal[
    "unknown-node",
    "forgotten-node",
    "unknown-key",
    "key-twice",
    "node-twice",
    "not-a-list",
    "no-graph-path",
    "no-port-name",
]
Span = tuple[int, int, int, int]  # line, column, last line and its column, in bytes from 0


class BuildFault(Struct, frozen=True):
    """A line at which a script stops, or loses something, while it builds a graph.

    `name` is what it wrote, `meant` what it likely meant, and `earlier` the line of the cause.
    """

    kind: FaultKind
    prim: str
    name: str
    at: Span
    meant: str = ""
    earlier: str = ""


class Build(Struct, frozen=True, eq=False):
    """How a script made the graphs of a stage.

    `places` are where it makes each prim (with None), sets each property, and wires each input
    from a source (with both). `created` are the ports that it creates itself, `quiet` those that
    get a value in a way that tells nothing of a wrong name.
    """

    faults: tuple[BuildFault, ...] = ()
    places: Mapping[tuple[str, str | None, str | None], Span] = {}
    created: frozenset[tuple[str, str]] = frozenset()
    quiet: frozenset[tuple[str, str]] = frozenset()
