"""What a sensor has around it: how near and how far things are, and what hides them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from lab3_usd.check.match.rule_inputs import RobotSubject, StageSubject
from lab3_usd.model.physics import number, numbers
from lab3_usd.model.prims import Collider, Prim, is_at_or_below
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.model.transforms import Vector, scaled

_SOLID = ("Cube", "Sphere", "Cylinder", "Capsule", "Cone")  # whose boxes are as they are
_SHAPES = (*_SOLID, "Mesh")
_ROOM = 1.5  # metres to a side: what is larger around a sensor is a room, or the sky
INVISIBLE = {"visibility": "invisible"}
_HIDDEN = {**INVISIBLE, "purpose": "guide"}
_INTENSITY, _EXPOSURE, _COLOR = "inputs:intensity", "inputs:exposure", "inputs:color"
_SHARES = ("inputs:diffuse", "inputs:specular")  # of its light that materials scatter and reflect
_BRIGHTEST = 50_000.0  # the largest intensity that a schema gives (DistantLight)
_DARK = 0.01  # intensity below which nothing is seen


def place_of(prim: Prim, subject: StageSubject) -> Vector | None:
    """Return where a prim is at the start, in metres; None where nothing, or an asset, says it."""
    if prim.world is None or subject.stage.unknown_pose(prim):
        return None
    return scaled((prim.world[12], prim.world[13], prim.world[14]), subject.stage.meters_per_unit)


def blind_range(
    stage: StageModel, robot: str, at: Vector, limits: tuple[float | None, float | None]
) -> tuple[float, float] | None:
    """Return between which distances all things lie that are level with a place, if none is seen.

    They lie between by their boxes, which may be nearer, and reach farther, than what is in them.
    What belongs to the prim at `robot` is left out. None where something may lie between the
    `limits`, the near and the far range, or there are no things.
    """
    near, far = limits
    nearest, farthest = math.inf, 0.0
    for box in _things(stage, robot):
        if not box.low[2] <= at[2] <= box.high[2]:
            continue
        gaps = [(box.low[i] - at[i], box.high[i] - at[i]) for i in (0, 1)]
        nearest = min(nearest, math.hypot(*(max(low, 0.0, -high) for low, high in gaps)))
        farthest = max(farthest, math.hypot(*(max(-low, high) for low, high in gaps)))
        if (far is None or nearest <= far) and (near is None or near <= farthest):
            return None
    return (nearest, farthest) if farthest > 0 else None


def _things(stage: StageModel, robot: str) -> Iterator[Collider]:
    """Yield the boxes around all that a robot may meet or see beside itself."""
    yield from stage.colliders.beside(robot)
    for prim in stage.of_type(lambda name: name in _SHAPES):
        if prim.present and not is_at_or_below(prim.path, robot):
            box = stage.colliders.shape(prim.path)
            if box is not None:
                yield box


def enclosing(sensor: Prim, subject: RobotSubject) -> Iterator[Prim]:
    """Yield the shapes on the robot right around a sensor that are no part of how it looks."""
    at = place_of(sensor, subject)
    if at is None:
        return
    for prim, box in _shapes_on_robot(subject):
        is_around = all(
            low < middle < high for low, middle, high in zip(box.low, at, box.high, strict=True)
        )
        if is_around and hidden_by(prim, subject.stage) is None:
            yield prim


@once_per_stage
def _shapes_on_robot(subject: RobotSubject) -> tuple[tuple[Prim, Collider], ...]:
    """Return the shapes on the robot that are no part of how it looks, and no room, with boxes."""
    robot, stage = subject.robot, subject.stage
    shapes = []
    for prim in stage.below(robot.path, _SOLID.__contains__, frozenset(robot.appearance_below)):
        box = stage.colliders.shape(prim.path) if prim.present else None
        if box is not None and all(
            high - low < 2 * _ROOM for low, high in zip(box.low, box.high, strict=True)
        ):
            shapes.append((prim, box))
    return tuple(shapes)


def hidden_by(prim: Prim, stage: StageModel, hiding: Mapping[str, str] = _HIDDEN) -> Prim | None:
    """Return the prim, itself or one above it, by whose value a prim is not rendered."""
    path = prim.path
    while path:
        above = stage.prim(path)
        values = {} if above is None else above.attributes
        if any(values.get(name) == value for name, value in hiding.items()):
            return above
        path = path.rpartition("/")[0]
    return None


def darkened(light: Prim, stage: StageModel) -> tuple[Prim, str] | None:
    """Return the prim and the property by which a light is dark, None for one that shines."""
    intensity, exposure = (number(light.attributes.get(n)) for n in (_INTENSITY, _EXPOSURE))
    if intensity is not None and intensity <= 0:
        return light, _INTENSITY
    # UsdLux multiplies the intensity by two to the power of the exposure, and by the color.
    if math.log2(intensity or _BRIGHTEST) + (exposure or 0.0) < math.log2(_DARK):
        return light, _EXPOSURE
    color = numbers(light.attributes.get(_COLOR))
    if color and max(color) <= 0:
        return light, _COLOR
    if all(number(light.attributes.get(name)) == 0 for name in _SHARES):
        return light, _SHARES[0]
    hiding = hidden_by(light, stage, INVISIBLE)
    return None if hiding is None else (hiding, next(iter(INVISIBLE)))


def shares_of(dark: Iterable[tuple[Prim, str]]) -> Iterator[tuple[str, str]]:
    """Yield the shares of lights that are dark because all of their shares are 0."""
    for light, name in dark:
        yield from ((light.path, share) for share in _SHARES if name in _SHARES)
