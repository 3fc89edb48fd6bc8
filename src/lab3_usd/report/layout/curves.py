"""Bezier curves of wires and the points on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise

from lab3_usd.report.picture import Bezier, Point

STEPS = 24  # points looked at on each Bezier curve


def between(start: Point, end: Point) -> Bezier:
    """Return the curve that leaves `start` and enters `end` horizontally, and never turns back."""
    half = (end[0] - start[0]) / 2
    return (start, (start[0] + half, start[1]), (end[0] - half, end[1]), end)


def through(points: Sequence[Point]) -> tuple[Bezier, ...]:
    """Return the curves from each point to the next, without those of no length."""
    return tuple(between(start, end) for start, end in pairwise(points) if start != end)


def around(start: Point, end: Point, lane: float, bulge: float) -> tuple[Bezier, ...]:
    """Return the way back from `start` to an `end` on its left, along the height `lane`.

    It keeps within `bulge` right of `start` and left of `end`.
    """
    reach = bulge / 0.75  # a cubic curve goes three quarters of the way to its control points
    right = (start[0], lane)
    left = (end[0], lane)
    return (
        (start, (start[0] + reach, start[1]), (right[0] + reach, lane), right),
        (right, _part(right, left, 1 / 3), _part(right, left, 2 / 3), left),
        (left, (left[0] - reach, lane), (end[0] - reach, end[1]), end),
    )


def points(path: Sequence[Bezier], steps: int = STEPS) -> Iterator[Point]:
    """Yield points along a path, ends included."""
    weights = _all_weights(steps)
    for (x0, y0), (x1, y1), (x2, y2), (x3, y3) in path:
        for a, b, c, d in weights:
            yield a * x0 + b * x1 + c * x2 + d * x3, a * y0 + b * y1 + c * y2 + d * y3


def point_at(curve: Bezier, t: float) -> Point:
    """Return the point of one curve at `t` from 0 to 1."""
    return _weighed(curve, _weights(t))


@cache
def _all_weights(steps: int) -> list[tuple[float, float, float, float]]:
    return [_weights(step / steps) for step in range(steps + 1)]


def _weights(t: float) -> tuple[float, float, float, float]:
    return (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3


def _weighed(curve: Bezier, weights: tuple[float, float, float, float]) -> Point:
    a, b, c, d = weights
    start, leaving, arriving, end = curve
    return (
        a * start[0] + b * leaving[0] + c * arriving[0] + d * end[0],
        a * start[1] + b * leaving[1] + c * arriving[1] + d * end[1],
    )


def on_longest(path: Sequence[Bezier], t: float) -> Point:
    """Return a place for a mark: at `t` from 0 to 1 on the widest piece of the path."""
    longest = max(path, key=lambda curve: abs(curve[3][0] - curve[0][0]))
    return point_at(longest, t)


def _part(start: Point, end: Point, share: float) -> Point:
    return (start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)
