"""The faces of a collision shape, in the shape's own coordinates and units."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from msgspec import Struct
from pxr import Usd, UsdGeom

# A circle of 96 corners misses the true one by 0.05 % of its radius.
_CORNERS = 96
_RINGS = 24

Number3 = tuple[float, float, float]
Profile = list[tuple[float, float]]


class Faces(Struct, frozen=True):
    """A surface: points, and the corners of each face as indices into them."""

    points: Sequence[Sequence[float]]
    corners: Sequence[Sequence[int]]


def faces_of(prim: Usd.Prim) -> Faces | None:
    """Return the surface of a shape; None for a type that has no surface here.

    A mesh is taken as it is, whatever a simulator makes of it (`physics:approximation`): a lidar
    sees the mesh, and a hull around a ring would fill the ring.
    """
    read = _READERS.get(prim.GetTypeName())
    return None if read is None else read(prim)


def is_endless(prim: Usd.Prim) -> bool:
    """Whether the shape is a ground plane, which no slice can show."""
    return bool(prim.IsA(UsdGeom.Plane))


def _value(prim: Usd.Prim, name: str) -> float:
    return float(prim.GetAttribute(name).Get())


def _cube(prim: Usd.Prim) -> Faces:
    half = _value(prim, "size") / 2
    ends = (-half, half)
    points = [(x, y, z) for x in ends for y in ends for z in ends]
    corners = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    return Faces(points, corners)


def _cylinder(prim: Usd.Prim) -> Faces:
    half, radius = _value(prim, "height") / 2, _value(prim, "radius")
    return _turned(prim, [(0.0, -half), (radius, -half), (radius, half), (0.0, half)])


def _cone(prim: Usd.Prim) -> Faces:
    half, radius = _value(prim, "height") / 2, _value(prim, "radius")
    return _turned(prim, [(0.0, -half), (radius, -half), (0.0, half)])


def _sphere(prim: Usd.Prim) -> Faces:
    return _turned(prim, _capped(_value(prim, "radius"), 0.0))


def _capsule(prim: Usd.Prim) -> Faces:
    return _turned(prim, _capped(_value(prim, "radius"), _value(prim, "height") / 2))


def _capped(radius: float, half: float) -> Profile:
    """Profile of a capsule whose straight part is `2 * half` long; of a sphere when it is 0."""
    angles = [math.pi * (ring / _RINGS - 0.5) for ring in range(_RINGS + 1)]
    middle = _RINGS // 2
    lower = [(radius * math.cos(a), radius * math.sin(a) - half) for a in angles[: middle + 1]]
    upper = [(radius * math.cos(a), radius * math.sin(a) + half) for a in angles[middle:]]
    return lower + upper


def _turned(prim: Usd.Prim, profile: Profile) -> Faces:
    """Turn a profile of (radius, height) about the shape's axis."""
    axis = prim.GetAttribute("axis")
    place = _PLACE.get(axis.Get() if axis else "Z", _PLACE["Z"])
    circle = [
        (math.cos(2 * math.pi * corner / _CORNERS), math.sin(2 * math.pi * corner / _CORNERS))
        for corner in range(_CORNERS)
    ]
    points = [place(radius * x, radius * y, h) for radius, h in profile for x, y in circle]
    return Faces(points, list(_bands(len(profile))))


def _bands(rings: int) -> Iterator[tuple[int, int, int, int]]:
    for low in range(0, (rings - 1) * _CORNERS, _CORNERS):
        high = low + _CORNERS
        for corner in range(_CORNERS):
            following = (corner + 1) % _CORNERS
            yield low + corner, low + following, high + following, high + corner


def _mesh(prim: Usd.Prim) -> Faces:
    mesh = UsdGeom.Mesh(prim)
    points = _numbers(mesh.GetPointsAttr())
    indices = _numbers(mesh.GetFaceVertexIndicesAttr())
    holes = set(mesh.GetHoleIndicesAttr().Get() or ())
    # A broken mesh may name points that it does not have.
    is_sound = not indices or (min(indices) >= 0 and max(indices) < len(points))
    corners = []
    start = 0
    for face, count in enumerate(mesh.GetFaceVertexCountsAttr().Get() or ()):
        face_corners = indices[start : start + count]
        start += count
        if face not in holes and (is_sound or _are_there(face_corners, len(points))):
            corners.append(face_corners)
    return Faces(points, corners)


def _numbers(attribute: Usd.Attribute) -> list[Any]:
    array = attribute.Get()
    # Thirty times as fast as asking the array for one element after the other.
    return memoryview(array).tolist() if array else []


def _are_there(corners: Sequence[int], count: int) -> bool:
    return all(0 <= corner < count for corner in corners)


_PLACE: dict[str, Callable[[float, float, float], Number3]] = {
    "X": lambda a, b, h: (h, a, b),
    "Y": lambda a, b, h: (b, h, a),
    "Z": lambda a, b, h: (a, b, h),
}
_READERS: dict[str, Callable[[Usd.Prim], Faces]] = {
    "Cube": _cube,
    "Cylinder": _cylinder,
    "Cone": _cone,
    "Sphere": _sphere,
    "Capsule": _capsule,
    "Mesh": _mesh,
}
