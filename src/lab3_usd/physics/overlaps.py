"""Shapes that are inside one another when playing starts: PhysX throws what moves out of there.

It pushed the lab's robot, 1 to 10 cm inside a wall, 5 to 11 cm away within a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct

from lab3_usd.model.dry_run import AXES, ScenePrim
from lab3_usd.model.solids import Solid, across, solid_of
from lab3_usd.model.transforms import Vector, box_of, cross, dot, length, minus, scaled
from lab3_usd.physics.surfaces import Surface, placed_surface

DEEP = 5e-3  # metres from which on it counts
_HULLS = (None, "convexHull", "boundingCube", "boundingSphere")  # one solid, as far as it is full
_ROUNDS = 12
Box = tuple[Vector, Vector]
_CORNERS = len("abc")


class Overlap(Struct, frozen=True):
    """A shape of a robot, what it is inside of, and how deep, in metres."""

    own: str
    other: str
    depth: float


class Block(Struct, frozen=True):
    """Something that a robot may be inside of: its shape, or the triangles that it consists of."""

    path: str
    solids: Sequence[Solid]


def block_of(prim: ScenePrim, box: Box, surface: Surface | None = None) -> Block | None:
    """Return a shape as PhysX has it inside a box; `surface` is that of one that does not move.

    None for a plane. A static mesh, and one that does not fill its hull, consists of its
    triangles; level triangles of a static mesh are ground.
    """
    is_full = prim.type != "Mesh" or prim.values.get("physics:approximation") in _HULLS
    if is_full and not (prim.type == "Mesh" and surface is not None and surface.side):
        solid = solid_of(prim, prim.world)
        return None if solid is None else Block(prim.path, [solid])
    surface = surface or placed_surface(prim, prim.world)
    steep: list[Solid] = []
    for face in surface.within(*box):
        x, y, z = cross(minus(face[1], face[0]), minus(face[2], face[0]))
        if abs(z) < math.hypot(x, y):
            steep.append(Solid(prim.path, prim.type, face))
    return Block(prim.path, steep)


def overlaps(own: Sequence[Solid], blocks: Iterable[Block], metres: float) -> Iterator[Overlap]:
    """Yield the deepest overlap with each block; `metres` is a unit of the stage."""
    boxes = [(solid, box_around(solid)) for solid in own]
    for block in blocks:
        deepest = Overlap("", block.path, 0.0)
        for other in block.solids:
            low, high = box_around(other)
            for solid, (near, far) in boxes:
                if all(min(far[k], high[k]) > max(near[k], low[k]) - 1e-9 for k in range(3)):
                    depth = depth_of(solid, other) * metres
                    if depth > max(DEEP, deepest.depth):
                        deepest = Overlap(solid.path, block.path, depth)
        if deepest.own:
            yield deepest


def box_around(solid: Solid) -> Box:
    """Return the lowest and the highest coordinates of a shape."""
    ends = [solid.farthest(axis) for axis in AXES]
    starts = [solid.farthest((-x, -y, -z)) for x, y, z in AXES]
    return box_of([*starts, *ends])


def depth_of(first: Solid, second: Solid) -> float:
    """Return how far one of two convex shapes is to be moved until they are apart; 0 if they are.

    It is the least over all directions, looked for from those of their sides on.
    """
    least, way = math.inf, AXES[0]
    for direction in _directions(first, second):
        depth, _ = _along(direction, first, second)
        if depth <= 0:
            return 0.0
        if depth < least:
            least, way = depth, direction
    step = 0.5
    for _ in range(_ROUNDS):
        _, gap = _along(way, first, second)
        aside = minus(gap, scaled(way, dot(gap, way)))
        size = length(aside)
        if size < 1e-9:  # noqa: PLR2004
            break
        turned = minus(way, scaled(aside, step / size))
        turned = scaled(turned, 1 / (length(turned) or 1.0))
        depth, _ = _along(turned, first, second)
        if depth <= 0:
            return 0.0
        if depth < least:
            least, way = depth, turned
        else:
            step /= 2
    return least


def _along(direction: Vector, first: Solid, second: Solid) -> tuple[float, Vector]:
    """Return how far the first shape reaches into the second in a direction, and by what points."""
    x, y, z = direction
    gap = minus(first.farthest(direction), second.farthest((-x, -y, -z)))
    return dot(gap, direction), gap


def _directions(first: Solid, second: Solid) -> Iterator[Vector]:
    """Yield the directions in which two shapes may be nearest to being apart, of length 1."""
    centres = minus(second.centre, first.centre)
    ways = [*AXES, centres]
    for solid in (first, second):
        points = solid.points
        if solid.axis is not None:
            ways += [solid.axis, minus(centres, scaled(solid.axis, dot(centres, solid.axis)))]
            ways += across(solid.axis)
        elif solid.kind == "Cube":
            ways += [minus(points[k], points[0]) for k in (4, 2, 1)]
        elif len(points) == _CORNERS and not solid.radii:
            ways.append(cross(minus(points[1], points[0]), minus(points[2], points[0])))
    for way in ways:
        size = length(way)
        if size > 1e-12:  # noqa: PLR2004
            yield scaled(way, 1 / size)
            yield scaled(way, -1 / size)
