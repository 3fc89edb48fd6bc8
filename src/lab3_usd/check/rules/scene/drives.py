"""Rules about how the wheel joints turn: about the axle, forward, by a velocity drive."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.scene.axles import AXIS, axle
from lab3_usd.check.scene.pose_errors import vector_text
from lab3_usd.check.scene.wheel_joints import (
    WheelJoint,
    base_side,
    is_stated,
    tied_joints,
    turning_joints,
)
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.physics import DAMPING, DRIVE_API, MAX_FORCE, STIFFNESS, number
from lab3_usd.model.transform_math import Vector, angle_between, scaled

_WORDS = {DAMPING: "damping", MAX_FORCE: "the drive's largest force"}


@rule("S09", "joint-axis", scope="stage")
def joint_axis(subject: StageSubject) -> Iterator[Problem]:
    """A wheel joint has a wrong axis: not the lateral axis of the robot, or inverted.

    Why: with one axis inverted the robot spins instead of driving straight. With both inverted it
    drives backward. About any other axis the wheel does not roll.

    Fix: select the joint and restore Axis and the local rotations in the Property panel to the
    values in the supplied file.

    Example: `physics:axis` X on `{joint}` and Z on `{other_joint}`.
    """
    scene = subject.lab.scene
    wanted, limit = scene.robot.wheels.axle, scene.tolerance.axle_angle
    axles = {joint: found for joint in tied_joints(subject) if (found := axle(joint, subject))}
    wrong = {
        joint: found for joint, found in axles.items() if not angle_between(found, wanted) <= limit
    }
    back = scaled(wanted, -1.0)
    is_all_back = len(wrong) == len(axles) > 1 and all(
        angle_between(found, back) <= limit for found in wrong.values()
    )
    severity: Severity | None = "warning" if is_all_back else None
    section = subject.lab.handout.behind("S09", scene.robot.wheels.handout)
    for joint, found in wrong.items():
        if not is_stated(joint, subject, AXIS, f"physics:localRot{base_side(joint)}"):
            continue
        message = f"{joint.name} {_says(found, wanted, limit)}"
        yield Problem(
            joint.site,
            message,
            _cause(joint, list(axles)),
            vector_text(wanted),
            vector_text(found),
            section,
            joint.related,
            severity,
        )


def _says(found: Vector, wanted: Vector, limit: float) -> str:
    if angle_between(found, scaled(wanted, -1.0)) <= limit:
        return "turns its wheel backward: its axis is inverted"
    return (
        f"turns its wheel about {vector_text(found)} of the robot, expected {vector_text(wanted)}"
    )


def _cause(joint: WheelJoint, others: list[WheelJoint]) -> str:
    """Name the axis, or the rotation where all wheel joints have the same axis."""
    axes = {None if each.prim is None else each.prim.attributes.get(AXIS, "X") for each in others}
    side = base_side(joint)
    is_rotation = len(axes) == 1 and len(others) > 1 and side is not None
    return f"physics:localRot{side}" if is_rotation else AXIS


@rule("S10", "joint-drive", scope="stage")
def joint_drive(subject: StageSubject) -> Iterator[Problem]:
    """A wheel joint has no velocity drive (stiffness 0, damping and force above 0).

    Why: velocity commands act through damping. Without damping, or with a largest force of 0, the
    wheel ignores them. With stiffness it is pulled back to its start position.

    Fix: select the joint, and under Drive > Angular set Stiffness to 0 and Damping to the value in
    the supplied file, or Max Force. If the drive is missing, choose Add > Physics > Angular Drive.

    Example: `drive:angular:physics:damping` 0 on `{joint}`.
    """
    handout = subject.lab.scene.robot.wheels.handout
    for joint in turning_joints(subject):
        prim = joint.prim
        if prim is None:
            continue
        may_be_hidden = is_unresolved(subject.stage, prim.path)
        if DRIVE_API not in prim.apis and not may_be_hidden:
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
        hidden = None if may_be_hidden else 0.0
        for name, unset in ((DAMPING, hidden), (MAX_FORCE, None)):
            value = number(prim.attributes.get(name, unset))
            if value is not None and not value > 0:
                message = f"{_WORDS[name]} is {value:g}, expected more than 0"
                yield Problem(
                    prim.path, message, name, "above 0", f"{value:g}", handout, joint.related
                )
