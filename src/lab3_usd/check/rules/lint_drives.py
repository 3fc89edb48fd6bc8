"""Rules about the drives of joints: whether a joint follows what it is commanded."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import (
    EFFORT,
    POSITION,
    Command,
    commands,
    controller_of,
    drive_of,
    reached_joints,
    told_joints,
    wired_commands,
)
from lab3_usd.model.finding import Problem
from lab3_usd.model.joint_drives import DRIVEN_AXES, hindrance
from lab3_usd.model.physics import number
from lab3_usd.model.prims import Prim

_VELOCITY = "inputs:velocityCommand"


@rule("K62", "drive-ignores-velocity", scope="lint")
def drive_ignores_velocity(subject: LintSubject) -> Iterator[Problem]:
    """The drive of a joint ignores its velocity commands.

    Why: a drive without damping exerts no force towards a velocity. A drive with stiffness pulls
    the joint back to a position: the wheel trembles or stands still. A drive with a maximum force
    of 0 has no effect.

    Fix: in the drive of the joint, set stiffness to 0, and damping and maximum force above 0.

    Example: an importer left `stiffness = 10000` on the wheel joints.
    """
    judged: set[str] = set()
    for command in commands(subject.stage, subject.platform):
        given = wired_commands(command)
        if given != [_VELOCITY] or not command.roots:
            continue
        for joint in told_joints(command, _VELOCITY, subject.stage, subject.platform):
            if joint.path not in judged:
                judged |= set() if command.unknown else {joint.path}
                yield from _drive_problems(command, joint)


def _drive_problems(command: Command, joint: Prim) -> Iterator[Problem]:
    wrong = _wrong_value(joint, drive_of(joint))
    if wrong is not None:
        message = f"{wrong[0]}, but {command.node.path} commands a velocity"
        yield Problem(
            joint.path, message, *wrong[1:], related=(command.node.path,), rests_on=command.unknown
        )


def _wrong_value(joint: Prim, drive: str | None) -> tuple[str, str | None, str, str | None] | None:
    """Return why a joint ignores a velocity: the property, what it should be, and what it is."""
    names = [f"{drive}{word}" for word in ("damping", "stiffness", "maxForce")]
    damping, stiffness, force = (number(joint.attributes.get(name)) for name in names)
    if drive is None:
        return "has no drive", None, "damping above 0", None
    if damping is None or damping <= 0.0:
        return "has a drive without damping", names[0], "damping above 0", None
    if stiffness is not None and stiffness > 0.0:
        return f"has a drive with stiffness {stiffness:g}", names[1], "0", f"{stiffness:g}"
    if force is not None and force <= 0.0:
        return "has a drive without force", names[2], "above 0", f"{force:g}"
    return None


@rule("K86", "joint-cannot-follow", scope="lint")
def joint_cannot_follow(subject: LintSubject) -> Iterator[Problem]:
    """A joint cannot follow commands to a position, or an effort.

    Why: a drive without stiffness exerts no force towards a position, one without force none at
    all, and a joint has no use for a drive of the other kind (angular, linear). A joint whose
    limits are equal stands still. One that is switched off or excluded from the articulation is
    unknown to the controller, which then moves no joint of the command. If the names of the joints
    come with the messages, so that this one may not be commanded, it is a warning.

    Fix: give the joint a drive of its kind with stiffness and maximum force above 0, and limits
    between which it moves.

    Example: `stiffness = 0` on one of the six joints of an arm.
    """
    judged: set[str] = set()
    for command in commands(subject.stage, subject.platform):
        given = wired_commands(command)
        port = next((port for port in (POSITION, EFFORT) if port in given), None)
        if port is None or not command.roots:
            continue
        if controller_of(command, subject.stage, subject.platform) is not None:
            continue  # speeds of wheels, which are no positions: another rule speaks of that
        if command.names:
            joints = told_joints(command, port, subject.stage, subject.platform)
        else:
            joints = reached_joints(command, subject.stage, subject.platform)
        if port == POSITION and _VELOCITY in given and not any(map(_has_spring, joints)):
            continue  # moved by the speeds that come as well
        for joint in joints:
            why = (
                hindrance(joint.type, joint.apis, joint.attributes, by_drive=port == POSITION)
                if joint.type in DRIVEN_AXES and joint.path not in judged
                else None
            )
            if why is not None:
                judged |= set() if command.unknown else {joint.path}
                what = "a position" if port == POSITION else "an effort"
                yield Problem(
                    joint.path,
                    f"{why.text}, but {command.node.path} commands {what}",
                    property=why.property,
                    expected=why.expected,
                    actual=why.actual,
                    related=(command.node.path,),
                    severity=None if command.names else "warning",
                    rests_on=command.unknown,
                )


def _has_spring(joint: Prim) -> bool:
    return (number(joint.attributes.get(f"{drive_of(joint) or ''}stiffness")) or 0.0) > 0.0
