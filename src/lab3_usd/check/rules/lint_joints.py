"""Rules about the joints that controllers pick: their names, numbers and commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.arrays import array_items, list_at
from lab3_usd.facts.articulations import (
    Command,
    commands,
    cut_off,
    has_joint,
    is_loose,
    joints_of,
    number_of_axes,
    number_of_commands,
    unused_indices,
)
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.facts.reaching_values import live_sources
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.model.changes import Edit, SetValue
from lab3_usd.model.finding import Place, Problem, display
from lab3_usd.model.physics import BODIES, bodies, ends, joints_at
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel, UnresolvedAsset


@rule("K61", "unknown-joint", scope="lint")
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
    ends = zip(BODIES, bodies(joint), strict=True)
    return ", ".join(
        f"{name} {'is ' + path if stage.prim(path) else f'names {path}, which is missing'}"
        if path
        else f"{name} names nothing"
        for name, path in ends
    )


def _joint_numbers(command: Command, subject: LintSubject) -> Iterator[Problem]:
    """Yield that a controller picks a joint by a number that its robot does not have."""
    stage, port = subject.stage, command.ports.indices
    numbers = list_at(command.node, port, subject.live) if not command.names else None
    count = number_of_axes(command, stage) if numbers else None
    beyond = [each for each in numbers or () if isinstance(each, int) and count is not None]
    beyond = [each for each in beyond if not 0 <= each < (count or 0)]
    if beyond:
        yield Problem(
            command.node.path,
            f"{port} has {beyond[0]}, and the robot has the joints 0 to {(count or 0) - 1}",
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


@rule("K68", "command-count", scope="lint", formerly="number-of-commands")
def command_count(subject: LintSubject) -> Iterator[Problem]:
    """A controller receives more or fewer commands than joints.

    Why: the controller requires one command for each joint that is named or given by number, or one
    for each joint of the robot if none is. Otherwise it logs an error at every update, and moves
    nothing.

    Fix: name as many joints as there are commands, in the same order, or correct the commands.

    Example: `jointNames = ["left_wheel"]`, and a Differential Controller gives two speeds.
    """
    for command in commands(subject.stage):
        facts = subject.platform.joints.get(command.node.type.type if command.node.type else "")
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


@rule("K69", "ignored-indices", scope="lint", severity="warning")
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
