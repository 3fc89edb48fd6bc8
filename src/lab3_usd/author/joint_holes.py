"""Joints to publish, command and grip with, as recipes ask for them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lab3_usd.author.choosing import choose_joints, present_prim
from lab3_usd.author.ros_holes import checked_topic
from lab3_usd.author.task import Hole, Task, robot_of_task
from lab3_usd.author.wheel_holes import refuse_stuck
from lab3_usd.errors import AmbiguousError, UsageError
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.robots import Robot, RobotJoint, is_mimic
from lab3_usd.model.joint_drives import JointCommand
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import StageModel


def joint_topics(task: Task) -> Iterator[Hole]:
    """Yield whether states are published and commands are taken, and on which topics."""
    options = task.options
    states, commands = options.states is not False, bool(options.commands)
    if not (states or commands):
        raise UsageError("--no-states without --commands adds nothing: give --commands")
    yield Hole("states", states)
    yield Hole("commands", commands)
    yield Hole("move", options.move is not False)
    if options.command_topic is not None:
        name = checked_topic(options.command_topic, "--command-topic")
    elif isinstance(options.topic, str) and not states:
        name = checked_topic(options.topic, "--topic")
    else:
        name = task.recipe.usual["command_topic"]
    if commands:
        is_given = name != task.recipe.usual["command_topic"]
        source = "given" if is_given else "usual name"
        yield Hole("command_topic", name, "commands", name, source, "--command-topic")


def positions(task: Task) -> Iterator[Hole]:
    """Yield the joints that are held, and where: where their drives have them, unless given."""
    yield from _joint_values(task, "position")


def velocities(task: Task) -> Iterator[Hole]:
    """Yield the joints that are turned, and how fast: as their drives have it, unless given."""
    yield from _joint_values(task, "velocity")


def _joint_values(task: Task, command: JointCommand) -> Iterator[Hole]:
    robot, names, values = robot_of_task(task), task.options.joints, task.options.positions
    if names is not None:
        joints, source = choose_joints(robot, names), "given"
    else:
        joints = [joint for joint in robot.arm_joints if not is_mimic(joint)]
        source = "joints with a drive that turn no wheel"
        if not joints and command == "velocity":
            joints = [wheel.joint for wheel in robot.driven_wheels if wheel.joint.has_drive]
            source = "wheels with a drive"
    if not joints:
        raise UsageError(f"{robot.path} has no joint with a drive to command; give --joints")
    refuse_stuck(task, joints, command)
    shown = ", ".join(joint.name for joint in joints)
    yield Hole("joint_names", tuple(j.name for j in joints), "joints", shown, source, "--joints")
    if values is not None and len(values) != len(joints):
        raise UsageError(f"--positions: {len(values)} values for {len(joints)} joints ({shown})")
    if values is None:
        targets = [j.position if command == "position" else j.velocity for j in joints]
        values = tuple(
            math.radians(target) if joint.is_angular else target
            for joint, target in zip(joints, targets, strict=True)
        )
    text = ", ".join(f"{value:.4g}" for value in values)
    measures = {"radians" if joint.is_angular else "units of length" for joint in joints}
    unit = " and ".join(sorted(measures)) + (" a second" if command == "velocity" else "")
    why = "given" if task.options.positions is not None else f"targets of the drives, in {unit}"
    numbers = tuple(map(float, values))
    yield Hole("commands_of_joints", numbers, command, text, why, "--positions")


def gripper(task: Task) -> Iterator[Hole]:
    """Yield the fingers, the link that carries them, and how far and fast they move."""
    robot, stage, options = robot_of_task(task), task.stage, task.options
    path = options.gripper
    if path is not None:
        present_prim(path, stage, "--gripper")
    names = options.joints
    if names is not None:
        joints, source = choose_joints(robot, names), "given"
    else:
        joints = _finger_joints(robot, path, stage)
        source = "prismatic joints that end the arm" if path is None else f"fingers of {path}"
        if not joints:
            raise UsageError(
                f"{robot.path} has no prismatic joints at the end of an arm: give --joints"
            )
    if path is None:
        holders = list(dict.fromkeys(joint.near for joint in joints))
        if len(holders) != 1:
            raise AmbiguousError("gripper", holders, "--gripper")
        path = holders[0]
    why = "given" if options.gripper else "carries the fingers"
    yield Hole("gripper", path, "gripper", path, why, "--gripper")
    shown = ", ".join(joint.name for joint in joints)
    yield Hole("joint_names", tuple(j.name for j in joints), "joints", shown, source, "--joints")
    limits = {(joint.low, joint.high) for joint in joints}
    low, high = next(iter(limits)) if len(limits) == 1 else (math.nan, math.nan)
    lacking = []
    for name, value, limit in (("open", options.open, high), ("close", options.close, low)):
        if value is not None:
            yield Hole(name, (float(value),), name, f"{value:g}", "given", f"--{name}")
        elif math.isfinite(limit):
            place = math.radians(limit) if joints[0].is_angular else limit
            yield Hole(name, (place,), name, f"{place:g}", "limit of the joints", f"--{name}")
        else:
            lacking.append(f"--{name}")
    asked = [f"{' and '.join(lacking)} (the fingers have no common limits)"] if lacking else []
    speed = options.speed
    if speed is None:
        asked.append("--speed (how far the fingers move in a frame)")
    if asked or speed is None:
        raise UsageError(f"give {', '.join(asked)}")
    yield Hole("speed", (float(speed),), "speed", f"{speed:g}", "given", "--speed")
    yield Hole("keyboard", bool(options.keyboard))


def _finger_joints(robot: Robot, gripper: str | None, stage: StageModel) -> list[RobotJoint]:
    near = {joint.near for joint in robot.joints}
    fingers = [j for j in robot.joints if not j.is_angular and j.link not in near and j.has_drive]
    if gripper is None:
        return fingers
    carrier = joined_bodies(stage).carrier(gripper)
    own = [joint for joint in fingers if joint.near == carrier]
    below = [joint for joint in fingers if is_at_or_below(joint.link, gripper)]
    return own or below
