"""What UsdPhysics makes of a prim: bodies, collisions, joints."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from lab3_usd.isaac.values import Value
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import StageModel, listed_once, once_per_stage
from lab3_usd.model.transforms import angle_between

BODY_API = "PhysicsRigidBodyAPI"
MASS_API = "PhysicsMassAPI"
COLLISION_API = "PhysicsCollisionAPI"
ARTICULATION_API = "PhysicsArticulationRootAPI"
DRIVE_API = "PhysicsDriveAPI:angular"
REVOLUTE = "PhysicsRevoluteJoint"
FIXED = "PhysicsFixedJoint"
STIFFNESS = "drive:angular:physics:stiffness"
DAMPING = "drive:angular:physics:damping"
MAX_FORCE = "drive:angular:physics:maxForce"
SCENE = "PhysicsScene"
GRAVITY, GRAVITY_DIRECTION = "physics:gravityMagnitude", "physics:gravityDirection"
TILT = 5.0  # degrees from which on a robot slides or rolls
SLIDES_OFF = 20.0  # degrees from which on nothing stays on the ground
EARTH = -1e9  # and below: the schema's own value, as a dry run reads it
_LEAST, _MOST = 1.0, 30.0  # metres per second squared: less than the moon's, more than Jupiter's
PLANE = "Plane"
MASS = "physics:mass"
WEIGHTLESS = "physxRigidBody:disableGravity"
CENTRE = "physics:centerOfMass"
UNSET = 1e8  # an infinite value means that the schema's own counts
BODY_ENABLED = "physics:rigidBodyEnabled"
KINEMATIC = "physics:kinematicEnabled"
COLLISION_ENABLED = "physics:collisionEnabled"
JOINT_ENABLED = "physics:jointEnabled"
EXCLUDED = "physics:excludeFromArticulation"
ARTICULATION_ENABLED = "physxArticulation:articulationEnabled"
LIMITS = ("physics:lowerLimit", "physics:upperLimit")
FAR = 36_000.0  # degrees: a wheel that may turn so far does not come to its limit
BODIES = ("physics:body0", "physics:body1")
AXIS, USUAL_AXIS = "physics:axis", "X"
_JOINT_END = "Joint"


def is_switched_off(prim: Prim, name: str) -> bool:
    """Whether a switch that is on by default was turned off."""
    return prim.attributes.get(name) is False


def is_excluded(joint: Prim) -> bool:
    """Whether a joint is left out of every articulation, whose controller does not find it then."""
    return joint.attributes.get(EXCLUDED) is True


def still_by(body: Mapping[str, Any]) -> str:
    """Return the switch of a body with these values by which nothing moves it, '' for none."""
    if body.get(BODY_ENABLED) is False:
        return BODY_ENABLED
    return KINEMATIC if body.get(KINEMATIC) is True else ""


def is_body(prim: Prim) -> bool:
    """Whether the prim is a rigid body, switched on or not; one without a place is none."""
    return BODY_API in prim.apis and not prim.placeless


def collides(prim: Prim) -> bool:
    """Whether other shapes bump into this one."""
    has_api = COLLISION_API in prim.apis
    return prim.present and has_api and not is_switched_off(prim, COLLISION_ENABLED)


def is_articulated(prim: Prim) -> bool:
    """Whether the prim is a live root of an articulation."""
    is_root = prim.present and ARTICULATION_API in prim.apis
    return is_root and not is_switched_off(prim, ARTICULATION_ENABLED)


def is_joint(prim: Prim) -> bool:
    """Whether the prim is a joint of any kind."""
    return is_joint_type(prim.type)


def is_joint_type(name: str) -> bool:
    """Whether the prims of a type are joints."""
    return name.endswith(_JOINT_END)


def bodies_below(stage: StageModel, top: str) -> Sequence[str]:
    """Return the paths of the rigid bodies of the scene at and below a prim, parents first."""
    return _bodies_by_top(stage).get(top, ())


@once_per_stage
def rigid_bodies(stage: StageModel) -> frozenset[str]:
    """Return the paths of the rigid bodies of the scene."""
    return frozenset(bodies_below(stage, "/"))


@once_per_stage
def _bodies_by_top(stage: StageModel) -> dict[str, list[str]]:
    """Map each prim to the rigid bodies at and below it."""
    below: dict[str, list[str]] = {}
    for prim in stage.with_api(BODY_API):
        if prim.present and not prim.placeless:
            for top in ("/", *upwards(prim.path)):
                below.setdefault(top, []).append(prim.path)
    return below


def bodies(prim: Prim) -> tuple[str, str]:
    """Return the prims that a joint connects; '' stands for the world."""
    ends = prim.relationships
    first, second = ends.get(BODIES[0]), ends.get(BODIES[1])
    return first[0] if first else "", second[0] if second else ""


@listed_once
def joints(stage: StageModel) -> Iterator[Prim]:
    """Yield the joints that are part of the scene and switched on."""
    for prim in stage.of_type(is_joint_type):
        if prim.present and not is_switched_off(prim, JOINT_ENABLED):
            yield prim


def ends(joint: Prim) -> tuple[str, ...]:
    """Return the bodies that a joint ties."""
    return tuple(filter(None, bodies(joint)))


def joints_at(paths: Iterable[str], stage: StageModel) -> list[Prim]:
    """Return the joints of the scene, switched on or not, that tie one of some bodies.

    They come in the order of the stage.
    """
    tying = _tying(stage)
    joint_of = {order: joint for path in paths for order, joint in tying.get(path, {}).items()}
    return [joint_of[order] for order in sorted(joint_of)]


def working_joints_at(paths: Iterable[str], stage: StageModel) -> list[Prim]:
    """Return those of `joints` that tie one of some bodies."""
    at_paths = joints_at(paths, stage)
    return [joint for joint in at_paths if not is_switched_off(joint, JOINT_ENABLED)]


@once_per_stage
def _tying(stage: StageModel) -> Mapping[str, Mapping[int, Prim]]:
    """Map each body to the joints that tie it, by their place in the order of the stage."""
    tying: dict[str, dict[int, Prim]] = {}
    for order, joint in enumerate(stage.of_type(is_joint_type)):
        for path in ends(joint) if joint.present else ():
            tying.setdefault(path, {})[order] = joint
    return tying


def joint_limits(joint: Mapping[str, Any]) -> tuple[float, float]:
    """Return between which positions a joint with these values turns, infinite without a limit.

    A lower limit above the upper one locks the joint where it starts (PhysX).
    """
    low, high = (number(joint.get(name)) for name in LIMITS)
    low, high = -math.inf if low is None else low, math.inf if high is None else high
    return (low, high) if low <= high else (0.0, 0.0)


def is_felt(scene: Mapping[str, Any], meters_per_unit: float) -> bool:
    """Whether the gravity of a scene with these values holds a robot, and does not crush it.

    Only -inf, the schema's own, is the earth's: another one below 0 pulls the other way (PhysX). A
    stage whose units are wrong may mean metres.
    """
    strength = number(scene.get(GRAVITY))
    if strength is None or strength <= EARTH:
        return True
    return any(_LEAST <= strength * unit <= _MOST for unit in (1.0, meters_per_unit))


def down(up_axis: str) -> tuple[float, float, float]:
    """Return the direction in which gravity pulls where an axis is up."""
    return (0.0, -1.0, 0.0) if up_axis == "Y" else (0.0, 0.0, -1.0)


def slant(scene: Mapping[str, Any], up_axis: str = "Z") -> float:
    """Return by how many degrees the gravity of a scene pulls aside, 0 without a direction."""
    direction = vector(scene.get(GRAVITY_DIRECTION))
    return angle_between(direction, down(up_axis)) if any(direction) else 0.0


def number(value: Value | None) -> float | None:
    """Return a value as a number; None for what is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value)


def numbers(value: Value | None) -> list[float]:
    """Return the numbers of a list."""
    items = value if isinstance(value, tuple) else ()
    return [float(item) for item in items if isinstance(item, (int, float))]


def vector(value: Value | None) -> tuple[float, float, float]:
    """Return a value as three numbers; zeros for what is none."""
    items = numbers(value)
    return (items[0], items[1], items[2]) if len(items) == 3 else (0.0, 0.0, 0.0)  # noqa: PLR2004
