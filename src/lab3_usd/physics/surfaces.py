"""Shapes as triangles, and their intersections with a plane."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import chain, islice, pairwise
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.dry_run import AXES, LARGEST, Affine, ScenePrim, Segment, bounded
from lab3_usd.model.transforms import Vector

Triangle = tuple[Vector, Vector, Vector]
_Values = Mapping[str, Any]
SIDES = 32  # of a round shape; its corners lie on the surface
ENDLESS = 1e3
BOTH = 2  # sides of a plane, or segments that meet at a point
IN_LINE = 1e-9
_MOST_LEVELS = 16  # of one surface
_EVERY_SIDE = 0b111111  # of a box
_FEW = 500  # faces, of which triangles are kept
_MESH, _MEASURES = "Mesh", ("size", "radius", "height", "axis")
_BUFFERS = ("points", "faceVertexCounts", "faceVertexIndices")
TURN = {"X": (2, 0, 1), "Y": (1, 2, 0), "Z": (0, 1, 2)}  # where x, y, z of an upright shape go


class Surface(Struct, frozen=True, dict=True):
    """A surface of polygons: its points by coordinate, and the points of each face.

    `counts` are the numbers of points of the faces, `indices` these points, face after face. A
    mesh may have a million of them: nothing is made of a face that nobody asks for.
    """

    xs: Sequence[float]
    ys: Sequence[float]
    zs: Sequence[float]
    counts: Sequence[int]
    indices: Sequence[int]
    side: int = 0  # of its faces that others meet: by the order of their points, against it, both

    @cached_property
    def box(self) -> tuple[Vector, Vector]:
        """The lowest and the highest coordinates; reversed infinities where there is no point."""
        low, high = (
            [edge(column, default=default) for column in (self.xs, self.ys, self.zs)]
            for edge, default in ((min, math.inf), (max, -math.inf))
        )
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])

    def points(self) -> Iterator[Vector]:
        """Yield the points of the faces."""
        if isinstance(self.indices, range):  # of all points, one after the other
            yield from zip(self.xs, self.ys, self.zs, strict=True)
            return
        for number in sorted(set(self.indices)):
            if 0 <= number < len(self.xs):
                yield self.xs[number], self.ys[number], self.zs[number]

    def triangles(self) -> Iterator[Triangle]:
        """Yield every face in triangles."""
        yield from self._few if len(self.counts) <= _FEW else self._triangles()

    @cached_property
    def _few(self) -> Sequence[Triangle]:
        """The triangles of a small surface, as it is asked for many places what is below them."""
        return tuple(self._triangles())

    def _triangles(self) -> Iterator[Triangle]:
        for face in self._faces():
            yield from self._fan(face)

    def crossing(self, normal: Vector, offset: float) -> Iterator[Triangle]:
        """Yield the triangles of the faces that the plane normal * point = offset cuts."""
        a, b, c = normal
        if not self._is_near(normal, offset):
            return
        columns = zip(self.xs, self.ys, self.zs, strict=True)
        above = [a * x + b * y + c * z > offset for x, y, z in columns]
        if not any(above):
            return
        for face in self._faces():
            if len({above[number] for number in face}) == BOTH:
                yield from self._fan(face)

    def within(self, low: Vector, high: Vector) -> Iterator[Triangle]:
        """Yield the triangles of the faces that may reach into a box."""
        (a, b, c), (d, e, f) = low, high
        beside = [
            (x < a) | (x > d) << 1 | (y < b) << 2 | (y > e) << 3 | (z < c) << 4 | (z > f) << 5
            for x, y, z in zip(self.xs, self.ys, self.zs, strict=True)
        ]
        for face in self._faces():
            sides = _EVERY_SIDE
            for number in face:
                sides &= beside[number]
            if not sides:
                yield from self._fan(face)

    def level(self, height: float) -> Sequence[Segment]:
        """Return what the plane z = height cuts out of the surface."""
        lines = self._levels.get(height)
        if lines is None:
            if len(self._levels) >= _MOST_LEVELS:
                self._levels.clear()
            lines = self._levels[height] = sections(self.crossing((0.0, 0.0, 1.0), height), height)
        return lines

    @cached_property
    def _levels(self) -> dict[float, Sequence[Segment]]:
        """The last cuts: the plays of a class cut the same room where robot and lidar are."""
        return {}

    def _is_near(self, normal: Vector, offset: float) -> bool:
        """Whether a plane cuts the box of the surface."""
        low, high = self.box
        ends = [sorted((k * p, k * q)) for k, p, q in zip(normal, low, high, strict=True)]
        least, most = sum(end[0] for end in ends), sum(end[1] for end in ends)
        near = IN_LINE * (1 + abs(offset) + abs(least) + abs(most))  # rounding
        return least - near <= offset <= most + near

    def _faces(self) -> Iterator[Sequence[int]]:
        """Yield the points of each face whose points are all there."""
        at, last = 0, len(self.xs)
        is_sound = not self.indices or (min(self.indices) >= 0 and max(self.indices) < last)
        for count in self.counts:
            face = self.indices[at : at + count]
            at += count
            if len(face) == count and (is_sound or all(0 <= number < last for number in face)):
                yield face

    def _fan(self, face: Sequence[int]) -> Iterator[Triangle]:
        xs, ys, zs = self.xs, self.ys, self.zs
        return _fan([(xs[number], ys[number], zs[number]) for number in face])


def placed_surface(prim: ScenePrim, at: Affine) -> Surface:
    """Return the surface of a shape that stands at `at`, its scale included."""
    if prim.type == _MESH:
        return _mesh(prim.values, at)
    return _placed(prim.type, tuple(prim.values.get(name) for name in _MEASURES), at)


# What makes a solid of a mesh that does not move; others are triangles.
SOLID = ("convexHull", "convexDecomposition", "boundingCube", "boundingSphere", "sphereFill")


def ground_of(prim: ScenePrim, at: Affine) -> Surface:
    """Return the surface on which a robot stands: triangles and planes have one side (PhysX).

    It is that of the order of their points and of `orientation`, whatever `doubleSided` says.
    """
    surface = placed_surface(prim, at)
    if prim.type == "Plane":
        front = at.turn(AXES[TURN.get(str(prim.values.get("axis")), TURN["Z"]).index(2)])
        # usd-core takes a mirrored place as one with all three axes mirrored.
        is_up = (front[2] > 0) != is_mirrored(at)
        side = 1
        for (ax, ay, _), (bx, by, _), (cx, cy, _) in islice(surface.triangles(), 1):
            # Whether its points go round counterclockwise, seen from above.
            side = 1 if (bx - ax) * (cy - ay) - (cx - ax) * (by - ay) > 0 else -1
        return replace(surface, side=side if is_up else -side)
    if prim.type != _MESH or prim.values.get("physics:approximation") in SOLID:
        return surface
    return replace(surface, side=-1 if prim.values.get("orientation") == "leftHanded" else 1)


def is_mirrored(at: Affine) -> bool:
    """Whether a place makes the right hand a left one."""
    (a, b, c), (d, e, f), (g, h, i) = at.rows
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0


@lru_cache(maxsize=128)
def _placed(kind: str, measures: Sequence[Any], at: Affine) -> Surface:
    """Return the surface of a shape without points; the stages of a class have the same room."""
    maker = _MAKERS.get(kind)
    triangles = () if maker is None else maker(dict(zip(_MEASURES, measures, strict=True)))
    points = [at.point(point) for triangle in triangles for point in triangle]
    xs, ys, zs = (tuple(point[k] for point in points) for k in range(3))
    return Surface(xs, ys, zs, (3,) * (len(points) // 3), range(len(points)))


def _mesh(values: _Values, at: Affine) -> Surface:
    """Return the surface of a mesh, whose arrays are buffers."""
    flat, counts, indices = (_numbers(values.get(name)) for name in _BUFFERS)
    if flat and not (math.isfinite(sum(flat)) and -LARGEST <= min(flat) <= max(flat) <= LARGEST):
        flat = list(map(bounded, flat))
    x, y, z = (flat[k::3] for k in range(3))
    xs, ys, zs = (
        [a * p + b * q + c * r + w for p, q, r in zip(x, y, z, strict=True)]
        for (a, b, c), w in zip(at.rows, at.origin, strict=True)
    )
    return Surface(xs, ys, zs, counts, indices)


def _numbers(buffer: memoryview | None) -> list[Any]:
    """Return the numbers of a buffer, one after the other."""
    if buffer is None or not buffer.nbytes:
        return []
    numbers: list[Any] = buffer.cast("B").cast(buffer.format).tolist()  # type: ignore[call-overload]
    return numbers


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


def _plane(values: _Values) -> Iterator[Triangle]:
    """Return a square of half-width ENDLESS in place of an infinite collision plane."""
    order = TURN.get(str(values.get("axis")), TURN["Z"])
    corners = [(-ENDLESS, -ENDLESS, 0.0), (ENDLESS, -ENDLESS, 0.0)]
    corners += [(ENDLESS, ENDLESS, 0.0), (-ENDLESS, ENDLESS, 0.0)]
    turned = [tuple(corner[order.index(k)] for k in range(3)) for corner in corners]
    yield from _fan(turned)  # type: ignore[arg-type]


_MAKERS = {
    "Cube": _cube,
    "Sphere": lambda values: _lathe(values, _round(_number(values, "radius", 1.0), 0.0)),
    "Cylinder": _cylinder,
    "Capsule": lambda values: _lathe(
        values,
        _round(_number(values, "radius", 0.5), _number(values, "height", 1.0) / 2),
    ),
    "Cone": _cone,
    "Plane": _plane,
}


def straddling(surface: Surface, at: Affine) -> Iterator[Triangle]:
    """Yield the triangles of a surface that stands at `at`, where z = 0 cuts it."""
    for a, b, c in surface.crossing(at.rows[2], -at.origin[2]):
        yield at.point(a), at.point(b), at.point(c)


def sections(triangles: Iterable[Triangle], height: float) -> list[Segment]:
    """Return what the plane z = height cuts out of triangles."""
    segments = []
    for triangle in triangles:
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


def cut(surfaces: Iterable[Surface], height: float) -> list[Segment]:
    """Return what the plane z = height cuts out of surfaces."""
    return list(chain.from_iterable(surface.level(height) for surface in surfaces))


def height_at(surfaces: Iterable[Surface], x: float, y: float, below: float) -> float | None:
    """Return the height of the highest surface over (x, y) that is not above `below`."""
    heights = (_height_at(surface, x, y, below) for surface in surfaces)
    return max((height for height in heights if height is not None), default=None)


def _height_at(surface: Surface, x: float, y: float, below: float) -> float | None:
    (left, near, low), (right, far, _) = surface.box
    if not (left <= x <= right and near <= y <= far and low <= below):
        return None
    best = None
    for (ax, ay, az), (bx, by, bz), (cx, cy, cz) in surface.triangles():
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if not area or area * surface.side < 0:
            continue
        s = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
        t = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
        if s >= 0 and t >= 0 and s + t <= 1:
            z = az + s * (bz - az) + t * (cz - az)
            if z <= below and (best is None or z > best):
                best = z
    return best


def distance_to_segments(segments: Sequence[Segment], x: float, y: float) -> float:
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


def joined_segments(segments: Sequence[Segment]) -> list[Segment]:
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
