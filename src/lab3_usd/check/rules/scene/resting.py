"""Rules about the robot at rest: on the ground, and where it starts."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.scene.ground import highest_ground
from lab3_usd.check.scene.pose_errors import (
    is_scaled,
    pose_errors,
    pose_property,
    root_tolerance,
    vector_text,
)
from lab3_usd.model.absent_prims import is_pose_unresolved
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.physics import collides
from lab3_usd.model.prims import Collider, Matrix
from lab3_usd.model.stage import StageModel
from lab3_usd.model.transform_math import (
    IDENTITY,
    Pose,
    angle_between,
    decompose,
    distance,
    rotation_difference,
    scaled,
    transform_point,
)

_UP = (0.0, 0.0, 1.0)


@rule("S19", "not-at-rest", scope="stage")
def not_at_rest(subject: StageSubject) -> Iterator[Problem]:
    """A wheel is above the ground, or a part of the robot is below it.

    Why: at Play the robot drops, tips, or is thrown up by the overlap. A lidar below the ground
    sees nothing. The collision shapes are judged as saved, if the robot root is at its pose. In
    later checkpoints, which may be saved after a run, it is a warning.

    Fix: set the transform of the link or ground named here to the value in the supplied file.

    Example: the ground plane moved to Z = -0.1.
    """
    if subject.lab.scene.world.ground is None or not _root_stands_right(subject):
        return
    found = highest_ground(subject)
    if found is None:
        return
    height, ground = found
    lows = {body: low - height for body, low in _lows(subject).items()}
    spec = subject.lab.scene.robot
    wheels = [f"{spec.path}/{name}" for name in spec.wheels.joints.values()]
    limit = _limit(subject)
    off = {body: low for body, low in lows.items() if low < -limit}
    off |= {body: lows[body] for body in wheels if body in lows and lows[body] > limit}
    standing = [body for body in wheels if body in lows]
    if standing and all(body in off for body in standing):
        # All wheels at once: it is the robot or the ground that is wrong, and one thing to say.
        off = {spec.path: off[standing[0]]}
    later = subject.lab.is_after(subject.checkpoint.id, spec.pose_is_error_until)
    severity: Severity | None = "warning" if later else None
    section = subject.lab.handout.behind("S19", spec.handout)
    for body, low in off.items():
        where = "above" if low > 0 else "below"
        part = body.rpartition("/")[2]
        message = f"{part} is {abs(low):.3g} m {where} the ground"
        related = (ground if body == spec.path else spec.path,)
        expected, actual = "on the ground", f"{low:.3g} m"
        yield Problem(body, message, None, expected, actual, section, related, severity)


def _root_stands_right(subject: StageSubject) -> bool:
    spec = subject.lab.scene.robot
    root = subject.stage.prim(spec.path)
    if root is None or root.local is None:
        return False
    tolerance = root_tolerance(subject.lab.scene, subject.stage)
    return not any(pose_errors(root, root.local or IDENTITY, spec.pose, tolerance))


def _limit(subject: StageSubject) -> float:
    """Allow the wheels as much as the robot's own height is allowed."""
    spec = subject.lab.scene.robot
    root = subject.stage.prim(spec.path)
    height = root.world[14] if root is not None and root.world else 0.0
    given = abs(height * subject.stage.meters_per_unit - spec.pose.translate[2])
    tolerance = subject.lab.scene.tolerance
    return tolerance.rest + min(given, tolerance.root_position)


def _lows(subject: StageSubject) -> dict[str, float]:
    """Return how low each link reaches, in metres: its collision shapes, else its own origin."""
    spec, stage = subject.lab.scene.robot, subject.stage
    size = subject.lab.scene.tolerance.scale
    lows: dict[str, float] = {}
    for name, link in spec.links.items():
        path = f"{spec.path}/{name}"
        shapes = [box.low[2] for box in stage.colliders.below(path) if _is_on(box, stage)]
        prim = stage.prim(path)
        if prim is not None and (is_pose_unresolved(stage, prim) or is_scaled(prim, size)):
            continue  # what is scaled S24 tells
        if shapes:
            lows[path] = min(shapes)
        elif link.offset is not None and prim is not None and prim.world:
            lows[path] = prim.world[14] * stage.meters_per_unit
    return lows


def _is_on(box: Collider, stage: StageModel) -> bool:
    prim = stage.prim(box.path)
    return prim is not None and collides(prim)


@rule("S22", "starts-elsewhere", scope="stage", severity="note")
def starts_elsewhere(subject: StageSubject) -> Iterator[Problem]:
    """The robot's base is not where its root has it.

    Why: at Play the robot starts where its bodies are, as after a saved run. The root stays behind.
    Odometry begins at zero there, and AMCL needs that place as its initial pose.

    Fix: nothing is required. To start at the pose in the supplied file, open the stage that was
    saved before the run, or reset the transforms of the links.

    Example: `{robot}/{base}` at (-1.4, 1.2, 0) on its root, facing 90 degrees.
    """
    robot, stage = subject.lab.scene.robot, subject.stage
    root = stage.prim(robot.path)
    base = stage.prim(robot.base)
    if (
        root is None
        or base is None
        or robot.base_frame not in robot.links
        or is_pose_unresolved(stage, root)
        or is_pose_unresolved(stage, base)
    ):
        return
    if root.world is None or base.world is None:
        return
    start, expected = decompose(base.world), _base_pose(subject, root.world)
    limits = root_tolerance(subject.lab.scene, stage)
    away = distance(start.translation, expected.translation) * stage.meters_per_unit
    turn = rotation_difference(start.rotation, expected.rotation)
    if away <= limits.position and turn <= limits.angle:
        return
    at, root_at = (_start(pose, stage.meters_per_unit) for pose in (start, expected))
    message = f"the robot starts {at}; its root has it {root_at}"
    where = pose_property(base, "translate")
    yield Problem(base.path, message, where, root_at, at, robot.pose.handout)


def _base_pose(subject: StageSubject, root: Matrix) -> Pose:
    """Return the pose of the robot's base where it is at its place on the root."""
    robot, units = subject.lab.scene.robot, subject.stage.meters_per_unit or 1.0
    pose = decompose(root)
    offset = robot.links[robot.base_frame].offset or (0.0, 0.0, 0.0)
    return replace(pose, translation=transform_point(scaled(offset, 1.0 / units), root))


def _start(pose: Pose, metres: float) -> str:
    """Say where a robot with this pose starts, and how it stands there."""
    ahead = pose.rotation[0]
    facing = round(math.degrees(math.atan2(ahead[1], ahead[0])), 1) + 0.0
    tilt = angle_between(pose.rotation[2], _UP)
    tipped = f", tipped by {tilt:.3g} degrees" if tilt >= 1 else ""
    at = vector_text([round(part, 4) for part in scaled(pose.translation, metres)])
    return f"at {at} m, facing {facing:g} degrees{tipped}"
