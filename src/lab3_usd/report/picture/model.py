"""A picture as plain data: boxes with rows, curves between their ports, and sizes.

Coordinates are in pixels at 100 %, x to the right and y downward, as in Isaac Sim's graph
editor.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.report.safe_text import visible

State = Literal["ok", "wrong", "missing", "extra", "warned"]
Kind = Literal["graph", "frames", "diff", "lint", "topics"]
Side = Literal["in", "out", "both", "none"]
Family = Literal["event", "ros", "action", "data", "frame", "absent"]
Point = tuple[float, float]
Bezier = tuple[Point, Point, Point, Point]
STATES: tuple[State, ...] = ("ok", "wrong", "missing", "extra", "warned")
HEADER = 44.0  # height of a box's coloured header, which holds title and subtitle


class Row(Struct, frozen=True, gc=False):
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


class Box(Struct, frozen=True, gc=False):
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

    @property
    def frame(self) -> State:
        """How its border is drawn: after the box, else after the gravest row that no wire shows."""
        states = {row.state for row in self.rows if not row.wired} if self.state == "ok" else set()
        return "wrong" if "wrong" in states else "warned" if "warned" in states else self.state

    def row(self, port: str) -> Row | None:
        """Return the row of this port, None where it is not drawn."""
        for rows in (self.inputs, self.outputs, self.settings):
            for row in rows:
                if row.port == port:
                    return row
        return None


class End(Struct, frozen=True, gc=False):
    """One end of a curve: a box and one of its ports."""

    key: str
    port: str


class Curve(Struct, frozen=True, gc=False):
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
    kind: Kind = "graph"
    remarks: tuple[Remark, ...] = ()
    legend: tuple[LegendEntry, ...] = ()
    width: float = 0.0
    height: float = 0.0


_WORDS: Mapping[Kind, Mapping[State, str]] = {
    "diff": {"wrong": "changed", "missing": "removed", "extra": "added"},
    "lint": {"wrong": "error"},
    "frames": {"warned": "another tree"},
}


def state_word(state: State, kind: Kind = "graph") -> str:
    """Return what a state is called, in captions, legends and labels of such a picture alike."""
    return _WORDS.get(kind, {}).get(state, "warning" if state == "warned" else state)


def port_point(box: Box, port: str, *, leaving: bool) -> Point:
    """Return where a wire leaves from (right edge) or arrives at (left edge) this port."""
    return (box.x + box.w if leaving else box.x, box.y + port_height(box, port))


def port_height(box: Box, port: str) -> float:
    """Return how far below the top of a box its wires to and from this port end."""
    row = box.row(port)
    return HEADER / 2 if row is None else row.y


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


_CODES = {"/": "--", ":": "-c-"}


@lru_cache(maxsize=4096)
def _encoded(text: str) -> str:
    # After a `-` comes `-`, `c-` or `x`: the code can be read back, so it is never ambiguous.
    return re.sub(r"[^A-Za-z0-9_]", lambda sign: _CODES.get(sign[0], f"-x{ord(sign[0]):x}-"), text)


# Widths in ems, by the letters of that width, rounded up from the widest of the usual fonts.
GROUPS = {
    0.30: "ijlIJ'",
    0.35: " .,:;/|!\\`",
    0.41: "frt-()[]{}",
    0.54: 'sz_"*^',
    0.60: "ckvxyFLP?$",
    0.64: "abdeghnopquESTY0123456789",
    0.71: "ABCKRVXZ",
    0.80: "DGHNOQU&",
    0.87: "Mw+<>=#~",
    1.00: "mW@%…→",
}
WIDTHS = {char: width for width, chars in GROUPS.items() for char in chars}
BOLD = 0.12  # a bold letter is at most this much wider
WIDE = 1.1
OTHER = 0.85
ELLIPSIS = "…"


@lru_cache(maxsize=1024)  # types and ports come again in every picture
def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Return the most pixels that `text` takes up at this font size."""
    extra = BOLD if bold else 0.0
    return sum(_em(char) + extra for char in text) * size


def _em(char: str) -> float:
    if char in WIDTHS:
        return WIDTHS[char]
    if unicodedata.combining(char):
        return 0.0
    return WIDE if unicodedata.east_asian_width(char) in "WF" else OTHER


def clip_end(text: str, most: int) -> str:
    """Return the text escaped where it does not print, and cut after `most` characters."""
    flat = visible(text)
    return flat if len(flat) <= most else flat[: most - 1] + ELLIPSIS


def clip_path(text: str, most: int) -> str:
    """Return the path escaped where it does not print, with the last names of `most` characters."""
    flat = visible(text)
    if len(flat) <= most:
        return flat
    end = flat[len(flat) - most + 1 :]
    slash = end.find("/")
    return ELLIPSIS + (end if slash < 0 else end[slash:])


TITLE_SIZE = 13.0
SMALL = 11.0  # subtitles, values, the line about ports that are not drawn
LABEL_SIZE = 12.0
ROW = 22.0
LINE = 15.0  # every further line of a row
PAD = 14.0  # from a port's place on the edge to its text
SPACE = 18.0  # between the two texts of a line
EDGE = 8.0  # above the first and below the last row
SMALLEST = 170.0
BADGE = 22.0  # the mark of a faulty box, right of its title
EXPECTED = "expected "


def sized(box: Box) -> Box:
    """Return the box with its size, and its rows with their heights."""
    bands = max(len(box.inputs), len(box.outputs))
    top = HEADER + EDGE
    inputs = _stacked(box.inputs, top)
    outputs = _stacked(box.outputs, top)
    top += bands * ROW
    if bands and box.settings:
        top += EDGE
    settings = _stacked(box.settings, top)
    top += sum(row_height(row) for row in box.settings)
    if box.more:
        top += ROW
    empty = not (bands or box.settings or box.more)
    return replace(
        box,
        inputs=inputs,
        outputs=outputs,
        settings=settings,
        w=_width(box),
        h=HEADER if empty else top + EDGE,
    )


def row_height(row: Row) -> float:
    """Return the height of a row: a line per value and per expected value."""
    lines = max(1, len(row.value)) + len(row.expected)
    return ROW + LINE * (lines - 1)


def _stacked(rows: Sequence[Row], top: float) -> tuple[Row, ...]:
    placed = []
    for row in rows:
        placed.append(replace(row, y=top + ROW / 2))
        top += row_height(row)
    return tuple(placed)


def _width(box: Box) -> float:
    title = text_width(box.title, TITLE_SIZE, bold=True) + 2 * PAD
    if box.state != "ok":
        title += BADGE
    left = max((_label_width(row) for row in box.inputs), default=0.0)
    right = max((_label_width(row) for row in box.outputs), default=0.0)
    widths = [
        SMALLEST,
        title,
        text_width(box.subtitle, SMALL) + 2 * PAD,
        left + right + 2 * PAD + (SPACE if left and right else 0),
        text_width(box.more, SMALL) + 2 * PAD,
    ]
    for row in box.settings:
        bold = row.state != "ok"
        first = text_width(row.value[0], SMALL, bold=bold) if row.value else 0.0
        lines = [_label_width(row) + SPACE + first]
        lines += [text_width(line, SMALL, bold=bold) for line in row.value[1:]]
        lines += [text_width(EXPECTED + line, SMALL) for line in row.expected]
        widths.append(max(lines) + 2 * PAD)
    return float(round(max(widths) / 2 + 0.5) * 2)


def _label_width(row: Row) -> float:
    return text_width(row.label, LABEL_SIZE, bold=row.state != "ok")
