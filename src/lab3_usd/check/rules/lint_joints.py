"""Rules about the joints that controllers pick: names, numbers, commands, and their drives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import get_args

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.arrays import array_items, list_at
from lab3_usd.facts.articulations import (
    Command,
    commands,
    controller_of,
    cut_off,
    gains_of,
    has_joint,
    is_loose,
    joints_commanded,
    joints_of,
    number_of_axes,
    number_of_commands,
    reached_joints,
    unused_indices,
    wired_commands,
)
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.facts.wires import Connection, connections
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.pure_nodes import last_part
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.model.changes import Edit, SetValue
from lab3_usd.model.finding import Place, Problem, display
from lab3_usd.model.joint_drives import (
    DRIVEN_AXES,
    JointCommand,
    hindrance,
    moving_command,
    of_drive,
)
from lab3_usd.model.physics import BODIES, bodies, ends, joints_at
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset


@rule("K61", "unknown-joint")
def unknown_joint(subject: LintSubject) -> Iterator[Problem]:
    """A controller names a joint that its robot does not have.

    Why: the controller logs an error at every update, and moves none of its joints. A joint between
    missing bodies, or of something else, does not belong to the robot. An articulation ends at a
    joint that is excluded from it, a fixed one too: what lies behind has no axes.

    Fix: use the name of the joint's prim in the Stage panel; for a joint with several axes, append
    the number of the axis, as in `hip:0`. Let Body 0 and Body 1 of the joint be links of the robot.

    Example: `left_wheel` instead of `left_wheel_joint`.
    """
    for command in commands(subject.stage):
        joints = joints_of(command, subject.stage)
        for name in command.names or () if command.roots else ():
            overrides = [joint.attributes.get("isaac:nameOverride") for joint in joints.values()]
            if name and not has_joint(joints, name) and name not in overrides:
                yield Problem(
                    command.node.path,
                    f"the robot has no joint '{name}'{did_you_mean(likely_name(name, joints))}",
                    property=command.ports.joints,
                    expected=likely_name(name, joints) or ", ".join(sorted(joints)),
                    actual=name,
                    related=(command.robot,),
                    fix=_without_space(command, name, subject) if name.strip() in joints else (),
                    rests_on=command.unknown
                    or _unknown_joint(name, command, joints, subject.stage),
                    assumes=((command.node.path, command.port),),
                )
            elif name in joints and is_loose(joints[name], command, subject.stage):
                joint = joints[name]
                # A missing asset may tie the bodies of the joint to the robot; below a prim it ties
                # nothing beside it: USD drops targets outside of what is referred to.
                tied = (
                    body for other in joints_at(ends(joint), subject.stage) for body in ends(other)
                )
                yield Problem(
                    command.node.path,
                    f"{joint.path} connects no link of the robot: {_ends_of(joint, subject.stage)}",
                    property=command.ports.joints,
                    related=(joint.path,),
                    rests_on=subject.stage.unknown(joint.path, *tied),
                    assumes=((command.node.path, command.port),),
                )
        yield from _cut_off(command, subject.stage)
        yield from _joint_numbers(command, subject)


def _cut_off(command: Command, stage: StageModel) -> Iterator[Problem]:
    """Yield the excluded joints behind which a robot has joints that a controller names."""
    joints, behind = joints_of(command, stage), cut_off(stage)
    names = command.names or () if command.roots else ()
    lost = [joints[name] for name in names if name in joints and joints[name].path in behind]
    for joint in {behind[joint.path].path: behind[joint.path] for joint in lost}.values():
        named = ", ".join(each.name for each in lost if behind[each.path] is joint)
        yield Problem(
            command.node.path,
            f"the articulation lacks {named}: {joint.path} is excluded, and leads there",
            property=command.ports.joints,
            related=(joint.path,),
            rests_on=stage.unknown(joint.path),
            assumes=((command.node.path, command.port),),
        )


def _ends_of(joint: Prim, stage: StageModel) -> str:
    """Say what the bodies of a joint are."""
    words = []
    for name, path in zip(BODIES, bodies(joint), strict=True):
        is_there = stage.prim(path) is not None
        named = f"is {path}" if is_there else f"names {path}, which is missing"
        words.append(f"{name} {named if path else 'names nothing'}")
    return ", ".join(words)


def _joint_numbers(command: Command, subject: LintSubject) -> Iterator[Problem]:
    """Yield that a controller picks a joint by a number that its robot does not have."""
    stage, port = subject.stage, command.ports.indices
    numbers = () if command.names else list_at(command.node, port, subject.live) or ()
    count = number_of_axes(command, stage) if numbers else None
    if count is None:
        return
    beyond = [each for each in numbers if isinstance(each, int) and not 0 <= each < count]
    if beyond:
        yield Problem(
            command.node.path,
            f"{port} has {beyond[0]}, and the robot has the joints 0 to {count - 1}",
            property=port,
            actual=display(numbers),
            rests_on=command.unknown,
            assumes=((command.node.path, command.port),),
        )


def _without_space(command: Command, name: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return what takes the white space around a joint's name away, where it is written."""
    ports, written = command.ports, command.names or ()
    if not command.node.sources(ports.joints):
        stripped = tuple(joint.strip() for joint in written)
        return (SetValue(command.node.path, ports.joints, "token[]", stripped),)
    return tuple(
        SetValue(constant.path, port, "token", name.strip())
        for maker, _ in live_sources(command.node, ports.joints, subject.live)
        for item in maker.ports
        for constant, port in live_sources(maker, item, subject.live)
        if constant.value(port) == name
    )


def _unknown_joint(
    name: str, command: Command, joints: Mapping[str, Prim], stage: StageModel
) -> UnresolvedAsset | None:
    """Return the missing asset that could hold a joint, at a prim of its name or beside others.

    Where the robot has none at all, any asset around it could hold them.
    """
    places = [prim.path for prim in stage.named(name)]
    asset = stage.unknown(*places, *(f"{joint.parent}/{name}" for joint in joints.values()))
    if asset is None and not joints:
        around = (root.rpartition("/")[0] or root for root in command.roots)
        asset = next(filter(None, map(stage.unknown_below, around)), None)
    return asset


@rule("K68", "command-count", formerly="number-of-commands")
def command_count(subject: LintSubject) -> Iterator[Problem]:
    """A controller receives more or fewer commands than joints.

    Why: the controller requires one command for each joint that is named or given by number, or one
    for each joint of the robot if none is. Otherwise it logs an error at every update, and moves
    nothing.

    Fix: name as many joints as there are commands, in the same order, or correct the commands.

    Example: `jointNames = ["left_wheel"]`, and a Differential Controller gives two speeds.
    """
    for command in commands(subject.stage):
        facts = subject.platform.joints.get(command.node.type_name)
        may_spread = facts is not None and is_release_within(
            subject.platform.release, "", facts.spreads_until
        )
        # Without a name all joints are meant.
        is_for_all = command.names == () and facts is not None and not may_spread
        axes = number_of_axes(command, subject.stage) if is_for_all else None
        joints = axes or 0 if is_for_all else len(command.names or ())
        listing = command.ports.joints
        if command.names is None:  # given by number
            numbers = list_at(command.node, command.ports.indices, subject.live)
            joints, listing = len(numbers or ()), command.ports.indices
        for port in command.ports.commands if joints else ():
            given = number_of_commands(command, port, subject.stage)
            is_right = not given or given == joints or (given == 1 and (may_spread or is_for_all))
            if not is_right:
                named = f"{port} and {listing} differ in length: {given} and {joints}"
                whole = f"{port} has {given} values, and the robot {joints} joints: none moves"
                yield Problem(
                    command.node.path,
                    whole if is_for_all else named,
                    property=port,
                    expected=str(joints),
                    actual=str(given),
                    related=(command.robot,) if is_for_all else (),
                    # More joints than those that are there could only ask for more commands.
                    rests_on=(command.unknown if is_for_all and (given or 0) > joints else None)
                    or subject.stage.unknown_inputs(command.node),
                    assumes=tuple(_sizes_and_gaps(command, subject)),
                )


def _sizes_and_gaps(command: Command, subject: LintSubject) -> Iterator[Place]:
    """Yield the sizes of the arrays that come in, and their elements without a value."""
    for port in (command.ports.joints, *command.ports.commands):
        for maker, _ in live_sources(command.node, port, subject.live):
            items = array_items(maker)
            for element in () if items is None else (items.count_port, *items.empty):
                yield maker.path, element


@rule("K69", "ignored-indices", severity="warning")
def ignored_indices(subject: LintSubject) -> Iterator[Problem]:
    """The joint indices of a controller are all 0.

    Why: Isaac Sim before 6.2 treats a list of zeros as no list: the command goes to all joints of
    the robot, not only to the first.

    Fix: name the joint in Joint Names.

    Example: `inputs:jointIndices = [0]` for the first joint of an arm.
    """
    for command in commands(subject.stage):
        indices = unused_indices(command.node, command.ports, subject.stage)
        joints = joints_of(command, subject.stage) if command.roots else {}
        if indices and not command.names and len(joints) != 1:
            yield Problem(
                command.node.path,
                f"{command.ports.indices} is {display(indices)}; zeros are ignored: all move",
                property=command.ports.indices,
                expected=f"a name in {command.ports.joints}",
                actual=display(indices),
                rests_on=None if joints else command.unknown,
            )


_PORTS: Mapping[JointCommand, str] = {
    kind: f"{INPUT}{kind}Command" for kind in get_args(JointCommand)
}
_KINDS = {port: kind for kind, port in _PORTS.items()}


@rule("K95", "one-command-for-all")
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
    is_one = node.type is not None and last_part(node.type_name) == "ArrayIndex"
    return f"{INPUT}index" if is_one else ""


@rule("K62", "drive-ignores-velocity")
def drive_ignores_velocity(subject: LintSubject) -> Iterator[Problem]:
    """The drive of a joint ignores its velocity commands.

    Why: a drive without damping exerts no force towards a velocity. A drive with stiffness pulls
    the joint back to a position: the wheel trembles or stops. A drive with a maximum force of 0 has
    no effect. If the names of the joints come with the messages, so that this one may not be
    commanded, it is a warning.

    Fix: in the drive of the joint, set stiffness to 0, and damping and maximum force above 0.

    Example: an importer left `stiffness = 10000` on the wheel joints.
    """
    yield from _not_following(commands(subject.stage), ("velocity",), subject)


def _not_following(
    given: Iterable[Command], kinds: tuple[JointCommand, ...], subject: LintSubject
) -> Iterator[Problem]:
    """Yield the joints that do not follow commands of some kinds, each once.

    Where messages name the joints, one may not be commanded: a warning.
    """
    judged: set[str] = set()
    for command, kind in product(given, kinds):
        # What else keeps a wheel from its speed, K82 says.
        judge = of_drive if kind == "velocity" else hindrance
        for joint in _joints_moved_by(kind, command, subject):
            why = judge(joint.type, joint.apis, joint.attributes, kind)
            if why is None or joint.path in judged:
                continue
            # A missing asset could set the value, or hold the robot whose joints nobody names.
            own = () if not why.property or why.property in joint.attributes else (joint.path,)
            asset = subject.stage.unknown(*own, *(() if command.names else command.roots))
            judged |= set() if asset else {joint.path}
            article = "an" if kind == "effort" else "a"
            yield Problem(
                joint.path,
                f"{why.text}, but {command.node.path} commands {article} {kind}",
                property=why.property,
                expected=why.expected,
                actual=why.actual,
                related=(command.node.path,),
                severity=None if _has_known_joints(kind, command) else "warning",
                rests_on=asset,
            )


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


@rule("K86", "joint-cannot-follow")
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
    every = commands(subject.stage)
    # Controllers of wheels give speeds, which are no positions.
    others = (command for command in every if controller_of(command, subject.stage) is None)
    yield from _not_following(others, ("position", "effort"), subject)
