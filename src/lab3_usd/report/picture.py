"""A picture as plain data: boxes with rows, curves between their ports, and their positions.

Coordinates are in pixels at 100 %, x to the right and y downward, as in Isaac Sim's graph editor.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

from msgspec import Struct

from lab3_usd.spec.catalog import INPUT, OUTPUT

State = Literal["ok", "wrong", "missing", "extra"]
Side = Literal["in", "out", "both", "none"]
Family = Literal["event", "ros", "action", "data", "frame", "absent"]
Point = tuple[float, float]
Bezier = tuple[Point, Point, Point, Point]
STATES: tuple[State, ...] = ("ok", "wrong", "missing", "extra")
HEADER = 44.0  # height of a box's coloured header, which holds title and subtitle


class Row(Struct, frozen=True):
    """One port of a box: its name, its value where that matters, and how it was judged.

    `value` and `expected` are the lines to show, `note` is the tooltip.
    `muted` marks a value that was not authored: the default of the node type. `y` is the middle
    of the first line, from the top of the box.
    """

    port: str
    label: str
    side: Side
    execution: bool = False
    wired: bool = False
    value: tuple[str, ...] = ()
    expected: tuple[str, ...] = ()
    state: State = "ok"
    note: str = ""
    muted: bool = False
    y: float = 0.0


class Box(Struct, frozen=True):
    """A node or frame. `key` is its prim path, or the path a missing one would have.

    `more` is the line with the number of ports that are not drawn. `at` is the position in the
    graph editor, from the file or the spec.
    """

    key: str
    title: str
    subtitle: str
    family: Family
    inputs: tuple[Row, ...] = ()
    outputs: tuple[Row, ...] = ()
    settings: tuple[Row, ...] = ()
    more: str = ""
    state: State = "ok"
    note: str = ""
    at: Point | None = None
    x: float = 0.0
    y: float = 0.0
    w: float = 0.0
    h: float = 0.0

    @property
    def rows(self) -> tuple[Row, ...]:
        """Every row: inputs, outputs, then settings."""
        return self.inputs + self.outputs + self.settings

    def row(self, port: str) -> Row | None:
        """Return the row of this port, None where it is not drawn."""
        return next((row for row in self.rows if row.port == port), None)


class End(Struct, frozen=True):
    """One end of a curve: a box and one of its ports."""

    key: str
    port: str


class Curve(Struct, frozen=True):
    """A wire, drawn as Bezier curves that follow each other; dashed where it carries execution."""

    source: End
    target: End
    dashed: bool = False
    state: State = "ok"
    note: str = ""
    path: tuple[Bezier, ...] = ()


class LegendEntry(Struct, frozen=True):
    """One entry of the legend: its symbol, the meaning, and its position."""

    kind: str
    text: str
    x: float = 0.0
    y: float = 0.0


class Remark(Struct, frozen=True):
    """A line below the title: a fault of the graph as a whole."""

    state: State
    text: str


class Picture(Struct, frozen=True):
    """A whole picture. `judged` says whether a stage was compared with a spec.

    `path` is that of the graph prim, '' for a tree of frames.
    """

    title: str
    subtitle: str
    boxes: tuple[Box, ...]
    curves: tuple[Curve, ...]
    path: str = ""
    judged: bool = False
    kind: Literal["graph", "frames", "diff"] = "graph"
    remarks: tuple[Remark, ...] = ()
    legend: tuple[LegendEntry, ...] = ()
    width: float = 0.0
    height: float = 0.0


def port_point(box: Box, port: str, *, leaving: bool) -> Point:
    """Return where a wire leaves from (right edge) or arrives at (left edge) this port."""
    row = box.row(port)
    y = box.y + (HEADER / 2 if row is None else row.y)
    return (box.x + box.w if leaving else box.x, y)


def is_port(prop: str) -> bool:
    """Whether a property of a node is one of its ports; a type or version belongs to the node."""
    return prop.startswith((INPUT, OUTPUT))


def port_id(prim: str, prop: str | None = None) -> str:
    """Return the element id of a port; of the node or graph where `prop` names no port of it.

    No two ports have the same id, and an id holds letters, digits, `_` and `-` only, so that it
    needs no escape in HTML, in a URL or in a CSS selector.
    """
    if prop is None or not is_port(prop):
        return f"port{_encoded(prim)}"
    return f"port{_encoded(prim)}-p-{_encoded(prop)}"


@lru_cache(maxsize=4096)
def _encoded(text: str) -> str:
    return text.translate(_CODES)


class _Codes(dict[int, str]):
    """What stands for each character, by its number."""

    def __missing__(self, number: int) -> str:
        char = chr(number)
        # After a `-` comes `-`, `c-` or `x`: the code can be read back, so it is never ambiguous.
        kept = char == "_" or (char.isascii() and char.isalnum())
        self[number] = code = char if kept else f"-x{number:x}-"
        return code


_CODES = _Codes({ord("/"): "--", ord(":"): "-c-"})
