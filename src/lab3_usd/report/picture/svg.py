"""Pictures as SVG: a file of its own, or a piece of an HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from html import escape
from typing import Literal

from msgspec import Struct

from lab3_usd.report.picture.canvas import (
    ENTRY_TEXT,
    LEGEND_LINE,
    MARGIN,
    REMARK_LINE,
    SUBTITLE_LINE,
    TITLE_LINE,
)
from lab3_usd.report.picture.model import (
    EXPECTED,
    HEADER,
    LINE,
    PAD,
    ROW,
    STATES,
    Bezier,
    Box,
    Family,
    Kind,
    LegendEntry,
    Picture,
    Row,
    State,
    port_id,
    row_height,
)
from lab3_usd.report.picture.routing import on_longest
from lab3_usd.report.safe_text import visible

Theme = Literal["auto", "light", "dark"]
THEMES: tuple[Theme, ...] = ("auto", "light", "dark")
FONT = "Inter,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"
HEADERS = {
    "event": "#2b6b4b",
    "ros": "#27598f",
    "action": "#5a4894",
    "data": "#4a5663",
    "frame": "#27598f",
    "absent": "#55595f",
}
ON_HEADER = "#ffffff"
BELOW_TITLE = "#dfe5ec"
PALETTES: Mapping[str, Mapping[str, str]] = {
    "light": {
        "canvas": "#f3f5f8",
        "body": "#ffffff",
        "border": "#aab4c0",
        "line": "#d5dbe3",
        "text": "#1c2128",
        "muted": "#555f6b",
        "value": "#0a4f9e",
        "data": "#3b78b8",
        "execution": "#5b6570",
        "fault": "#b3101d",
        "fault_tint": "#fbe3e4",
        "extra": "#7d5200",
        "extra_tint": "#fbefd5",
        "lit": "#ffe27a",
    },
    "dark": {
        "canvas": "#1b1e23",
        "body": "#2b2f36",
        "border": "#565e6a",
        "line": "#414852",
        "text": "#e9edf2",
        "muted": "#aeb7c2",
        "value": "#8ec9ff",
        "data": "#6fa8dc",
        "execution": "#c3cad3",
        "fault": "#ff8a84",
        "fault_tint": "#452a2d",
        "extra": "#e8b64a",
        "extra_tint": "#40361f",
        "lit": "#6b5a12",
    },
}
# A difference is no fault: what is added is green, what is removed or changed is amber.
OF_CHANGES: Mapping[str, Mapping[str, str]] = {
    "light": {
        "fault": "#7d5200",
        "fault_tint": "#fbefd5",
        "extra": "#1b653a",
        "extra_tint": "#dff3e5",
    },
    "dark": {
        "fault": "#e8b64a",
        "fault_tint": "#40361f",
        "extra": "#74cf95",
        "extra_tint": "#20382a",
    },
}
LEAST = 0.7  # of its size, to which a picture is shrunk
SCOPE = ".lab3"  # the class of the element of a picture
RULES = """\
{s} text{{font-family:{font};font-size:12px;fill:{text}}}
{s} .canvas{{fill:{canvas}}}
{s} .h1{{font-size:18px;font-weight:700}}
{s} .h2{{fill:{muted}}}
{s} .rule{{stroke:{line};stroke-width:1;fill:none}}
{s} .b{{fill:{body};stroke:{border};stroke-width:1}}
{s} .t{{font-size:13px;font-weight:700;fill:{on_header}}}
{s} .u{{font-size:11px;fill:{below_title}}}
{s} .v{{font-size:11px;fill:{value};text-anchor:end}}
{s} .e{{text-anchor:end}}
{s} .m{{font-size:11px;fill:{muted}}}
{s} .p{{fill:{body};stroke:{data};stroke-width:1.5}}
{s} .p.f{{fill:{data}}}
{s} .px{{stroke:{execution};stroke-linejoin:round}}
{s} .px.f{{fill:{execution}}}
{s} .w{{fill:none;stroke:{data};stroke-width:2}}
{s} .x{{stroke:{execution};stroke-dasharray:7 4}}
{s} .hit{{fill:none}}
{s} .wrong .hit,{s} .missing .hit{{fill:{fault_tint}}}
{s} .extra .hit{{fill:{extra_tint}}}
{s} .r:target .hit,{s} .lit .hit{{fill:{lit}}}
{s} .wrong .p,{s} .missing .p,{s} .ghost .p{{stroke:{fault}}}
{s} .wrong .p.f,{s} .missing .p.f,{s} .ghost .p.f{{fill:{fault}}}
{s} .extra .p{{stroke:{extra}}}
{s} .extra .p.f{{fill:{extra}}}
{s} .r.wrong text,{s} .r.missing text{{fill:{fault};font-weight:700}}
{s} .r.extra text{{fill:{extra};font-weight:700}}
{s} .r text.s{{font-weight:400;fill:{text}}}
{s} .b.wrong{{stroke:{fault};stroke-width:2.5}}
{s} .b.extra{{stroke:{extra};stroke-width:2.5}}
{s} .b.missing{{fill:none;stroke:{fault};stroke-width:2;stroke-dasharray:6 4}}
{s} .n.ghost text,{s} .h3{{fill:{fault}}}
{s} .h3.extra{{fill:{extra}}}
{s} .w.wrong{{stroke:{fault};stroke-width:3}}
{s} .w.missing{{stroke:{fault};stroke-dasharray:1 6;stroke-linecap:round;stroke-width:2.5}}
{s} .w.x.missing{{stroke-dasharray:7 8;stroke-linecap:butt}}
{s} .w.extra{{stroke:{extra};stroke-width:3}}
{s} .k{{fill:{canvas};stroke:{fault};stroke-width:1.5}}
{s} .k.extra{{stroke:{extra}}}
{s} .g{{fill:none;stroke:{fault};stroke-width:2;stroke-linecap:round}}
{s} .g.extra{{stroke:{extra}}}
"""


@lru_cache(maxsize=2 * len(THEMES))
def stylesheet(theme: Theme = "auto", kind: Kind = "graph") -> str:
    """Return the rules for pictures; `auto` follows the reader's system, the others do not."""
    if theme != "auto":
        return _rules(theme, kind)
    dark = _rules("dark", kind)
    return f"{_rules('light', kind)}@media (prefers-color-scheme:dark){{\n{dark}}}\n"


def _rules(theme: str, kind: Kind) -> str:
    palette = {**PALETTES[theme], **(OF_CHANGES[theme] if kind == "diff" else {})}
    rules = RULES.format(
        s=SCOPE, font=FONT, on_header=ON_HEADER, below_title=BELOW_TITLE, **palette
    )
    headers = (f"{SCOPE} .f-{family}{{fill:{colour}}}\n" for family, colour in HEADERS.items())
    return rules + "".join(headers)


# From the middle of a mark to where its stroke starts, and the stroke.
STROKES: Mapping[State, tuple[float, float, str]] = {
    "wrong": (-3, -3, "l6 6m0-6-6 6"),
    "missing": (-4, 0, "h8"),
    "extra": (-4, 0, "h8m-4-4v8"),
    "warned": (0, -4, "v5m0 3v.1"),
}
CHANGED = "m-1 1h8m-8 4h8"  # of two bars, in the place of the cross
MARK = 8


class ElementIds(Struct, frozen=True):
    """The ids of elements: the prefix of all, and where each one links to.

    With `links` only the ids it names are written; without, every port and node has its id.
    """

    prefix: str = ""
    links: Mapping[str, str] | None = None

    def id(self, prim: str, prop: str | None = None) -> str:
        """Return the id attribute of a node or port, with the space before it; '' without one."""
        name = port_id(prim, prop)
        if self.links is not None and name not in self.links:
            return ""
        return f' id="{markup(self.prefix)}{name}"'

    def linked(self, content: str, prim: str, prop: str | None = None) -> str:
        """Return the part as a link where there is one for its id."""
        target = None if self.links is None else self.links.get(port_id(prim, prop))
        return content if target is None else f'<a href="{markup(target)}">{content}</a>'


def markup(text: str) -> str:
    """Return any string as text or attribute value: what does not print, and markup, is escaped."""
    return escape(visible(text))


def note(text: str) -> str:
    """Return the tooltip of a part; it may have several lines."""
    return f"<title>{chr(10).join(map(markup, text.splitlines()))}</title>" if text else ""


def pixels(value: float) -> str:
    """Write a coordinate with at most one decimal."""
    return f"{value:.1f}".removesuffix(".0")


def text(content: str, x: float, y: float, kind: str = "") -> str:
    """Return one line of text, its baseline at `y`."""
    style = f' class="{kind}"' if kind else ""
    return f'<text x="{pixels(x)}" y="{pixels(y)}"{style}>{markup(content)}</text>'


def rect(x: float, y: float, size: tuple[float, float], kind: str, corner: float = 0) -> str:
    """Return a rectangle, `size` being width and height."""
    round_off = f' rx="{pixels(corner)}"' if corner else ""
    return (
        f'<rect class="{kind}" x="{pixels(x)}" y="{pixels(y)}"'
        f' width="{pixels(size[0])}" height="{pixels(size[1])}"{round_off}/>'
    )


def port(x: float, y: float, *, execution: bool, wired: bool) -> str:
    """Return a port: a disc for data, an arrowhead for execution, hollow without a wire."""
    full = " f" if wired else ""
    if execution:
        return f'<path class="p px{full}" d="M{pixels(x - 4)} {pixels(y - 5)}l9 5-9 5z"/>'
    return f'<circle class="p{full}" cx="{pixels(x)}" cy="{pixels(y)}" r="4.5"/>'


def mark(x: float, y: float, state: State) -> str:
    """Return the round mark of a fault: a cross, a minus, a plus or an exclamation mark."""
    kind = _kind(state) if state in {"extra", "warned"} else ""
    left, top, stroke = STROKES[state]
    return (
        f'<circle class="k{kind}" cx="{pixels(x)}" cy="{pixels(y)}" r="{MARK}"/>'
        f'<path class="g{kind}" d="M{pixels(x + left)} {pixels(y + top)}{stroke}"/>'
    )


def _kind(state: State) -> str:
    """Return the class of a state, with the space before it; warnings look like what is extra."""
    return "" if state == "ok" else " extra" if state == "warned" else f" {state}"


CORNER = 8.0
BASELINE = 4.0  # from the middle of a line of 12 px to its baseline


KEPT = 4096  # parts of pictures that are alike in the graphs of a stage


def box_svg(box: Box, ids: ElementIds) -> str:
    """Return the group of one box."""
    ghost = " ghost" if box.state == "missing" else ""
    header = _header((box.x, box.y, box.w, box.h), box.title, box.subtitle, box.family, box.state)
    head = ids.linked(f"<g{ids.id(box.key)}>{note(box.note)}{header}</g>", box.key)
    rows = "".join(_row(box, row, ids) for row in box.rows)
    top = box.settings[0].y if box.settings and (box.inputs or box.outputs) else None
    frame, separator, more = _frame((box.x, box.y, box.w, box.h), box.frame, top, box.more)
    return f'<g class="n{ghost}">{frame}{head}{separator}{rows}{more}</g>'


Area = tuple[float, float, float, float]  # left, top, width, height


@lru_cache(maxsize=KEPT)
def _frame(area: Area, state: State, settings: float | None, more: str) -> tuple[str, str, str]:
    """Return the frame of a box, the line above its settings, and the line below its rows."""
    x, y, width, height = area
    separator = ""
    if settings is not None:
        line = pixels(y + settings - ROW / 2 - 4)
        separator = f'<path class="rule" d="M{pixels(x + PAD)} {line}h{pixels(width - 2 * PAD)}"/>'
    last = text(more, x + PAD, y + height - 14, "m") if more else ""
    return rect(x, y, (width, height), f"b{_kind(state)}", CORNER), separator, last


@lru_cache(maxsize=KEPT)
def _header(area: Area, title: str, subtitle: str, family: Family, state: State) -> str:
    x, y, width, _ = area
    parts = []
    if state != "missing":
        parts.append(f'<path class="f-{family}" d="{_header_path(area)}"/>')
    parts.append(text(title, x + PAD, y + (19 if subtitle else 27), "t"))
    if subtitle:
        parts.append(text(subtitle, x + PAD, y + 35, "u"))
    if state != "ok":
        parts.append(mark(x + width - 16, y + 16, state))
    return "".join(parts)


def _header_path(area: Area) -> str:
    """Return the header inside the border; its lower corners are round where nothing is below."""
    # Half a pixel inside, so that the border stays whole.
    x, y, width, height = area
    left, top = pixels(x + 0.5), pixels(y + CORNER)
    width, radius = width - 1, CORNER - 0.5
    upper = f"M{left} {top}a{radius:g} {radius:g} 0 0 1 {radius:g}-{radius:g}"
    upper += f"h{pixels(width - 2 * radius)}a{radius:g} {radius:g} 0 0 1 {radius:g} {radius:g}"
    if height > HEADER:
        return f"{upper}v{pixels(HEADER - CORNER)}H{left}z"
    lower = f"v{pixels(HEADER - 2 * CORNER)}a{radius:g} {radius:g} 0 0 1-{radius:g} {radius:g}"
    lower += f"h-{pixels(width - 2 * radius)}a{radius:g} {radius:g} 0 0 1-{radius:g}-{radius:g}z"
    return upper + lower


def _row(box: Box, row: Row, ids: ElementIds) -> str:
    place = ids.id(box.key, row.port)
    if not place and row.state == "ok":
        # Nobody asks for this row by its id: a page of many pictures stays small.
        content = _row_content(row, box.x, box.y, box.w)
        return f"<g>{note(row.note)}{content}</g>" if row.note else content
    # The area that lights up; rows of ports share a line, each has its half.
    left, width = box.x + 1, box.w - 2
    if box.inputs and box.outputs and row not in box.settings:
        width /= 2
        left += width if row in box.outputs else 0.0
    start, end = _row_around(row, (box.x, box.y, box.w), left, width)
    return ids.linked(f"{start}{place}{end}", box.key, row.port)


@lru_cache(maxsize=KEPT)
def _row_around(
    row: Row, place: tuple[float, float, float], left: float, width: float
) -> tuple[str, str]:
    """Return the group of a row before and after its id; `place` is its box: left, top, width."""
    area = rect(left, place[1] + row.y - ROW / 2, (width, row_height(row)), "hit")
    content = f"{note(row.note)}{area}{_row_content(row, *place)}"
    return f'<g class="r{_kind(row.state)}"', f">{content}</g>"


@lru_cache(maxsize=KEPT)
def _row_content(row: Row, x: float, y: float, width: float) -> str:
    """Return the texts and ports of a row in a box that stands there."""
    content = "".join(_texts(row, x, y, width))
    for side, edge in (("in", x), ("out", x + width)):
        if row.side in {side, "both"}:
            content += port(edge, y + row.y, execution=row.execution, wired=row.wired)
    return content


def _texts(row: Row, x: float, y: float, width: float) -> Iterator[str]:
    y += row.y + BASELINE
    right = x + width - PAD
    if row.side == "out" and not row.value:
        yield text(row.label, right, y, "e")
    else:
        yield text(row.label, x + PAD, y)
    style = "v m" if row.muted and row.state == "ok" else "v"
    for line in row.value:
        yield text(line, right, y, style)
        y += LINE
    for line in row.expected:
        yield text(EXPECTED + line, right, y, "v s")
        y += LINE


FAMILIES = {
    "event": "event",
    "ros": "ros",
    "action": "action",
    "family-data": "data",
    "absent": "absent",
}


def svg(picture: Picture, ids_prefix: str = "", links: Mapping[str, str] | None = None) -> str:
    """Return the picture as an element for an HTML page, which has to hold `stylesheet()` once.

    Every node and port is a group with the id `ids_prefix` + `port_id(prim, property)`; the
    prefix keeps several pictures of one page apart. With `links`, from `port_id` to an address,
    only those have ids, and each is a link. The row that the page's address names is lit, and so
    is one that a script gives the class `lit`.
    """
    return _element(picture, ElementIds(ids_prefix, links), style="")


def svg_file(picture: Picture, theme: Theme = "auto") -> str:
    """Return the picture as a whole SVG file; the theme `auto` follows the reader's system.

    A viewer shrinks it to its window, as far as it stays readable.
    """
    least = pixels(LEAST * picture.width)
    fitting = f"{SCOPE}{{max-width:max(100%,{least}px);height:auto}}\n"
    style = f"<style>\n{fitting}{stylesheet(theme, picture.kind)}</style>"
    element = _element(picture, ElementIds(), style)
    if picture.kind == "diff":
        element = element.replace(STROKES["wrong"][2], CHANGED)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{element}\n'


def _element(picture: Picture, ids: ElementIds, style: str) -> str:
    width, height = pixels(picture.width), pixels(picture.height)
    label = markup(f"{picture.title}: {picture.subtitle.replace('  ·  ', ', ')}")
    opening = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="lab3" role="img" aria-label="{label}"'
        f' width="{width}" height="{height}" viewBox="0 0 {width} {height}">'
    )
    # Faulty wires lie on top, boxes above all wires, marks of wires above everything.
    wires = []
    for curve in sorted(picture.curves, key=lambda curve: curve.state != "ok"):
        dashes = " x" if curve.dashed else ""
        path = f'<path class="w{dashes}{_kind(curve.state)}" d="{path_data(curve.path)}"'
        wires.append(f"{path}>{note(curve.note)}</path>" if curve.note else f"{path}/>")
    parts = [
        opening,
        style,
        rect(0, 0, (picture.width, picture.height), "canvas"),
        f"<g{ids.id(picture.path)}>{''.join(_head(picture))}</g>",
        *wires,
        *(box_svg(box, ids) for box in picture.boxes),
        *_marks(picture),
        *_legend(picture.legend, picture.width),
        "</svg>",
    ]
    return "\n".join(part for part in parts if part)


def _head(picture: Picture) -> Iterator[str]:
    yield text(picture.title, MARGIN, TITLE_LINE, "h1")
    yield text(picture.subtitle, MARGIN, SUBTITLE_LINE, "h2")
    for line, remark in enumerate(picture.remarks, start=1):
        y = SUBTITLE_LINE + 4 + REMARK_LINE * line
        if remark.state != "ok":
            yield mark(MARGIN + 8, y - 4, remark.state)
        kind = "h2" if remark.state == "ok" else f"h3{_kind(remark.state)}"
        yield text(remark.text, MARGIN + ENTRY_TEXT, y, kind)


def _marks(picture: Picture) -> Iterator[str]:
    """Yield a mark for each faulty wire, except those of nodes that are missing as a whole."""
    missing = {box.key for box in picture.boxes if box.state == "missing"}
    for curve in picture.curves:
        if curve.state != "ok" and not {curve.source.key, curve.target.key} & missing:
            # A missing wire often runs beside the wrong one: their marks stand apart.
            place = on_longest(curve.path, 0.35 if curve.state == "missing" else 0.6)
            yield mark(*place, curve.state)


@lru_cache(maxsize=KEPT)
def path_data(path: tuple[Bezier, ...]) -> str:
    """Return the curves of a path, which follow each other, as SVG path data."""
    start = path[0][0]
    data = [f"M{pixels(start[0])} {pixels(start[1])}"]
    for curve in path:
        if len({point[1] for point in curve}) == 1:
            data.append(f"H{pixels(curve[3][0])}")
        else:
            data.append("C" + " ".join(f"{pixels(x)} {pixels(y)}" for x, y in curve[1:]))
    return "".join(data)


@lru_cache(maxsize=64)
def _legend(legend: tuple[LegendEntry, ...], width: float) -> tuple[str, ...]:
    if not legend:
        return ()
    y = legend[0].y - LEGEND_LINE
    parts = [f'<path class="rule" d="M{pixels(MARGIN)} {pixels(y)}H{pixels(width - MARGIN)}"/>']
    for entry in legend:
        if entry.kind in {"data", "execution"}:
            dashes = " x" if entry.kind == "execution" else ""
            parts.append(f'<path class="w{dashes}" d="M{pixels(entry.x)} {pixels(entry.y)}h22"/>')
        elif entry.kind in FAMILIES:
            parts.append(rect(entry.x + 4, entry.y - 7, (14, 14), f"f-{FAMILIES[entry.kind]}", 3))
        else:
            state = next(state for state in STATES if state == entry.kind)
            parts.append(mark(entry.x + 11, entry.y, state))
        parts.append(text(entry.text, entry.x + ENTRY_TEXT, entry.y + 4, "h2"))
    return tuple(parts)
