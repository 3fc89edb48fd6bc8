"""Rules about how the wheel joints turn: about the axle, forward, by a velocity drive."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import is_hidden
from lab3_usd.check.axles import AXIS, axle
from lab3_usd.check.finding import Problem, Severity
from lab3_usd.check.physics import DRIVE_API, number
from lab3_usd.check.poses import Vector, angle_between, scaled
from lab3_usd.check.posing import text, vector
from lab3_usd.check.registry import rule
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.wheel_joints import (
    WheelJoint,
    base_side,
    is_stated,
    tied_joints,
    turning_joints,
)

STIFFNESS = "drive:angular:physics:stiffness"
DAMPING = "drive:angular:physics:damping"


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
    axles = {joint: found for joint in tied_joints(subject) if (found := axle(joint, subject))}
    wrong = {
        joint: found for joint, found in axles.items() if not angle_between(found, wanted) <= limit
    }
    back = scaled(wanted, -1.0)
    is_all_back = len(wrong) == len(axles) > 1 and all(
        angle_between(found, back) <= limit for found in wrong.values()
    )
    severity: Severity | None = "warning" if is_all_back else None
    for joint, found in wrong.items():
        if not is_stated(joint, subject, AXIS, f"physics:localRot{base_side(joint)}"):
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
    for joint in turning_joints(subject):
        prim = joint.prim
        if prim is None:
            continue
        may_be_hidden = is_hidden(subject.stage, prim.path)
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
        damping = number(prim.attributes.get(DAMPING, None if may_be_hidden else 0.0))
        if damping is not None and not damping > 0:
            message = f"damping is {damping:g}, expected more than 0"
            yield Problem(
                prim.path, message, DAMPING, "above 0", f"{damping:g}", handout, joint.related
            )
