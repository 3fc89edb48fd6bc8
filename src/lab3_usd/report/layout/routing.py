"""Routes of wires between boxes at any position: direct, or along a free lane."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from lab3_usd.report.layout.curves import around, points, through
from lab3_usd.report.picture import Bezier, Box, Curve, End, Point, port_point

CLEAR = 6.0  # how far a wire stays away from other boxes
LANE_CLEAR = 9.0  # how far lanes of different outputs stay apart
OUTSIDE = 14.0  # from a box to the lane that passes above or below it
STEPS = (0.0, 11.0, 22.0)  # lanes beside each other
TURNS = (28.0, 44.0, 60.0, 80.0, 100.0)  # lengths of the bend between a port and a lane
STEEP = 0.3  # the length that suits a bend, as a share of its height
BULGE = 26.0
NEAREST = 36.0  # a wire this short bends sharply and takes the way around

Path = tuple[Bezier, ...]


@dataclass(slots=True)
class Lanes:
    """Lanes in use: height, left and right end, and the output whose wire runs there."""

    used: list[tuple[float, float, float, End]] = field(default_factory=list)

    def free(self, height: float, left: float, right: float, source: End) -> bool:
        """Whether no wire of another output runs here."""
        return not any(
            abs(height - other) < LANE_CLEAR and left < end and start < right
            for other, start, end, owner in self.used
            if owner != source
        )


def routed(boxes: Sequence[Box], curves: Sequence[Curve]) -> tuple[Path, ...] | None:
    """Return a path for each curve that crosses no box; None where one has no such path."""
    by_key = {box.key: box for box in boxes}
    lanes = Lanes()
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
        near = _near(piece, boxes)
        walls = [_walls(box, -1.0 if box.key in own else CLEAR) for box in near]
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


def _walls(box: Box, margin: float) -> tuple[float, float, float, float]:
    """Return left, right, top and bottom of a box with room around it."""
    return (
        box.x - margin,
        box.x + box.w + margin,
        box.y - margin,
        box.y + box.h + margin,
    )


def _route(curve: Curve, boxes: Mapping[str, Box], lanes: Lanes) -> Path | None:
    start = port_point(boxes[curve.source.key], curve.source.port, leaving=True)
    end = port_point(boxes[curve.target.key], curve.target.port, leaving=False)
    if end[0] - start[0] >= NEAREST:
        direct = through([start, end])
        if not crosses(direct, curve, boxes):
            return direct
    for height in _heights(start, end, boxes):
        for path, left, right in _along(start, end, height):
            if lanes.free(height, left, right, curve.source) and not crosses(path, curve, boxes):
                lanes.used.append((height, left, right, curve.source))
                return path
    return None


def _heights(start: Point, end: Point, boxes: Mapping[str, Box]) -> list[float]:
    """Return the heights of lanes above and below every box, those with the least detour first."""
    heights = {start[1], end[1]}
    for box in boxes.values():
        for step in STEPS:
            heights |= {box.y - OUTSIDE - step, box.y + box.h + OUTSIDE + step}
    return sorted(heights, key=lambda y: (abs(y - start[1]) + abs(y - end[1]), y))


def _along(start: Point, end: Point, height: float) -> Iterator[tuple[Path, float, float]]:
    """Yield paths along one height, each with the ends of its lane."""
    rise = max(abs(height - start[1]), abs(height - end[1]))
    suits = max(44.0, min(STEEP * rise, 100.0))
    for turn in sorted(TURNS, key=lambda turn: (abs(turn - suits), turn)):
        left, right = start[0] + turn, end[0] - turn
        if left < right:
            yield through([start, (left, height), (right, height), end]), left, right
    if height not in {start[1], end[1]}:
        yield around(start, end, height, BULGE), min(start[0], end[0]), max(start[0], end[0])
