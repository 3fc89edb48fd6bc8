"""The frame of a picture: a title above, a legend below, and margins around everything drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.report.drawing.curves import points
from lab3_usd.report.drawing.text_width import text_width
from lab3_usd.report.picture_model import STATES, Bezier, Box, Curve, Picture, Point, Sign

MARGIN = 32.0
TITLE_SIZE = 18.0
TITLE_LINE = 40.0  # baseline of the title
SUBTITLE_LINE = 60.0
REMARK_LINE = 18.0
HEAD = 84.0  # above the drawing, without remarks
FOOT = 30.0  # from the drawing to the line above the legend
SIGN = 30.0  # width of a sign before its text
SIGN_SIZE = 12.0
SIGN_LINE = 24.0
SIGN_SPACE = 26.0
SMALLEST = 620.0

GRAPH_SIGNS = (Sign("data", "data wire"), Sign("execution", "execution wire"))
FRAME_SIGNS = (Sign("data", "published by the stage"), Sign("execution", "published elsewhere"))
UNKNOWN_SIGN = Sign("absent", "unknown: asset not found")
FAMILY_SIGNS = {
    "event": Sign("event", "event"),
    "ros": Sign("ros", "ROS 2"),
    "action": Sign("action", "runs when triggered"),
    "data": Sign("family-data", "gives data"),
}
STATE_SIGNS = {
    "wrong": Sign("wrong", "wrong"),
    "missing": Sign("missing", "missing"),
    "extra": Sign("extra", "extra: not asked for"),
}


def framed(picture: Picture) -> Picture:
    """Return the picture moved into its frame, with its legend and its size."""
    low, high = _extent(picture.boxes, picture.curves)
    head = HEAD + REMARK_LINE * len(picture.remarks)
    width = max(high[0] - low[0] + 2 * MARGIN, _text_width(picture), SMALLEST)
    # A drawing narrower than its title stands in the middle.
    across = (width - (high[0] - low[0])) / 2 - low[0]
    down = head - low[1]
    bottom = head + high[1] - low[1] + FOOT
    signs = tuple(_set_out(_signs(picture), width, bottom + SIGN_LINE))
    last = signs[-1].y if signs else bottom
    return replace(
        picture,
        boxes=tuple(replace(box, x=box.x + across, y=box.y + down) for box in picture.boxes),
        curves=tuple(_moved(curve, across, down) for curve in picture.curves),
        signs=signs,
        width=width,
        height=last + SIGN_LINE,
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
    lines += [SIGN + text_width(remark.text, 12.0, bold=True) for remark in picture.remarks]
    return max(lines) + 2 * MARGIN


def _moved(curve: Curve, across: float, down: float) -> Curve:
    return replace(curve, path=tuple(_shifted(piece, across, down) for piece in curve.path))


def _shifted(piece: Bezier, across: float, down: float) -> Bezier:
    start, first, second, end = ((x + across, y + down) for x, y in piece)
    return (start, first, second, end)


def _signs(picture: Picture) -> Iterator[Sign]:
    if picture.kind == "frames":
        yield from FRAME_SIGNS
        if any(box.family == UNKNOWN_SIGN.kind for box in picture.boxes):
            yield UNKNOWN_SIGN
    else:
        yield from GRAPH_SIGNS
        families = {box.family for box in picture.boxes}
        yield from (sign for family, sign in FAMILY_SIGNS.items() if family in families)
    if picture.judged:
        yield from (STATE_SIGNS[state] for state in STATES if state != "ok")


def _set_out(signs: Iterable[Sign], width: float, top: float) -> Iterator[Sign]:
    """Place the signs in lines from left to right."""
    left, line = MARGIN, top
    for sign in signs:
        takes = SIGN + text_width(sign.text, SIGN_SIZE)
        if left > MARGIN and left + takes > width - MARGIN:
            left, line = MARGIN, line + SIGN_LINE
        yield replace(sign, x=left, y=line)
        left += takes + SIGN_SPACE
