"""Rules about what makes one robot of its links: articulation and joints."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.check.repairs import restorable
from lab3_usd.check.robot.axles import rest_frames, welds
from lab3_usd.check.robot.ground import UP
from lab3_usd.check.robot.wheels import has_no_joints, link_of, unknown_joints, wheel_joints
from lab3_usd.check.rules.world import at_rest
from lab3_usd.facts.articulations import cut_off
from lab3_usd.model.changes import ApplySchema, ClearValue, RemovePrim, RemoveSchema, Restore
from lab3_usd.model.finding import Problem
from lab3_usd.model.physics import (
    ARTICULATION_API,
    ARTICULATION_ENABLED,
    BODIES,
    EXCLUDED,
    FIXED,
    JOINT_ENABLED,
    bodies,
    is_articulated,
    is_body,
    is_joint_type,
    is_switched_off,
    joints,
)
from lab3_usd.model.prims import Matrix, Prim, is_at_or_below
from lab3_usd.model.stage import UnresolvedAsset
from lab3_usd.model.transforms import angle_between
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import RobotSpec


def _articulation(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    del checkpoint
    for robot in lab.scene.robots:
        spec = robot.articulation
        if spec.target:
            title = "one articulation root"
            yield Demand(_articulated(robot), title, spec.target, spec.handout, part="assembly")


def _articulated(robot: RobotSpec) -> str:
    """Return the id of the requirement that a robot is an articulation."""
    return f"{robot.group}/articulation"


@rule("S11", "articulation", scope="robot", demands=_articulation)
def articulation(subject: RobotSubject) -> Iterator[Problem]:
    """The articulation root is missing, doubled or misplaced, or a joint ends it.

    Why: the Articulation Controller looks for the articulation at its target prim and below.
    Without one it reports an error in the console, and nothing moves. An
    articulation root on the robot root works too, with the robot root as the target. A joint that
    is excluded from the articulation, a fixed one too, ends it: no joint behind moves.

    Fix: select the prim and choose Add > Physics > Articulation Root. Remove another one with the
    cross beside it in the Property panel. Clear Exclude From Articulation on the joint.

    Example: `PhysicsArticulationRootAPI` removed from `{robot}/{base}`.
    """
    spec = subject.robot.articulation
    target = spec.target
    if not target:  # the lab's robot has none
        return
    root = subject.stage.prim(subject.robot.path)
    base = subject.stage.prim(target)
    if root is None or base is None:
        return
    roots = [
        prim
        for prim in subject.stage.with_api(ARTICULATION_API)
        if is_articulated(prim) and is_at_or_below(prim.path, root.path)
    ]
    right = [prim for prim in (base, root) if prim in roots]
    for prim in roots:
        if prim not in right[:1]:
            fault = f"a second articulation root, beside {right[0].path}" if right else "misplaced"
            yield Problem(
                prim.path,
                f"the articulation root on {prim.name} is {fault}",
                expected=target,
                actual=prim.path,
                handout=spec.handout,
                related=(target,) if prim.path != target else (),
                fix=(RemoveSchema(prim.path, spec.api), ApplySchema(target, spec.api)),
                unmet=(_articulated(subject.robot),),
                covers=() if right else ((target, spec.api),),  # which it left
            )
            if not right:
                return
    if not roots:
        is_off = is_switched_off(base, ARTICULATION_ENABLED)
        reason = "is disabled" if is_off and ARTICULATION_API in base.apis else "is missing"
        yield Problem(
            target,
            f"the articulation root {reason}, expected on {target}",
            expected=ARTICULATION_API,
            handout=spec.handout,
            fix=(ApplySchema(target, spec.api), ClearValue(target, spec.switch)),
            unmet=(_articulated(subject.robot),),
            rests_on=subject.stage.unknown(target),
        )
    yield from _cut_off(subject)


def _cut_off(subject: RobotSubject) -> Iterator[Problem]:
    """Yield the excluded joints behind which the robot has joints."""
    spec, behind = subject.robot.articulation, dict[str, list[str]]()
    for path, excluded in cut_off(subject.stage).items():
        joint = subject.stage.prims[path]
        if joint.type != FIXED and any(_is_on_robot(end, subject) for end in bodies(joint)):
            behind.setdefault(excluded.path, []).append(joint.name)
    for path, names in behind.items():
        lost = f"is excluded from the articulation, which ends here and lacks {', '.join(names)}"
        site = (path, EXCLUDED)
        problem = Problem(path, lost, EXCLUDED, "False", "True", assumes=(site,))
        unmet = _articulated(subject.robot)
        yield restorable(problem, spec.handout, unmet, related=(spec.target,))


def joined_links(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    """Yield that joints tie each link to the robot, where no joint of it is asked for itself."""
    del checkpoint
    for robot in lab.scene.robots:
        for name, link in robot.links.items():
            is_base = name == robot.base_frame
            if name not in robot.turned_links and (link.held or not is_base):
                title = f"joints tie {name} to the {'world' if is_base else 'robot'}"
                yield Demand(joined(robot, name), title, robot.path_of(name), link.handout)


def joined(robot: RobotSpec, link: str) -> str:
    """Return the id of the requirement that joints tie a link."""
    return f"{robot.group}/joined/{link}"


@rule("S12", "loose-link", scope="robot", demands=joined_links)
def loose_link(subject: RobotSubject) -> Iterator[Problem]:
    """A link is loose, or a fixed robot is not fixed to the world.

    Why: at Play the link stays behind or falls. If several links are detached together, the finding
    names the first; other rules check the rest. The robot's body, and a link whose place the
    handout gives, must be held upright by a fixed joint: where the joint holds it tilted, it turns
    over. A robot that the course has fixed to the world, as an arm, falls over without that joint.

    Fix: undo the deletion of the joint, or start again from the supplied file. The handout says not
    to recreate the robot's physics.

    Example: the joint of `{robot}/{link}` deleted: `{link}` falls down.
    """
    robot = subject.robot
    turned = robot.turned_links
    present = [path for path in robot.link_paths if subject.stage.prim(path) is not None]
    base = robot.base
    if has_no_joints(subject) or base not in present:
        return
    if unknown_joints(subject):  # then only what a joint let go of is known to be loose
        present = [base, *(path for path in present if path in _let_go(subject))]
    groups = _groups(subject)
    # A link that is held by the world is S21's.
    holding = [*_holds(subject)]
    held = [bodies(joint)[side] for joint, side, asset in holding if asset is None]
    by_world = [bodies(joint)[side] for joint, side, _ in holding if _may_hold(joint)]
    is_bolted = groups[base] in {groups[link_of(body, robot) or body] for body in by_world}
    if _is_to_stand(subject) and not is_bolted:
        yield _not_bolted(subject, base, robot.links[robot.base_frame].handout)
    judged = [groups[base], *(groups[link_of(body, robot) or body] for body in held)]
    for name, link in robot.links.items():
        path = robot.path_of(name)
        if path in present and name not in turned and groups[path] not in judged:
            judged.append(groups[path])
            message = f"no joint connects {name} to {robot.base_frame}"
            off = _switched_off(subject, path)
            problem = Problem(path, message, expected=base, fix=() if off else (Restore(path),))
            yield _untied(problem, off, link.handout, joined(robot, name))
        elif (
            path in present
            and (link.held or link.offset is not None)
            and groups[path] == groups[base]
        ):
            yield from _movable(subject, path, link.handout)
            yield from _tilted(subject, path, link.handout)


def _not_bolted(subject: RobotSubject, base: str, handout: str) -> Problem:
    """Return that no joint fixes the base to the world."""
    off = _switched_off(subject, base)
    off = tuple(joint for joint in off if not all(bodies(subject.stage.prims[joint])))
    name = subject.robot.base_frame
    message = f"no joint fixes {name} to the world: the robot falls over at Play"
    expected, asset = "a fixed joint between it and the world", unknown_joints(subject)
    problem = Problem(base, message, expected=expected, rests_on=asset)
    return _untied(problem, off, handout, joined(subject.robot, name))


def _untied(problem: Problem, off: tuple[str, ...], handout: str, unmet: str) -> Problem:
    """Return that no joint ties a link, with the joints that would and are switched off."""
    problem = replace(problem, handout=handout, unmet=(unmet,))
    if not off:
        return problem
    return replace(
        problem,
        message=f"{problem.message}; {off[0]} is disabled",
        related=off,
        hint=f"select {off[0]} and set Joint Enabled in the Property panel",
        fix=tuple(Restore(joint, JOINT_ENABLED) for joint in off),
        covers=tuple((joint, JOINT_ENABLED) for joint in off),
    )


def _is_to_stand(subject: RobotSubject) -> bool:
    """Whether the base is to be fixed to the world."""
    robot = subject.robot
    base = robot.links.get(robot.base_frame)
    return base is not None and base.held and robot.base_frame not in robot.turned_links


_SIX_AXES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")


def _tilted(subject: RobotSubject, link: str, handout: str) -> Iterator[Problem]:
    """Say that a link is held tilted, by the joint that tilts it."""
    tolerance = subject.lab.scene.tolerance.axle_angle
    rest = rest_frames(subject)
    for joint in welds(subject):
        ends = bodies(joint)
        other = ends[1 - ends.index(link)] if link in ends else ""
        if link not in rest or other not in rest:
            continue
        tilt = _tilt(rest[link])
        if tilt > tolerance >= _tilt(rest[other]):
            name = f"physics:localRot{ends.index(link)}"
            message, degrees = f"{joint.name} holds {link} tilted by", f"{tilt:.3g} degrees"
            problem = Problem(joint.path, f"{message} {degrees}", name, "upright", degrees)
            unmet = joined(subject.robot, subject.robot.link_at(link))
            yield restorable(problem, handout, unmet, related=(link,))
            return


def _tilt(frame: Matrix) -> float:
    """Return by how many degrees something leans whose place in the base's frame is given."""
    return angle_between((frame[8], frame[9], frame[10]), UP)


def _may_hold(joint: Prim) -> bool:
    """Whether a joint holds its bodies; one with limits on all six axes may."""
    limited = [api for api in joint.apis if api.startswith("PhysicsLimitAPI:")]
    return joint.type == FIXED or len(limited) == len(_SIX_AXES)


def _movable(subject: RobotSubject, link: str, handout: str) -> Iterator[Problem]:
    """Say that a link that must be held hangs on a joint that moves, on what is held itself."""
    rest = rest_frames(subject)
    for joint in joints(subject.stage) if link not in rest else ():
        is_first = link in bodies(joint) and any(end in rest for end in bodies(joint))
        if is_first and not _may_hold(joint):
            message = f"{joint.name} lets {link} move on the robot: it is a {joint.type}"
            problem = Problem(joint.path, message, None, FIXED, joint.type)
            unmet = joined(subject.robot, subject.robot.link_at(link))
            asset = subject.stage.unknown(joint.path)
            yield restorable(problem, handout, unmet, related=(link,), rests_on=asset)


@rule("S21", "held-by-the-world", scope="robot", needs="wheels")
def held_by_the_world(subject: RobotSubject) -> Iterator[Problem]:
    """A joint connects the robot to the world.

    Why: the joint holds the robot in place: the wheels turn and odometry stays at zero. An empty
    body of a joint is the world. Other rules check the joints of the wheels.

    Fix: delete the joint, or clear Joint Enabled in the Property panel. The option Static Base of
    the URDF importer creates such a joint. The supplied robot has none.

    Example: `{robot}/root_joint`, a fixed joint with `physics:body1` `{base}` and no
    `physics:body0`.
    """
    robot = subject.robot.path
    section = subject.lab.handout.behind("S21", subject.robot.handout)
    if not subject.robot.wheels.joints or _is_to_stand(subject):  # as an arm may be
        return
    for joint, side, asset in _holds(subject):
        ends = bodies(joint)
        holder = ends[1 - side]
        yield Problem(
            joint.path,
            f"{joint.name} connects {ends[side]} to {holder or 'the world'}",
            BODIES[1 - side],
            "a link of the robot, or no such joint",
            holder or "no prim",
            section,
            (robot,),
            fix=(RemovePrim(joint.path),),
            unmet=(at_rest(subject.robot),),
            rests_on=asset,
        )


def _holds(subject: RobotSubject) -> Iterator[tuple[Prim, int, UnresolvedAsset | None]]:
    """Yield each joint with one body on the robot and one off it, and which one is on it.

    The third is the missing asset that could name the other body, where the joint names none.
    Those of wheels have rules of their own.
    """
    stage = subject.stage
    wheels = wheel_joints(subject)
    own = [wheel.prim for wheel in wheels]
    for joint in joints(stage):
        ends = bodies(joint)
        on_robot = [_is_on_robot(end, subject) for end in ends]
        if on_robot.count(True) != 1:
            continue
        on_wheel = any(is_at_or_below(end, wheel.link) for end in ends for wheel in wheels)
        if joint not in own and not on_wheel:
            asset = None if all(ends) else stage.unknown(joint.path)
            yield joint, on_robot.index(True), asset


def _is_on_robot(body: str, subject: RobotSubject) -> bool:
    """Whether a joint's target is below the robot's root, or is the root and moves itself.

    A root that is no body stands for the world, as whatever has no body above it does.
    """
    path = subject.robot.path
    if body != path:
        return is_at_or_below(body, path)
    root = subject.stage.prim(path)
    return root is not None and is_body(root)


def _switched_off(subject: RobotSubject, link: str) -> tuple[str, ...]:
    """Return the joints of the scene that would tie a link and are switched off."""
    every_joint = subject.stage.of_type(is_joint_type)
    off = (prim for prim in every_joint if prim.present and is_switched_off(prim, JOINT_ENABLED))
    return tuple(prim.path for prim in off if any(is_at_or_below(b, link) for b in bodies(prim)))


def _let_go(subject: RobotSubject) -> list[str]:
    """Return the links that joints of the file name which are switched off or deactivated."""
    return [
        link_of(body, subject.robot) or body
        for prim in subject.stage.of_type(lambda name: not name or is_joint_type(name))
        if not prim.present or is_switched_off(prim, JOINT_ENABLED)
        for body in bodies(prim)
    ]


def _groups(subject: RobotSubject) -> dict[str, str]:
    """Map each link and body to one name for all that joints tie together."""
    robot = subject.robot
    group = {link: link for link in robot.link_paths}
    for joint in joints(subject.stage):
        ends = [link_of(body, robot) or body for body in bodies(joint) if body]
        names = {group.setdefault(end, end) for end in ends}
        if len(names) > 1:
            first = min(names)
            group = {body: first if name in names else name for body, name in group.items()}
    return group
