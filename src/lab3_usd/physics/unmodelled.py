"""Physics that moves or stops a robot and is not simulated: the attribute, by prim."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from lab3_usd.model.dry_run import Scene, ScenePrim
from lab3_usd.model.joint_drives import DRIVEN_AXES
from lab3_usd.model.physics import SCENE, UNSET, numbers, vector
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.transforms import box_of, length, minus
from lab3_usd.physics.bodies import OWNER, has_collision, has_drive
from lab3_usd.physics.machine import HINGE, JOINTS, Joint, Machine

if TYPE_CHECKING:
    from lab3_usd.physics.machines import Machines

_GROUP = "PhysicsCollisionGroup"
_PAIRS = "physics:filteredPairs"
_FILTERED, _INVERTED = "physics:filteredGroups", "physics:invertFilteredGroups"
_COLLIDERS = "collection:colliders:"
_SPEED = "physxJoint:maxJointVelocity"
_ROUND, _EVEN = ("Sphere", "Cylinder", "Capsule", "Cone"), 0.01
_INERTIA, _PLACEHOLDER = "physics:diagonalInertia", 50.0  # times that no shape explains
_MIMIC = ("physxMimicJoint:", "newton:mimic")
_FASTEST = 0.5  # metres a second: no command lets a robot, or the rim of a wheel, go faster
_SLOWEST = 10.0  # degrees a second: a joint that may turn so fast comes where it should

Harmless = Callable[[Any], bool]


def _is(*values: object) -> Harmless:
    return lambda value: value in values


def _most(limit: float) -> Harmless:
    def is_small(value: Any) -> bool:
        parts = numbers(value if isinstance(value, tuple) else (value,))
        return all(abs(part) <= limit for part in parts)

    return is_small


def _least(limit: float) -> Harmless:
    return lambda value: not isinstance(value, (int, float)) or value >= limit


# The values with which nothing changes: those of the schemas, and what is too little to matter.
_BODY: Mapping[str, Harmless] = {
    "physics:velocity": _most(1.0),
    "physics:angularVelocity": _most(1000.0),
    "physxRigidBody:lockedPosAxis": _is(0),
    "physxRigidBody:lockedRotAxis": _is(0),
    "physxRigidBody:disableGravity": _most(0.0),
    "physxRigidBody:solveContact": _least(1.0),
    "physxRigidBody:linearDamping": _most(1.0),
    "physxRigidBody:angularDamping": _most(1.0),
    "physxRigidBody:maxLinearVelocity": _least(_FASTEST),
    "physxRigidBody:maxAngularVelocity": _least(1000.0),
    "physxForce:force": _most(0.0),
    "physxForce:torque": _most(0.0),
}
_JOINT: Mapping[str, Harmless] = {
    "physics:breakForce": _least(100.0),
    "physics:breakTorque": _least(100.0),
    "physxJoint:jointFriction": _most(0.1),
    "physxJoint:armature": _most(0.1),
}
_SURFACE: Mapping[str, Harmless] = {
    "physxSurfaceVelocity:surfaceVelocity": _most(0.0),
    "physxSurfaceVelocity:surfaceAngularVelocity": _most(0.0),
}
_OF_SCENE: Mapping[str, Harmless] = {
    "physxScene:updateType": _is("Synchronous", "Asynchronous"),
    "physxScene:invertCollisionGroupFilter": _most(0.0),
}
_SWITCHES = {
    "physxForce:": "physxForce:forceEnabled",
    "physxSurfaceVelocity:": "physxSurfaceVelocity:surfaceVelocityEnabled",
}


def unmodelled(machines: Machines, robot: Machine) -> dict[str, str]:
    """Return what of a robot, its ground and its scene is not simulated: attributes by prim."""
    scene = machines.scene
    bodies = [scene.prims[body] for body in robot.rest]
    floors = [scene.prims[path] for path in machines.floors(robot)]
    own = [
        prim
        for prim in scene.prims.values()
        if has_collision(prim) and machines.body_of(prim.path) in robot.rest
    ]
    grounds = [above for floor in floors for above in scene.above(floor.path)]
    effects = [
        *(
            pair
            for prim in scene.prims.values()
            if prim.type == SCENE
            for pair in _bad(prim, _OF_SCENE)
        ),
        *(pair for body in bodies for pair in _bad(body, {**_BODY, **_SURFACE})),
        *(pair for ground in grounds for pair in _bad(ground, _SURFACE)),
        *(pair for prim in scene.prims.values() for pair in _of_joint(prim, machines, robot)),
        *_uneven(own),
        *inert(machines, robot),
        *_owned(scene, [*bodies, *own, *floors]),
        *filtered(machines, [prim.path for prim in own], [floor.path for floor in floors]),
    ]
    return dict(reversed(effects))  # the first of each


def _bad(prim: ScenePrim, table: Mapping[str, Harmless]) -> Iterator[tuple[str, str]]:
    for name, value in prim.values.items():
        switch = next((at for start, at in _SWITCHES.items() if name.startswith(start)), "")
        if name in table and not table[name](value) and prim.values.get(switch) is not False:
            yield prim.path, f"{name} is {value}"


def _of_joint(prim: ScenePrim, machines: Machines, robot: Machine) -> Iterator[tuple[str, str]]:
    if not any(machines.body_of(end) in robot.rest for end in prim.ends):
        return
    if prim.values.get("physics:jointEnabled") is False:
        return
    if has_drive(prim) and prim.type in JOINTS and prim.type not in DRIVEN_AXES:
        yield prim.path, f"{prim.type} with a drive, whose axes are not played"
    yield from _bad(prim, _JOINT)
    for name in (name for name, at in prim.targets.items() if name.startswith(_MIMIC) and at):
        yield prim.path, f"{name} is {prim.targets[name][0]}"
    speed = prim.values.get(_SPEED)
    joint = robot.joints.get(prim.path.rpartition("/")[2])
    if isinstance(speed, float) and joint is not None and speed < _needed(joint, machines, robot):
        yield prim.path, f"{_SPEED} is {speed}"


def _needed(joint: Joint, machines: Machines, robot: Machine) -> float:
    """Return how fast a joint turns at the most, degrees or units a second."""
    unit = machines.scene.meters_per_unit
    radius = next((wheel.radius for wheel in robot.wheels if wheel.joint is joint), 0.0)
    if radius > 0:
        return math.degrees(_FASTEST / unit / radius)
    return _SLOWEST if joint.kind == HINGE else math.radians(_SLOWEST) / unit


def inert(machines: Machines, robot: Machine) -> Iterator[tuple[str, str]]:
    """Yield bodies with an inertia that none of their mass and size can have.

    One that turns on no joint is a part of the robot, and is held against the whole.
    """
    stance = machines.stances.get(robot.base)
    if stance is None:
        return
    turning = {robot.link_of(joint) for joint in robot.joints.values()}
    unit = machines.scene.meters_per_unit
    for body in robot.rest:
        most = max(map(abs, vector(machines.scene.prims[body].values.get(_INERTIA))))
        parts = [body] if body in turning else [*robot.rest]
        shapes = [shape for part in parts for shape in stance.solids[part]]
        points = [point for shape in shapes for point in shape.points]
        if not most or most > UNSET or not points:
            continue
        low, high = box_of(points)
        reach = max((r for shape in shapes for r in shape.radii), default=0.0)
        size = length(minus(high, low)) / 2 + reach
        usual = sum(stance.masses[part] for part in parts) * size**2
        if most > _PLACEHOLDER * usual:
            text = (
                f"{_INERTIA} is {most * unit**2:g} kg m2, about {most / usual:.0f} times what its"
            )
            yield body, f"{text} mass and size allow"


def _uneven(shapes: list[ScenePrim]) -> Iterator[tuple[str, str]]:
    """Yield round shapes of another scale across: their radius in PhysX is not what is seen."""
    for shape in shapes:
        if shape.type not in _ROUND:
            continue
        along = "XYZ".find(str(shape.values.get("axis", "Z"))) if shape.type == "Cylinder" else -1
        columns = zip(*shape.world.rows, strict=True)
        scale = [math.hypot(*column) for column in columns]
        across = [size for index, size in enumerate(scale) if index != along]
        if min(across) < (1 - _EVEN) * max(across):
            yield shape.path, f"its scale is {', '.join(f'{size:g}' for size in scale)}"


def _owned(scene: Scene, prims: list[ScenePrim]) -> Iterator[tuple[str, str]]:
    """Yield what belongs to a scene that the rest does not; of several nobody says which."""
    scenes = [prim.path for prim in scene.prims.values() if prim.type == SCENE]
    usual = scenes[0] if len(scenes) == 1 else ""
    owners = {prim.path: (prim.targets.get(OWNER) or (usual,))[0] for prim in prims}
    for path, owner in owners.items() if len(set(owners.values())) > 1 else ():
        if owner != usual:
            yield path, f"{OWNER} is {owner}"


Covers = Callable[[str], bool]


def filters_of(scene: Scene) -> Iterator[tuple[str, str, Covers, Covers]]:
    """Yield what lets shapes pass through each other: a prim, its value, and both sides."""
    for prim in scene.prims.values():
        for target in prim.targets.get(_PAIRS, ()):
            yield prim.path, f"{_PAIRS} is {target}", _below(prim.path), _below(target)
    groups = {prim.path: prim for prim in scene.prims.values() if prim.type == _GROUP}
    for path, group in groups.items():
        named = [groups[to] for to in group.targets.get(_FILTERED, ()) if to in groups]
        if group.values.get(_INVERTED) is True:
            yield path, f"{_INVERTED} is True", _members(group), _outside(named)
            continue
        for other in named:
            yield path, f"{_FILTERED} is {other.path}", _members(group), _members(other)


def filtered(machines: Machines, own: list[str], floors: list[str]) -> Iterator[tuple[str, str]]:
    """Yield what lets shapes of the robot and its ground pass through each other."""
    for path, value, *sides in machines.filters:
        (own_first, floor_first), (own_second, floor_second) = (
            (any(map(covers, own)), any(map(covers, floors))) for covers in sides
        )
        if (own_first and floor_second) or (floor_first and own_second):
            yield path, value


def _below(top: str) -> Covers:
    return lambda path: is_at_or_below(path, top)


def _outside(groups: list[ScenePrim]) -> Covers:
    kept = list(map(_members, groups))
    return lambda path: not any(covers(path) for covers in kept)


def _members(group: ScenePrim) -> Covers:
    """Return whether a shape is in a group; an expression could include any."""
    inside, outside = (group.targets.get(f"{_COLLIDERS}{n}", ()) for n in ("includes", "excludes"))
    every = bool(group.values.get(f"{_COLLIDERS}membershipExpression"))
    every = every or group.values.get(f"{_COLLIDERS}includeRoot") is True

    def is_in(path: str) -> bool:
        is_out = any(is_at_or_below(path, top) for top in outside)
        return not is_out and (every or any(is_at_or_below(path, top) for top in inside))

    return is_in
