"""Routes of wires between boxes, and their Bezier curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from lab3_usd.report.picture.model import Bezier, Box, Curve, End, Point, port_point

STEPS = 24  # points looked at on each Bezier curve


def between(start: Point, end: Point) -> Bezier:
    """Return the curve that leaves `start` and enters `end` horizontally, and never turns back."""
    half = (end[0] - start[0]) / 2
    return (start, (start[0] + half, start[1]), (end[0] - half, end[1]), end)


def through(points: Sequence[Point]) -> tuple[Bezier, ...]:
    """Return the curves from each point to the next, without those of no length."""
    return tuple(between(start, end) for start, end in pairwise(points) if start != end)


def around(start: Point, end: Point, lane: float, bulge: float) -> tuple[Bezier, ...]:
    """Return the path from `start` to `end` that goes left along the height `lane`.

    It keeps within `bulge` right and left of both.
    """
    reach = bulge / 0.75  # a cubic curve goes three quarters of the way to its control points
    right = (max(start[0], end[0]), lane)
    left = (min(start[0], end[0]), lane)
    along = (right, _part(right, left, 1 / 3), _part(right, left, 2 / 3), left)
    return (
        (start, (right[0] + reach, start[1]), (right[0] + reach, lane), right),
        *((along,) if right != left else ()),
        (left, (left[0] - reach, lane), (left[0] - reach, end[1]), end),
    )


def bent(start: Point, end: Point, reach: float) -> tuple[Bezier, ...]:
    """Return the curve between two points that are nearly above each other, as an S."""
    return ((start, (start[0] + reach, start[1]), (end[0] - reach, end[1]), end),)


def points(path: Sequence[Bezier]) -> Iterator[Point]:
    """Yield points along a path, ends included."""
    for (x0, y0), (x1, y1), (x2, y2), (x3, y3) in path:
        for a, b, c, d in _ALONG:
            yield a * x0 + b * x1 + c * x2 + d * x3, a * y0 + b * y1 + c * y2 + d * y3


def point_at(curve: Bezier, t: float) -> Point:
    """Return the point of one curve at `t` from 0 to 1."""
    a, b, c, d = _weights(t)
    start, leaving, arriving, end = curve
    return (
        a * start[0] + b * leaving[0] + c * arriving[0] + d * end[0],
        a * start[1] + b * leaving[1] + c * arriving[1] + d * end[1],
    )


def _weights(t: float) -> tuple[float, float, float, float]:
    return (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3


_ALONG = [_weights(step / STEPS) for step in range(STEPS + 1)]


def on_longest(path: Sequence[Bezier], t: float) -> Point:
    """Return a place for a mark: at `t` from 0 to 1 on the widest piece of the path."""
    longest = max(path, key=lambda curve: abs(curve[3][0] - curve[0][0]))
    return point_at(longest, t)


def _part(start: Point, end: Point, share: float) -> Point:
    return (start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)


CLEAR = 6.0  # how far a wire stays away from other boxes
LANE_CLEAR = 9.0  # how far lanes of different outputs stay apart
OUTSIDE = 14.0  # from a box to the lane that passes above or below it
ROUTING_STEPS = (0.0, 11.0, 22.0)  # lanes beside each other
TURNS = (28.0, 44.0, 60.0, 80.0, 100.0)  # lengths of the bend between a port and a lane
STEEP = 0.3  # the length that suits a bend, as a share of its height
BULGE = 26.0
NEAREST = 36.0  # a wire between ports nearer than this is bent as an S

Path = tuple[Bezier, ...]


# Lanes in use: height, left and right end, and the output whose wire runs there.
Lanes = list[tuple[float, float, float, End]]


def routed(boxes: Sequence[Box], curves: Sequence[Curve]) -> tuple[Path, ...] | None:
    """Return a path for each curve that crosses no box; None where one has no such path."""
    by_key = {box.key: box for box in boxes}
    lanes: Lanes = []
    paths = []
    for curve in curves:
        path = _route(curve, by_key, lanes)
        if path is None:
            return None
        paths.append(path)
    return tuple(paths)


def crosses(path: Path, curve: Curve, boxes: Mapping[str, Box]) -> bool:
    """Whether a path comes too near to a box, its own two ends excepted."""
    own = {curve.source.key, curve.target.key}
    for piece in path:
        walls = []
        for box in _near(piece, boxes):
            margin = -1.0 if box.key in own else CLEAR
            sides = (box.x - margin, box.x + box.w + margin)
            walls.append((*sides, box.y - margin, box.y + box.h + margin))
        if walls and any(
            left < x < right and top < y < bottom
            for x, y in points((piece,))
            for left, right, top, bottom in walls
        ):
            return True
    return False


def _near(piece: Bezier, boxes: Mapping[str, Box]) -> list[Box]:
    """Return the boxes that a curve may touch: those near the box around its control points."""
    xs, ys = [point[0] for point in piece], [point[1] for point in piece]
    left, right, top, bottom = min(xs), max(xs), min(ys), max(ys)
    return [
        box
        for box in boxes.values()
        if left < box.x + box.w + CLEAR
        and box.x - CLEAR < right
        and top < box.y + box.h + CLEAR
        and box.y - CLEAR < bottom
    ]


def _route(curve: Curve, boxes: Mapping[str, Box], lanes: Lanes) -> Path | None:
    start = port_point(boxes[curve.source.key], curve.source.port, leaving=True)
    end = port_point(boxes[curve.target.key], curve.target.port, leaving=False)
    if end[0] > start[0]:
        is_near = end[0] - start[0] < NEAREST
        direct = bent(start, end, NEAREST) if is_near else through([start, end])
        if not crosses(direct, curve, boxes):
            return direct
    for height in _heights(start, end, boxes):
        for path, left, right in _paths_along(start, end, height):
            is_free = not any(  # of wires of other outputs
                abs(height - lane) < LANE_CLEAR and left < lane_end and lane_start < right
                for lane, lane_start, lane_end, owner in lanes
                if owner != curve.source
            )
            if is_free and not crosses(path, curve, boxes):
                lanes.append((height, left, right, curve.source))
                return path
    return None


def _heights(start: Point, end: Point, boxes: Mapping[str, Box]) -> list[float]:
    """Return the heights of lanes above and below every box, those with the least detour first."""
    heights = {start[1], end[1]}
    for box in boxes.values():
        for step in ROUTING_STEPS:
            heights |= {box.y - OUTSIDE - step, box.y + box.h + OUTSIDE + step}
    return sorted(heights, key=lambda y: (abs(y - start[1]) + abs(y - end[1]), y))


def _paths_along(start: Point, end: Point, height: float) -> Iterator[tuple[Path, float, float]]:
    """Yield paths along one height, each with the ends of its lane."""
    rise = max(abs(height - start[1]), abs(height - end[1]))
    suits = max(44.0, min(STEEP * rise, 100.0))
    for turn in sorted(TURNS, key=lambda turn: (abs(turn - suits), turn)):
        left, right = start[0] + turn, end[0] - turn
        if left < right:
            yield through([start, (left, height), (right, height), end]), left, right
    if height not in {start[1], end[1]}:
        yield around(start, end, height, BULGE), min(start[0], end[0]), max(start[0], end[0])
