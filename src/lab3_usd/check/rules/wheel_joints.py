"""Rules about the wheel joints: what they connect, where they sit, and how they turn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.registry import Demand, Demands, rule
from lab3_usd.check.robot.axles import anchor_in_metres, axles, own_axle
from lab3_usd.check.robot.wheels import (
    TiedJoint,
    WheelJoint,
    has_no_joints,
    restored,
    tied_joints,
    turning_joints,
    unknown_joints,
    wheel_joints,
    wheel_problem,
    wheel_side,
    wrong_ends,
)
from lab3_usd.check.rules.link_joints import joined_links
from lab3_usd.model.changes import Edit, MovePrim, RemovePrim, Restore
from lab3_usd.model.finding import Problem
from lab3_usd.model.joint_drives import JointFault, left_out
from lab3_usd.model.physics import (
    AXIS,
    FAR,
    JOINT_ENABLED,
    LIMITS,
    REVOLUTE,
    USUAL_AXIS,
    bodies,
    is_switched_off,
    joint_limits,
    joints,
)
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import absence_reason
from lab3_usd.model.transforms import Vector, angle_between, distance, dot, scaled, vector_text
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import RobotSpec

_PAIR = 2  # wheels that are a distance apart


def of_each_joint(**titles: str) -> Demands:
    """Return the demands that each wheel joint has to meet: their ids, and what they say of it."""

    def demands(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
        del checkpoint
        for robot in lab.scene.robots:
            for name in robot.wheels.joints:
                path, handout = robot.joint_path(name), robot.wheels.handout
                for part, title in titles.items():
                    yield Demand(f"{robot.group}/{part}/{name}", f"{name} {title}", path, handout)

    return demands


_TURNS_A_WHEEL = of_each_joint(joint="turns a wheel")


@rule("S07", "wheel-joint", scope="robot", demands=_TURNS_A_WHEEL, needs="wheels")
def wheel_joint(subject: RobotSubject) -> Iterator[Problem]:
    """A wheel joint is missing, renamed, or cannot turn.

    Why: the drive graph commands the joints by name. An unknown name stops the whole controller
    with an error in the console. A joint that is excluded from the articulation is unknown to it.
    With limits the wheel stops after a part of a turn, or a few.

    Fix: undo the deletion or the change of the joint, rename it in the Stage panel, or start again
    from the supplied file.

    Example: `{joint_path}` deactivated.
    """
    robot = subject.robot
    handout = robot.wheels.handout or robot.handout
    if has_no_joints(subject):
        if not _is_below_missing_link(subject):
            yield _no_joints(subject, handout)
        return
    for joint in wheel_joints(subject):
        if subject.stage.prim(joint.link) is None:
            continue
        message = _why_useless(joint, subject)
        is_gone = joint.prim is None or (joint.prim.active and not joint.prim.present)
        wrong = None if message or joint.live is None else _why_stuck(joint.live)
        if message is not None:
            fix: tuple[Edit, ...] = tuple(map(Restore, (joint.site, *joint.related)))
            if joint.live is not None:  # but it has another name
                fix = (MovePrim(joint.site, f"{joint.live.parent}/{joint.name}"),)
            yield Problem(
                joint.site,
                message,
                expected=f"{REVOLUTE} {joint.name}",
                handout=handout,
                related=joint.related,
                fix=fix,
                unmet=(f"{subject.robot.group}/joint/{joint.name}",),
                absent=joint.live is None,
                rests_on=unknown_joints(subject) if is_gone else None,
            )
        elif wrong is not None:
            named = replace(wrong, text=f"{joint.name} {wrong.text}")
            yield wheel_problem(joint, robot, named, "joint", handout)


def _why_stuck(joint: Prim) -> JointFault | None:
    """Return the value by which a joint cannot turn on and on, None where it can."""
    off = next(left_out(joint.attributes), None)
    low, high = joint_limits(joint.attributes)
    if off is not None or (low <= -FAR and high >= FAR):
        return off
    name, value = (LIMITS[0], low) if low > -FAR else (LIMITS[1], high)
    return JointFault(f"cannot turn past {value:g} degrees", name, "no limit", f"{value:g}")


def _is_below_missing_link(subject: RobotSubject) -> bool:
    """Whether the joints are gone with a link that holds them, which S01 misses."""
    robot = subject.robot
    home = f"{robot.path}/{robot.wheels.joints_below}"
    missing = (link for link in robot.link_paths if not subject.stage.prim(link))
    return any(is_at_or_below(home, link) for link in missing)


def _no_joints(subject: RobotSubject, handout: str) -> Problem:
    """Say once that the robot has lost all of its joints, and which links fall apart."""
    robot = subject.robot
    site = f"{robot.path}/{robot.wheels.joints_below}".rstrip("/")
    message = f"the robot has no joints: {site} {absence_reason(subject.stage, site)}"
    if subject.stage.prim(site) is not None:
        message = "the robot has no joints"
    return Problem(
        site,
        message,
        expected="joints",
        handout=handout,
        related=robot.link_paths,
        fix=tuple(map(Restore, (site, *robot.link_paths))),
        unmet=tuple(
            demand.id
            for demand in joined_links(subject.lab, subject.checkpoint)
            if demand.group == robot.group
        ),
        absent=True,
    )


def _why_useless(joint: WheelJoint, subject: RobotSubject) -> str | None:
    prim = joint.prim
    if prim is None or not prim.present:
        return f"{joint.name} {absence_reason(subject.stage, joint.site)}"
    if prim.type != REVOLUTE:
        return f"{joint.name} is a {prim.type or 'prim without a type'}, expected {REVOLUTE}"
    if prim.name != joint.name:
        return f"the joint of {joint.link} is named {prim.name}, expected {joint.name}"
    return None


@rule(
    "S08",
    "joint-bodies",
    scope="robot",
    demands=of_each_joint(bodies="connects its wheel"),
    needs="wheels",
)
def joint_bodies(subject: RobotSubject) -> Iterator[Problem]:
    """A wheel joint does not connect its wheel to the robot.

    Why: with the wheels exchanged the robot turns the wrong way. A wheel tied to the world holds
    the robot in place.

    Fix: select the joint and set Body 0 to the base and Body 1 to the wheel in the Property panel.

    Example: `physics:body1` of `{joint}` names `{other_wheel}`.
    """
    lab = subject.lab
    section = lab.handout.behind("S08", subject.robot.wheels.handout)
    for joint, prim in turning_joints(subject).items():
        for name, actual in wrong_ends(prim, joint.link, subject):
            is_loose = wheel_side(prim, joint.link) is None
            is_wheel = is_loose and not is_at_or_below(actual, joint.link)
            expected = joint.link if is_wheel else "a link of the robot other than a wheel"
            message = f"{name} is {actual or 'the world'}, expected {expected}"
            fault = JointFault(message, name, expected, actual or "no prim")
            asset = None if actual else subject.stage.unknown(joint.site)
            yield wheel_problem(joint, subject.robot, fault, "bodies", section, asset)


@rule("S23", "second-wheel-joint", scope="robot", demands=_TURNS_A_WHEEL, needs="wheels")
def second_wheel_joint(subject: RobotSubject) -> Iterator[Problem]:
    """A second joint holds a wheel.

    Why: the second joint holds or drags the wheel, or couples it to another body. The robot does
    not move or drives in circles, whatever the drive graph commands.

    Fix: delete the joint, or clear Joint Enabled in the Property panel. Each wheel has one joint.

    Example: `{robot}/lock`, a fixed joint from `{base}` to `{wheel}`.
    """
    wheels = wheel_joints(subject)
    own = [wheel.prim for wheel in wheels]
    lab = subject.lab
    section = lab.handout.behind("S23", subject.robot.wheels.handout)
    for joint in joints(subject.stage):
        tied = [
            wheel
            for wheel in (() if joint in own else wheels)
            # At both ends of a joint, a wheel would be tied to itself.
            if sum(is_at_or_below(end, wheel.link) for end in bodies(joint)) == 1
        ]
        for wheel in [wheel for wheel in tied if _may_turn(wheel, subject)][:1]:
            holder = next((end for end in bodies(joint) if not is_at_or_below(end, wheel.link)), "")
            tie_text = f"{joint.name} connects {wheel.link} to {holder or 'the world'}"
            yield Problem(
                joint.path,
                f"{tie_text}, beside {wheel.name}",
                None,
                f"{wheel.name} alone",
                joint.type,
                section,
                (wheel.link, wheel.path),
                fix=(RemovePrim(joint.path),),
                unmet=(f"{subject.robot.group}/joint/{wheel.name}",),
            )


def _may_turn(wheel: WheelJoint, subject: RobotSubject) -> bool:
    """Whether the wheel has its own joint, or may have it."""
    if wheel.prim is None:
        return unknown_joints(subject) is not None
    return wheel.live is not None and not is_switched_off(wheel.live, JOINT_ENABLED)


@rule(
    "S20",
    "wheel-distance",
    scope="robot",
    demands=of_each_joint(place="sits at its place"),
    needs="wheels",
)
def wheel_distance(subject: RobotSubject) -> Iterator[Problem]:
    """The wheels are exchanged, off centre, or at another distance.

    Why: the controller computes the turn rate from this distance. The robot turns too much or too
    little, and odometry drifts away from what sensors see. With the wheels exchanged it turns the
    wrong way. It turns about the middle between its wheels: beside the centre it drives away.

    Fix: select the joint and restore its local positions in the Property panel, or start again from
    the supplied file.

    Example: `physics:localPos0` (0, 0.1, 0.023) on `{joint}`.
    """
    scene = subject.lab.scene
    wheels, limit = subject.robot.wheels, scene.tolerance.link_position
    places = {
        joint: place
        for joint in tied_joints(subject)
        if not subject.stage.unknown_value(joint.prim, f"physics:localPos{joint.base_side}")
        and (place := anchor_in_metres(joint, subject))
    }
    if len(places) != len(wheels.joints) or len(places) != _PAIR:
        return
    (first, first_place), (second, second_place) = places.items()
    apart = distance(first_place, second_place)
    units = subject.stage.meters_per_unit or 1.0  # a unit of nothing has a finding of its own
    if min(abs(apart - wheels.distance), abs(apart / units - wheels.distance)) <= limit:
        directions = axles(subject)
        if all(joint in directions and dot(directions[joint], wheels.axle) > 0 for joint in places):
            yield from _exchanged(places, subject.robot)
        yield from _off_centre(places, subject.robot, limit * units)
        return
    half = wheels.distance / 2
    is_first = abs(abs(first_place[1]) - half) >= abs(abs(second_place[1]) - half)
    joint = first if is_first else second
    expected, actual = f"{wheels.distance:g} m", f"{apart:g} m"
    message = f"the wheel joints are {actual} apart, expected {expected}"
    fault = JointFault(message, f"physics:localPos{joint.base_side}", expected, actual)
    yield wheel_problem(joint, subject.robot, fault, "place")


def _off_centre(
    places: Mapping[TiedJoint, Vector], robot: RobotSpec, limit: float
) -> Iterator[Problem]:
    """Say that the middle between the wheels is not where the robot is to turn."""
    wheels = robot.wheels
    middle = [sum(axis) / len(places) for axis in zip(*places.values(), strict=True)][:2]
    off = math.dist(middle, wheels.centre)
    if off > limit:
        joint, other = places
        name, beside = (f"physics:localPos{each.base_side}" for each in (joint, other))
        text = f"the middle between the wheel joints is {off:.3g} m beside the robot's centre"
        fault = JointFault(text, name, "0 m", f"{off:.3g} m")
        problem = wheel_problem(joint, robot, fault, "place")
        yield replace(
            problem,
            related=(*joint.related, f"{other.site}.{beside}"),
            fix=(*problem.fix, *restored(other, beside)),
        )


def _exchanged(places: Mapping[TiedJoint, Vector], robot: RobotSpec) -> Iterator[Problem]:
    """Say that the left wheel is on the right: a wheel rolls forward about what points left."""
    wheels = robot.wheels
    left = next((joint for joint in places if joint.name == wheels.left), None)
    if left is None:
        return
    (right,) = places.keys() - {left}
    if dot(wheels.axle, places[left]) >= dot(wheels.axle, places[right]):
        return
    name, on_right = (f"physics:localPos{joint.base_side}" for joint in (left, right))
    text = f"{left.name} is on the right of {right.name}: the wheels are exchanged"
    fault = JointFault(text, name, "on the left", "on the right")
    problem = wheel_problem(left, robot, fault, "place")
    yield replace(
        problem,
        related=(*left.related, f"{right.site}.{on_right}"),
        fix=(*problem.fix, Restore(right.site, on_right)) if problem.fix else (),
        unmet=(*problem.unmet, f"{robot.group}/place/{right.name}"),
    )


@rule(
    "S09", "joint-axis", scope="robot", demands=of_each_joint(axis="turns forward"), needs="wheels"
)
def joint_axis(subject: RobotSubject) -> Iterator[Problem]:
    """A wheel joint has a wrong or inverted axis.

    Why: with one axis inverted the robot spins instead of driving straight. With both inverted it
    drives backward. About any other axis the wheel does not roll. If the joint's rotation on the
    wheel's side is wrong, the wheel is turned over at Play.

    Fix: select the joint and restore Axis and the local rotations in the Property panel to the
    values in the supplied file.

    Example: `physics:axis` X on `{joint}` and Z on `{other_joint}`.
    """
    scene = subject.lab.scene
    wanted, limit = subject.robot.wheels.axle, scene.tolerance.axle_angle
    directions = axles(subject)
    wrong = {
        joint: direction
        for joint, direction in directions.items()
        if not angle_between(direction, wanted) <= limit
    }
    # Where all wheel joints have the same axis, it is the rotation that is wrong.
    axes = {joint.prim.attributes.get(AXIS, USUAL_AXIS) for joint in directions}
    has_one_axis = len(axes) == 1 and len(directions) > 1
    back = scaled(wanted, -1.0)
    section = subject.lab.handout.behind("S09", subject.robot.wheels.handout)
    for joint, direction in wrong.items():
        rotation = f"physics:localRot{joint.base_side}"
        if subject.stage.unknown_value(joint.prim, AXIS, rotation):
            continue
        name = rotation if has_one_axis else AXIS
        expected, actual = vector_text(wanted), vector_text(direction)
        turn_text = f"about {actual} of the robot, expected {expected}"
        if angle_between(direction, back) <= limit:
            turn_text = "backward: its axis is inverted"
        fault = JointFault(f"{joint.name} turns its wheel {turn_text}", name, expected, actual)
        yield wheel_problem(joint, subject.robot, fault, "axis", section)
    for joint in (joint for joint in directions if joint not in wrong):
        yield from _lying_wheel(joint, subject, section)


def _lying_wheel(joint: TiedJoint, subject: RobotSubject, section: str) -> Iterator[Problem]:
    """Say that a joint turns its wheel about another axis than that of its own cylinder."""
    seen, name = own_axle(joint, subject), f"physics:localRot{joint.wheel_side}"
    if seen is None or subject.stage.unknown_value(joint.prim, AXIS, name):
        return
    actual, expected = map(vector_text, seen)
    text = f"{joint.name} turns its wheel about {actual} of the wheel, whose axle is {expected}"
    fault = JointFault(text, name, expected, actual)
    yield wheel_problem(joint, subject.robot, fault, "axis", section)
