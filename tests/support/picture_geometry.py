"""What the tests of pictures ask of geometry: who overlaps whom, and which wire crosses what."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise

from lab3_usd.report.picture.model import HEADER, Box, Curve, Picture, Point
from lab3_usd.report.picture.routing import point_at

STEPS = 60


def along(curve: Curve) -> Iterator[Point]:
    """Yield points along a curve, more than the layout looks at."""
    for piece in curve.path:
        yield from (point_at(piece, step / STEPS) for step in range(STEPS + 1))


def overlapping(boxes: tuple[Box, ...]) -> list[tuple[str, str]]:
    """The pairs of boxes that share ground."""
    return [
        (one.key, other.key)
        for one, other in combinations(boxes, 2)
        if one.x < other.x + other.w
        and other.x < one.x + one.w
        and one.y < other.y + other.h
        and other.y < one.y + one.h
    ]


def crossings(boxes: tuple[Box, ...], curves: tuple[Curve, ...]) -> list[tuple[str, str]]:
    """The wires, by target port, that come inside a box, be it one of their own."""
    return [
        (f"{curve.target.key}.{curve.target.port}", box.key)
        for curve in curves
        for box in boxes
        if any(_is_inside(point, box, 0.5) for point in along(curve))
    ]


def through_titles(boxes: tuple[Box, ...], curves: tuple[Curve, ...]) -> list[str]:
    """The boxes whose header a wire crosses."""
    return [
        box.key
        for curve in curves
        for box in boxes
        for x, y in along(curve)
        if box.x + 1 < x < box.x + box.w - 1 and box.y < y < box.y + HEADER
    ]


def loose_ends(boxes: tuple[Box, ...], curves: tuple[Curve, ...]) -> list[str]:
    """The wires whose path does not lead from port to port without a break."""
    places = {box.key: box for box in boxes}
    return [curve.target.port for curve in curves if not _is_whole(curve, places)]


def outside(picture: Picture) -> Iterator[str]:
    """Name what does not lie within the picture."""
    for box in picture.boxes:
        if box.x < 0 or box.y < 0 or box.x + box.w > picture.width:
            yield box.key
    for curve in picture.curves:
        for x, y in along(curve):
            if not (0 <= x <= picture.width and 0 <= y <= picture.height):
                yield curve.target.port


def _is_whole(curve: Curve, places: dict[str, Box]) -> bool:
    source, target = places[curve.source.key], places[curve.target.key]
    first, last = curve.path[0][0], curve.path[-1][3]
    joined = all(one[3] == other[0] for one, other in pairwise(curve.path))
    return (
        joined
        and first == (source.x + source.w, source.y + _height(source, curve.source.port))
        and last == (target.x, target.y + _height(target, curve.target.port))
    )


def _height(box: Box, port: str) -> float:
    row = box.row(port)
    return HEADER / 2 if row is None else row.y


def _is_inside(point: tuple[float, float], box: Box, margin: float) -> bool:
    return (
        box.x + margin < point[0] < box.x + box.w - margin
        and box.y + margin < point[1] < box.y + box.h - margin
    )
