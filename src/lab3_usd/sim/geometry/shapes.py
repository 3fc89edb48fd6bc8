"""Shapes as triangles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from lab3_usd.model.dry_run.affine import Affine
from lab3_usd.model.dry_run.scene import Prim
from lab3_usd.model.transform_math import Vector

Triangle = tuple[Vector, Vector, Vector]
SIDES = 32  # of a round shape; its corners lie on the surface
ENDLESS = 1e3
TURN = {"X": (2, 0, 1), "Y": (1, 2, 0), "Z": (0, 1, 2)}  # where x, y, z of an upright shape go


def triangles(prim: Prim) -> list[Triangle]:
    """Return the surface of a shape in its own frame."""
    maker = _MAKERS.get(prim.type)
    return list(maker(prim)) if maker is not None else []


def placed(prim: Prim, at: Affine) -> list[Triangle]:
    """Return the surface of a shape that stands at `at`, its scale included."""
    return [(at.point(a), at.point(b), at.point(c)) for a, b, c in triangles(prim)]


def _number(prim: Prim, name: str, default: float) -> float:
    value = prim.values.get(name)
    return default if value is None else float(value)


def _cube(prim: Prim) -> Iterator[Triangle]:
    h = _number(prim, "size", 2.0) / 2
    corners = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    for face in (
        (0, 1, 3, 2),
        (4, 6, 7, 5),
        (0, 4, 5, 1),
        (2, 3, 7, 6),
        (0, 2, 6, 4),
        (1, 5, 7, 3),
    ):
        yield from _fan([corners[each] for each in face])


def _fan(points: Sequence[Vector]) -> Iterator[Triangle]:
    for one, other in pairwise(points[1:]):
        yield points[0], one, other


def _lathe(prim: Prim, profile: Sequence[tuple[float, float]]) -> Iterator[Triangle]:
    """Turn a profile of (radius, height) about the axis of the shape."""
    order = TURN.get(str(prim.values.get("axis")), TURN["Z"])
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


def _cylinder(prim: Prim) -> Iterator[Triangle]:
    r, h = _number(prim, "radius", 1.0), _number(prim, "height", 2.0) / 2
    return _lathe(prim, [(0.0, -h), (r, -h), (r, h), (0.0, h)])


def _cone(prim: Prim) -> Iterator[Triangle]:
    r, h = _number(prim, "radius", 1.0), _number(prim, "height", 2.0) / 2
    return _lathe(prim, [(0.0, -h), (r, -h), (0.0, h)])


def _round(radius: float, half: float) -> list[tuple[float, float]]:
    """Return the profile of a capsule; of a sphere where its cylinder has no height."""
    rows = SIDES // 4
    angles = [math.pi / 2 * k / rows for k in range(rows + 1)]
    top = [(radius * math.cos(a), half + radius * math.sin(a)) for a in angles]
    return [*((r, -h) for r, h in reversed(top)), *top]


def _sphere(prim: Prim) -> Iterator[Triangle]:
    return _lathe(prim, _round(_number(prim, "radius", 1.0), 0.0))


def _capsule(prim: Prim) -> Iterator[Triangle]:
    half = _number(prim, "height", 1.0) / 2
    return _lathe(prim, _round(_number(prim, "radius", 0.5), half))


def _plane(prim: Prim) -> Iterator[Triangle]:
    """Return a square, as large as its collision is endless."""
    order = TURN.get(str(prim.values.get("axis")), TURN["Z"])
    corners = [(-ENDLESS, -ENDLESS, 0.0), (ENDLESS, -ENDLESS, 0.0)]
    corners += [(ENDLESS, ENDLESS, 0.0), (-ENDLESS, ENDLESS, 0.0)]
    turned = [tuple(each[order.index(k)] for k in range(3)) for each in corners]
    yield from _fan(turned)  # type: ignore[arg-type]


def _mesh(prim: Prim) -> Iterator[Triangle]:
    points = prim.values.get("points") or ()
    indices = prim.values.get("faceVertexIndices") or ()
    at = 0
    for count in prim.values.get("faceVertexCounts") or ():
        face = indices[at : at + count]
        at += count
        if len(face) == count and all(0 <= each < len(points) for each in face):
            yield from _fan([points[each] for each in face])


_MAKERS = {
    "Cube": _cube,
    "Sphere": _sphere,
    "Cylinder": _cylinder,
    "Capsule": _capsule,
    "Cone": _cone,
    "Mesh": _mesh,
    "Plane": _plane,
}
