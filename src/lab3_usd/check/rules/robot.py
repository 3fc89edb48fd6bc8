"""Rules about the bodies of the robot."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import restorable
from lab3_usd.check.robot.poses import UNSCALED, is_scaled, pose_property, scale_on_parent, untyped
from lab3_usd.check.robot.wheels import unknown_joints
from lab3_usd.check.rules.any_physics import link_bodies
from lab3_usd.check.rules.world import SHAPE, at_rest
from lab3_usd.facts.wheels import disc_of
from lab3_usd.isaac.values import same_numbers
from lab3_usd.model.changes import (
    Activate,
    ApplySchema,
    Edit,
    RemoveSchema,
    Restore,
)
from lab3_usd.model.finding import Problem
from lab3_usd.model.physics import (
    BODY_API,
    BODY_ENABLED,
    COLLISION_API,
    COLLISION_ENABLED,
    MASS,
    MASS_API,
    bodies,
    collides,
    is_switched_off,
    joints,
    number,
    still_by,
)
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.transforms import vector_text
from lab3_usd.spec.scene import LinkSpec


def _asked(subject: RobotSubject, what: str, link: Prim) -> str:
    """Return the id of what is asked of a link."""
    return f"{subject.robot.group}/{what}/{subject.robot.link_at(link.path)}"


def _links(subject: RobotSubject) -> Iterator[tuple[Prim, LinkSpec]]:
    """Yield the links that are in the scene; those that are not are S01's.

    An over of a link whose asset is missing counts: what it says itself holds.
    """
    robot, stage = subject.robot, subject.stage
    for name, spec in robot.links.items():
        prim = stage.prims.get(robot.path_of(name))
        if prim is not None and prim.active and (prim.defined or stage.unknown(prim.path)):
            yield prim, spec


@rule("S04", "link-mass", scope="robot", demands=link_bodies)
def link_mass(subject: RobotSubject) -> Iterator[Problem]:
    """A link has another mass.

    Why: the joints are tuned for these masses. {wheels?}A heavier base may slip or
    crawl, a lighter one may tip.{/}

    Fix: select the link, find Mass in the Property panel under Physics and type the value named
    here. Do not recreate the robot's physics.

    Example: `physics:mass` 1.0 on `{robot}/{link}`.
    """
    margin = subject.lab.scene.tolerance.margin("mass")
    for prim, spec in _links(subject):
        expected = spec.mass
        if expected is None:
            continue
        actual = number(prim.attributes.get(MASS))
        asset = subject.stage.unknown(prim.path)
        has_api = MASS_API in prim.apis or asset is not None
        if actual is not None and has_api and same_numbers([actual], [expected], margin):
            continue
        shown, wanted = "not set" if actual is None else f"{actual:g} kg", f"{expected:g} kg"
        problem = Problem(prim.path, f"mass is {shown}, expected {wanted}", MASS, wanted, shown)
        if actual is not None and not has_api:
            message = f"mass has no effect: {MASS_API} was removed"
            fix = ApplySchema(prim.path, MASS_API)
            problem = Problem(prim.path, message, MASS, MASS_API, shown, fix=(fix,))
        unmet, asset = _asked(subject, "mass", prim), asset if actual is None else None
        yield restorable(problem, spec.handout, unmet, rests_on=asset)


@rule("S05", "rigid-body", scope="robot", demands=link_bodies)
def rigid_body(subject: RobotSubject) -> Iterator[Problem]:
    """A link is not a dynamic rigid body, or the root is one.

    Why: without a rigid body a prim has no mass and no joints: it does not turn, or the robot falls
    apart or hangs in the air. A Scope, or a prim without a type, has no pose and is not a body,
    whatever its schemas. A robot root that is a rigid body without a joint to a link falls by
    itself, and PhysX does not simulate the bodies below it as required.

    Fix: select the link, choose Add > Physics > Rigid Body, or tick Rigid Body Enabled and clear
    Kinematic Enabled in the Property panel. Remove Rigid Body from the root.

    Example: `PhysicsRigidBodyAPI` removed from `{robot}/{link}`.
    """
    handout = subject.robot.handout
    for prim, _ in _links(subject):
        path, still, unmet = prim.path, still_by(prim.attributes), _asked(subject, "body", prim)
        if BODY_API in prim.apis and prim.placeless:
            yield Problem(
                path,
                f"{prim.name} is not a rigid body: {untyped(prim)}",
                expected="Xform",
                actual=prim.type or "no type",
                handout=handout,
                hint=f"write {prim.name} with the type Xform (def Xform)",
                unmet=(unmet,),
            )
        elif BODY_API not in prim.apis:
            message, fix = f"{prim.name} is not a rigid body", (ApplySchema(path, BODY_API),)
            problem = Problem(path, message, BODY_ENABLED, BODY_API, fix=fix)
            yield restorable(problem, handout, unmet, rests_on=subject.stage.unknown(path))
        elif still == BODY_ENABLED:
            message = f"{prim.name}'s rigid body is disabled"
            yield restorable(Problem(path, message, still, "True", "False"), handout, unmet)
        elif still:
            message = f"{prim.name} is kinematic: nothing moves it"
            yield restorable(Problem(path, message, still, "False", "True"), handout, unmet)
    root = subject.stage.prim(subject.robot.path)
    if root is not None and _falls_alone(root, subject):
        yield Problem(
            root.path,
            f"{root.name} is a rigid body of its own, which no joint connects to a link",
            BODY_ENABLED,
            "no rigid body",
            BODY_API,
            handout,
            fix=(RemoveSchema(root.path, BODY_API),),
            unmet=(at_rest(subject.robot),),
        )


def _falls_alone(root: Prim, subject: RobotSubject) -> bool:
    """Whether the robot's root is a body that moves apart from the links below it."""
    if BODY_API not in root.apis or still_by(root.attributes):
        return False
    if root.path in subject.robot.link_paths or unknown_joints(subject):
        return False
    return not any(root.path in bodies(joint) for joint in joints(subject.stage))


_GROUPS = ("Xform", "Scope")


@rule("S06", "wheel-collision", scope="robot", demands=link_bodies, needs="wheels")
def wheel_collision(subject: RobotSubject) -> Iterator[Problem]:
    """A wheel has no enabled collision geometry, or one of another size.

    Why: nothing supports the robot on that side. It drops to its base plate and turns in circles.
    On wheels of two sizes it leans, and drives a curve where it should go straight.

    Fix: select the wheel's collision geometry, choose Add > Physics > Colliders Preset, or tick
    Collision Enabled in the Property panel. Restore its size from the supplied file.

    Example: `physics:collisionEnabled` False below `{robot}/{wheel}`.
    """
    stage, is_whole = subject.stage, True
    for prim, spec in _links(subject):
        if not spec.collision:
            continue
        shapes = stage.with_api(COLLISION_API)
        # On the link itself, which is no shape, the schema counts for nothing.
        parts = [
            part
            for part in shapes
            if is_at_or_below(part.path, prim.path)
            and (part.path != prim.path or part.type not in _GROUPS)
        ]
        if any(map(collides, parts)):
            continue
        off = [part for part in parts if part.present]
        asset = stage.unknown_below(prim.path)
        if asset is not None:
            below = stage.below(prim.path)
            off = [part for part in below if is_switched_off(part, COLLISION_ENABLED)]
        site = off[0].path if off else prim.path
        what = "collision is disabled" if off else "has no collision geometry"
        inactive = [part.path for part in stage.below(prim.path) if not part.active]
        fix: Edit = Restore(site, COLLISION_ENABLED) if off else Restore(site)
        if len(inactive) == 1:
            fix = Activate(inactive[0])
        yield Problem(
            site,
            f"{prim.name}'s {what}" if off else f"{prim.name} {what}",
            COLLISION_ENABLED,
            "True" if off else COLLISION_API,
            "False" if off else None,
            spec.handout,
            related=(prim.path,) if site != prim.path else (),
            fix=(fix,),
            unmet=(_asked(subject, "collision", prim),),
            covers=() if site == prim.path else ((prim.path, COLLISION_ENABLED),),
            rests_on=None if off else asset,
        )
        is_whole = False
    if is_whole:
        yield from _wheels_of_two_sizes(subject)


def _wheels_of_two_sizes(subject: RobotSubject) -> Iterator[Problem]:
    """Say that a wheel is smaller than another."""
    wheels = [(prim, spec) for prim, spec in _links(subject) if spec.collision]
    sizes = {
        prim: (disc.radius, spec)
        for prim, spec in wheels
        if (disc := disc_of(prim, subject.stage)) is not None
    }
    margin = subject.lab.scene.tolerance.margin("wheel")
    largest = max((radius for radius, _ in sizes.values()), default=0.0)
    other = next((prim for prim, (radius, _) in sizes.items() if radius == largest), None)
    for prim, (radius, spec) in sizes.items():
        if other is not None and not same_numbers([radius], [largest], margin):
            yield Problem(
                prim.path,
                f"{prim.name} has a radius of {radius:.4g} m, {other.name} of {largest:.4g}",
                None,
                f"{largest:.4g}",
                f"{radius:.4g}",
                spec.handout,
                unmet=(_asked(subject, "collision", prim),),
                assumes=(
                    *((link.path, pose_property(link, "scale")) for link in (prim, other)),
                    *((f"{link.path}/", name) for link in (prim, other) for name in SHAPE),
                ),
                rests_on=subject.stage.unknown_below(prim.path),
            )


@rule("S24", "link-scale", scope="robot", demands=link_bodies)
def link_scale(subject: RobotSubject) -> Iterator[Problem]:
    """A link is scaled.

    Why: the scale of a body scales its shapes and the positions of its joints. {wheels?}A wheel of
    another size changes the speed, and a larger wheel distance changes the turn rate.{/} A run
    never changes a scale.

    Fix: select the link and set Scale to (1, 1, 1) in the Property panel.

    Example: `xformOp:scale` (1, 1, 1.5) on `{robot}/{link}`.
    """
    tolerance = subject.lab.scene.tolerance.scale
    handout = subject.robot.handout
    for prim, _ in _links(subject):
        if is_scaled(prim, tolerance):
            actual, expected = vector_text(scale_on_parent(prim)), vector_text(UNSCALED)
            message = f"{prim.name}'s scale is {actual}, expected {expected}"
            problem = Problem(prim.path, message, pose_property(prim, "scale"), expected, actual)
            yield restorable(problem, handout, _asked(subject, "body", prim))
