"""Rules about robots: articulations, joints and drives."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.lint.bodies import Followed, followed_bodies
from lab3_usd.check.lint.names import did_you_mean, likely_name
from lab3_usd.check.lint.needs import array_items
from lab3_usd.check.lint.robots import (
    AXES,
    Command,
    commands,
    joints_of,
    number_of_commands,
    told_joints,
    wired_commands,
)
from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import live_sources
from lab3_usd.model.finding import Problem
from lab3_usd.model.physics import number
from lab3_usd.model.prims import Prim
from lab3_usd.spec.isaac import NEWEST

_VELOCITY = "inputs:velocityCommand"
_DRIVE = "PhysicsDriveAPI"


@rule("K60", "no-articulation", scope="lint")
def no_articulation(subject: LintSubject) -> Iterator[Problem]:
    """The robot that a controller should move has no articulation at or below its prim.

    Why: the controller looks for the articulation root at its target and below, never above. Where
    none is found, it logs an error and nothing moves.

    Fix: choose the prim that carries the articulation root, or one above it.

    Example: `inputs:targetPrim` names `/World/robot/base_link`, the root is on `/World/robot`.
    """
    for command in commands(subject):
        is_there = subject.stage.prim(command.robot) is not None
        is_by_path = command.port == command.ports.path
        if command.is_open or command.roots or not (is_there or is_by_path):
            continue  # of a target that is not there another rule speaks
        what = "no articulation root is there or below" if is_there else "there is no such prim"
        yield Problem(
            command.node.path,
            f"{command.port} is {command.robot}, and {what}",
            property=command.port,
            expected="a prim with an articulation root",
            actual=command.robot,
        )


@rule("K61", "unknown-joint", scope="lint")
def unknown_joint(subject: LintSubject) -> Iterator[Problem]:
    """A controller names a joint that the robot does not have.

    Why: the controller logs an error for each frame, and moves none of its joints.

    Fix: write the name of the joint's prim, as the Stage panel shows it.

    Example: `left_wheel` instead of `left_wheel_joint`.
    """
    for command in commands(subject):
        known = joints_of(command, subject.stage) if command.roots else {}
        if command.is_open or not known:
            continue
        for name in command.names or ():
            if name and name not in known and not _is_renamed(name, known):
                yield Problem(
                    command.node.path,
                    f"the robot has no joint '{name}'{did_you_mean(likely_name(name, known))}",
                    property=command.ports.joints,
                    expected=likely_name(name, known) or ", ".join(sorted(known)),
                    actual=name,
                    related=(command.robot,),
                )


def _is_renamed(name: str, known: dict[str, Prim]) -> bool:
    """Whether a joint goes by another name than that of its prim."""
    return any(joint.attributes.get("isaac:nameOverride") == name for joint in known.values())


@rule("K62", "drive-ignores-velocity", scope="lint")
def drive_ignores_velocity(subject: LintSubject) -> Iterator[Problem]:
    """A joint is told a velocity, and its drive does not follow.

    Why: a drive without damping exerts no force towards a velocity. One with stiffness pulls back
    to a position: the wheel trembles, or stands still. With a largest force of 0 it is not driven.

    Fix: set stiffness to 0, and damping and the largest force above 0, in the joint's drive.

    Example: an importer left `stiffness = 10000` on the wheel joints.
    """
    told: set[str] = set()
    for command in commands(subject):
        given = wired_commands(command)
        if command.is_open or given != [_VELOCITY] or not command.roots:
            continue
        for joint in told_joints(command, _VELOCITY, subject):
            if joint.path not in told:
                told.add(joint.path)
                yield from _drive_problems(command, joint)


def _drive_problems(command: Command, joint: Prim) -> Iterator[Problem]:
    drives = [api for api in joint.apis if api.startswith(f"{_DRIVE}:{AXES.get(joint.type, '')}")]
    kind = next(iter(drives), "")
    wrong = _wrong_value(joint, f"drive:{kind.partition(':')[2]}:physics:", is_driven=bool(kind))
    if wrong is not None:
        message = f"{wrong[0]}, and {command.node.path} tells it a velocity"
        yield Problem(joint.path, message, *wrong[1:], related=(command.node.path,))


def _wrong_value(
    joint: Prim, drive: str, *, is_driven: bool
) -> tuple[str, str | None, str, str | None] | None:
    """Return why a joint ignores a velocity: the property, what it should be, and what it is."""
    names = [f"{drive}{word}" for word in ("damping", "stiffness", "maxForce")]
    damping, stiffness, force = (number(joint.attributes.get(name)) for name in names)
    if not is_driven:
        return "has no drive", None, "damping above 0", None
    if damping is None or damping <= 0.0:
        return "has a drive without damping", names[0], "damping above 0", None
    if stiffness is not None and stiffness > 0.0:
        return f"has a drive of stiffness {stiffness:g}", names[1], "0", f"{stiffness:g}"
    if force is not None and force <= 0.0:
        return "has a drive without force", names[2], "above 0", f"{force:g}"
    return None


@rule("K67", "no-body-to-follow", scope="lint")
def no_body_to_follow(subject: LintSubject) -> Iterator[Problem]:
    """The prim that an odometry follows is no rigid body and no articulation root.

    Why: the node logs an error at every update and passes no signal on. Its outputs stay 0: the
    odometry says that the robot stands where it started.

    Fix: choose the robot's base link, a prim with a rigid body, or the one with the articulation
    root. Of a prim with the robot schema the first link that it lists counts.

    Example: `inputs:chassisPrim` names `/World/robot`, an Xform above the links.
    """
    for found in followed_bodies(subject):
        if not found.is_body:
            yield Problem(
                found.node.path,
                f"{found.port} is {found.prim.path}, {_why_no_body(found)}",
                property=found.port,
                expected="a rigid body or an articulation root",
                actual=found.prim.path,
            )


def _why_no_body(found: Followed) -> str:
    if found.body is None:
        return f"a robot that lists no link in {found.asked.links}"
    what = "is no rigid body and no articulation root"
    is_other = found.body.path != found.prim.path
    return f"and its first link {found.body.path} {what}" if is_other else f"which {what}"


@rule("K68", "number-of-commands", scope="lint")
def number_of_commands_differs(subject: LintSubject) -> Iterator[Problem]:
    """A controller gets more or fewer commands than it names joints.

    Why: the controller asks for one command for each joint. Otherwise it logs an error at every
    update, leaves out all of its commands, and moves nothing.

    Fix: name as many joints as there are commands, in the same order, or correct the commands.

    Example: `jointNames = ["left_wheel"]`, and a Differential Controller gives two speeds.
    """
    may_spread = subject.release != NEWEST  # before, a single command counts for all joints
    for command in commands(subject):
        if not command.names or subject.is_open(command.node.path):
            continue
        for port in command.ports.commands:
            given, named = number_of_commands(command, port, subject), len(command.names)
            is_right = not given or given == named or (may_spread and given == 1)
            if not is_right and not _has_gaps(command, subject):
                yield Problem(
                    command.node.path,
                    f"{port} and {command.ports.joints} differ in length: {given} and {named}",
                    property=port,
                    expected=str(named),
                    actual=str(given),
                )


def _has_gaps(command: Command, subject: LintSubject) -> bool:
    """Whether an array that comes in is not as long as it looks: another rule speaks of it."""
    ports = (command.ports.joints, *command.ports.commands)
    made = (each for port in ports for each, _ in live_sources(command.node, port, subject.live))
    found = (array_items(node) for node in made)
    return any(items.beyond or items.empty for items in found if items is not None)
