"""Wheels, steering and rollers of a robot, as recipes ask for them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from lab3_usd.author.choosing import choose_joints, refuse_missing
from lab3_usd.author.task import Hole, Task, leaf, robot_of_task
from lab3_usd.errors import UsageError
from lab3_usd.facts.robots import Robot, RobotJoint, Wheel, wheel_pairs
from lab3_usd.model.joint_drives import JointCommand, of_drive
from lab3_usd.model.prims import is_at_or_below

_ALIKE = 0.01  # between radii that count as one, and distances
_DIGITS = 6  # of a measured metre
_PARALLEL = 0.95  # cosine between axles that count as parallel
_PAIR = 2


def wheels(task: Task) -> Iterator[Hole]:
    """Yield the wheels left and right with their sizes, and whether keys drive them."""
    robot, options = robot_of_task(task), task.options
    groups = _wheel_groups(task)
    wheels = [wheel for pair in groups for wheel in pair if wheel is not None]
    if options.indices is None:
        refuse_stuck(task, [wheel.joint for wheel in wheels], "velocity")
        names = _pair_names(task, groups)
        shown = ", ".join(name for pair in names for name in pair)
        place = next((w for w in wheels if w.side == "left"), None)
        source = "given"
        if options.joints is None and place is not None:
            source = f"round links on level axles; left is at {place.place[1]:+.2f} m"
        items: list[dict[str, Any]] = [{"joints": pair, "indices": None} for pair in names]
        yield Hole("pairs", items, "wheels", shown, source, "--joints")
    else:
        numbers = options.indices
        if not numbers or len(numbers) % _PAIR or min(numbers) < 0:
            raise UsageError("--indices: give the numbers of left and right joints in turn: 0,1")
        pairs = zip(numbers[::_PAIR], numbers[1::_PAIR], strict=True)
        items = [{"joints": None, "indices": pair} for pair in pairs]
        yield Hole("pairs", items, "wheels", ", ".join(map(str, numbers)), "given", "--indices")
    yield _radius_hole("radius", wheels, robot, options.radius)
    yield _distance_hole(groups, robot, options.distance)
    yield Hole("keyboard", bool(options.keyboard))


_Pair = tuple[Wheel | None, Wheel | None]


def _wheel_groups(task: Task) -> list[_Pair]:
    """Return the wheels in pairs of left and right; None for a joint that turns no wheel."""
    robot, names = robot_of_task(task), task.options.joints
    if names is not None:
        choose_joints(robot, names)
        if not names or len(names) % _PAIR:
            raise UsageError("--joints: name left and right joints in turn: LEFT,RIGHT")
        by_name = {wheel.joint.name: wheel for wheel in robot.wheels}
        chosen = [by_name.get(name) for name in names]
        return [*zip(chosen[::_PAIR], chosen[1::_PAIR], strict=True)]
    wheels = robot.driven_wheels
    if not wheels:
        if task.options.indices is not None:
            return []
        refuse_missing(task.stage.unknown_below(robot.path), f"wheels of {robot.path}")
        raise UsageError(
            f"{robot.path} has no wheels: no unlimited revolute joint turns a link with a collider "
            "about a level axle; name the joints with --joints LEFT,RIGHT"
        )
    if any(wheel.steering is not None for wheel in wheels):
        raise UsageError(f"{robot.path} steers its wheels: lab3 add ackermann")
    first = wheels[0].axle
    if any(abs(sum(a * b for a, b in zip(first, w.axle, strict=True))) < _PARALLEL for w in wheels):
        raise UsageError(f"the axles of {robot.path} are not parallel: lab3 add holonomic")
    found_pairs = wheel_pairs(wheels)
    if not found_pairs or len(found_pairs) * _PAIR != len(wheels):
        named = ", ".join(f"{wheel.joint.name} ({wheel.side})" for wheel in wheels)
        raise UsageError(f"{robot.path} has no pairs of wheels left and right: {named}; --joints")
    return [*found_pairs]


def _pair_names(task: Task, groups: Sequence[_Pair]) -> list[tuple[str, ...]]:
    names = task.options.joints
    if names is not None:
        return [*zip(names[::_PAIR], names[1::_PAIR], strict=True)]
    return [tuple(wheel.joint.name for wheel in pair if wheel is not None) for pair in groups]


def refuse_stuck(task: Task, joints: Sequence[RobotJoint], command: JointCommand) -> None:
    """Refuse joints whose drives cannot follow.

    Raises:
        UsageError: there is one.
    """
    for joint in joints if not task.force else ():
        prim = joint.prim
        stuck = of_drive(prim.type, prim.apis, prim.attributes, command)
        if stuck is not None and task.stage.unknown(prim.path) is None:
            where = f"{prim.path}.{stuck.property}" if stuck.property else prim.path
            raise UsageError(
                f"{joint.name} {stuck.text}, and cannot follow a {command}: set {where} to "
                f"{stuck.expected}, or --force"
            )


def _given_size(option: str, size: float, name: str, label: str) -> Hole:
    """Return the size that an option gives.

    Raises:
        UsageError: it is none.
    """
    if not size > 0 or not math.isfinite(size):
        raise UsageError(f"--{option} {size:g}: is not a {option} in metres")
    return Hole(name, float(size), label, f"{size:g} m", "given", f"--{option}")


def _radius_hole(
    name: str, wheels: Sequence[Wheel], robot: Robot, given: float | None, label: str = "radius"
) -> Hole:
    if given is not None:
        return _given_size("radius", given, name, label)
    if not wheels:
        raise UsageError(f"no wheel of {robot.path} is known by these joints: give --radius")
    sizes = []
    for wheel in wheels:
        if wheel.radius is None:
            raise UsageError(
                f"{wheel.joint.link} has no round collider ({wheel.shape}): give --radius"
            )
        sizes.append(wheel.radius)
    if max(sizes) - min(sizes) > _ALIKE * max(sizes):
        listed = ", ".join(
            f"{leaf(w.joint.link)} {size:.4g} m" for w, size in zip(wheels, sizes, strict=True)
        )
        raise UsageError(
            f"the wheels of {robot.path} have unequal radii: {listed}; give --radius, and --force: "
            "with wheels of two sizes it drives a curve"
        )
    size = round(sum(sizes) / len(sizes), _DIGITS)
    return Hole(name, size, label, f"{size:.3f} m", f"collider {wheels[0].shape}", "--radius")


def _distance_hole(groups: Sequence[_Pair], robot: Robot, given: float | None) -> Hole:
    if given is not None:
        return _given_size("distance", given, "distance", "distance")
    distances = [abs(a.place[1] - b.place[1]) for a, b in groups if a is not None and b is not None]
    if not distances or len(distances) < len(groups):
        raise UsageError(f"no wheel of {robot.path} is known by these joints: give --distance")
    if max(distances) - min(distances) > _ALIKE * max(distances):
        listed = ", ".join(f"{size:.4g} m" for size in distances)
        raise UsageError(f"the wheels of {robot.path} are {listed} apart: give --distance")
    size = round(sum(distances) / len(distances), _DIGITS)
    return Hole(
        "distance", size, "distance", f"{size:.3f} m", "between the two joints", "--distance"
    )


def steering(task: Task) -> Iterator[Hole]:
    """Yield the joints and sizes of a car."""
    robot = robot_of_task(task)
    steered = [wheel for wheel in robot.wheels if wheel.steering is not None]
    fixed = [wheel for wheel in robot.wheels if wheel.steering is None]
    turning, rolling = wheel_pairs(steered), wheel_pairs(fixed)
    if len(turning) != 1 or len(rolling) != 1 or len(steered) + len(fixed) != 2 * _PAIR:
        refuse_missing(task.stage.unknown_below(robot.path), f"wheels of {robot.path}")
        raise UsageError(
            f"{robot.path} is not a car: it has {len(steered)} steered and {len(fixed)} other "
            "wheels, expected two of each, left and right"
        )
    (steer_left, steer_right), (roll_left, roll_right) = turning[0], rolling[0]
    is_rear = steer_left.place[0] < roll_left.place[0]
    front, rear = (rolling[0], turning[0]) if is_rear else (turning[0], rolling[0])
    joints = [wheel.steering for wheel in (steer_left, steer_right) if wheel.steering is not None]
    refuse_stuck(task, joints, "position")
    refuse_stuck(task, [w.joint for w in robot.wheels if w.joint.has_drive], "velocity")
    names = tuple(joint.name for joint in joints)
    where = "rear" if is_rear else "front"
    yield Hole(
        "steering_joints", names, "steering", ", ".join(names), f"{where} wheels turn with them"
    )
    order = tuple(wheel.joint.name for wheel in (*front, *rear))
    yield Hole("wheel_joints", order, "wheels", ", ".join(order), "front left, front right, rear")
    base = abs(steer_left.place[0] - roll_left.place[0])
    track = abs(roll_left.place[1] - roll_right.place[1])
    for name, label, size, source in (
        ("wheel_base", "wheel base", base, "between front and rear joints"),
        ("track", "track", track, f"between {roll_left.joint.name} and {roll_right.joint.name}"),
    ):
        yield Hole(name, round(size, _DIGITS), label, f"{size:.3f} m", source)
    radius = task.options.radius
    yield _radius_hole("front_radius", front, robot, radius, "front radius")
    yield _radius_hole("back_radius", rear, robot, radius, "back radius")
    widest = min(min(abs(joint.low), abs(joint.high)) for joint in joints)
    if math.isfinite(widest):
        limit = round(math.radians(widest), _DIGITS)
        yield Hole(
            "steering_limit", limit, "limit", f"{widest:g} degrees", "of the steering joints"
        )
    yield Hole("rear_steering", True if is_rear else None)


def rollers(task: Task) -> Iterator[Hole]:
    """Yield the joints of wheels with rollers."""
    robot, mark = robot_of_task(task), task.recipe.joint_mark
    marked = [joint for joint in robot.joints if mark in joint.prim.attributes]
    if not marked:
        refuse_missing(task.stage.unknown_below(robot.path), f"wheels of {robot.path}")
        raise UsageError(
            f"{robot.path} has no wheels with rollers: no joint has {mark}; apply the Mecanum "
            "Wheel API to the joints of its wheels"
        )
    outside = [j.prim.path for j in marked if not is_at_or_below(j.prim.path, robot.path)]
    if outside:
        raise UsageError(f"{outside[0]} is outside {robot.path}, where Isaac Sim looks for it")
    refuse_stuck(task, marked, "velocity")
    names = tuple(joint.name for joint in marked)
    yield Hole("wheel_joints", names, "wheels", ", ".join(names), f"joints with {mark}")
