"""The collision geometry of a stage in the plane of a lidar, as line segments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any

from msgspec import Struct
from pxr import Gf, Tf, Usd, UsdGeom, UsdPhysics, Vt

from lab3_usd.errors import UsageError
from lab3_usd.stage.read.opening import quiet, stage_errors

# A circle of 96 corners misses the true one by 0.05 % of its radius.
_CORNERS = 96
_RINGS = 24

_ROUNDING = 1e-3  # metres; usd-core measures with single precision

Number3 = tuple[float, float, float]
Point = tuple[float, float]
Segment = tuple[Point, Point]


class Faces(Struct, frozen=True):
    """A surface: points, and the corners of each face as indices into them."""

    points: Sequence[Sequence[float]]
    corners: Sequence[Sequence[int]]


class StageSlice(Struct, frozen=True):
    """A cut through a stage, in metres of a world whose Z points up.

    `robot` is where the robot stands, None in a stage without it. `not_cut` names shapes that
    cannot be cut, because of their type or of what is written there. `missing` counts the assets
    that could not be found.
    """

    height: float
    robot: Point | None
    segments: tuple[Segment, ...]
    not_cut: tuple[str, ...] = ()
    missing: int = 0


class SliceOptions(Struct, frozen=True):
    """Where to cut: the robot to leave out, and the height in metres or the link that has it."""

    robot: str
    lidar_link: str
    height: float | None = None


@quiet()
def slice_stage(stage: Usd.Stage, cut: SliceOptions) -> StageSlice:
    """Cut the collision geometry of a stage.

    Only enabled colliders count, in instances too. Ground planes are endless and left out, and
    so is the robot, which does not see itself.

    Raises:
        StageError: what is written of the robot or the link gives no place.
        UsageError: no height is given and the stage has no link to take it from.
    """
    to_metres = Gf.Matrix4d().SetScale(UsdGeom.GetStageMetersPerUnit(stage))
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        to_metres *= Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d.XAxis(), 90.0))
    cache = UsdGeom.XformCache()
    height = cut.height
    if height is None:
        link = stage.GetPrimAtPath(cut.lidar_link)
        if not link:
            raise UsageError(
                f"the stage has no {cut.lidar_link} to take the height from, give --height"
            )
        height = _position(link, to_metres)[2]
    robot = stage.GetPrimAtPath(cut.robot)
    segments: list[Segment] = []
    not_cut: list[str] = []
    for prim in _colliders(stage, cut.robot):
        for shape in _shapes(prim):
            try:
                matrix = cache.GetLocalToWorldTransform(shape) * to_metres
                cuts = () if _misses(shape, matrix, height) else _cut_shape(shape, matrix, height)
            except (Tf.ErrorException, TypeError, ValueError):
                cuts = None  # what is written there tells neither its surface nor its place
            if cuts is None:
                not_cut.append(str(shape.GetPath()))
            else:
                segments.extend(cuts)
    return StageSlice(
        height=height,
        robot=_position(robot, to_metres)[:2] if robot else None,
        segments=tuple(segments),
        not_cut=tuple(not_cut),
        missing=len(stage.GetCompositionErrors()),
    )


def _misses(shape: Usd.Prim, matrix: Gf.Matrix4d, height: float) -> bool:
    """Whether a mesh lies above or below the cut: then none of its faces need be looked at."""
    mesh = UsdGeom.Mesh(shape)
    points = mesh.GetPointsAttr().Get() if mesh else None
    if not isinstance(points, Vt.Vec3fArray) or not points:
        return False
    low, high = UsdGeom.Boundable.ComputeExtentFromPlugins(mesh, Usd.TimeCode.Default(), matrix)
    return bool(low[2] > height + _ROUNDING or high[2] < height - _ROUNDING)


def _position(prim: Usd.Prim, to_metres: Gf.Matrix4d) -> tuple[float, float, float]:
    with stage_errors(str(prim.GetPath()), Tf.ErrorException):
        world = UsdGeom.XformCache().GetLocalToWorldTransform(prim) * to_metres
    x, y, z = world.ExtractTranslation()
    return (x, y, z)


def _colliders(stage: Usd.Stage, robot: str) -> Iterator[Usd.Prim]:
    prims = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.GetPath() == robot:
            prims.PruneChildren()
            continue
        if _collides(prim) and not prim.IsA(UsdGeom.Plane):  # the ground, which is endless
            yield prim


def _collides(prim: Usd.Prim) -> bool:
    if not prim.HasAPI(UsdPhysics.CollisionAPI):
        return False
    return UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get() is not False


def _shapes(collider: Usd.Prim) -> Iterator[Usd.Prim]:
    """Yield the collider, or what is below it where it is no shape itself.

    What is below another collider is that one's.
    """
    if collider.IsA(UsdGeom.Gprim):
        yield collider
        return
    prims = iter(Usd.PrimRange(collider, Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim != collider and _collides(prim):
            prims.PruneChildren()
        elif prim.IsA(UsdGeom.Gprim) and not prim.HasAPI(UsdPhysics.CollisionAPI):
            yield prim


def _cut_shape(shape: Usd.Prim, matrix: Gf.Matrix4d, height: float) -> Sequence[Segment] | None:
    """Return the cut through a shape; None for a type that has no surface here.

    A mesh is taken as it is, whatever a simulator makes of it (`physics:approximation`): a lidar
    sees the mesh, and a hull around a ring would fill the ring.
    """
    kind = str(shape.GetTypeName())
    # Plain numbers: a Gf vector takes ten times as long for each point.
    columns = tuple(tuple(matrix[row][column] for row in range(4)) for column in range(3))
    if kind == "Mesh":
        return tuple(_cut_faces(_mesh(shape), columns, height))
    if kind == "Cube":
        return _cut_solid(kind, _value(shape, "size"), 0.0, "", columns, height)
    if kind not in _ROUND:
        return None
    length = 0.0 if kind == "Sphere" else _value(shape, "height")
    axis = shape.GetAttribute("axis")
    upright = axis.Get() if axis else "Z"
    return _cut_solid(kind, _value(shape, "radius"), length, upright, columns, height)


@lru_cache(maxsize=512)  # the stages of a class have the same room
def _cut_solid(
    kind: str,
    size: float,
    length: float,
    axis: str,
    columns: Sequence[Sequence[float]],
    height: float,
) -> Sequence[Segment]:
    """Return the cut through a cube or a round shape."""
    faces = _cube(size / 2) if kind == "Cube" else _round(kind, size, length / 2, axis)
    return tuple(_cut_faces(faces, columns, height))


def _cut_faces(
    faces: Faces, columns: Sequence[Sequence[float]], height: float
) -> Iterator[Segment]:
    """Yield where the faces cross the height; a face that lies in it has no crossing."""
    of_x, of_y, of_z, shift = columns[2]
    is_above = [of_x * x + of_y * y + of_z * z + shift > height for x, y, z in faces.points]
    for corners in faces.corners:
        sides = [is_above[corner] for corner in corners]
        if True in sides and False in sides:
            outline = [
                tuple(a * x + b * y + c * z + d for a, b, c, d in columns)
                for x, y, z in (faces.points[corner] for corner in corners)
            ]
            crossings = sorted(_crossings(outline, height))
            # A face that is not convex is crossed in more than one piece.
            yield from zip(crossings[::2], crossings[1::2], strict=False)


def _crossings(outline: Sequence[tuple[float, ...]], height: float) -> Iterator[Point]:
    after = (*outline[1:], *outline[:1])
    for (x0, y0, z0), (x1, y1, z1) in zip(outline, after, strict=True):
        if (z0 > height) == (z1 > height):
            continue
        share = (height - z0) / (z1 - z0)
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        if math.isfinite(x) and math.isfinite(y):
            yield (x, y)


def _value(prim: Usd.Prim, name: str) -> float:
    return float(prim.GetAttribute(name).Get())


def _cube(half: float) -> Faces:
    ends = (-half, half)
    points = [(x, y, z) for x in ends for y in ends for z in ends]
    corners = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    return Faces(points, corners)


def _round(kind: str, radius: float, half: float, axis: str) -> Faces:
    if kind == "Cylinder":
        return _turned(axis, [(0.0, -half), (radius, -half), (radius, half), (0.0, half)])
    if kind == "Cone":
        return _turned(axis, [(0.0, -half), (radius, -half), (0.0, half)])
    # A sphere is a capsule without a straight part.
    angles = [math.pi * (ring / _RINGS - 0.5) for ring in range(_RINGS + 1)]
    middle = _RINGS // 2
    lower = [(radius * math.cos(a), radius * math.sin(a) - half) for a in angles[: middle + 1]]
    upper = [(radius * math.cos(a), radius * math.sin(a) + half) for a in angles[middle:]]
    return _turned(axis, lower + upper)


def _turned(axis: str, profile: list[tuple[float, float]]) -> Faces:
    """Turn a profile of (radius, height) about an axis."""
    place = _PLACE.get(axis, _PLACE["Z"])
    circle = [
        (math.cos(2 * math.pi * corner / _CORNERS), math.sin(2 * math.pi * corner / _CORNERS))
        for corner in range(_CORNERS)
    ]
    points = [place(radius * x, radius * y, h) for radius, h in profile for x, y in circle]
    faces = []
    for low in range(0, (len(profile) - 1) * _CORNERS, _CORNERS):
        high = low + _CORNERS
        for corner in range(_CORNERS):
            following = (corner + 1) % _CORNERS
            faces.append((low + corner, low + following, high + following, high + corner))
    return Faces(points, faces)


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
        if face not in holes and (
            is_sound or all(0 <= corner < len(points) for corner in face_corners)
        ):
            corners.append(face_corners)
    return Faces(points, corners)


def _numbers(attribute: Usd.Attribute) -> list[Any]:
    array = attribute.Get()
    # Thirty times as fast as asking the array for one element after the other.
    return memoryview(array).tolist() if array else []


_PLACE: dict[str, Callable[[float, float, float], Number3]] = {
    "X": lambda a, b, h: (h, a, b),
    "Y": lambda a, b, h: (b, h, a),
    "Z": lambda a, b, h: (a, b, h),
}
_ROUND = ("Cylinder", "Cone", "Sphere", "Capsule")
