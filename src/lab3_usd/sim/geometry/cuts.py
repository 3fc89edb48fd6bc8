"""What a plane cuts out of triangles, and how far its segments are."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lab3_usd.model.dry_run.behaviour import Segment
from lab3_usd.sim.geometry.shapes import Triangle

BOTH = 2  # segments that meet at a point
IN_LINE = 1e-9


def cut(surface: Sequence[Triangle], height: float) -> list[Segment]:
    """Return what the plane z = height cuts out of triangles."""
    found = []
    for triangle in surface:
        (_, _, a), (_, _, b), (_, _, c) = triangle
        if (a > height and b > height and c > height) or (
            a <= height and b <= height and c <= height
        ):
            continue
        ends: list[float] = []
        for one, other in ((0, 1), (1, 2), (2, 0)):
            (x, y, z), (u, v, w) = triangle[one], triangle[other]
            if (z > height) != (w > height):
                k = (height - z) / (w - z)
                ends += (x + k * (u - x), y + k * (v - y))
        found.append((ends[0], ends[1], ends[2], ends[3]))
    return found


def height_at(surface: Sequence[Triangle], x: float, y: float, below: float) -> float | None:
    """Return the height of the highest triangle over (x, y) that is not above `below`."""
    best = None
    for (ax, ay, az), (bx, by, bz), (cx, cy, cz) in surface:
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if not area:
            continue
        s = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
        t = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
        if s >= 0 and t >= 0 and s + t <= 1:
            z = az + s * (bz - az) + t * (cz - az)
            if z <= below and (best is None or z > best):
                best = z
    return best


def distance(segments: Sequence[Segment], x: float, y: float) -> float:
    """Return how far the nearest segment is."""
    best = math.inf
    for ax, ay, bx, by in segments:
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        k = ((x - ax) * dx + (y - ay) * dy) / square if square else 0.0
        k = 0.0 if k < 0 else min(k, 1.0)
        gap = (ax + k * dx - x) ** 2 + (ay + k * dy - y) ** 2
        best = min(best, gap)
    return math.sqrt(best)


def joined(segments: Sequence[Segment]) -> list[Segment]:
    """Make one of two segments that go on in a line, as the halves of a face do."""
    ends: dict[tuple[float, float], list[int]] = {}
    found: list[Segment | None] = list(segments)
    for number, (ax, ay, bx, by) in enumerate(segments):
        for x, y in ((ax, ay), (bx, by)):
            ends.setdefault((round(x, 6), round(y, 6)), []).append(number)
    for (x, y), pair in ends.items():
        if len(pair) != BOTH:
            continue
        one, other = found[pair[0]], found[pair[1]]
        if one is None or other is None or pair[0] == pair[1]:
            continue
        (p, q), (u, v) = _far_end(one, x, y), _far_end(other, x, y)
        if abs((p - x) * (v - y) - (q - y) * (u - x)) < IN_LINE:
            found[pair[0]], found[pair[1]] = None, (p, q, u, v)
            at = ends[round(p, 6), round(q, 6)]
            at[at.index(pair[0])] = pair[1]
    return [each for each in found if each is not None]


def _far_end(segment: Segment, x: float, y: float) -> tuple[float, float]:
    ax, ay, bx, by = segment
    near = abs(ax - x) + abs(ay - y) < abs(bx - x) + abs(by - y)
    return (bx, by) if near else (ax, ay)
