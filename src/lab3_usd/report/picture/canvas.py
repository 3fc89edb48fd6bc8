"""The canvas of a picture: where boxes stand, its title, legend and margins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from msgspec.structs import replace

from lab3_usd.report.picture.layered import Placed
from lab3_usd.report.picture.model import (
    STATES,
    Bezier,
    Box,
    Curve,
    Family,
    Kind,
    LegendEntry,
    Picture,
    Point,
    state_word,
    text_width,
)
from lab3_usd.report.picture.routing import points, routed

ASIDE = 64.0  # room for wires between boxes that stand side by side
ABOVE = 26.0  # between boxes that stand above each other
FACTORS = tuple(1 + step / 10 for step in range(16))
MOST_BOXES = 60


def at_editor_positions(boxes: Sequence[Box], curves: Sequence[Curve]) -> Placed | None:
    """Return boxes and curves at the positions of the editor; None if that is not possible.

    Boxes may be larger than in the editor. So all positions are stretched if boxes would be too
    close; their order does not change. None if a position is unknown or a wire has no route
    around the boxes.
    """
    if len(boxes) > MOST_BOXES or any(box.at is None for box in boxes):
        return None
    stretches = [(across, down) for across in FACTORS for down in FACTORS]
    for across, down in sorted(stretches, key=lambda pair: (pair[0] * pair[1], pair)):
        placed = tuple(
            replace(box, x=float(round(left * across)), y=float(round(top * down)))
            for box in boxes
            for left, top in [box.at or (0.0, 0.0)]
        )
        if not any(_too_close(first, second) for first, second in combinations(placed, 2)):
            break
    else:
        return None
    paths = routed(placed, curves)
    if paths is None:
        return None
    drawn = tuple(replace(curve, path=path) for curve, path in zip(curves, paths, strict=True))
    return placed, drawn


def _too_close(first: Box, second: Box) -> bool:
    return (
        first.x < second.x + second.w + ASIDE
        and second.x < first.x + first.w + ASIDE
        and first.y < second.y + second.h + ABOVE
        and second.y < first.y + first.h + ABOVE
    )


MISSING_POSITIONS_ASIDE = 80.0


def position_missing(
    boxes: Sequence[Box],
    curves: Sequence[Curve],
    spec_positions: Mapping[str, Point],
    present: frozenset[str],
) -> tuple[Box, ...]:
    """Return the boxes, those without a position beside those that have one.

    `spec_positions` are the positions in the spec, `present` the keys of nodes in the file. A
    missing node keeps its distance to its neighbours in the spec. The box of a dangling source is
    left of the wire's target. Where most nodes of the file have no position (a script made them),
    no box gets one.
    """
    places = {box.key: box for box in boxes if box.key in present and box.at is not None}
    if 2 * len(places) < len(present):
        return tuple(replace(box, at=None) for box in boxes)
    for box in boxes:
        if box.key not in places and places:
            wanted = _wanted_position(box, curves, places, spec_positions)
            places[box.key] = _below_placed(replace(box, at=wanted), places.values())
    return tuple(places.get(box.key, box) for box in boxes)


def _wanted_position(
    box: Box,
    curves: Sequence[Curve],
    places: Mapping[str, Box],
    spec_positions: Mapping[str, Point],
) -> Point:
    if box.key in spec_positions:
        near = [key for key in _neighbours(box, curves) if key in places and key in spec_positions]
        near = near or [key for key in places if key in spec_positions]
        moves = []
        for key in near:
            left, top = places[key].at or spec_positions[key]
            moves.append((left - spec_positions[key][0], top - spec_positions[key][1]))
        if moves:
            return (
                spec_positions[box.key][0] + sum(move[0] for move in moves) / len(moves),
                spec_positions[box.key][1] + sum(move[1] for move in moves) / len(moves),
            )
    near = [key for key in _neighbours(box, curves) if key in places] or list(places)
    left, top = places[near[0]].at or (0.0, 0.0)
    return (left - box.w - MISSING_POSITIONS_ASIDE, top)


def _neighbours(box: Box, curves: Sequence[Curve]) -> Iterator[str]:
    for curve in curves:
        if curve.source.key == box.key:
            yield curve.target.key
        elif curve.target.key == box.key:
            yield curve.source.key


def _below_placed(box: Box, placed: Iterable[Box]) -> Box:
    """Return the box moved down until it overlaps none that is placed."""
    left, top = box.at or (0.0, 0.0)
    for obstacle in sorted(placed, key=lambda box: (box.at or (0.0, 0.0))[1]):
        x, y = obstacle.at or (0.0, 0.0)
        beside = left < x + obstacle.w + ABOVE and x < left + box.w + ABOVE
        if beside and top < y + obstacle.h + ABOVE and y < top + box.h + ABOVE:
            top = y + obstacle.h + ABOVE
    return replace(box, at=(left, top))


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

LINES: dict[Kind, tuple[str, str]] = {  # what whole and dashed lines mean
    "frames": ("published by the stage", "published elsewhere, or perhaps"),
    "topics": ("sent", "perhaps sent, or never"),
}
FAMILIES: dict[Kind, dict[Family, LegendEntry]] = {
    "frames": {"absent": LegendEntry("absent", "unknown: asset not found")},
    "topics": {
        "ros": LegendEntry("ros", "node"),
        "data": LegendEntry("family-data", "topic"),
        "absent": LegendEntry("absent", "not judged"),
    },
}
OF_GRAPHS: dict[Family, LegendEntry] = {
    "event": LegendEntry("event", "event"),
    "ros": LegendEntry("ros", "ROS 2"),
    "action": LegendEntry("action", "runs when triggered"),
    "data": LegendEntry("family-data", "gives data"),
}


def on_canvas(picture: Picture) -> Picture:
    """Return the picture moved to its position on the canvas, with legend and size."""
    corners = [(box.x, box.y) for box in picture.boxes]
    corners += [(box.x + box.w, box.y + box.h) for box in picture.boxes]
    if corners:
        low, high = _bounds(corners)
        # A curve stays among its control points: where boxes enclose these, they enclose it.
        corners += [
            point
            for curve in picture.curves
            for piece in curve.path
            if any(not (low[0] <= x <= high[0] and low[1] <= y <= high[1]) for x, y in piece)
            for point in points([piece])
        ]
    low, high = _bounds(corners or [(0.0, 0.0)])
    head = HEAD + REMARK_LINE * len(picture.remarks)
    texts = [text_width(picture.title, TITLE_SIZE, bold=True), text_width(picture.subtitle, 12.0)]
    texts += [ENTRY_TEXT + text_width(remark.text, 12.0, bold=True) for remark in picture.remarks]
    width = max(high[0] - low[0] + 2 * MARGIN, max(texts) + 2 * MARGIN, SMALLEST)
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


def _bounds(corners: Iterable[Point]) -> tuple[Point, Point]:
    """Return the lowest and the highest coordinates."""
    xs, ys = zip(*corners, strict=True)
    return (min(xs), min(ys)), (max(xs), max(ys))


def _moved(curve: Curve, across: float, down: float) -> Curve:
    path: list[Bezier] = []
    for piece in curve.path:
        start, first, second, end = ((x + across, y + down) for x, y in piece)
        path.append((start, first, second, end))
    return replace(curve, path=tuple(path))


def _legend_entries(picture: Picture) -> Iterator[LegendEntry]:
    """Yield the entries of what is drawn: kinds of lines, families of boxes, states."""
    texts = LINES.get(picture.kind, ("data wire", "execution wire"))
    for is_dashed, kind, text in zip((False, True), ("data", "execution"), texts, strict=True):
        if any(curve.dashed is is_dashed for curve in picture.curves):
            yield LegendEntry(kind, text)
    families = {box.family for box in picture.boxes}
    named = FAMILIES.get(picture.kind, OF_GRAPHS)
    yield from (entry for family, entry in named.items() if family in families)
    if picture.judged:
        seen = {box.frame for box in picture.boxes} | {curve.state for curve in picture.curves}
        seen |= {row.state for box in picture.boxes for row in box.rows}
        seen |= {remark.state for remark in picture.remarks}
        for state in STATES:
            if state in seen and state != "ok":
                word = state_word(state, picture.kind)
                text = f"{word}: not asked for" if word == "extra" else word
                yield LegendEntry(state, text)


def _in_lines(legend: Iterable[LegendEntry], width: float, top: float) -> Iterator[LegendEntry]:
    """Place the signs in lines from left to right."""
    left, line = MARGIN, top
    for entry in legend:
        takes = ENTRY_TEXT + text_width(entry.text, ENTRY_SIZE)
        if left > MARGIN and left + takes > width - MARGIN:
            left, line = MARGIN, line + LEGEND_LINE
        yield replace(entry, x=left, y=line)
        left += takes + ENTRY_SPACE
