"""A layered layout: boxes in columns from left to right, wires only where no box stands.

A wire that skips columns gets a lane of its own through each of them, so it cannot cross a box;
a wire that runs backward passes below all boxes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.report.layout.curves import around, through
from lab3_usd.report.layout.ordering import Columns, Link, Slot, SlotKey, ordered
from lab3_usd.report.layout.ranks import backward, ranks
from lab3_usd.report.layout.stacking import stacked
from lab3_usd.report.picture import Bezier, Box, Curve, End, Point, port_point

GAP = 26.0  # between two boxes of a column
LANE = 12.0  # the height that a passing wire takes up in a column
BETWEEN = 70.0  # between two columns, and a little more for every wire there
PER_WIRE = 4.0
MOST_BETWEEN = 156.0
BELOW = 34.0  # from the lowest box to the first wire that runs backward
BULGE = 26.0

Placed = tuple[tuple[Box, ...], tuple[Curve, ...]]


class Grid(Struct, frozen=True):
    """The columns: left edge and width of each, and the top of each slot."""

    lefts: tuple[float, ...]
    widths: tuple[float, ...]
    tops: Mapping[SlotKey, float]
    rank: Mapping[str, int]


def layered(boxes: Sequence[Box], curves: Sequence[Curve]) -> Placed:
    """Return the boxes at their places and the curves with their paths; the highest is at 0."""
    keys = [box.key for box in boxes]
    edges = [(curve.source.key, curve.target.key) for curve in curves]
    against = backward(keys, edges)
    forward = [edge for place, edge in enumerate(edges) if place not in against]
    rank = ranks(keys, forward)
    onward = [curve for place, curve in enumerate(curves) if place not in against]
    lasts = _last_ranks(onward, rank)
    slots = [Slot((box.key,), rank[box.key], box.h) for box in boxes]
    slots += [
        Slot(_lane(end, column), column, LANE, lane=True)
        for end, last in lasts.items()
        for column in range(rank[end.key] + 1, last)
    ]
    by_key = {box.key: box for box in boxes}
    links = list(_links(onward, lasts, by_key, rank))
    columns = ordered(slots, links)
    grid = _grid(columns, links, by_key, rank)
    placed = {box.key: _placed(box, grid) for box in boxes}
    back = [curves[place] for place in sorted(against)]
    lanes = _return_lanes(back, placed, grid)
    drawn = tuple(
        replace(curve, path=_back(curve, placed, lanes[curve.source]))
        if place in against
        else replace(curve, path=_along(curve, placed, grid))
        for place, curve in enumerate(curves)
    )
    return tuple(placed.values()), drawn


def _last_ranks(curves: Sequence[Curve], rank: Mapping[str, int]) -> dict[End, int]:
    """Return, per output, the column of the farthest box that it feeds."""
    lasts: dict[End, int] = {}
    for curve in curves:
        column = rank[curve.target.key]
        lasts[curve.source] = max(column, lasts.get(curve.source, column))
    return lasts


def _lane(end: End, column: int) -> SlotKey:
    return (end.key, end.port, str(column))


def _links(
    curves: Sequence[Curve],
    lasts: Mapping[End, int],
    boxes: Mapping[str, Box],
    rank: Mapping[str, int],
) -> Iterator[Link]:
    """Yield the pieces of wire between neighbouring columns; lanes of one output are shared."""
    for end, last in lasts.items():
        for column in range(rank[end.key] + 1, last):
            yield Link(*_left(end, column - 1, boxes, rank), _lane(end, column), LANE / 2)
    for curve in curves:
        column = rank[curve.target.key]
        arrival = port_point(
            replace(boxes[curve.target.key], y=0.0), curve.target.port, leaving=False
        )
        yield Link(*_left(curve.source, column - 1, boxes, rank), (curve.target.key,), arrival[1])


def _left(
    end: End, column: int, boxes: Mapping[str, Box], rank: Mapping[str, int]
) -> tuple[SlotKey, float]:
    if column == rank[end.key]:
        departure = port_point(replace(boxes[end.key], y=0.0), end.port, leaving=True)
        return (end.key,), departure[1]
    return _lane(end, column), LANE / 2


def _grid(
    columns: Columns, links: Sequence[Link], boxes: Mapping[str, Box], rank: Mapping[str, int]
) -> Grid:
    crowd = [0] * len(columns)
    home = {slot.key: slot.rank for column in columns for slot in column}
    for link in links:
        crowd[home[link.left]] += 1
    widths = tuple(
        max((boxes[slot.key[0]].w for slot in column if not slot.lane), default=0.0)
        for column in columns
    )
    lefts = []
    left = 0.0
    for width, wires in zip(widths, crowd, strict=True):
        lefts.append(left)
        left += width + min(BETWEEN + PER_WIRE * wires, MOST_BETWEEN)
    return Grid(tuple(lefts), widths, stacked(columns, links, GAP), rank)


def _placed(box: Box, grid: Grid) -> Box:
    column = grid.rank[box.key]
    return replace(box, x=grid.lefts[column], y=grid.tops[(box.key,)], w=grid.widths[column])


def _along(curve: Curve, boxes: Mapping[str, Box], grid: Grid) -> tuple[Bezier, ...]:
    """Return the way rightward: from column to column, and along its lane through each."""
    start, end = _ends(curve, boxes)
    way: list[Point] = [start]
    for column in range(grid.rank[curve.source.key] + 1, grid.rank[curve.target.key]):
        height = grid.tops[_lane(curve.source, column)] + LANE / 2
        left = grid.lefts[column]
        way += [(left, height), (left + grid.widths[column], height)]
    return through([*way, end])


def _return_lanes(
    curves: Sequence[Curve], boxes: Mapping[str, Box], grid: Grid
) -> dict[End, float]:
    """Return the height below everything at which each output's wires run backward."""
    lowest = max((box.y + box.h for box in boxes.values()), default=0.0)
    lowest = max([lowest, *grid.tops.values()])
    outputs = list({curve.source: None for curve in curves})
    return {end: lowest + BELOW + LANE * number for number, end in enumerate(outputs)}


def _back(curve: Curve, boxes: Mapping[str, Box], lane: float) -> tuple[Bezier, ...]:
    start, end = _ends(curve, boxes)
    return around(start, end, lane, BULGE)


def _ends(curve: Curve, boxes: Mapping[str, Box]) -> tuple[Point, Point]:
    return (
        port_point(boxes[curve.source.key], curve.source.port, leaving=True),
        port_point(boxes[curve.target.key], curve.target.port, leaving=False),
    )
