"""Rules about the drives of joints: whether a joint follows what it is commanded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import get_args

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import (
    Command,
    commands,
    controller_of,
    gains_of,
    joints_commanded,
    reached_joints,
    wired_commands,
)
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.wires import Connection, connections
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.pure_nodes import last_part
from lab3_usd.model.finding import Problem
from lab3_usd.model.joint_drives import (
    DRIVEN_AXES,
    JointCommand,
    JointFault,
    hindrance,
    moving_command,
    of_drive,
)
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset

_PORTS: Mapping[JointCommand, str] = {
    kind: f"{INPUT}{kind}Command" for kind in get_args(JointCommand)
}
_KINDS = {port: kind for kind, port in _PORTS.items()}


@rule("K95", "one-command-for-all", scope="lint")
def one_command_for_all(subject: LintSubject) -> Iterator[Problem]:
    """Several joints get the same element of the commands for two wheels.

    Why: the commands are that of the left wheel and that of the right one. With one of them for
    both wheels the robot drives straight on and never turns.

    Fix: set the index of the node that picks the element: 0 for the left wheel, 1 for the right.

    Example: two Get Array Index nodes behind a Differential Controller, both with index 0.
    """
    by_source: dict[str, list[Connection]] = {}
    for wire in connections(subject.stage):
        by_source.setdefault(wire.source_prim, []).append(wire)
    for maker in subject.live.values():
        for out, size in maker.type.sizes.items() if maker.type is not None else ():
            wires = by_source.get(maker.path, ())
            taking = [wire.node for wire in wires if wire.path == f"{maker.path}.{out}"]
            elements: dict[str, int | None] = {}  # which each takes; None for all or unknown
            for node in taking:
                index = _index_port(node)
                value = effective_value(node, index, subject.live) if index else None
                elements[node.path] = value % size if isinstance(value, int) else None
            fed = [wire.node.path for path in elements for wire in by_source.get(path, ())]
            numbers = {*elements.values()}
            if size > 1 and len(fed) > 1 and len(numbers) == 1 and None not in numbers:
                first = taking[0]
                port = _index_port(first)
                yield Problem(
                    first.path,
                    f"{port} is {numbers.pop()}, as wherever an element of "
                    f"{maker.name}.{out} is taken: {len(fed)} inputs get the command of one wheel",
                    property=port,
                    expected="each wheel's own element",
                    related=(maker.path, *dict.fromkeys(fed)),
                )


def _index_port(node: Node) -> str:
    """Return the input that numbers the element which a node takes, '' for another node."""
    is_one = node.type is not None and last_part(node.type.type) == "ArrayIndex"
    return f"{INPUT}index" if is_one else ""


@rule("K62", "drive-ignores-velocity", scope="lint")
def drive_ignores_velocity(subject: LintSubject) -> Iterator[Problem]:
    """The drive of a joint ignores its velocity commands.

    Why: a drive without damping exerts no force towards a velocity. A drive with stiffness pulls
    the joint back to a position: the wheel trembles or stops. A drive with a maximum force of 0 has
    no effect. If the names of the joints come with the messages, so that this one may not be
    commanded, it is a warning.

    Fix: in the drive of the joint, set stiffness to 0, and damping and maximum force above 0.

    Example: an importer left `stiffness = 10000` on the wheel joints.
    """
    judged: set[str] = set()
    for command in commands(subject.stage):
        for joint in _joints_moved_by("velocity", command, subject):
            why = of_drive(joint.type, joint.apis, joint.attributes, "velocity")
            if why is not None and joint.path not in judged:
                asset = _unread(command, joint, why, subject.stage)
                judged |= set() if asset else {joint.path}
                yield _problem("velocity", command, joint, why, asset)


def _joints_moved_by(kind: JointCommand, command: Command, subject: LintSubject) -> Iterator[Prim]:
    """Yield the joints of one axis that a command moves by this kind of its inputs."""
    given = [_KINDS[port] for port in wired_commands(command)]
    if kind not in given or not command.roots:
        return
    stage = subject.stage
    if _has_known_joints(kind, command):
        joints = joints_commanded(command, _PORTS[kind], stage)
    else:
        joints = reached_joints(command, stage)
        if kind == "velocity" and moving_command(given, [*map(gains_of, joints)]) != "position":
            joints = reached_joints(command, stage, with_wheels=True)
    joints = [joint for joint in joints if joint.type in DRIVEN_AXES]
    if moving_command(given, [*map(gains_of, joints)]) == kind:
        yield from joints


def _has_known_joints(kind: JointCommand, command: Command) -> bool:
    """Whether a command names its joints, or gives speeds to all."""
    return bool(command.names) or (command.names == () and kind == "velocity")


def _unread(
    command: Command, joint: Prim, why: JointFault, stage: StageModel
) -> UnresolvedAsset | None:
    """Return the missing asset that could let a joint follow, or say that it is not commanded.

    That is one which could set the value, and where no names are known one that holds the robot.
    """
    own = () if not why.property or why.property in joint.attributes else (joint.path,)
    of_robot = () if command.names else command.roots
    return stage.unknown(*own, *of_robot)


def _problem(
    kind: JointCommand,
    command: Command,
    joint: Prim,
    why: JointFault,
    asset: UnresolvedAsset | None,
) -> Problem:
    """Return why a joint does not follow; where messages name the joints, it may not be told to."""
    article = "an" if kind == "effort" else "a"
    return Problem(
        joint.path,
        f"{why.text}, but {command.node.path} commands {article} {kind}",
        property=why.property,
        expected=why.expected,
        actual=why.actual,
        related=(command.node.path,),
        severity=None if _has_known_joints(kind, command) else "warning",
        rests_on=asset,
    )


@rule("K86", "joint-cannot-follow", scope="lint")
def joint_cannot_follow(subject: LintSubject) -> Iterator[Problem]:
    """A joint cannot follow commands to a position, or an effort.

    Why: a drive without stiffness exerts no force towards a position, one without force none at
    all, and one of the other kind (angular, linear) does not act. Equal limits hold a joint still.
    A joint that is switched off or excluded from the articulation is unknown to the controller,
    which then moves no joint of the command. If the messages bring the names of the joints, so that
    this one may not be commanded, it is a warning.

    Fix: give the joint a drive of its kind with stiffness and maximum force above 0, and limits
    between which it moves.

    Example: `stiffness = 0` on one of the six joints of an arm.
    """
    judged: set[str] = set()
    for command in commands(subject.stage):
        if controller_of(command, subject.stage) is not None:
            continue  # speeds of wheels, which are no positions
        kinds: tuple[JointCommand, ...] = ("position", "effort")
        for kind in kinds:
            for joint in _joints_moved_by(kind, command, subject):
                why = hindrance(joint.type, joint.apis, joint.attributes, kind)
                if why is not None and joint.path not in judged:
                    asset = _unread(command, joint, why, subject.stage)
                    judged |= set() if asset else {joint.path}
                    yield _problem(kind, command, joint, why, asset)
