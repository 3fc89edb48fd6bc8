"""What UsdPhysics makes of a prim: bodies, collisions, joints."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from lab3_usd.check.model import Prim, StageModel
from lab3_usd.spec.catalog import Value

BODY_API = "PhysicsRigidBodyAPI"
MASS_API = "PhysicsMassAPI"
COLLISION_API = "PhysicsCollisionAPI"
ARTICULATION_API = "PhysicsArticulationRootAPI"
DRIVE_API = "PhysicsDriveAPI:angular"
REVOLUTE = "PhysicsRevoluteJoint"
FIXED = "PhysicsFixedJoint"
SCENE = "PhysicsScene"
PLANE = "Plane"
MASS = "physics:mass"
BODY_ENABLED = "physics:rigidBodyEnabled"
KINEMATIC = "physics:kinematicEnabled"
COLLISION_ENABLED = "physics:collisionEnabled"
JOINT_ENABLED = "physics:jointEnabled"
ARTICULATION_ENABLED = "physxArticulation:articulationEnabled"
BODIES = ("physics:body0", "physics:body1")
_JOINT_END = "Joint"


def is_switched_off(prim: Prim, name: str) -> bool:
    """Whether a switch that is on by default was turned off."""
    return prim.attributes.get(name) is False


def collides(prim: Prim) -> bool:
    """Whether other shapes bump into this one."""
    has_api = COLLISION_API in prim.apis
    return prim.present and has_api and not is_switched_off(prim, COLLISION_ENABLED)


def is_articulated(prim: Prim) -> bool:
    """Whether the prim is a live root of an articulation."""
    is_on = not is_switched_off(prim, ARTICULATION_ENABLED)
    return prim.present and ARTICULATION_API in prim.apis and is_on


def is_joint(prim: Prim) -> bool:
    """Whether the prim is a joint of any kind."""
    return prim.type.endswith(_JOINT_END)


def bodies(prim: Prim) -> tuple[str, str]:
    """Return the prims that a joint connects; '' stands for the world."""
    first, second = (next(iter(prim.relationships.get(name, ())), "") for name in BODIES)
    return first, second


@lru_cache(maxsize=1)  # every rule about joints asks for the same
def joints(stage: StageModel) -> tuple[Prim, ...]:
    """Return the joints that are part of the scene and switched on."""
    return tuple(
        prim
        for prim in stage.prims.values()
        if is_joint(prim) and prim.present and not is_switched_off(prim, JOINT_ENABLED)
    )


def below(stage: StageModel, top: str) -> Iterator[Prim]:
    """Yield every prim at or below `top`, in the scene or not."""
    inside = f"{top.rstrip('/')}/"
    return (prim for path, prim in stage.prims.items() if path == top or path.startswith(inside))


def number(value: Value | None) -> float | None:
    """Return a value as a number; None for what is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value)
