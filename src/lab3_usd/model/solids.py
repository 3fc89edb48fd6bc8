"""Collision shapes as PhysX sees them: what is lowest of them, their volume and its centre.

Round shapes are round here, not polygons. One that is scaled unevenly across its axis has the
largest scale there, as in PhysX (omni.usdphysics/plugins/Collision.cpp:132-310).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import nsmallest
from operator import itemgetter
from typing import Any

from msgspec import Struct

from lab3_usd.model.dry_run import Affine, ScenePrim
from lab3_usd.model.transforms import Vector, box_of, cross, length, minus, scaled

_RING = 16  # points of an upright disc
_UPRIGHT = 0.98  # of the cosine between an axis and the vertical, from which on a disc lies flat
_MANY, _FEW = 2000, 500  # points of a mesh, beyond which only so many count, the lowest
BALLS, DISCS = ("Sphere", "Capsule"), ("Cylinder", "Cone")


class Solid(Struct, frozen=True):
    """A shape by its corners, each the centre of a ball or of a disc about `axis`.

    `points` are the corners, `radii` the radius of each. A box or a mesh has none. `axis` has
    length 1; None where the corners are balls.
    """

    path: str
    kind: str
    points: Sequence[Vector]
    radii: Sequence[float] = ()
    axis: Vector | None = None

    @property
    def centre(self) -> Vector:
        """The middle of its volume; of a mesh that of the box around it."""
        if self.kind == "Cone":
            base, top = self.points
            return _between(base, top, 0.25)
        if not self.points:
            return (0.0, 0.0, 0.0)
        return _between(*box_of(self.points), 0.5)

    @property
    def volume(self) -> float:
        """Its volume; of a mesh that of the box around it."""
        if not self.points:
            return 0.0
        r = self.radii[0] if self.radii else 0.0
        high = length(minus(self.points[-1], self.points[0])) if self.radii else 0.0
        ball, disc = 4 / 3 * math.pi * r**3, math.pi * r * r
        round_ones = {
            "Sphere": ball,
            "Capsule": ball + disc * high,
            "Cylinder": disc * high,
            "Cone": disc * high / 3,
        }
        if self.kind in round_ones:
            return round_ones[self.kind]
        if self.kind == "Cube":
            a, b, c = (minus(self.points[k], self.points[0]) for k in (4, 2, 1))
            x, y, z = cross(a, b)
            return abs(x * c[0] + y * c[1] + z * c[2])
        low, high_corner = box_of(self.points)
        return math.prod(b - a for a, b in zip(low, high_corner, strict=True))

    def moved(self, at: Affine) -> Solid:
        """Return it at another place, which has no scale."""
        axis = None if self.axis is None else at.turn(self.axis)
        points = tuple(at.point(point) for point in self.points)
        return Solid(self.path, self.kind, points, self.radii, axis)

    def lowest(self) -> Iterator[Vector]:
        """Yield the points that could touch the ground below it, as it is turned now."""
        if self.axis is None:
            radii = self.radii or (0.0,) * len(self.points)
            for (x, y, z), r in zip(self.points, radii, strict=True):
                yield (x, y, z - r)
            return
        a, b, c = self.axis
        flat = math.hypot(a, b)
        for (x, y, z), r in zip(self.points, self.radii, strict=True):
            if flat and not (r and abs(c) > _UPRIGHT):
                # Down, across the axis.
                yield (x + r * a * c / flat, y + r * b * c / flat, z - r * flat)
            if r and abs(c) > 1 - _UPRIGHT:
                yield from _ring((x, y, z), r, self.axis)

    @property
    def low(self) -> float:
        """How low it reaches."""
        return min((z for _, _, z in self.lowest()), default=math.inf)

    def farthest(self, direction: Vector) -> Vector:
        """Return the point that lies farthest in a direction."""
        u, v, w = direction
        size = length(direction) or 1.0
        u, v, w = u / size, v / size, w / size
        out = (u, v, w)
        if self.axis is not None:
            a, b, c = self.axis
            k = a * u + b * v + c * w
            out = (u - k * a, v - k * b, w - k * c)
            n = length(out)
            out = (out[0] / n, out[1] / n, out[2] / n) if n > 1e-9 else (0.0, 0.0, 0.0)  # noqa: PLR2004
        radii = self.radii or (0.0,) * len(self.points)
        best, at = -math.inf, (0.0, 0.0, 0.0)
        for (x, y, z), r in zip(self.points, radii, strict=True):
            point = (x + r * out[0], y + r * out[1], z + r * out[2])
            far = point[0] * u + point[1] * v + point[2] * w
            if far > best:
                best, at = far, point
        return at


def _ring(at: Vector, radius: float, axis: Vector) -> Iterator[Vector]:
    """Yield points around a disc."""
    u, v = across(axis)
    for k in range(_RING):
        c, s = (f(2 * math.pi * k / _RING) * radius for f in (math.cos, math.sin))
        yield (
            at[0] + c * u[0] + s * v[0],
            at[1] + c * u[1] + s * v[1],
            at[2] + c * u[2] + s * v[2],
        )


def across(axis: Vector) -> tuple[Vector, Vector]:
    """Return two directions of length 1 that stand on one another and on an axis of length 1."""
    aside = (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0)  # noqa: PLR2004
    u = cross(axis, aside)
    n = length(u) or 1.0
    u = (u[0] / n, u[1] / n, u[2] / n)
    return u, cross(axis, u)


def _between(first: Vector, second: Vector, part: float) -> Vector:
    x, y, z = (a + part * (b - a) for a, b in zip(first, second, strict=True))
    return (x, y, z)


_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def solid_of(prim: ScenePrim, at: Affine) -> Solid | None:
    """Return the shape of a prim at a place, None for what is no solid."""
    return solid(prim.path, prim.type, prim.values, at)


def solid(path: str, kind: str, values: Mapping[str, Any], at: Affine) -> Solid | None:
    """Return the shape of a prim that stands at `at`, its scale included; None for no solid.

    `values` are its sizes, and of a mesh the points as a buffer. A disc whose axis is scaled to
    nothing is none.
    """
    if kind == "Cube":
        h = values.get("size", 2.0) / 2
        corners = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
        return Solid(path, kind, tuple(map(at.point, corners)))
    if kind == "Mesh":
        placed = list(map(at.point, _points(values.get("points"))))
        return Solid(path, kind, tuple(_fewer(placed))) if placed else None
    if kind not in (*BALLS, *DISCS):
        return None
    name = str(values.get("axis"))
    name = name if name in _AXES else "Z"
    scale = {axis: length(at.turn(along)) for axis, along in _AXES.items()}
    if kind in DISCS and not scale[name]:
        return None
    r = values.get("radius", 1.0)
    if kind == "Sphere":
        return Solid(path, kind, (at.origin,), (r * max(scale.values()),))
    r *= max(size for axis, size in scale.items() if axis != name)
    along = at.turn(_AXES[name])
    half = scaled(along, values.get("height", 2.0) / 2)
    ends = (minus(at.origin, half), minus(at.origin, scaled(half, -1.0)))
    axis = None if kind == "Capsule" else scaled(along, 1 / (scale[name] or 1.0))
    return Solid(path, kind, ends, (r, 0.0 if kind == "Cone" else r), axis)


def _points(buffer: memoryview | None) -> Iterable[Vector]:
    """Return the points of a mesh, which a buffer has number after number."""
    if buffer is None or not buffer.nbytes:
        return ()
    flat = buffer.cast("B").cast(buffer.format).tolist()  # type: ignore[call-overload]
    return zip(flat[::3], flat[1::3], flat[2::3], strict=True)


def _fewer(points: list[Vector]) -> list[Vector]:
    """Return the lowest points of many, and those that bound all."""
    if len(points) <= _MANY:
        return points
    kept = dict.fromkeys(nsmallest(_FEW, points, key=itemgetter(2)))
    for k in range(3):
        kept |= dict.fromkeys((min(points, key=itemgetter(k)), max(points, key=itemgetter(k))))
    return [*kept]
