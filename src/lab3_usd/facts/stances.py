"""How the robots of a stage stand: what a dry run works out, where boxes leave a doubt."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

from lab3_usd.facts.articulations import driven_wheels
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.model.physics import (
    BODIES,
    CENTRE,
    DRIVE_API,
    MASS,
    PLANE,
    REVOLUTE,
    STIFFNESS,
    UNSET,
    joints,
    number,
    vector,
)
from lab3_usd.model.prims import Collider, Prim
from lab3_usd.model.stage import Node, StageModel, once_per_stage
from lab3_usd.model.transforms import IDENTITY, scaled, transform_point

if TYPE_CHECKING:
    from lab3_usd.physics.machine import Machine
    from lab3_usd.physics.machines import Machines

INERTIA = "physics:diagonalInertia"
_NOISE = 5e-5  # metres between boxes
_DEEP = 5e-3  # metres by which boxes of shapes overlap that are inside one another
_NEAR = 0.01  # metres above the lowest point up to which a shape may carry a robot
_BESIDE = 2e-3  # metres around a centre of mass that are to be carried as well
_STEP = 0.05  # metres that ground may be above the lowest point of a robot
_HEAVY = 10.0  # times that inertia is larger than that of a ball around the body
_MESH = "Mesh"
_Point = tuple[float, float]
_LEVEL = 1e-7  # metres by which a way over a place between two points is longer, 0.1 mm beside
_FEW = 64  # square metres below a box, beyond which each robot looks at it


@once_per_stage
def machines(stage: StageModel) -> Machines | None:
    """Return what moves on a stage as a dry run has it, None where boxes show that it stands well.

    Nothing is known of what a script makes. Z is up in what is returned.
    """
    if stage.scene is None or not _is_doubtful(stage):
        return None
    from lab3_usd.physics.machines import Machines  # which few stages need

    return Machines(stage.scene().upright(), has_ground=True)


def driven_machines(stage: StageModel) -> Iterator[tuple[Node, Machine]]:
    """Yield the robots whose wheels controllers drive, each with the node that commands it."""
    bases: set[str] = set()
    for command, _, wheels in driven_wheels(stage):
        built = machines(stage)
        ends = (path for wheel in wheels for path in wheel.relationships.get(BODIES[1], ()))
        members = (built.member.get(path) for path in ends) if built is not None else ()
        machine = next(filter(None, members), None)
        if machine is not None and machine.base not in bases:
            bases.add(machine.base)
            yield command.node, machine


def _is_doubtful(stage: StageModel) -> bool:
    """Whether boxes do not tell that a robot stands on its wheels and is in nothing."""
    bodies = joined_bodies(stage)
    wheels = _wheels(stage)
    boxes: dict[str, list[tuple[Collider, str]]] = {}
    for bounds in stage.colliders.bounds():
        body = bodies.carrier(bounds.path)
        name = bodies.robots.get(body, "")
        is_robot = name and bodies.sizes.get(name, 0) > 1
        box = stage.colliders.measured(bounds.path) if is_robot else bounds
        if box is not None:
            if stage.up_axis != "Z":  # as it would be with Z up
                (x, y, z), (u, v, w) = box.low, box.high
                box = Collider(box.path, (x, -w, y), (u, -z, v))
            boxes.setdefault(name, []).append((box, body))
    robots = {name: own for name, own in boxes.items() if name and bodies.sizes.get(name, 0) > 1}
    rolling = {bodies.robots[link] for link in wheels}
    members: dict[str, list[str]] = {}
    for body, name in bodies.robots.items():
        members.setdefault(name, []).append(body)
    for name in rolling & robots.keys():
        own = robots[name]
        low = min((box.low[2] for box, body in own if body in wheels), default=0.0)
        if any(box.low[2] < low - _NOISE for box, body in own if body not in wheels):
            return True
        if _may_tip(stage, own, members[name]):
            return True
    whole = {name: _around(box for box, _ in own) for name, own in robots.items()}
    return (
        _has_odd_ground(
            stage, boxes.get("", ()), {name: whole[name] for name in rolling & {*whole}}
        )
        or _meet(stage, boxes, whole)
        or any(_is_odd_inertia(stage, own) for own in robots.values())
    )


@once_per_stage
def _wheels(stage: StageModel) -> frozenset[str]:
    """Return the bodies that joints turn whose drives hold a speed."""
    return frozenset(
        body
        for joint in joints(stage)
        if joint.type == REVOLUTE
        and DRIVE_API in joint.apis
        and not number(joint.attributes.get(STIFFNESS))
        for path in joint.relationships.get(BODIES[1], ())
        if (body := joined_bodies(stage).carrier(path))
    )


def _around(boxes: Iterable[Collider]) -> Collider:
    every = list(boxes)
    low = [min(box.low[k] for box in every) for k in range(3)]
    high = [max(box.high[k] for box in every) for k in range(3)]
    return Collider("", (low[0], low[1], low[2]), (high[0], high[1], high[2]))


def _may_tip(stage: StageModel, own: Sequence[tuple[Collider, str]], bodies: Sequence[str]) -> bool:
    """Whether the centre of mass of a robot may be beside the middles of what is near the ground.

    The mass centre of a body without an authored mass comes from its shapes, and boxes do not
    determine it. So its own centre must be among those middles, too, unless it is near the ground.
    """
    shapes: dict[str, list[Collider]] = {}
    for box, body in own:
        shapes.setdefault(body, []).append(box)
    low = min(box.low[2] for box, _ in own)
    feet = {
        body: [box for box in boxes if box.low[2] <= low + _NEAR] for body, boxes in shapes.items()
    }
    total, moment, places = 0.0, (0.0, 0.0), []
    for body in bodies:
        mass = max(0.0, number(stage.prims[body].attributes.get(MASS)) or 0.0)
        x, y = _centre_of(stage.prims[body], shapes.get(body, ()), stage)
        total, moment = total + mass, (moment[0] + mass * x, moment[1] + mass * y)
        if not mass and not feet.get(body):
            places.append((x, y))
    places += [(moment[0] / total, moment[1] / total)] if total else []
    middles = [_middle(box) for boxes in feet.values() for box in boxes]
    return not places or not all(_is_carried(place, middles) for place in places)


def _is_carried(place: _Point, feet: Sequence[_Point]) -> bool:
    """Whether a place, and what is right around it, is among points, or it is between two."""
    x, y = place
    around = [(x + u, y + v) for u in (-_BESIDE, _BESIDE) for v in (-_BESIDE, _BESIDE)]
    if all(_is_among(feet, near) for near in around):
        return True
    pairs = combinations(feet, 2)
    return any(
        math.dist(a, place) + math.dist(place, b) - math.dist(a, b) < _LEVEL for a, b in pairs
    )


def _centre_of(prim: Prim, shapes: Sequence[Collider], stage: StageModel) -> tuple[float, float]:
    """Return where about the centre of mass of a body is, seen from above."""
    centre = vector(prim.attributes.get(CENTRE)) if CENTRE in prim.attributes else None
    if (centre is None or max(map(abs, centre)) >= UNSET) and shapes:
        return _middle(_around(shapes))
    local = centre if centre is not None and max(map(abs, centre)) < UNSET else (0.0, 0.0, 0.0)
    x, y, z = scaled(transform_point(local, prim.world or IDENTITY), stage.meters_per_unit)
    return (x, y) if stage.up_axis == "Z" else (x, -z)


def _middle(box: Collider) -> tuple[float, float]:
    return (box.low[0] + box.high[0]) / 2, (box.low[1] + box.high[1]) / 2


def _is_among(points: Sequence[_Point], place: _Point) -> bool:
    """Whether points lie around a place on all sides."""
    x, y = place
    ways = sorted(math.atan2(v - y, u - x) for u, v in points)
    return all(b - a < math.pi for a, b in pairwise([*ways, ways[0] + 2 * math.pi]))


def _has_odd_ground(
    stage: StageModel, still: Sequence[tuple[Collider, str]], robots: Mapping[str, Collider]
) -> bool:
    """Whether the ground below a robot may face down: a plane that is turned, or a mesh."""
    planes = [prim for prim in stage.of_type(PLANE) if prim.present and prim.world is not None]
    if any(not _faces_up(prim.world or ()) for prim in planes):
        return True
    if planes:
        return False
    return any(
        box.low[2] <= robot.low[2] + _STEP
        and all(box.low[k] <= (robot.low[k] + robot.high[k]) / 2 <= box.high[k] for k in (0, 1))
        and stage.prims[box.path].type == _MESH
        for robot in robots.values()
        for box, _ in still
    )


def _faces_up(world: Sequence[float]) -> bool:
    a, b, c, d, e, f, g, h, i = (world[4 * row + column] for row in range(3) for column in range(3))
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0 and i > 0


def _meet(
    stage: StageModel,
    boxes: Mapping[str, Sequence[tuple[Collider, str]]],
    robots: Mapping[str, Collider],
) -> bool:
    """Whether the box of a robot's shape is inside that of something else."""
    squares: dict[_Square, list[Collider]] = {}
    for box in (box for theirs in boxes.values() for box, _ in theirs) if robots else ():
        for square in _under(box):
            squares.setdefault(square, []).append(box)
    for name, robot in robots.items():
        own = {box.path: box for box, _ in boxes[name]}
        for box in (box for square in (*_under(robot), None) for box in squares.get(square, ())):
            if box.path not in own:
                least = 0.0 if stage.prims[box.path].type == _MESH else _DEEP
                for shape in own.values():
                    overlap = min(
                        min(box.high[k], shape.high[k]) - max(box.low[k], shape.low[k])
                        for k in range(3)
                    )
                    if overlap >= least:
                        return True
    return False


_Square = tuple[int, int] | None


def _under(box: Collider) -> Sequence[_Square]:
    """Return the square metres that a box stands on; None where there are many."""
    (x, y, _), (u, v, _) = box.low, box.high
    if not (u - x) * (v - y) < _FEW:
        return (None,)
    across = range(math.floor(x), math.floor(u) + 1)
    return [(a, b) for a in across for b in range(math.floor(y), math.floor(v) + 1)]


def _is_odd_inertia(stage: StageModel, own: Sequence[tuple[Collider, str]]) -> bool:
    """Whether a body of a robot may have an inertia that its mass and size do not allow.

    What is no wheel is held against the whole robot.
    """
    bodies = dict.fromkeys(body for _, body in own)
    masses = {body: number(stage.prims[body].attributes.get(MASS)) or 0.0 for body in bodies}
    for body in bodies:
        inertia = vector(stage.prims[body].attributes.get(INERTIA))
        if not any(inertia):
            continue
        parts = [body] if body in _wheels(stage) else [*bodies]
        box = _around(box for box, of in own if of in parts)
        sides = [high - low for low, high in zip(box.low, box.high, strict=True)]
        size = sum(side * side for side in sides) / 4
        usual = sum(masses[part] for part in parts) * size
        unit = stage.meters_per_unit  # not to a power, which raises for the largest numbers
        if max(map(abs, inertia)) * unit * unit > _HEAVY * usual:
            return True
    return False
