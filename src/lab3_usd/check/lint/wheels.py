"""The size and the places of wheels, as their shapes and joints tell."""

from __future__ import annotations

import math

from lab3_usd.model.stage import Collider, Matrix, Prim, StageModel
from lab3_usd.model.transform_math import Vector, distance, transform_point

_BODIES = ("physics:body0", "physics:body1")
_SQUARE = 0.999  # how far along an axis an axis must point
_ALIKE = 0.02


def _body(joint: Prim, side: int, stage: StageModel) -> Prim | None:
    paths = joint.relationships.get(_BODIES[side], ())
    return stage.prim(paths[0]) if paths else None


def wheel_radius(joint: Prim, stage: StageModel) -> float | None:
    """Return the radius of the wheel that a joint turns, in metres; None where nothing tells it.

    A wheel is as high as it is long: two sides of the box around it are alike. A wheel that was
    saved turned has a larger box, so that none is taken then.
    """
    wheel = _body(joint, 1, stage)
    if wheel is None or wheel.world is None or not _is_square(wheel.world):
        return None
    boxes = list(stage.colliders.below(wheel.path))
    return _radius(boxes) if boxes else None


def _radius(boxes: list[Collider]) -> float | None:
    sides = sorted(
        max(box.high[axis] for box in boxes) - min(box.low[axis] for box in boxes)
        for axis in range(3)
    )
    is_wheel = math.isclose(sides[1], sides[2], rel_tol=_ALIKE) and sides[0] < sides[1]
    return sides[2] / 2 if is_wheel else None


def _is_square(world: Matrix) -> bool:
    """Whether the axes of a prim point along those of the world."""
    rows = (world[0:3], world[4:7], world[8:11])
    return all(max(map(abs, row)) > _SQUARE * math.hypot(*row) for row in rows)


def anchor(joint: Prim, stage: StageModel) -> Vector | None:
    """Return where a joint sits on its base, in the base's own axes and in stage units."""
    base = _body(joint, 0, stage)
    place = joint.attributes.get("physics:localPos0", (0.0, 0.0, 0.0))
    if base is None or not isinstance(place, tuple):
        return None
    numbers = [float(each) for each in place if isinstance(each, (int, float))]
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == len("xyz") else None


def wheel_distance(one: Prim, other: Prim, stage: StageModel) -> float | None:
    """Return how far two joints sit apart, in metres; None where nothing tells it."""
    places = []
    for joint in (one, other):
        base, place = _body(joint, 0, stage), anchor(joint, stage)
        if base is None or base.world is None or place is None:
            return None
        places.append(transform_point(place, base.world))
    return distance(*places) * stage.meters_per_unit
