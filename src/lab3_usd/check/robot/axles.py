"""Where the wheel joints sit on the robot, and about what they turn the wheels.

Bodies are placed by the frames of the joints that tie them, not by the poses in the file: a
stage that was saved after a run has the robot, and all of its bodies, wherever it had driven.
"""

from __future__ import annotations

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.robot.wheels import TiedJoint, tied_joints
from lab3_usd.facts.wheels import ALONG, axis_of_joint, joint_turn
from lab3_usd.model.physics import (
    COLLISION_API,
    FIXED,
    bodies,
    collides,
    is_joint_type,
    joints,
    vector,
)
from lab3_usd.model.prims import Matrix, Prim, is_at_or_below
from lab3_usd.model.stage import once_per_stage
from lab3_usd.model.transforms import (
    AXES,
    IDENTITY,
    Vector,
    angle_between,
    decompose,
    inverse,
    multiply,
    relative_transform,
    rotate_by_quaternion,
    rotate_vector,
    scaled,
    transform_point,
)

_SHAPE_AXIS = "axis"
_ROLLING = ("Cylinder", "Capsule")  # which roll about their own axis
_FRAMES = tuple(f"physics:local{part}{side}" for part in ("Pos", "Rot") for side in (0, 1))


@once_per_stage
def axles(subject: RobotSubject) -> dict[TiedJoint, Vector]:
    """Map each wheel joint that is tied to the direction about which a positive velocity turns it.

    The direction is that in the base's frame. The base's side of the joint is asked: how far the
    wheel has turned does not matter then. Joints of which it is unknown are left out.
    """
    directions = {}
    for joint in tied_joints(subject):
        frame, local = _base_frame(joint, subject), axis_of_joint(joint.prim, joint.base_side)
        if frame is not None and local is not None:
            directions[joint] = rotate_vector(local, decompose(frame).rotation)
    return directions


def own_axle(joint: TiedJoint, subject: RobotSubject) -> tuple[Vector, Vector] | None:
    """Return about what a joint turns its wheel and the axle of the wheel's own shape.

    Both are seen from the wheel. None where they agree, or where no cylinder tells the axle.
    """
    wheel = subject.stage.prim(bodies(joint.prim)[joint.wheel_side])
    back = axis_of_joint(joint.prim, joint.wheel_side)  # about which the robot turns on the wheel
    if back is None or wheel is None or wheel.world is None:
        return None
    turned = scaled(back, -1.0)
    limit = subject.lab.scene.tolerance.axle_angle
    axle = None
    for shape in subject.stage.with_api(COLLISION_API):
        if shape.type not in _ROLLING or not is_at_or_below(shape.path, joint.link):
            continue
        seen = None if shape.world is None else relative_transform(shape.world, wheel.world)
        axis = ALONG.get(shape.attributes.get(_SHAPE_AXIS, "Z"))
        if not collides(shape) or seen is None or axis is None:
            continue
        own = rotate_vector(axis, decompose(seen).rotation)
        if min(angle_between(own, turned), angle_between(own, back)) <= limit:
            return None
        axle = turned, own
    return axle


def anchor_in_metres(joint: TiedJoint, subject: RobotSubject) -> Vector | None:
    """Return where the joint sits, in the base's frame and in metres; None without a base."""
    frame = _base_frame(joint, subject)
    if frame is None:
        return None
    local = joint.prim.attributes.get(f"physics:localPos{joint.base_side}")
    point = transform_point(vector(local), frame)
    return scaled(point, subject.stage.meters_per_unit)


def _base_frame(joint: TiedJoint, subject: RobotSubject) -> Matrix | None:
    """Return where the end at the robot stands as seen from the robot's base, at rest.

    What no fixed joint ties to the base is taken from where both stand in the file.
    """
    end, placed = bodies(joint.prim)[joint.base_side], rest_frames(subject)
    body = next((path for path in placed if is_at_or_below(end, path)), None)
    if body is None:
        return _between(end, _base(subject), subject)
    on_body = IDENTITY if end == body else _between(end, body, subject)
    return None if on_body is None else multiply(on_body, placed[body])


def _between(path: str, base_path: str, subject: RobotSubject) -> Matrix | None:
    """Return where one prim stands as seen from another in the file, None where nothing says."""
    prim, base = subject.stage.prim(path), subject.stage.prim(base_path)
    if prim is None or base is None or prim.world is None or base.world is None:
        return None
    if subject.stage.unknown_pose(prim, base):
        return None
    return relative_transform(prim.world, base.world)


def _base(subject: RobotSubject) -> str:
    """Return the path of the robot's base, of the robot where it has none."""
    robot = subject.robot
    return robot.path if subject.stage.prim(robot.base) is None else robot.base


@once_per_stage
def rest_frames(subject: RobotSubject) -> dict[str, Matrix]:
    """Map the base, and each body that fixed joints tie to it, to where it stands on the base."""
    placed = {_base(subject): IDENTITY}
    reached = [*placed]
    for body in reached:  # which grows
        for weld in (weld for weld in welds(subject) if body in bodies(weld)):
            far = 1 - bodies(weld).index(body)
            other, seen = bodies(weld)[far], _seen_over(weld, far)
            if other and other not in placed and seen is not None:
                placed[other] = multiply(seen, placed[body])
                reached.append(other)
    return placed


def _seen_over(joint: Prim, far: int) -> Matrix | None:
    """Return where one body of a joint stands as seen from the other."""
    undone = inverse(_joint_frame(joint, far))
    return multiply(undone, _joint_frame(joint, 1 - far)) if undone else None


def holder_of(subject: RobotSubject, link: str) -> Prim | None:
    """Return the joint that holds a link, else one that would: it is off, or lets the link move."""
    stage = subject.stage
    named = [joint for joint in stage.of_type(is_joint_type) if link in bodies(joint)]
    weld = next((joint for joint in named if joint in welds(subject)), None)
    if weld is not None or any(stage.unknown_value(joint, *_FRAMES) for joint in named):
        return weld
    return next(iter(named), None)


def held_at(subject: RobotSubject, joint: Prim, link: str) -> Matrix | None:
    """Return where a joint has a link at rest, be it off, or movable; None where it has no place.

    What it hangs on is tied to the base by fixed joints.
    """
    placed, ends = rest_frames(subject), bodies(joint)
    if link in placed:
        return placed[link]
    far = ends.index(link)
    seen = _seen_over(joint, far)
    return multiply(seen, placed[ends[1 - far]]) if seen and ends[1 - far] in placed else None


@once_per_stage
def welds(subject: RobotSubject) -> list[Prim]:
    """Return the joints that hold two bodies where they say, and no missing asset may differ."""
    stage = subject.stage
    return [
        joint
        for joint in joints(stage)
        if joint.type == FIXED and not stage.unknown_value(joint, *_FRAMES)
    ]


def _joint_frame(joint: Prim, side: int) -> Matrix:
    """Return where the joint sits on one of its bodies."""
    x, y, z = vector(joint.attributes.get(f"physics:localPos{side}"))
    turn = joint_turn(joint.attributes.get(f"physics:localRot{side}"))
    rows = [rotate_by_quaternion(along, turn) for along in AXES] if any(turn[:3]) else AXES
    return (*rows[0], 0.0, *rows[1], 0.0, *rows[2], 0.0, x, y, z, 1.0)
