"""How large the wheels of a robot are and how far apart they sit, as its bodies and joints tell."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lab3_usd.check.robot.axles import wheel_radius
from lab3_usd.model.physics import BODIES
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.model.transforms import Vector, distance, transform_point

_OF_CAR = 4  # wheels


def pair_sizes(pair: Sequence[Prim], stage: StageModel) -> dict[str, float | None]:
    """Return the sizes of a robot of two driven wheels in metres, as `QuantityOf` names them."""
    return {"radius": _common_radius(pair, stage), "distance": wheel_distance(stage, *pair)}


def car_sizes(wheels: Sequence[Prim], stage: StageModel) -> dict[str, float | None]:
    """Return the sizes of a car in metres, as `QuantityOf` names them; none of other robots.

    Its wheels are front left and right, back left and right (ackermann_controller.py:82-84).
    """
    if len(wheels) != _OF_CAR:
        return {}
    sizes = {
        "front radius": _common_radius(wheels[:2], stage),
        "back radius": _common_radius(wheels[2:], stage),
        "track": wheel_distance(stage, *wheels[2:]),
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
    return one if one == other else None


@once_per_stage
def wheel_distance(stage: StageModel, one: Prim, other: Prim) -> float | None:
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
    place = joint.attributes.get("physics:localPos0", (0.0, 0.0, 0.0))
    if _base(joint, stage) is None or not isinstance(place, tuple):
        return None
    numbers = [float(part) for part in place if isinstance(part, (int, float))]
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == len("xyz") else None


def _anchor_in_world(joint: Prim, stage: StageModel) -> Vector | None:
    base, place = _base(joint, stage), anchor(joint, stage)
    if base is None or base.world is None or place is None:
        return None
    return transform_point(place, base.world)
