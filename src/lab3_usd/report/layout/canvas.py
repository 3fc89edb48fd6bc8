"""The canvas of a picture: its title, legend, margins and size."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.report.layout.curves import points
from lab3_usd.report.layout.text_width import text_width
from lab3_usd.report.picture import STATES, Bezier, Box, Curve, LegendEntry, Picture, Point

MARGIN = 32.0
TITLE_SIZE = 18.0
TITLE_LINE = 40.0  # baseline of the title
SUBTITLE_LINE = 60.0
REMARK_LINE = 18.0
HEAD = 84.0  # above the drawing, without remarks
FOOT = 30.0  # from the drawing to the line above the legend
ENTRY_TEXT = 30.0  # width of a sign before its text
ENTRY_SIZE = 12.0
LEGEND_LINE = 24.0
ENTRY_SPACE = 26.0
SMALLEST = 620.0

GRAPH_LEGEND = (LegendEntry("data", "data wire"), LegendEntry("execution", "execution wire"))
TF_LEGEND = (
    LegendEntry("data", "published by the stage"),
    LegendEntry("execution", "published elsewhere"),
)
UNKNOWN_ENTRY = LegendEntry("absent", "unknown: asset not found")
FAMILY_ENTRIES = {
    "event": LegendEntry("event", "event"),
    "ros": LegendEntry("ros", "ROS 2"),
    "action": LegendEntry("action", "runs when triggered"),
    "data": LegendEntry("family-data", "gives data"),
}
STATE_ENTRIES = {
    "wrong": LegendEntry("wrong", "wrong"),
    "missing": LegendEntry("missing", "missing"),
    "extra": LegendEntry("extra", "extra: not asked for"),
}
DIFF_ENTRIES = {
    "wrong": LegendEntry("wrong", "changed"),
    "missing": LegendEntry("missing", "removed"),
    "extra": LegendEntry("extra", "added"),
}


def on_canvas(picture: Picture) -> Picture:
    """Return the picture moved to its position on the canvas, with legend and size."""
    low, high = _extent(picture.boxes, picture.curves)
    head = HEAD + REMARK_LINE * len(picture.remarks)
    width = max(high[0] - low[0] + 2 * MARGIN, _text_width(picture), SMALLEST)
    # A drawing narrower than its title is centred.
    across = (width - (high[0] - low[0])) / 2 - low[0]
    down = head - low[1]
    bottom = head + high[1] - low[1] + FOOT
    legend = tuple(_in_lines(_legend_entries(picture), width, bottom + LEGEND_LINE))
    last = legend[-1].y if legend else bottom
    return replace(
        picture,
        boxes=tuple(replace(box, x=box.x + across, y=box.y + down) for box in picture.boxes),
        curves=tuple(_moved(curve, across, down) for curve in picture.curves),
        legend=legend,
        width=width,
        height=last + LEGEND_LINE,
    )


def _extent(boxes: Iterable[Box], curves: Iterable[Curve]) -> tuple[Point, Point]:
    corners = [(box.x, box.y) for box in boxes]
    corners += [(box.x + box.w, box.y + box.h) for box in boxes]
    corners += [point for curve in curves for point in points(curve.path)]
    corners = corners or [(0.0, 0.0)]
    xs, ys = [point[0] for point in corners], [point[1] for point in corners]
    return (min(xs), min(ys)), (max(xs), max(ys))


def _text_width(picture: Picture) -> float:
    lines = [text_width(picture.title, TITLE_SIZE, bold=True), text_width(picture.subtitle, 12.0)]
    lines += [ENTRY_TEXT + text_width(remark.text, 12.0, bold=True) for remark in picture.remarks]
    return max(lines) + 2 * MARGIN


def _moved(curve: Curve, across: float, down: float) -> Curve:
    return replace(curve, path=tuple(_shifted(piece, across, down) for piece in curve.path))


def _shifted(piece: Bezier, across: float, down: float) -> Bezier:
    start, first, second, end = ((x + across, y + down) for x, y in piece)
    return (start, first, second, end)


def _legend_entries(picture: Picture) -> Iterator[LegendEntry]:
    if picture.kind == "frames":
        yield from TF_LEGEND
        if any(box.family == UNKNOWN_ENTRY.kind for box in picture.boxes):
            yield UNKNOWN_ENTRY
    else:
        yield from GRAPH_LEGEND
        families = {box.family for box in picture.boxes}
        yield from (entry for family, entry in FAMILY_ENTRIES.items() if family in families)
    if picture.judged:
        entries = DIFF_ENTRIES if picture.kind == "diff" else STATE_ENTRIES
        yield from (entries[state] for state in STATES if state != "ok")


def _in_lines(legend: Iterable[LegendEntry], width: float, top: float) -> Iterator[LegendEntry]:
    """Place the signs in lines from left to right."""
    left, line = MARGIN, top
    for entry in legend:
        takes = ENTRY_TEXT + text_width(entry.text, ENTRY_SIZE)
        if left > MARGIN and left + takes > width - MARGIN:
            left, line = MARGIN, line + LEGEND_LINE
        yield replace(entry, x=left, y=line)
        left += takes + ENTRY_SPACE
