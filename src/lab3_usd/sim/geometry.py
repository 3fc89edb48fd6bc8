"""Shapes as triangles, and their intersections with a plane."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

from lab3_usd.model.dry_run import Affine, ScenePrim, Segment
from lab3_usd.model.transforms import Vector

Triangle = tuple[Vector, Vector, Vector]
_Values = Mapping[str, Any]
SIDES = 32  # of a round shape; its corners lie on the surface
ENDLESS = 1e3
_MESH, _MEASURES = "Mesh", ("size", "radius", "height", "axis")
TURN = {"X": (2, 0, 1), "Y": (1, 2, 0), "Z": (0, 1, 2)}  # where x, y, z of an upright shape go


def placed(prim: ScenePrim, at: Affine) -> Sequence[Triangle]:
    """Return the surface of a shape that stands at `at`, its scale included."""
    if prim.type == _MESH:
        return _at(at, _mesh(prim.values))
    return _placed(prim.type, tuple(prim.values.get(name) for name in _MEASURES), at)


@lru_cache(maxsize=128)
def _placed(kind: str, measures: Sequence[Any], at: Affine) -> Sequence[Triangle]:
    """Return the surface of a shape without points; the stages of a class have the same room."""
    maker = _MAKERS.get(kind)
    return () if maker is None else _at(at, maker(dict(zip(_MEASURES, measures, strict=True))))


def _at(at: Affine, surface: Iterable[Triangle]) -> Sequence[Triangle]:
    return tuple((at.point(a), at.point(b), at.point(c)) for a, b, c in surface)


def _number(values: _Values, name: str, default: float) -> float:
    value = values.get(name)
    return default if value is None else float(value)


def _cube(values: _Values) -> Iterator[Triangle]:
    h = _number(values, "size", 2.0) / 2
    corners = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    for face in (
        (0, 1, 3, 2),
        (4, 6, 7, 5),
        (0, 4, 5, 1),
        (2, 3, 7, 6),
        (0, 2, 6, 4),
        (1, 5, 7, 3),
    ):
        yield from _fan([corners[number] for number in face])


def _fan(points: Sequence[Vector]) -> Iterator[Triangle]:
    for second, third in pairwise(points[1:]):
        yield points[0], second, third


def _lathe(values: _Values, profile: Sequence[tuple[float, float]]) -> Iterator[Triangle]:
    """Turn a profile of (radius, height) about the axis of the shape."""
    order = TURN.get(str(values.get("axis")), TURN["Z"])
    rings = []
    for radius, height in profile:
        ring = []
        for k in range(SIDES):
            angle = 2 * math.pi * k / SIDES
            upright = (radius * math.cos(angle), radius * math.sin(angle), height)
            ring.append((upright[order.index(0)], upright[order.index(1)], upright[order.index(2)]))
        rings.append(ring)
    for low, high in pairwise(rings):
        for k in range(SIDES):
            n = (k + 1) % SIDES
            yield low[k], low[n], high[n]
            yield low[k], high[n], high[k]


def _cylinder(values: _Values) -> Iterator[Triangle]:
    r, h = _number(values, "radius", 1.0), _number(values, "height", 2.0) / 2
    return _lathe(values, [(0.0, -h), (r, -h), (r, h), (0.0, h)])


def _cone(values: _Values) -> Iterator[Triangle]:
    r, h = _number(values, "radius", 1.0), _number(values, "height", 2.0) / 2
    return _lathe(values, [(0.0, -h), (r, -h), (0.0, h)])


def _round(radius: float, half: float) -> list[tuple[float, float]]:
    """Return the profile of a capsule; of a sphere where its cylinder has no height."""
    rows = SIDES // 4
    angles = [math.pi / 2 * k / rows for k in range(rows + 1)]
    top = [(radius * math.cos(a), half + radius * math.sin(a)) for a in angles]
    return [*((r, -h) for r, h in reversed(top)), *top]


def _sphere(values: _Values) -> Iterator[Triangle]:
    return _lathe(values, _round(_number(values, "radius", 1.0), 0.0))


def _capsule(values: _Values) -> Iterator[Triangle]:
    half = _number(values, "height", 1.0) / 2
    return _lathe(values, _round(_number(values, "radius", 0.5), half))


def _plane(values: _Values) -> Iterator[Triangle]:
    """Return a square, as large as its collision is endless."""
    order = TURN.get(str(values.get("axis")), TURN["Z"])
    corners = [(-ENDLESS, -ENDLESS, 0.0), (ENDLESS, -ENDLESS, 0.0)]
    corners += [(ENDLESS, ENDLESS, 0.0), (-ENDLESS, ENDLESS, 0.0)]
    turned = [tuple(corner[order.index(k)] for k in range(3)) for corner in corners]
    yield from _fan(turned)  # type: ignore[arg-type]


def _mesh(values: _Values) -> Iterator[Triangle]:
    points = values.get("points") or ()
    indices = values.get("faceVertexIndices") or ()
    at = 0
    for count in values.get("faceVertexCounts") or ():
        face = indices[at : at + count]
        at += count
        if len(face) == count and all(0 <= number < len(points) for number in face):
            yield from _fan([points[number] for number in face])


_MAKERS = {
    "Cube": _cube,
    "Sphere": _sphere,
    "Cylinder": _cylinder,
    "Capsule": _capsule,
    "Cone": _cone,
    "Plane": _plane,
}


BOTH = 2  # segments that meet at a point
IN_LINE = 1e-9


def straddling(surface: Sequence[Triangle], at: Affine) -> Iterator[Triangle]:
    """Yield the triangles of a surface that stands at `at`, where z = 0 cuts it."""
    _, _, (g, h, i) = at.rows
    _, _, w = at.origin
    for (x, y, z), (p, q, r), (s, t, u) in surface:
        above = g * x + h * y + i * z + w > 0
        if (g * p + h * q + i * r + w > 0) != above or (g * s + h * t + i * u + w > 0) != above:
            yield at.point((x, y, z)), at.point((p, q, r)), at.point((s, t, u))


def cut(surface: Sequence[Triangle], height: float) -> list[Segment]:
    """Return what the plane z = height cuts out of triangles."""
    segments = []
    for triangle in surface:
        (_, _, a), (_, _, b), (_, _, c) = triangle
        if (a > height and b > height and c > height) or (
            a <= height and b <= height and c <= height
        ):
            continue
        ends: list[float] = []
        for start, end in ((0, 1), (1, 2), (2, 0)):
            (x, y, z), (u, v, w) = triangle[start], triangle[end]
            if (z > height) != (w > height):
                k = (height - z) / (w - z)
                ends += (x + k * (u - x), y + k * (v - y))
        segments.append((ends[0], ends[1], ends[2], ends[3]))
    return segments


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
    remaining: list[Segment | None] = list(segments)
    for number, (ax, ay, bx, by) in enumerate(segments):
        for x, y in ((ax, ay), (bx, by)):
            ends.setdefault((round(x, 6), round(y, 6)), []).append(number)
    for (x, y), pair in ends.items():
        if len(pair) != BOTH:
            continue
        first, second = remaining[pair[0]], remaining[pair[1]]
        if first is None or second is None or pair[0] == pair[1]:
            continue
        (p, q), (u, v) = _far_end(first, x, y), _far_end(second, x, y)
        if abs((p - x) * (v - y) - (q - y) * (u - x)) < IN_LINE:
            remaining[pair[0]], remaining[pair[1]] = None, (p, q, u, v)
            at = ends[round(p, 6), round(q, 6)]
            at[at.index(pair[0])] = pair[1]
    return [segment for segment in remaining if segment is not None]


def _far_end(segment: Segment, x: float, y: float) -> tuple[float, float]:
    ax, ay, bx, by = segment
    near = abs(ax - x) + abs(ay - y) < abs(bx - x) + abs(by - y)
    return (bx, by) if near else (ax, ay)
