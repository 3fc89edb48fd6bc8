"""Rules about the robot's bodies: masses, rigid bodies, collisions."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.scene.pose_errors import (
    UNSCALED,
    is_scaled,
    pose_property,
    scale_of,
    vector_text,
)
from lab3_usd.model.absent_prims import is_subtree_unresolved, is_unresolved
from lab3_usd.model.finding import Problem
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import (
    BODY_API,
    BODY_ENABLED,
    COLLISION_API,
    COLLISION_ENABLED,
    KINEMATIC,
    MASS,
    MASS_API,
    collides,
    is_switched_off,
    number,
)
from lab3_usd.model.prims import Prim
from lab3_usd.spec.scene import LinkSpec


def _links(subject: StageSubject) -> Iterator[tuple[Prim, LinkSpec]]:
    """Yield the links that are in the scene; those that are not are S01's.

    An over of a link whose asset is missing counts: what it says itself holds.
    """
    robot, stage = subject.lab.scene.robot, subject.stage
    for name, spec in robot.links.items():
        prim = stage.prims.get(f"{robot.path}/{name}")
        if prim is not None and prim.active and (prim.defined or is_unresolved(stage, prim.path)):
            yield prim, spec


@rule("S04", "link-mass", scope="stage")
def link_mass(subject: StageSubject) -> Iterator[Problem]:
    """A link of the robot does not have the mass in the handout.

    Why: the drive is tuned for these masses. A heavier base may slip or crawl, a lighter one may
    tip.

    Fix: select the link, find Mass in the Property panel under Physics and type the value named
    here. Do not recreate the robot's physics.

    Example: `physics:mass` 1.0 on `{robot}/{link}`.
    """
    tolerance = subject.lab.scene.tolerance.mass
    for prim, spec in _links(subject):
        expected = spec.mass
        if expected is None:
            continue
        actual = number(prim.attributes.get(MASS))
        may_be_hidden = is_unresolved(subject.stage, prim.path)
        has_api = MASS_API in prim.apis or may_be_hidden
        if actual is None and may_be_hidden:
            continue
        if actual is not None and has_api and abs(actual - expected) <= tolerance * expected:
            continue
        is_ = "not set" if actual is None else f"{actual:g} kg"
        message, asked = f"mass is {is_}, expected {expected:g} kg", f"{expected:g} kg"
        if actual is not None and not has_api:
            message, asked = f"mass counts for nothing: {MASS_API} was removed", MASS_API
        yield Problem(prim.path, message, MASS, asked, is_, spec.handout)


@rule("S05", "rigid-body", scope="stage")
def rigid_body(subject: StageSubject) -> Iterator[Problem]:
    """A link of the robot is not a rigid body, or is a rigid body that cannot move.

    Why: a prim that is not a rigid body has no mass and no joints. The wheel does not turn, or the
    robot falls apart or hangs in the air.

    Fix: select the link, choose Add > Physics > Rigid Body, or tick Rigid Body Enabled and clear
    Kinematic Enabled in the Property panel.

    Example: `PhysicsRigidBodyAPI` removed from `{robot}/{wheel}`.
    """
    handout = subject.lab.scene.robot.handout
    for prim, _ in _links(subject):
        if BODY_API not in prim.apis:
            if not is_unresolved(subject.stage, prim.path):
                message = f"{prim.name} is no rigid body"
                yield Problem(prim.path, message, BODY_ENABLED, BODY_API, handout=handout)
        elif is_switched_off(prim, BODY_ENABLED):
            message = f"{prim.name}'s rigid body is switched off"
            yield Problem(prim.path, message, BODY_ENABLED, "True", "False", handout)
        elif prim.attributes.get(KINEMATIC) is True:
            message = f"{prim.name} is kinematic: nothing moves it"
            yield Problem(prim.path, message, KINEMATIC, "False", "True", handout)


@rule("S06", "wheel-collision", scope="stage")
def wheel_collision(subject: StageSubject) -> Iterator[Problem]:
    """A wheel has no collision geometry, or its collision is disabled.

    Why: nothing supports the robot on that side. It drops to its base plate and turns in circles.

    Fix: select the wheel's collision geometry, choose Add > Physics > Colliders Preset, or tick
    Collision Enabled in the Property panel.

    Example: `physics:collisionEnabled` False below `{robot}/{wheel}`.
    """
    stage = subject.stage
    for prim, spec in _links(subject):
        if not spec.collision:
            continue
        shapes = stage.with_api(COLLISION_API)
        parts = [part for part in shapes if is_at_or_below(part.path, prim.path)]
        if any(map(collides, parts)):
            continue
        off = [part for part in parts if part.present]
        if is_subtree_unresolved(stage, prim.path):
            below = stage.below(prim.path)
            off = [part for part in below if is_switched_off(part, COLLISION_ENABLED)]
            if not off:
                continue
        site = off[0].path if off else prim.path
        what = "collision is switched off" if off else "has no collision geometry"
        yield Problem(
            site,
            f"{prim.name}'s {what}" if off else f"{prim.name} {what}",
            COLLISION_ENABLED,
            "True" if off else COLLISION_API,
            "False" if off else None,
            spec.handout,
            related=(prim.path,) if site != prim.path else (),
        )


@rule("S24", "link-scale", scope="stage")
def link_scale(subject: StageSubject) -> Iterator[Problem]:
    """A link of the robot is scaled.

    Why: the scale of a body scales its shapes and the positions of its joints. A wheel of another
    size changes the speed, and a larger wheel distance changes the turn rate. A run never changes a
    scale.

    Fix: select the link and set Scale to (1, 1, 1) in the Property panel.

    Example: `xformOp:scale` (1, 1, 1.5) on `{robot}/{wheel}`.
    """
    tolerance = subject.lab.scene.tolerance.scale
    handout = subject.lab.scene.robot.handout
    for prim, _ in _links(subject):
        if is_scaled(prim, tolerance):
            is_, should = vector_text(scale_of(prim)), vector_text(UNSCALED)
            message = f"{prim.name}'s scale is {is_}, expected {should}"
            where = pose_property(prim, "scale")
            yield Problem(prim.path, message, where, should, is_, handout)
