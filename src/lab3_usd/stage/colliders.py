"""The boxes around collision shapes in world space, in metres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from pxr import Gf, Usd

from lab3_usd.check.model import Collider, Matrix, Prim
from lab3_usd.stage.places import Places

_Corner = tuple[float, float, float]
_Box = tuple[_Corner, _Corner]


RIGID_BODY = "PhysicsRigidBodyAPI"
_AXIS_NAMES = ("X", "Y", "Z")
# The shapes of UsdGeom by type name; whether round ones end in half balls.
_ROUND = {"Cylinder": False, "Capsule": True, "Cone": False}


def find_colliders(
    prims: Iterable[Usd.Prim], read: Mapping[str, Prim], places: Places
) -> Iterator[Collider]:
    """Yield the world box of each collision prim that has a shape of its own or shapes below.

    `read` holds the prims of the stage that were read, by path. Planes have no box. The bodies
    are the nearest ancestors that are rigid bodies, '' for none. Cylinders, spheres and capsules
    are taken as round, so that a wheel turned about its axle stands as high as one that is not;
    cones as the cylinders around them.
    """
    for prim in prims:
        metres = float(prim.GetStage().GetMetadata("metersPerUnit"))
        boxes = [box for shape in _shapes(prim) for box in [_world_box(shape, places)] if box]
        if boxes:
            low, high = _union(boxes)
            path = str(prim.GetPath())
            body = _body_above(path, read)
            yield Collider(path, body, _scaled(low, metres), _scaled(high, metres))


def _shapes(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    if not prim.GetAllChildrenNames() and not prim.IsInstance():
        return iter((prim,))
    return iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))


def _body_above(path: str, read: Mapping[str, Prim]) -> str:
    while path:
        prim = read.get(path)
        if prim is not None and RIGID_BODY in prim.apis:
            return path
        path = path.rpartition("/")[0]
    return ""


def _world_box(prim: Usd.Prim, places: Places) -> _Box | None:
    kind = str(prim.GetTypeName())
    if kind in _ROUND:
        return _around(places.world(prim), *_round_sizes(prim), has_balls=_ROUND[kind])
    if kind == "Sphere":
        return _around(places.world(prim), _number(prim, "radius"), 0.0, 0, has_balls=True)
    if kind == "Cube":
        return _cube_box(places.world(prim), _number(prim, "size") / 2)
    points = prim.GetAttribute("points")
    values = points.Get() if points else None
    if not values:
        return None
    matrix = Gf.Matrix4d(*places.world(prim))
    return _bounds([_moved(matrix, Gf.Vec3d(point)) for point in values])


def _number(prim: Usd.Prim, name: str) -> float:
    """Return a size of a shape, the schema's own where the file names none; 0 for what is none."""
    value = prim.GetAttribute(name).Get()
    return float(value) if isinstance(value, (int, float)) else 0.0


def _moved(matrix: Gf.Matrix4d, point: Gf.Vec3d) -> _Corner:
    # Plain tuples, because iterating over a Gf type is twenty times as slow.
    moved = matrix.Transform(point)
    return moved[0], moved[1], moved[2]


def _cube_box(matrix: Matrix, half: float) -> _Box:
    half = abs(half)
    return _reaching(
        matrix,
        half * (abs(matrix[0]) + abs(matrix[4]) + abs(matrix[8])),
        half * (abs(matrix[1]) + abs(matrix[5]) + abs(matrix[9])),
        half * (abs(matrix[2]) + abs(matrix[6]) + abs(matrix[10])),
    )


def _round_sizes(prim: Usd.Prim) -> tuple[float, float, int]:
    """Return radius, half the height, and the index of the axis, Z where the file names none."""
    axis = prim.GetAttribute("axis").Get()
    along = "XYZ".index(axis) if axis in _AXIS_NAMES else 2
    return _number(prim, "radius"), _number(prim, "height") / 2, along


def _around(matrix: Matrix, radius: float, half: float, along: int, *, has_balls: bool) -> _Box:
    """Return the box around two discs, or two balls, that lie `half` from the middle."""
    x, y, z = (
        abs(matrix[4 * along + column]) * half
        + radius
        * math.hypot(*(matrix[4 * row + column] for row in range(3) if has_balls or row != along))
        for column in range(3)
    )
    return _reaching(matrix, x, y, z)


def _reaching(matrix: Matrix, x: float, y: float, z: float) -> _Box:
    """Return the box around where the matrix puts the origin, with these half sizes."""
    across, along, up = matrix[12:15]
    return (across - x, along - y, up - z), (across + x, along + y, up + z)


def _bounds(points: list[_Corner]) -> _Box:
    xs, ys, zs = zip(*points, strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def _union(boxes: list[_Box]) -> _Box:
    lows, highs = zip(*boxes, strict=True)
    return _bounds([*lows, *highs])


def _scaled(corner: _Corner, metres: float) -> _Corner:
    return corner[0] * metres, corner[1] * metres, corner[2] * metres
