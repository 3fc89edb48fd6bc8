"""Bounding boxes of collision shapes in world space, in metres."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache, cached_property
from typing import Any

from pxr import Gf, Usd, Vt

from lab3_usd.model.physics import COLLISION_API
from lab3_usd.model.prims import Collider, Colliders, Matrix, Prims, upwards
from lab3_usd.model.transforms import Vector, box_of, scale_of, scaled, transform_point
from lab3_usd.stage.read.opening import stage_errors
from lab3_usd.stage.read.prim_transforms import TransformCache
from lab3_usd.stage.read.prims import PrimReader
from lab3_usd.stage.read.properties import (
    CENTIMETRES,
    authored_data,
    elements,
    prim_at,
    stage_number,
)

_Box = tuple[Vector, Vector]

_EVEN = 1e-4  # of a scale, between what counts as one
_ENDS = 2  # corners of an extent
_FEW = 100  # points of a mesh; more are left to UsdGeom
_AXIS_NAMES = ("X", "Y", "Z")
# The shapes of UsdGeom by type name; whether round ones end in half balls.
_ROUND = {"Cylinder": False, "Capsule": True, "Cone": False}
_PARTS = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


class StageColliders(Colliders):
    """The boxes around the collision prims of an open stage, each measured when it is asked for.

    A collision prim has the box of its own shape and of the shapes below it. Planes have none.
    Cylinders, spheres and capsules count as round, so that turning a wheel about its axle does not
    change its height; cones count as the cylinders around them. The largest scale across the axis
    gives the radius, as in PhysX (omni.usdphysics/plugins/Collision.cpp:132-310).
    """

    def __init__(self, prims: Prims, reader: PrimReader) -> None:
        """Measure the prims of a stage."""
        self._prims = prims
        self._reader = reader
        self._shapes: dict[str, _Box | None] = {}  # of prims by themselves
        self._boxes: dict[str, _Box | None] = {}  # of collision prims, with what is below them
        self._measured: dict[str, Collider | None] = {}  # the same in metres
        self._bounds: dict[str, Collider | None] = {}  # by their extents
        self._metres = stage_number(reader.stage.GetMetadata("metersPerUnit"), CENTIMETRES)

    def below(self, top: str) -> list[Collider]:
        """Return the boxes of the shapes at and below a prim."""
        start, end = self._spans.get(top.rstrip("/"), (0, 0))
        return [*filter(None, map(self.measured, self._paths[start:end]))]

    def beside(self, top: str) -> Iterator[Collider]:
        """Yield the boxes of the shapes that are not `below` a prim."""
        start, end = self._spans.get(top.rstrip("/"), (0, 0))
        return filter(None, map(self.measured, [*self._paths[:start], *self._paths[end:]]))

    def bounds(self) -> Iterator[Collider]:
        """Yield boxes that hold the shapes: that of a mesh by its `extent`, where a layer says it.

        So the points of a mesh that is far from a robot are not read.
        """
        return filter(None, map(self._bounds_of, self._paths))

    def measured(self, path: str) -> Collider | None:
        """Return the box of the shapes of a collision prim."""
        if path not in self._measured:
            start, end = self._spans.get(path, (0, 0))
            with stage_errors(self._reader.name):
                # Those below a prim are measured before it, so that each shape is looked at once.
                for each in (*reversed(self._paths[start:end]), path):
                    if each not in self._boxes:
                        self._boxes[each] = self._measure(each)
            self._measured[path] = self._in_metres(path, self._boxes[path])
        return self._measured[path]

    def shape(self, path: str) -> Collider | None:
        """Return the box around a prim's own shape, whether it collides or not."""
        with stage_errors(self._reader.name):
            prim = self._reader.stage.GetPrimAtPath(path)
            is_there = bool(prim) and self._is_defined(path)
            return self._in_metres(path, self._shape_of(prim) if is_there else None)

    @cached_property
    def _paths(self) -> list[str]:
        """The collision prims that are there, as the stage is traversed."""
        colliding = self._prims.with_api(COLLISION_API)
        return [prim.path for prim in colliding if prim.present and self._is_defined(prim.path)]

    @cached_property
    def _spans(self) -> dict[str, tuple[int, int]]:
        """Where the collision prims at and below each prim begin and end among all."""
        spans: dict[str, tuple[int, int]] = {}
        for number, path in enumerate(self._paths):
            for above in ("", *upwards(path)):
                start, _ = spans.get(above, (number, 0))
                spans[above] = start, number + 1
        return spans

    def _bounds_of(self, path: str) -> Collider | None:
        if path not in self._bounds:
            with stage_errors(self._reader.name):
                box = self._by_extent(path)
            self._bounds[path] = self._in_metres(path, box) or self.measured(path)
        return self._bounds[path]

    def _by_extent(self, path: str) -> _Box | None:
        """Return the box around the extent of a mesh, None where no layer says it."""
        prim = prim_at(self._reader.stage, path)
        is_mesh = Usd.Prim.GetTypeName(prim) == "Mesh" and not Usd.Prim.GetAllChildrenNames(prim)
        extent = authored_data(prim, "extent") if is_mesh else None
        if not isinstance(extent, Vt.Vec3fArray) or len(extent) != _ENDS:
            return None
        low, high = elements(extent[0]), elements(extent[1])
        half = [(end - start) / 2 for start, end in zip(low, high, strict=True)]
        middle = (low[0] + half[0], low[1] + half[1], low[2] + half[2])
        return _turned_box(self._reader.transforms.of(prim, path)[1], middle, half)

    def _is_defined(self, path: str) -> bool:
        """Whether a prim is surely in the scene, and not only if a missing asset defines it."""
        hidden = self._reader.hidden
        return not hidden or bool(self._reader.stage.GetPrimAtPath(path).IsDefined())

    def _in_metres(self, path: str, box: _Box | None) -> Collider | None:
        if box is None:
            return None
        return Collider(path, scaled(box[0], self._metres), scaled(box[1], self._metres))

    def _measure(self, top: str) -> _Box | None:
        """Return the box around the shapes at and below a prim."""
        corners: list[Vector] = []
        parts = iter(Usd.PrimRange(prim_at(self._reader.stage, top), _PARTS))
        for part in parts:
            path = str(Usd.Prim.GetPath(part))
            if path in self._boxes:
                parts.PruneChildren()
            corners += (self._boxes[path] if path in self._boxes else self._shape_of(part)) or ()
        return box_of(corners) if corners else None

    def _shape_of(self, prim: Usd.Prim) -> _Box | None:
        """Return the box around a prim's own shape in the world, in units of the stage."""
        path = str(Usd.Prim.GetPath(prim))
        if path not in self._shapes:
            self._shapes[path] = _world_box(prim, path, self._reader.transforms)
        return self._shapes[path]


def _world_box(prim: Usd.Prim, path: str, transforms: TransformCache) -> _Box | None:
    kind, (_, world) = Usd.Prim.GetTypeName(prim), transforms.of(prim, path)
    if kind in _ROUND:
        axis = authored_data(prim, "axis")
        index = _AXIS_NAMES.index(axis) if axis in _AXIS_NAMES else 2  # Z by the schema
        radius, half = _number(prim, "radius"), _number(prim, "height") / 2
        return _around(_evenly(world, index), radius, half, index, has_balls=_ROUND[kind])
    if kind == "Sphere":
        return _around(_evenly(world), _number(prim, "radius"), 0.0, 0, has_balls=True)
    if kind == "Cube":
        half = abs(_number(prim, "size")) / 2
        return _turned_box(world, (0.0, 0.0, 0.0), (half, half, half))
    points = authored_data(prim, "points")
    if not points or not isinstance(points, Vt.Vec3fArray):
        return None
    matrix = Gf.Matrix4d(*world)
    if len(points) <= _FEW:
        # Iterating over a Vt array or a vector is many times as slow.
        rows: Any = memoryview(points).tolist()
        moved: Any = [elements(matrix.Transform(Gf.Vec3d(*row))) for row in rows]
        return box_of(moved)
    return _box_of_many(points, matrix)


def _evenly(world: Matrix, along: int | None = None) -> Matrix:
    """Return where a round shape stands, with its largest scale across its axis, if it has one."""
    scale = [abs(size) for size in scale_of(world)]
    across = scale if along is None else scale[:along] + scale[along + 1 :]
    largest = max(across)
    if min(across) >= largest * (1 - _EVEN) or not all(across):
        return world
    sizes = [1.0 if row == along else largest / scale[row] for row in range(3)]
    return (*(world[at] * sizes[at // 4] for at in range(12)), *world[12:])


def _box_of_many(points: Vt.Vec3fArray, matrix: Gf.Matrix4d) -> _Box:
    """Return the box around many points, which usd-core works out without a loop here."""
    from pxr import UsdGeom

    mesh = UsdGeom.Mesh(_scratch().GetPrimAtPath("/points"))
    mesh.GetPointsAttr().Set(points)
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(mesh, Usd.TimeCode.Default(), matrix)
    low, high = ((corner[0], corner[1], corner[2]) for corner in extent)
    return low, high


@cache
def _scratch() -> Usd.Stage:
    """Return a stage with a mesh that takes any points, as usd-core measures none by themselves."""
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/points", "Mesh")
    return stage


def _number(prim: Usd.Prim, name: str) -> float:
    """Return a size of a shape, the schema's own where the file names none; 0 for what is none."""
    value = Usd.Attribute.Get(Usd.Prim.GetAttribute(prim, name))
    return float(value) if isinstance(value, (int, float)) else 0.0


def _around(matrix: Matrix, radius: float, half: float, along: int, *, has_balls: bool) -> _Box:
    """Return the box around two discs, or two balls, that lie `half` from the middle."""
    reach = (
        abs(matrix[4 * along + column]) * half
        + radius
        * math.hypot(*(matrix[4 * row + column] for row in range(3) if has_balls or row != along))
        for column in range(3)
    )
    return _reaching((matrix[12], matrix[13], matrix[14]), *reach)


def _turned_box(matrix: Matrix, middle: Vector, half: Sequence[float]) -> _Box:
    """Return the box around one of these half sizes about a point, where the matrix puts it."""
    reach = (
        sum(abs(size * matrix[4 * row + column]) for row, size in enumerate(half))
        for column in range(3)
    )
    return _reaching(transform_point(middle, matrix), *reach)


def _reaching(middle: Vector, x: float, y: float, z: float) -> _Box:
    """Return the box around a point, with these half sizes."""
    across, along, up = middle
    return (across - x, along - y, up - z), (across + x, along + y, up + z)
