"""Rules about the robot's bodies: masses, rigid bodies, collisions, articulation, loose links."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lab3_usd.check.absence import hides_below, is_at_or_below, is_hidden
from lab3_usd.check.finding import Problem
from lab3_usd.check.model import Prim
from lab3_usd.check.physics import (
    ARTICULATION_API,
    ARTICULATION_ENABLED,
    BODY_API,
    BODY_ENABLED,
    COLLISION_API,
    COLLISION_ENABLED,
    KINEMATIC,
    MASS,
    MASS_API,
    below,
    bodies,
    collides,
    is_switched_off,
    joints,
    number,
)
from lab3_usd.check.registry import rule
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.wheel_joints import could_hide_joints


def _links(subject: StageSubject) -> Iterator[tuple[Prim, Mapping[str, Any]]]:
    """Yield the links that are in the scene; those that are not are S01's.

    An over of a link whose asset is missing counts: what it says itself holds.
    """
    robot, stage = subject.lab.scene["robot"], subject.stage
    for name, spec in robot["links"].items():
        prim = stage.prims.get(f"{robot['path']}/{name}")
        if prim is not None and prim.active and (prim.defined or is_hidden(stage, prim.path)):
            yield prim, spec


@rule("S04", "link-mass", scope="stage")
def link_mass(subject: StageSubject) -> Iterator[Problem]:
    """A link of the robot does not have the mass that the handout lists.

    Why: the drive was tuned for these masses: a heavier base slips or crawls, a lighter one tips.

    Fix: select the link, find Mass in the Property panel under Physics and type the value named
    here; do not recreate the robot's physics.

    Example: `physics:mass` 1.0 on `/turtlebot3_burger/base_link`.
    """
    tolerance = subject.lab.scene["tolerance"]["mass"]
    for prim, spec in _links(subject):
        expected = spec.get("mass")
        if expected is None:
            continue
        actual = number(prim.attributes.get(MASS))
        may_be_hidden = is_hidden(subject.stage, prim.path)
        has_api = MASS_API in prim.apis or may_be_hidden
        if actual is None and may_be_hidden:
            continue
        if actual is not None and has_api and abs(actual - expected) <= tolerance * expected:
            continue
        is_ = "not set" if actual is None else f"{actual:g} kg"
        message = f"mass is {is_}, expected {expected:g} kg"
        if actual is not None and not has_api:
            message = f"mass counts for nothing: {MASS_API} was removed"
        yield Problem(prim.path, message, MASS, f"{expected:g} kg", is_, spec["handout"])


@rule("S05", "rigid-body", scope="stage")
def rigid_body(subject: StageSubject) -> Iterator[Problem]:
    """A link of the robot is no rigid body, or one that does not move.

    Why: what is no body has no weight and no joints: the wheel turns nothing, the robot falls
    apart or hangs in the air.

    Fix: select the link, choose Add > Physics > Rigid Body, or tick Rigid Body Enabled and clear
    Kinematic Enabled in the Property panel.

    Example: `PhysicsRigidBodyAPI` removed from `/turtlebot3_burger/wheel_left_link`.
    """
    handout = subject.lab.scene["robot"]["handout"]
    for prim, _ in _links(subject):
        if BODY_API not in prim.apis:
            if not is_hidden(subject.stage, prim.path):
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
    """A wheel has no collision geometry, or all of it is switched off.

    Why: nothing carries the robot on that side: it drops to its base plate and turns in circles.

    Fix: select the wheel's collision geometry, choose Add > Physics > Colliders Preset, or tick
    Collision Enabled in the Property panel.

    Example: `physics:collisionEnabled` False below `/turtlebot3_burger/wheel_left_link`.
    """
    stage = subject.stage
    for prim, spec in _links(subject):
        if not spec.get("collision") or hides_below(stage, prim.path):
            continue
        parts = list(below(stage, prim.path))
        if any(map(collides, parts)):
            continue
        off = [part for part in parts if part.present and COLLISION_API in part.apis]
        site = off[0].path if off else prim.path
        what = "collision is switched off" if off else "has no collision geometry"
        yield Problem(
            site,
            f"{prim.name}'s {what}" if off else f"{prim.name} {what}",
            COLLISION_ENABLED,
            "True" if off else COLLISION_API,
            "False" if off else None,
            spec["handout"],
            related=(prim.path,) if site != prim.path else (),
        )


@rule("S11", "articulation", scope="stage")
def articulation(subject: StageSubject) -> Iterator[Problem]:
    """The robot has no articulation root, two of them, or one on the wrong prim.

    Why: the controller and the odometry graph name the articulation at `base_footprint`; without
    it Isaac Sim says that the prim is no articulation, and nothing moves.

    Fix: select the prim, choose Add > Physics > Articulation Root; remove one that stands elsewhere
    with the cross beside it in the Property panel.

    Example: `PhysicsArticulationRootAPI` removed from `/turtlebot3_burger/base_footprint`.
    """
    spec = subject.lab.scene["robot"]
    target, handout = spec["articulation"]["target"], spec["articulation"]["handout"]
    root = subject.stage.prim(spec["path"])
    base = subject.stage.prim(target)
    if root is None or base is None:
        return
    found = [prim for prim in below(subject.stage, root.path) if _is_articulated(prim)]
    right = [prim for prim in (base, root) if prim in found]
    for prim in found:
        if prim not in right[:1]:
            what = f"a second articulation root, beside {right[0].path}" if right else "misplaced"
            message = f"the articulation root on {prim.name} is {what}"
            related = (target,) if prim.path != target else ()
            yield Problem(prim.path, message, None, target, prim.path, handout, related)
            if not right:
                return
    if not found and not is_hidden(subject.stage, target):
        is_off = is_switched_off(base, ARTICULATION_ENABLED)
        why = "is switched off" if is_off and ARTICULATION_API in base.apis else "is missing"
        message = f"the articulation root {why}, expected on {target}"
        yield Problem(target, message, None, ARTICULATION_API, handout=handout)


def _is_articulated(prim: Prim) -> bool:
    is_on = not is_switched_off(prim, ARTICULATION_ENABLED)
    return prim.present and ARTICULATION_API in prim.apis and is_on


@rule("S12", "loose-link", scope="stage")
def loose_link(subject: StageSubject) -> Iterator[Problem]:
    """A link of the robot is not tied to the others by joints.

    Why: the robot separates at Play: the link stays behind or rolls away. Wheels are the business
    of their own rules, and of several links that come off together the first is named.

    Fix: undo the deletion of the joint, or start again from the supplied file; the handout says
    not to recreate the robot's physics.

    Example: `/turtlebot3_burger/joints/scan_joint` deleted: `base_scan` falls down.
    """
    robot = subject.lab.scene["robot"]
    wheels = robot["wheels"]["joints"].values()
    present = [prim.path for prim, _ in _links(subject)]
    base = f"{robot['path']}/{robot['base_frame']}"
    if could_hide_joints(subject) or base not in present:
        return
    groups = _groups(subject, present)
    told = [groups[base]]
    for name in robot["links"]:
        path = f"{robot['path']}/{name}"
        if path in present and name not in wheels and groups[path] not in told:
            told.append(groups[path])
            message = f"no joint ties {name} to {robot['base_frame']}"
            yield Problem(path, message, None, base, None, robot["links"][name]["handout"])


def _groups(subject: StageSubject, links: list[str]) -> dict[str, str]:
    """Map each link and body to one name for all that joints tie together."""
    group = {link: link for link in links}
    for joint in joints(subject.stage):
        ends = [_link_of(body, links) for body in bodies(joint) if body]
        names = {group.setdefault(end, end) for end in ends}
        if len(names) > 1:
            first = min(names)
            group = {body: first if name in names else name for body, name in group.items()}
    return group


def _link_of(body: str, links: list[str]) -> str:
    """Return the link that a joint's target moves with."""
    return next((link for link in links if is_at_or_below(body, link)), body)
