"""Where the wheel joints sit on the robot, and about what they turn the wheels."""

from __future__ import annotations

from typing import Any

from lab3_usd.check.absence import hides_place
from lab3_usd.check.model import Matrix
from lab3_usd.check.poses import Vector, decompose, directed, moved, relative, scaled, spun
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.wheel_joints import WheelJoint, base_side, ends_of
from lab3_usd.spec.catalog import Value

_AXES: dict[Any, Vector] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
AXIS = "physics:axis"


def axle(joint: WheelJoint, subject: StageSubject) -> Vector | None:
    """Return the direction about which a positive velocity turns the wheel, in the robot's frame.

    The base's side of the joint is asked: how far the wheel has turned does not matter then.
    None where a body is missing.
    """
    side = base_side(joint)
    frame = None if side is None else _base_frame(joint, side, subject)
    if side is None or frame is None or joint.prim is None:
        return None
    attributes = joint.prim.attributes
    along = _AXES.get(attributes.get(AXIS, "X"))
    if along is None:
        return None
    local = spun(along, _quaternion(attributes.get(f"physics:localRot{side}")))
    # A joint turns its second body against its first.
    sign = 1.0 if side == 0 else -1.0
    return scaled(directed(local, decompose(frame).rotation), sign)


def anchor(joint: WheelJoint, subject: StageSubject) -> Vector | None:
    """Return where the joint sits, in the robot's frame and in metres; None without a base."""
    side = base_side(joint)
    frame = None if side is None else _base_frame(joint, side, subject)
    if frame is None or joint.prim is None:
        return None
    local = joint.prim.attributes.get(f"physics:localPos{side}")
    point = moved(_vector(local), frame)
    return scaled(point, subject.stage.meters_per_unit)


def _base_frame(joint: WheelJoint, side: int, subject: StageSubject) -> Matrix | None:
    body = subject.stage.prim(ends_of(joint)[side])
    root = subject.stage.prim(subject.lab.scene["robot"]["path"])
    if body is None or root is None or body.world is None or root.world is None:
        return None
    if hides_place(subject.stage, body):
        return None
    return relative(body.world, root.world)


def _numbers(value: Value | None) -> list[float]:
    items = value if isinstance(value, tuple) else ()
    return [float(item) for item in items if isinstance(item, (int, float))]


def _vector(value: Value | None) -> Vector:
    found = _numbers(value)
    return (found[0], found[1], found[2]) if len(found) == len(_AXES) else (0.0, 0.0, 0.0)


def _quaternion(value: Value | None) -> tuple[float, float, float, float]:
    found = _numbers(value)
    if len(found) != 4:  # noqa: PLR2004 - x, y, z, w
        return (0.0, 0.0, 0.0, 1.0)
    return (found[0], found[1], found[2], found[3])
