"""The wheels of robots as bodies, joints and colliders tell: axles, radii, distances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from msgspec import Struct

from lab3_usd.isaac.values import Value
from lab3_usd.model.physics import AXIS, BODIES, PLANE, USUAL_AXIS, numbers
from lab3_usd.model.prims import Collider, Prim, is_at_or_below
from lab3_usd.model.stage import StageModel, UnresolvedAsset, once_per_stage
from lab3_usd.model.transforms import (
    AXES,
    Vector,
    distance,
    rotate_by_quaternion,
    scaled,
    transform_point,
)

ALONG: dict[Any, Vector] = dict(zip("XYZ", AXES, strict=True))
_ROUND = {"Cylinder": False, "Cone": False, "Capsule": True}  # whether they end in half balls
_BALL = "Sphere"
_FLAT = ("Cube", PLANE)
_SQUARE = 0.999  # how far along an axis an axis must point
_ALIKE = 0.02
_NOISE = 1e-4  # of sizes that are measured after turns and scales
_PAIR, _OF_CAR = 2, 4  # wheels


def axis_of_joint(joint: Prim, side: int) -> Vector | None:
    """Return about what a positive velocity turns the other body, in the axes of this side's."""
    along = ALONG.get(joint.attributes.get(AXIS, USUAL_AXIS))
    if along is None:
        return None
    turn = joint_turn(joint.attributes.get(f"physics:localRot{side}"))
    # A joint turns its second body against its first.
    return scaled(rotate_by_quaternion(along, turn), 1.0 if side == 0 else -1.0)


class Disc(Struct, frozen=True):
    """The shape of a wheel in the world: its sizes in metres, and the axis it rolls about."""

    radius: float
    width: float
    axis: Vector


@once_per_stage
def disc_of(wheel: Prim, stage: StageModel) -> Disc | None:
    """Return the shape of a wheel, None where nothing tells it.

    A wheel is as high as it is long: two sides of the box around it are alike. A wheel that was
    saved turned has a larger box, so that none is taken then.
    """
    boxes = list(stage.colliders.below(wheel.path))
    if wheel.world is None or not boxes:
        return None
    rows = (wheel.world[0:3], wheel.world[4:7], wheel.world[8:11])
    if not all(max(map(abs, row)) > _SQUARE * math.hypot(*row) for row in rows):
        return None  # its axes do not point along those of the world
    sides = [
        max(box.high[axis] for box in boxes) - min(box.low[axis] for box in boxes)
        for axis in range(3)
    ]
    width, height, length = sorted(sides)
    if not math.isclose(height, length, rel_tol=_ALIKE) or width >= height:
        return None
    return Disc(length / 2, width, AXES[sides.index(width)])


def wheel_radius(joint: Prim, stage: StageModel) -> float | None:
    """Return the radius of the wheel that a joint turns, None where nothing tells it."""
    paths = joint.relationships.get(BODIES[1], ())
    wheel = stage.prim(paths[0]) if paths else None
    disc = None if wheel is None else disc_of(wheel, stage)
    return None if disc is None else disc.radius


def unknown_shape(joints: Sequence[Prim], stage: StageModel) -> UnresolvedAsset | None:
    """Return the missing asset that could hold a shape of the wheels which joints turn.

    One at the robot, or beside its wheels, changes nothing of what the file says of them.
    """
    wheels = [path for joint in joints for path in joint.relationships.get(BODIES[1], ())[:1]]
    inside = (
        asset
        for asset in stage.unresolved
        if any(is_at_or_below(asset.prim, wheel) for wheel in wheels)
    )
    return next(inside, None)


def sizes_of(wheels: Sequence[Prim], stage: StageModel) -> dict[str, float | None]:
    """Return the sizes of a robot in metres, as `QuantityOf` names them: of two wheels, or a car.

    The wheels of a car are front left and right, back left and right
    (ackermann_controller.py:82-84).
    """
    if len(wheels) == _PAIR:
        distance = distance_of_wheels(stage, *wheels)
        return {"radius": _common_radius(wheels, stage), "distance": distance}
    if len(wheels) != _OF_CAR:
        return {}
    sizes = {
        "front radius": _common_radius(wheels[:2], stage),
        "back radius": _common_radius(wheels[2:], stage),
        "track": distance_of_wheels(stage, *wheels[2:]),
    }
    places = [place for joint in wheels if (place := _anchor_in_world(joint, stage)) is not None]
    if len(places) == _OF_CAR:
        a, b, c, d = places
        front, back = (
            [sum(pair) / 2 for pair in zip(*ends, strict=True)] for ends in ((a, b), (c, d))
        )
        sizes["wheel base"] = math.dist(front, back) * stage.meters_per_unit
    return sizes


def _common_radius(pair: Sequence[Prim], stage: StageModel) -> float | None:
    one, other = (wheel_radius(joint, stage) for joint in pair)
    is_same = one is not None and other is not None and math.isclose(one, other, rel_tol=_NOISE)
    return one if is_same else None


@once_per_stage
def distance_of_wheels(stage: StageModel, one: Prim, other: Prim) -> float | None:
    """Return how far two joints sit apart, in metres; None where nothing tells it."""
    first, second = _anchor_in_world(one, stage), _anchor_in_world(other, stage)
    if first is None or second is None:
        return None
    return distance(first, second) * stage.meters_per_unit


def _base(joint: Prim, stage: StageModel) -> Prim | None:
    paths = joint.relationships.get(BODIES[0], ())
    return stage.prim(paths[0]) if paths else None


def anchor(joint: Prim, stage: StageModel) -> Vector | None:
    """Return where a joint sits on its base, in the base's own axes and in stage units."""
    place = numbers(joint.attributes.get("physics:localPos0", (0.0, 0.0, 0.0)))
    is_known = _base(joint, stage) is not None and len(place) == len("xyz")
    return (place[0], place[1], place[2]) if is_known else None


def _anchor_in_world(joint: Prim, stage: StageModel) -> Vector | None:
    base, place = _base(joint, stage), anchor(joint, stage)
    if base is None or base.world is None or place is None:
        return None
    return transform_point(place, base.world)


def joint_turn(value: Value | None) -> tuple[float, float, float, float]:
    """Return a rotation in the frame of a joint as x, y, z, w; none where it is not written."""
    parts = numbers(value)
    if len(parts) != 4:  # noqa: PLR2004 - x, y, z, w
        return (0.0, 0.0, 0.0, 1.0)
    return (parts[0], parts[1], parts[2], parts[3])


def rolling_radius(link: str, axle: Vector, stage: StageModel) -> tuple[float | None, str]:
    """Return the radius of a link about its axle in metres, and what told it or stands there.

    Without any collider nothing is there: ''.
    """
    radii: list[tuple[float, str]] = []
    shapes = list(stage.colliders.below(link))
    for shape in shapes:
        radius = _round(shape, axle, stage)
        if radius is not None:
            radii.append((radius, shape.path))
    if radii:
        return max(radii)
    return None, shapes[0].path if shapes else ""


def _round(shape: Collider, axle: Vector, stage: StageModel) -> float | None:
    prim = stage.prims.get(shape.path)
    half = [(high - low) / 2 for low, high in zip(shape.low, shape.high, strict=True)]
    if prim is None or prim.type in _FLAT:
        return None
    if prim.type == _BALL:
        return max(half)
    if prim.type in _ROUND and prim.world is not None:
        index = "XYZ".find(str(prim.attributes.get("axis", "Z")))
        row = prim.world[4 * index : 4 * index + 3]
        size = math.hypot(*row) or 1.0
        return _of_cylinder(half, [abs(part) / size for part in row], has_balls=_ROUND[prim.type])
    along = [abs(part) for part in axle]
    if max(along) < _SQUARE:
        return None
    across = [size for size, part in zip(half, along, strict=True) if part != max(along)]
    is_round = math.isclose(across[0], across[1], rel_tol=_ALIKE)
    return sum(across) / len(across) if is_round else None


def _of_cylinder(half: Sequence[float], along: Sequence[float], *, has_balls: bool) -> float | None:
    """Return the radius of a cylinder from the box around it and the direction of its axis.

    Half a side of the box is half the height along it, and the radius across.
    """
    low, high = min(range(3), key=along.__getitem__), max(range(3), key=along.__getitem__)
    across = [1.0 if has_balls else math.sqrt(max(0.0, 1 - part * part)) for part in along]
    determinant = across[low] * along[high] - across[high] * along[low]
    if not determinant:
        return None
    return (half[low] * along[high] - half[high] * along[low]) / determinant
