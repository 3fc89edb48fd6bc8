"""Rules about the joints of a robot that turn no wheels, as those of an arm."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.check.repairs import restorable
from lab3_usd.check.robot.poses import Units, units_of
from lab3_usd.check.robot.wheels import find_joint, has_no_joints, link_of, unknown_joints
from lab3_usd.facts.quantities import wheel_commands
from lab3_usd.isaac.values import same_numbers
from lab3_usd.model.changes import ApplySchema, ClearValue, Restore
from lab3_usd.model.finding import Problem
from lab3_usd.model.joint_drives import (
    DRIVE,
    DRIVEN_AXES,
    Drive,
    JointFault,
    left_out,
    number_text,
    read_drive,
)
from lab3_usd.model.physics import (
    AXIS,
    BODIES,
    FAR,
    LIMITS,
    USUAL_AXIS,
    bodies,
    joint_limits,
    number,
)
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import absence_reason
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import JointSpec, RobotSpec

_WORLD = "the world"


def _joints(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    del checkpoint
    for robot in lab.scene.robots:
        for name, joint in robot.joints.items():
            first, second = (link or _WORLD for link in joint.links)
            titles = {"joint": f"{name} connects {second} to {first}"}
            if joint.limits is not None:
                titles["limits"] = f"{name} moves from {joint.limits[0]:g} to {joint.limits[1]:g}"
            if joint.drive:
                values = ", ".join(f"{key} {value:g}" for key, value in joint.drive.items())
                titles["drive"] = f"the drive of {name} has {values}"
            for part, title in titles.items():
                place = f"{robot.path}/{name}"
                yield Demand(f"{robot.group}/{part}/{name}", title, place, joint.handout)


@rule("S26", "described-joint", scope="robot", demands=_joints, needs="described joints")
def described_joint(subject: RobotSubject) -> Iterator[Problem]:
    """A joint is missing or differs from the lab's.

    Why: commands go to joints by their names, and messages of their states name them. A joint with
    other limits stops elsewhere, one with a weaker drive sags, and one with a stiffer drive swings.
    One that should turn on and on stops at any limit.

    Fix: undo the change of the joint, or start again from the supplied file. Limits and drive are
    in the Property panel under Physics.

    Example: `physics:upperLimit` 90 where the lab has 160.
    """
    if has_no_joints(subject):
        message = "the robot has no joints"
        if subject.robot.joints and not subject.robot.wheels.joints:
            names = tuple(subject.robot.joints)
            yield _absent(subject, names, subject.robot.path, message)
        return
    robot = subject.robot
    for name, spec in robot.joints.items():
        prim = find_joint(subject.stage, robot.path, name)
        if prim is None or not prim.present:
            # A joint is missing beside the first one that is there, else below the robot.
            joints = (find_joint(subject.stage, robot.path, joint) for joint in robot.joints)
            home = next((joint.parent for joint in joints if joint is not None), robot.path)
            place = f"{home}/{name}" if prim is None else prim.path
            reason = absence_reason(subject.stage, place)
            yield _absent(subject, (name,), place, f"{name} {reason}")
        else:
            yield from _wrong_values(prim, name, spec, subject)
    if not robot.wheels.joints:  # of which other rules speak
        yield from _limited_wheels(subject)


def _limited_wheels(subject: RobotSubject) -> Iterator[Problem]:
    """Yield the joints of wheels that limits stop, where the lab says nothing of limits."""
    robot, stage = subject.robot, subject.stage
    driven = {
        joint.path: (command.node.path, joint)
        for command, wheels in wheel_commands(stage)
        for joint in wheels
        if subject.lab.scene.robot_of(joint.path) is robot
    }
    for path, (node, joint) in driven.items():
        spec = robot.joints.get(joint.name)
        low, high = joint_limits(joint.attributes)
        if (spec is None or spec.limits is None) and (low > -FAR or high < FAR):
            yield Problem(
                path,
                f"turns between {low:g} and {high:g} degrees only, but {node} drives it as a wheel",
                LIMITS[0] if low > -FAR else LIMITS[1],
                expected="no limits",
                actual=f"{low:g} to {high:g}",
                handout=robot.handout if spec is None else spec.handout,
                hint=f"clear Lower Limit and Upper Limit of {path}",
                related=(node,),
                fix=tuple(ClearValue(path, name) for name in LIMITS),
                unmet=() if spec is None else (f"{robot.group}/joint/{joint.name}",),
                rests_on=stage.unknown(path),
            )


def _absent(subject: RobotSubject, names: tuple[str, ...], place: str, message: str) -> Problem:
    robot = subject.robot
    parts = ("joint", "limits", "drive")
    return Problem(
        place,
        message,
        expected=", ".join(f"{robot.joints[name].type} {name}" for name in names),
        handout=robot.joints[names[0]].handout,
        fix=(Restore(place),),
        unmet=tuple(f"{robot.group}/{part}/{name}" for name in names for part in parts),
        rests_on=unknown_joints(subject),
    )


def _wrong_values(
    prim: Prim, name: str, spec: JointSpec, subject: RobotSubject
) -> Iterator[Problem]:
    """Yield each value of a joint that is not as described."""
    stage, group = subject.stage, subject.robot.group
    for part, fault in (
        *(("joint", fault) for fault in _ties(prim, name, spec, subject.robot)),
        *(("limits", fault) for fault in _limits(prim, name, spec, subject)),
        *(("drive", fault) for fault in _drive(prim, name, spec, subject)),
    ):
        key, has_no_drive = fault.property, fault.expected == _api(spec)
        fix = (ApplySchema(prim.path, _api(spec)),) if has_no_drive else ()
        problem = Problem(prim.path, fault.text, key, fault.expected, fault.actual, fix=fix)
        asset = stage.unknown_value(prim, key) if key else stage.unknown(prim.path)
        yield restorable(problem, spec.handout, f"{group}/{part}/{name}", rests_on=asset)


def _ties(prim: Prim, name: str, spec: JointSpec, robot: RobotSpec) -> Iterator[JointFault]:
    """Yield what is wrong with the kind of a joint, and with what it ties."""
    if prim.type != spec.type:
        text = f"{name} is a {prim.type or 'prim without a type'}, expected {spec.type}"
        yield JointFault(text, None, spec.type, prim.type)
        return
    for off in left_out(prim.attributes):
        yield replace(off, text=f"{name} {off.text}")
    wheels = [robot.path_of(wheel) for wheel in robot.wheels.joints.values()]
    for key, end, link in zip(BODIES, bodies(prim), spec.links, strict=True):
        asked, tied = robot.path_of(link) if link else "", link_of(end, robot)
        # Rules about wheels speak of a wheel, and of what is no part of a robot with wheels.
        is_of_wheels = wheels and (tied in wheels or not is_at_or_below(end, robot.path))
        if tied != asked and not is_of_wheels:
            text = f"{name} connects {end or _WORLD}, expected {asked or _WORLD}"
            yield JointFault(text, key, asked or _WORLD, end or _WORLD)
    axis = prim.attributes.get(AXIS, USUAL_AXIS)
    if spec.axis and axis != spec.axis:
        text = f"{name} moves along {axis}, expected {spec.axis}"
        if prim.type not in DRIVEN_AXES or DRIVEN_AXES[prim.type] == "angular":
            text = f"{name} turns about {axis}, expected {spec.axis}"
        yield JointFault(text, AXIS, spec.axis, str(axis))


def _limits(prim: Prim, name: str, spec: JointSpec, subject: RobotSubject) -> Iterator[JointFault]:
    is_angle = DRIVEN_AXES.get(spec.type) != "linear"
    units = Units() if is_angle else units_of(subject.lab.scene, subject.stage)
    for key, word, limit in zip(LIMITS, ("lower", "upper"), spec.limits or (), strict=False):
        actual, wanted = number(prim.attributes.get(key)), limit / units.expected
        is_free = actual is None and math.isinf(wanted)  # USD's own values
        readings = (wanted, limit / (units.actual or 1.0))
        if not (is_free or any(_same(actual, reading, subject) for reading in readings)):
            shown = "not set" if actual is None else f"{actual:g}"
            text = f"the {word} limit of {name} is {shown}, expected {wanted:g}"
            yield JointFault(text, key, f"{wanted:g}", shown)


_WORDS = {"stiffness": "stiffness", "damping": "damping", "maxForce": "largest force"}


def _api(spec: JointSpec) -> str:
    """Return the schema of a joint's drive, '' for a joint that has several or none."""
    kind = DRIVEN_AXES.get(spec.type)
    return "" if kind is None else f"{DRIVE}:{kind}"


def _drive(prim: Prim, name: str, spec: JointSpec, subject: RobotSubject) -> Iterator[JointFault]:
    if prim.type not in DRIVEN_AXES or not spec.drive:
        return
    drive = read_drive(prim.type, prim.apis, prim.attributes)
    if not drive.api:
        yield JointFault(f"{name} has no drive", None, _api(spec), "none")
        return
    values = {"stiffness": drive.stiffness, "damping": drive.damping, "maxForce": drive.force}
    for word, wanted in spec.drive.items():
        if not _same(values[word], wanted, subject):
            yield drive_fault(name, drive, word, values[word], f"{wanted:g}")


def drive_fault(
    joint: str, drive: Drive, word: str, value: float | None, expected: str
) -> JointFault:
    """Return that a value of the drive of a joint is another one than expected."""
    text = f"the {_WORDS[word]} of {joint} is {number_text(value)}, expected {expected}"
    return JointFault(text, f"{drive.start}{word}", expected, number_text(value))


def _same(actual: float | None, wanted: float, subject: RobotSubject) -> bool:
    margin = subject.lab.scene.tolerance.margin("joint")
    return actual is not None and same_numbers([actual], [wanted], margin)
