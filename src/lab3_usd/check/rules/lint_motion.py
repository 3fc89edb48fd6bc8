"""Rules about wheels that turn and a robot that does not move, or an odometry of a wheel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import driven_pairs
from lab3_usd.facts.feeding import MisnamedPose, misnamed_poses
from lab3_usd.facts.followed_bodies import followed_bodies
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.quantities import wheel_commands
from lab3_usd.facts.wheels import axis_of_joint, disc_of
from lab3_usd.model.finding import Problem
from lab3_usd.model.physics import (
    AXIS,
    BODIES,
    BODY_ENABLED,
    FAR,
    FIXED,
    JOINT_ENABLED,
    KINEMATIC,
    LIMITS,
    bodies,
    ends,
    is_switched_off,
    joint_limits,
    working_joints_at,
)
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel, UnresolvedAsset, once_per_stage
from lab3_usd.model.transforms import decompose, dot, rotate_vector

_FASTEST = "physxJoint:maxJointVelocity"  # drive_rules.py:102 of Isaac Sim's own validation
_APART, _ACROSS = -0.9, 0.5  # cosine of the angle between two axes
_FLAT = 1.8  # widths of a wheel by its radius, from which on nothing tells its axis


@rule("K81", "robot-tied-to-world", severity="warning")
def robot_tied_to_world(subject: LintSubject) -> Iterator[Problem]:
    """A fixed joint connects a driven robot to the world.

    Why: the wheels turn and the robot stays where it is. Importers create such a joint for a fixed
    base.

    Fix: delete the joint, or import the robot again with a movable base.

    Example: `/World/robot/root_joint`, a fixed joint with `base_link` and no other body.
    """
    tied: set[str] = set()
    for command, wheels in wheel_commands(subject.stage):
        robot = _joined_bodies(subject.stage, wheels)
        for joint in working_joints_at(robot, subject.stage):
            sides = bodies(joint)
            is_tie = joint.type == FIXED and any(
                side in robot and _is_world(other, subject.stage)
                for side, other in (sides, sides[::-1])
            )
            if is_tie and joint.path not in tied:
                tied.add(joint.path)
                yield Problem(
                    joint.path,
                    f"fixes the robot to the world, but {command.node.path} drives its wheels",
                    related=(command.node.path,),
                    assumes=((command.node.path, command.port),),
                )


@once_per_stage
def _joined_bodies(stage: StageModel, wheels: tuple[Prim, ...]) -> frozenset[str]:
    """Return the bodies of wheel joints, and all that further joints tie to them."""
    return _tied_to((path for joint in wheels for path in ends(joint)), "", stage)


def _tied_to(paths: Iterable[str], kind: str, stage: StageModel) -> frozenset[str]:
    """Return some bodies and all that joints of a type, '' for any, tie to them."""
    ahead = [*paths]
    tied = {*ahead}
    while ahead:
        joints = [j for j in working_joints_at([ahead.pop()], stage) if kind in {"", j.type}]
        new = {end for j in joints for end in ends(j) if not _is_world(end, stage)} - tied
        tied |= new
        ahead += new
    return frozenset(tied)


def _is_world(path: str, stage: StageModel) -> bool:
    """Whether the end of a joint moves with no body: none is named, or none is there."""
    return not path or (stage.prim(path) is not None and _body(path, stage) is None)


def _body(path: str, stage: StageModel) -> Prim | None:
    """Return the body that a prim moves with."""
    return stage.prim(joined_bodies(stage).carrier(path))


@rule("K82", "wheel-cannot-turn")
def wheel_cannot_turn(subject: LintSubject) -> Iterator[Problem]:
    """Something stops a commanded wheel or its robot.

    Why: a disabled joint moves nothing, and one with limits stops there. A wheel or chassis does
    not move if it is kinematic, disabled or not a rigid body, or if a fixed joint holds it to such
    a body. Neither does a joint whose maximum velocity is 0. A wheel without a collision shape, and
    without rollers that have one, turns in the air.

    Fix: enable the joint and the bodies, switch Kinematic off, delete limits and fixed joints of
    the wheel, and enable its collision.

    Example: `physics:upperLimit = 90` on the joint of a wheel.
    """
    stage, judged = subject.stage, set[str]()
    for command, wheels in wheel_commands(stage):
        driver = command.node.path
        for joint in wheels:
            obstacles = () if joint.path in judged else _obstacles(joint, wheels, stage)
            judged.add(joint.path)
            for site, name, message in obstacles:
                text = f"{message}, but {driver} drives the wheel"
                asset = stage.unknown(site, *joint.relationships.get(name or "", ()))
                yield Problem(site, text, property=name, related=(driver,), rests_on=asset)
        for wheel in _without_shape(wheels, stage):
            if wheel not in judged:
                judged.add(wheel)
                text = f"has no enabled collision shape: {driver} turns it in the air"
                asset = stage.unknown_below(wheel)
                yield Problem(wheel, text, related=(driver,), rests_on=asset)
        bases = sorted(_tied_to(_bases(stage, wheels), FIXED, stage))
        for body in filter(None, (_body(base, stage) for base in bases)):
            switches = () if body.path in judged else _stops(body)
            judged.add(body.path)
            for name, message in switches:
                text, asset = f"{message}, but {driver} drives its wheels", stage.unknown(body.path)
                yield Problem(body.path, text, property=name, related=(driver,), rests_on=asset)


def _without_shape(wheels: tuple[Prim, ...], stage: StageModel) -> list[str]:
    """Return the wheels that touch nothing, nor does what they carry."""
    bodies_of = (_wheel(joint, wheels, stage) for joint in wheels)
    moved = dict.fromkeys(path for path in bodies_of if path is not None and stage.prim(path))
    bare = [path for path in moved if not stage.colliders.below(path)]
    fixed = _bases(stage, wheels) if bare else frozenset()
    return [
        path
        for path in bare
        if not any(
            end and end not in fixed and stage.colliders.below(end)
            for joint in working_joints_at([path], stage)
            for end in bodies(joint)
        )
    ]


def _stops(body: Prim) -> Iterator[tuple[str, str]]:
    """Yield the switches of a body that keep it where it is: property, message."""
    if is_switched_off(body, BODY_ENABLED):
        yield BODY_ENABLED, "rigid body is disabled"
    if body.attributes.get(KINEMATIC) is True:
        yield KINEMATIC, "is kinematic"


def _obstacles(
    joint: Prim, wheels: tuple[Prim, ...], stage: StageModel
) -> Iterator[tuple[str, str | None, str]]:
    """Yield the reasons that keep a wheel from turning: prim, property, message."""
    if is_switched_off(joint, JOINT_ENABLED):
        yield joint.path, JOINT_ENABLED, "is disabled"
    if joint.attributes.get(_FASTEST) == 0:
        yield joint.path, _FASTEST, f"has {_FASTEST} 0"
    low, high = joint_limits(joint.attributes)
    if low > -FAR or high < FAR:
        name = LIMITS[0] if low > -FAR else LIMITS[1]
        yield joint.path, name, f"turns between {low:g} and {high:g} degrees only"
    wheel = _wheel(joint, wheels, stage)
    body = None if wheel is None else _body(wheel, stage)
    if wheel is None or stage.prim(wheel) is None:
        return
    if body is None:
        side = BODIES[ends(joint).index(wheel)]
        yield joint.path, side, f"moves {wheel}, which is not a rigid body"
        return
    yield from ((body.path, name, message) for name, message in _stops(body))
    for other in working_joints_at([wheel], stage):
        if other.type == FIXED:
            held = next((path for path in bodies(other) if path != wheel), "")
            if not held or held in _bases(stage, wheels):
                yield other.path, None, f"connects {wheel} to {held or 'the world'}"


@once_per_stage
def _bases(stage: StageModel, wheels: tuple[Prim, ...]) -> frozenset[str]:
    """Return the bodies that wheels hang on: those of several wheels, or of more joints."""
    counts = Counter(path for joint in wheels for path in set(ends(joint)))
    shared = frozenset(path for path, count in counts.items() if count > 1)
    if shared:
        return shared
    ties = {path: len(working_joints_at([path], stage)) for path in counts}
    most = max(ties.values(), default=0)
    tied = [path for path, count in ties.items() if count == most]
    return frozenset(tied if len(tied) == 1 else ())


def _wheel(joint: Prim, wheels: tuple[Prim, ...], stage: StageModel) -> str | None:
    """Return the body that a joint turns as a wheel, None where both ends may be the base."""
    bases = _bases(stage, wheels)
    moved = [path for path in ends(joint) if path not in bases]
    return moved[0] if len(moved) == 1 and len(ends(joint)) == len(BODIES) else None


@rule("K83", "odometry-of-wheel", severity="warning")
def odometry_of_wheel(subject: LintSubject) -> Iterator[Problem]:
    """The chassis of odometry is a wheel, or not the named link.

    Why: a wheel rotates: odometry shows a robot that rolls over and over, with a speed in all
    directions. A foot or an arm moves against the base, and so does the base in its odometry. With
    the pose of a prim 2 cm or more from the named link, the robot is shifted, and turns about
    another point.

    Fix: set Chassis Prim to the base link of the robot.

    Example: `inputs:chassisPrim` names `/World/robot/wheel_left_link`.
    """
    turning = {
        wheel: joint.path
        for _, wheels in wheel_commands(subject.stage)
        for joint in wheels
        if (wheel := _wheel(joint, wheels, subject.stage)) is not None
    }
    for odometry in followed_bodies(subject.stage):
        if odometry.body is not None and odometry.body.path in turning:
            joint = turning[odometry.body.path]
            yield Problem(
                odometry.node.path,
                f"{odometry.port} is {odometry.prim.path}, a wheel that {joint} turns",
                property=odometry.port,
                expected="the base link of the robot",
                actual=odometry.prim.path,
                related=(joint,),
            )
    told, robots = set(turning), joined_bodies(subject.stage)
    for pose in misnamed_poses(subject.stage):
        body = "" if pose.followed.body is None else pose.followed.body.path
        if body not in told and robots.owner(pose.prim) == robots.owner(body):
            told.add(body)
            why = f"which is {pose.away:.2g} m from it" if pose.away else "which moves against it"
            prims = (subject.stage.prim(pose.prim), pose.followed.body)
            asset = subject.stage.unknown_pose(*filter(None, prims)) if pose.away else None
            yield misnamed(pose, why, asset or pose.followed.unknown)


def misnamed(pose: MisnamedPose, why: str, rests_on: UnresolvedAsset | None) -> Problem:
    """Return the problem of odometry whose message names the frame of another prim."""
    followed, path = pose.followed, pose.followed.prim.path
    return Problem(
        followed.node.path,
        f"{followed.port} is {path}, but {pose.publisher} publishes it as '{pose.frame}', the "
        f"frame of {pose.prim}, {why}",
        property=followed.port,
        expected=pose.prim,
        actual=path,
        related=(pose.publisher,),
        rests_on=rests_on,
    )


@rule("K84", "wheels-turn-apart")
def wheels_turn_apart(subject: LintSubject) -> Iterator[Problem]:
    """Two wheel joints turn opposite ways, or one across its wheel's axis.

    Why: a Differential Controller gives both wheels a positive speed to drive ahead. If the axis of
    one joint points the other way, the robot turns on the spot instead, and drives when it should
    turn. A wheel that turns about another axis than its own, or than the other wheel, tips over
    instead of rolling.

    Fix: turn the frame of that joint by 180 degrees, or choose its Axis, so that both axes point to
    the same side, along the axes of the wheels.

    Example: `physics:localRot0` of the left wheel's joint is turned half a circle about Z.
    """
    judged: set[str] = set()
    for command, wheels in wheel_commands(subject.stage):
        for joint in wheels:
            if joint.path not in judged and _is_across(joint, wheels, subject.stage):
                judged.add(joint.path)
                yield Problem(
                    joint.path,
                    "its axis is perpendicular to the axis of its wheel, which cannot roll",
                    property=AXIS,
                    related=(command.node.path,),
                    rests_on=subject.stage.unknown(joint.path),
                )
    for command, controller, pair in driven_pairs(subject.stage):
        bases = _bases(subject.stage, pair)
        axes = []
        for joint in pair:
            sides = [side for side, path in enumerate(bodies(joint)) if path in bases]
            axes.append(axis_of_joint(joint, sides[0]) if sides else None)
        if len(bases) != 1 or not axes[0] or not axes[1] or pair[1].path in judged:
            continue
        cosine, effect = dot(axes[0], axes[1]), ""
        if cosine < _APART:
            turns = f"{controller.path} turns the robot when it should drive ahead"
            effect = f"against that of {pair[1].path}: {turns}"
        elif abs(cosine) < _ACROSS:
            effect = f"across the axis of {pair[1].path}: one of the two wheels cannot roll"
        if effect and pair[0].path not in judged:
            judged.add(pair[0].path)
            yield Problem(
                pair[0].path,
                f"turns its wheel {effect}",
                related=(pair[1].path, command.node.path),
                rests_on=subject.stage.unknown(pair[0].path, pair[1].path),
            )


def _is_across(joint: Prim, wheels: tuple[Prim, ...], stage: StageModel) -> bool:
    """Whether a joint turns a flat wheel about another axis than the wheel's own."""
    wheel = stage.prim(_wheel(joint, wheels, stage) or "")
    disc = None if wheel is None else disc_of(wheel, stage)
    if wheel is None or wheel.world is None or disc is None:
        return False
    turned = axis_of_joint(joint, bodies(joint).index(wheel.path))
    if turned is None or disc.width > _FLAT * disc.radius:
        return False
    seen = rotate_vector(turned, decompose(wheel.world).rotation)
    return abs(dot(seen, disc.axis)) < _ACROSS
