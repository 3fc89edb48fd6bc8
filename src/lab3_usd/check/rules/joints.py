"""Rules about the wheel joints: they exist, turn the right wheel the right way, and are driven."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import is_hidden, why_absent
from lab3_usd.check.finding import Problem, Severity
from lab3_usd.check.physics import DRIVE_API, JOINT_ENABLED, REVOLUTE, is_switched_off, number
from lab3_usd.check.poses import Vector, angle_between, distance, scaled
from lab3_usd.check.posing import text, vector
from lab3_usd.check.registry import rule
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.wheel_joints import (
    AXIS,
    WheelJoint,
    anchor,
    axle,
    base_side,
    could_hide_joints,
    wheel_joints,
    wrong_ends,
)

STIFFNESS = "drive:angular:physics:stiffness"
DAMPING = "drive:angular:physics:damping"


@rule("S07", "wheel-joint", scope="stage")
def wheel_joint(subject: StageSubject) -> Iterator[Problem]:
    """A wheel joint is missing, switched off, misnamed, or does not turn.

    Why: the drive graph commands the joints by name. A name that no joint has stops the whole
    controller with an error in the console.

    Fix: undo the deletion or the change of the joint, rename it in the Stage panel, or start again
    from the supplied file.

    Example: `/turtlebot3_burger/joints/wheel_left_joint` deactivated.
    """
    handout = subject.lab.scene["robot"]["wheels"]["handout"]
    for joint in wheel_joints(subject):
        if subject.stage.prim(joint.link) is None:
            continue
        message = _why_useless(joint, subject)
        if message is None:
            continue
        is_off = joint.live is not None and is_switched_off(joint.live, JOINT_ENABLED)
        yield Problem(
            joint.site,
            message,
            JOINT_ENABLED if is_off else None,
            "True" if is_off else f"{REVOLUTE} {joint.name}",
            "False" if is_off else None,
            handout,
            joint.related,
        )


def _why_useless(joint: WheelJoint, subject: StageSubject) -> str | None:
    prim = joint.prim
    if prim is None or not prim.present:
        is_gone = prim is None or prim.active
        if is_gone and could_hide_joints(subject):
            return None
        return f"{joint.name} {why_absent(subject.stage, joint.site)}"
    if prim.type != REVOLUTE:
        return f"{joint.name} is a {prim.type or 'prim without a type'}, expected {REVOLUTE}"
    if prim.name != joint.name:
        return f"the joint of {joint.link} is named {prim.name}, expected {joint.name}"
    if is_switched_off(prim, JOINT_ENABLED):
        return f"{joint.name} is switched off"
    return None


def _turning(subject: StageSubject) -> list[WheelJoint]:
    """Return the wheel joints that can turn; the others are S07's."""
    return [
        joint
        for joint in wheel_joints(subject)
        if joint.live is not None and subject.stage.prim(joint.link) is not None
    ]


def _tied(subject: StageSubject) -> list[WheelJoint]:
    """Return the wheel joints that connect what they should; the others are S08's."""
    return [joint for joint in _turning(subject) if not any(wrong_ends(joint, subject))]


@rule("S08", "joint-bodies", scope="stage")
def joint_bodies(subject: StageSubject) -> Iterator[Problem]:
    """A wheel joint does not connect its own wheel with a body of the robot.

    Why: with the wheels swapped the robot turns the wrong way round; a wheel tied to the world
    holds the robot in place.

    Fix: select the joint and set Body 0 to the base and Body 1 to the wheel in the Property panel.

    Example: `physics:body1` of `wheel_left_joint` names `wheel_right_link`.
    """
    for joint in _turning(subject):
        for name, actual in wrong_ends(joint, subject):
            if joint.prim is None or (not actual and is_hidden(subject.stage, joint.prim.path)):
                continue
            is_wheel = base_side(joint) is None
            expected = joint.link if is_wheel else "a link of the robot that is no wheel"
            message = f"{name} is {actual or 'the world'}, expected {expected}"
            is_ = actual or "no prim"
            yield Problem(joint.site, message, name, expected, is_, "8.4", joint.related)


@rule("S09", "joint-axis", scope="stage")
def joint_axis(subject: StageSubject) -> Iterator[Problem]:
    """A wheel joint does not turn its wheel about the robot's lateral axis, forward for plus.

    Why: with one axis inverted the robot spins where it should go straight (8.5), with both it
    moves backward (8.4); about any other axis the wheel does not roll.

    Fix: select the joint and restore Axis and the local rotations in the Property panel, as the
    supplied file has them.

    Example: `physics:axis` X on `wheel_left_joint` and Z on `wheel_right_joint`.
    """
    scene = subject.lab.scene
    wanted, limit = vector(scene["robot"]["wheels"]["axle"]), scene["tolerance"]["axle_angle"]
    axles = {joint: found for joint in _tied(subject) if (found := axle(joint, subject))}
    wrong = {joint: found for joint, found in axles.items() if angle_between(found, wanted) > limit}
    back = scaled(wanted, -1.0)
    is_all_back = len(wrong) == len(axles) > 1 and all(
        angle_between(found, back) <= limit for found in wrong.values()
    )
    severity: Severity | None = "warning" if is_all_back else None
    for joint, found in wrong.items():
        if joint.prim is not None and is_hidden(subject.stage, joint.prim.path):
            continue
        message = f"{joint.name} {_says(found, wanted, limit)}"
        yield Problem(
            joint.site,
            message,
            _cause(joint, list(axles)),
            text(wanted),
            text(found),
            "8.4" if is_all_back else "8.5",
            joint.related,
            severity,
        )


def _says(found: Vector, wanted: Vector, limit: float) -> str:
    if angle_between(found, scaled(wanted, -1.0)) <= limit:
        return "turns its wheel backward: its axis is inverted"
    return f"turns its wheel about {text(found)} of the robot, expected {text(wanted)}"


def _cause(joint: WheelJoint, others: list[WheelJoint]) -> str:
    """Name the axis, or the rotation where all wheel joints have the same axis."""
    axes = {None if each.prim is None else each.prim.attributes.get(AXIS) for each in others}
    side = base_side(joint)
    is_rotation = len(axes) == 1 and len(others) > 1 and side is not None
    return f"physics:localRot{side}" if is_rotation else AXIS


@rule("S10", "joint-drive", scope="stage")
def joint_drive(subject: StageSubject) -> Iterator[Problem]:
    """A wheel joint has no velocity drive: stiffness 0 and damping above 0.

    Why: velocity commands act through damping. Without damping the wheel ignores them, and with
    stiffness it is pulled back to where it started.

    Fix: select the joint, and under Drive > Angular set Stiffness to 0 and Damping to the value of
    the supplied file; Add > Physics > Angular Drive where it is gone.

    Example: `drive:angular:physics:damping` 0 on `wheel_left_joint`.
    """
    handout = subject.lab.scene["robot"]["wheels"]["handout"]
    for joint in _turning(subject):
        prim = joint.prim
        if prim is None:
            continue
        may_be_hidden = is_hidden(subject.stage, prim.path)
        if DRIVE_API not in prim.apis:
            if not may_be_hidden:
                message = f"{joint.name} has no angular drive"
                yield Problem(prim.path, message, DAMPING, DRIVE_API, None, handout, joint.related)
            continue
        stiffness = number(prim.attributes.get(STIFFNESS, 0.0))
        if stiffness != 0:
            message = f"stiffness is {stiffness:g}, expected 0" if stiffness is not None else ""
            message = message or "stiffness is no number, expected 0"
            yield Problem(
                prim.path, message, STIFFNESS, "0", f"{stiffness}", handout, joint.related
            )
        damping = number(prim.attributes.get(DAMPING, None if may_be_hidden else 0.0))
        if damping is not None and not damping > 0:
            message = f"damping is {damping:g}, expected more than 0"
            yield Problem(
                prim.path, message, DAMPING, "above 0", f"{damping:g}", handout, joint.related
            )


@rule("S20", "wheel-distance", scope="stage")
def wheel_distance(subject: StageSubject) -> Iterator[Problem]:
    """The wheel joints do not sit as far apart as the handout lists.

    Why: the controller computes turning from this distance: the robot turns too much or too
    little, and odometry and scan drift apart.

    Fix: select the joint and restore its local positions in the Property panel, or start again
    from the supplied file.

    Example: `physics:localPos0` (0, 0.1, 0.023) on `wheel_left_joint`.
    """
    scene = subject.lab.scene
    wheels, limit = scene["robot"]["wheels"], scene["tolerance"]["link_position"]
    places = {joint: found for joint in _tied(subject) if (found := anchor(joint, subject))}
    if len(places) != len(wheels["joints"]) or could_hide_joints(subject):
        return
    (first, one), (second, other) = places.items()
    apart = distance(one, other)
    units = subject.stage.meters_per_unit
    if min(abs(apart - wheels["distance"]), abs(apart / units - wheels["distance"])) <= limit:
        return
    half = wheels["distance"] / 2
    is_first = abs(abs(one[1]) - half) >= abs(abs(other[1]) - half)
    joint = first if is_first else second
    expected, actual = f"{wheels['distance']:g} m", f"{apart:g} m"
    message = f"the wheel joints are {actual} apart, expected {expected}"
    name = f"physics:localPos{base_side(joint)}"
    yield Problem(joint.site, message, name, expected, actual, wheels["handout"], joint.related)
