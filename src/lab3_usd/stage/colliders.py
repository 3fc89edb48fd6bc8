"""The boxes around collision shapes in world space, in metres."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import product

from pxr import Gf, Usd

from lab3_usd.check.model import Collider, Prim
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
        return _round_box(prim, places.world(prim), has_balls=_ROUND[kind])
    if kind == "Sphere":
        return _ball(Gf.Vec3d(0), _number(prim, "radius"), places.world(prim))
    points = _points(prim, kind)
    if not points:
        return None
    matrix = places.world(prim)
    return _bounds([_moved(matrix, point) for point in points])


def _number(prim: Usd.Prim, name: str) -> float:
    """Return a size of a shape, the schema's own where the file names none; 0 for what is none."""
    value = prim.GetAttribute(name).Get()
    return float(value) if isinstance(value, (int, float)) else 0.0


def _moved(matrix: Gf.Matrix4d, point: Gf.Vec3d) -> _Corner:
    # Plain tuples, because iterating over a Gf type is twenty times as slow.
    moved = matrix.Transform(point)
    return moved[0], moved[1], moved[2]


def _points(prim: Usd.Prim, kind: str) -> list[Gf.Vec3d]:
    """Return the points whose hull is the shape: the corners of a cube, the vertices of a mesh."""
    if kind == "Cube":
        half = _number(prim, "size") / 2
        return [Gf.Vec3d(*corner) for corner in product((-half, half), repeat=3)]
    points = prim.GetAttribute("points")
    return [Gf.Vec3d(point) for point in points.Get() or ()] if points else []


def _ball(centre: Gf.Vec3d, radius: float, matrix: Gf.Matrix4d) -> _Box:
    middle = matrix.Transform(centre)
    reach = [radius * _length(matrix, axis) for axis in range(3)]
    return (
        (middle[0] - reach[0], middle[1] - reach[1], middle[2] - reach[2]),
        (middle[0] + reach[0], middle[1] + reach[1], middle[2] + reach[2]),
    )


def _length(matrix: Gf.Matrix4d, column: int) -> float:
    """Return how far a unit ball reaches along a world axis."""
    return float(sum(matrix[row][column] ** 2 for row in range(3)) ** 0.5)


def _round_box(prim: Usd.Prim, matrix: Gf.Matrix4d, *, has_balls: bool) -> _Box:
    radius, half = _number(prim, "radius"), _number(prim, "height") / 2
    axis_name = prim.GetAttribute("axis").Get()
    along = "XYZ".index(axis_name) if axis_name in _AXIS_NAMES else 2
    round_ends = radius if has_balls else 0.0
    low, high = [0.0] * 3, [0.0] * 3
    middle = matrix.Transform(Gf.Vec3d(0))
    for axis in range(3):
        disc = sum(matrix[row][axis] ** 2 for row in range(3) if row != along) ** 0.5
        reach = abs(matrix[along][axis]) * half
        reach += max(radius * disc, round_ends * _length(matrix, axis))
        low[axis], high[axis] = middle[axis] - reach, middle[axis] + reach
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def _bounds(points: list[_Corner]) -> _Box:
    xs, ys, zs = zip(*points, strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def _union(boxes: list[_Box]) -> _Box:
    lows, highs = zip(*boxes, strict=True)
    return _bounds([*lows, *highs])


def _scaled(corner: _Corner, metres: float) -> _Corner:
    return corner[0] * metres, corner[1] * metres, corner[2] * metres
