"""The robots that nodes command: their articulations, joints, drives and wheels."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.ros.running import effective_value, live_sources
from lab3_usd.check.scene.wheel_commands import joint_names
from lab3_usd.check.tf.link_tree import articulation_links
from lab3_usd.model.absent_prims import is_subtree_unresolved
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import (
    BODIES,
    FIXED,
    JOINT_ENABLED,
    REVOLUTE,
    is_articulated,
    is_excluded,
    is_joint_type,
    is_switched_off,
)
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.spec.catalog import INPUT
from lab3_usd.spec.port_groups import DrivePorts

AXES = {REVOLUTE: "angular", "PhysicsPrismaticJoint": "linear"}  # others have several drives
_MIMIC = "Mimic"


class Command(Struct, frozen=True, eq=False):
    """A node that moves joints: its robot, and the joints that it names, None where unknown.

    `robot` is '' where the stage does not tell; `is_open` where an asset could hold the robot.
    """

    node: Node
    ports: DrivePorts
    port: str
    robot: str
    roots: tuple[str, ...]
    names: tuple[str, ...] | None
    is_open: bool


def commands(subject: LintSubject) -> Iterator[Command]:
    """Yield every live node that moves joints, in the order of the stage."""
    for node in subject.live.values():
        ports = None if node.type is None else node.type.drives
        if ports is None:
            continue
        path = effective_value(node, ports.path, subject.live)
        is_by_path = path is None or bool(path)
        aim = str(path or "") if is_by_path else next(iter(node.targets(ports.target)), "")
        yield Command(
            node=node,
            ports=ports,
            port=ports.path if is_by_path else ports.target,
            robot=aim,
            roots=tuple(articulations(aim, subject.stage)) if aim else (),
            names=_names(node, ports, subject),
            is_open=not aim or is_subtree_unresolved(subject.stage, aim),
        )


def _names(node: Node, ports: DrivePorts, subject: LintSubject) -> tuple[str, ...] | None:
    """Return the names of the joints, None where they are unknown or given by number."""
    numbers = node.state(ports.joints.replace("Names", "Indices"))
    if numbers is not None and (numbers.sources or numbers.value):
        return None
    return joint_names(node, ports.joints, subject.live)


def articulations(top: str, stage: StageModel) -> Iterator[str]:
    """Yield the roots of articulations at and below a prim."""
    for prim in stage.below(top):
        if is_articulated(prim):
            yield prim.path


def joints_of(command: Command, stage: StageModel) -> dict[str, Prim]:
    """Return the joints of a robot that can move, by name.

    Joints may stand anywhere: those count that tie a body of the robot's own subtree, or stand in
    it. The subtree is that of the target and of the articulation root; of joints of other names
    also that of the prim right above the root, where its links may stand beside it.
    """
    inside = {command.robot, *command.roots}
    around = {root.rpartition("/")[0] or root for root in command.roots}
    joints = [
        prim
        for prim in stage.of_type(is_joint_type)
        if prim.present and prim.type != FIXED and not is_excluded(prim)
    ]
    found: dict[str, Prim] = {}
    for tops in (inside, around):
        for joint in joints:
            if any(
                is_at_or_below(path, top) for path in (joint.path, *ends(joint)) for top in tops
            ):
                found.setdefault(joint.name, joint)
    return found


def ends(joint: Prim) -> tuple[str, ...]:
    """Return the bodies that a joint ties."""
    return tuple(path for name in BODIES for path in joint.relationships.get(name, ()))


def told_joints(command: Command, port: str, subject: LintSubject) -> list[Prim]:
    """Return the joints that a command surely moves: those that are named, or all of the robot.

    Without names each joint gets a command only where there are as many commands as joints, and
    none of them stands still.
    """
    if command.names:
        known = joints_of(command, subject.stage)
        return [known[name] for name in dict.fromkeys(command.names) if name in known]
    value = effective_value(command.node, port, subject.live)
    if isinstance(value, tuple):
        is_moving = all(value)
    else:
        is_moving = controller_of(command, subject) is not None
    joints = _axes(command, subject.stage) if is_moving and command.names == () else []
    return joints if number_of_commands(command, port, subject) == len(joints) else []


def _axes(command: Command, stage: StageModel) -> list[Prim]:
    """Return the joints of the one robot of a command, none where they are not all plain axes."""
    root = stage.prim(command.roots[0]) if len(command.roots) == 1 else None
    links = (None if root is None else articulation_links(root, stage)) or {}
    joints = [each for each in joints_of(command, stage).values() if set(ends(each)) & set(links)]
    return joints if all(_is_axis(each) for each in joints) else []


def _is_axis(joint: Prim) -> bool:
    """Whether a joint has one axis that moves by itself, and not as another joint does."""
    follows = any(_MIMIC in api for api in joint.apis)
    return joint.type in AXES and not follows and not is_switched_off(joint, JOINT_ENABLED)


def wired_commands(command: Command) -> list[str]:
    """Return the kinds of commands that a node gives: the names of its inputs."""
    given = []
    for port in command.ports.commands:
        state = command.node.state(port)
        if state is not None and (state.sources or state.value):
            given.append(port)
    return given


def number_of_commands(command: Command, port: str, subject: LintSubject) -> int | None:
    """Return how many values come into an input for commands, None where nothing tells it."""
    sources = list(live_sources(command.node, port, subject.live))
    if len(sources) > 1:
        return None
    for source, out in sources:
        kind = source.type
        if kind is not None and out in kind.sizes:
            return kind.sizes[out]
        if kind is not None and kind.dynamic is not None:
            count = effective_value(source, INPUT + kind.dynamic.count, subject.live)
            return count if isinstance(count, int) else None
    value = effective_value(command.node, port, subject.live)
    return len(value) if isinstance(value, tuple) else None


def controller_of(command: Command, subject: LintSubject) -> Node | None:
    """Return the node that computes the wheel speeds of a command, None for several or none."""
    for port in command.ports.commands:
        for source, _ in live_sources(command.node, port, subject.live):
            if source.type is not None and source.type.step_limits:
                return source
    return None
