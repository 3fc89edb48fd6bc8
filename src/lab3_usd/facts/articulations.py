"""The robots that nodes command: articulations, joints, drives and wheels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct

from lab3_usd.facts.arrays import list_at, listed_names
from lab3_usd.facts.execution_order import live_nodes, nodes_with
from lab3_usd.facts.frame_targets import articulation_links
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.isaac.node_types import INPUT, DrivePorts, JointList
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.isaac.values import Value
from lab3_usd.model.joint_drives import DRIVE, DRIVEN_AXES, read_drive
from lab3_usd.model.physics import (
    ARTICULATION_API,
    BODIES,
    FAR,
    FIXED,
    JOINT_ENABLED,
    REVOLUTE,
    bodies_below,
    ends,
    is_articulated,
    is_excluded,
    is_joint_type,
    is_switched_off,
    joint_limits,
    joints,
    joints_at,
    rigid_bodies,
)
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset, listed_once, once_per_stage

_MIMIC = "Mimic"
_PAIR = 2
# An effort of 1 turns a joint by 1 / damping degrees a second: below 1 % of a speed of 1 rad/s.
_HOLDING = 2.0


class Command(Struct, frozen=True, eq=False):
    """A node that moves joints: its robot, and the joints that it names.

    `names` is None where they are unknown or given by number. Those that a node finds have the
    attribute `marked_by`.
    `robot` is '' where the stage does not tell; `unknown` is a missing asset that could hold it.
    """

    node: Node
    ports: DrivePorts
    port: str
    robot: str
    roots: tuple[str, ...]
    names: tuple[str, ...] | None
    unknown: UnresolvedAsset | None
    marked_by: str = ""


@once_per_stage
def commands_of(roots: tuple[str, ...], stage: StageModel) -> Sequence[Command]:
    """Return the commands of articulations with one of some roots, in the order of the stage."""
    by_root = _by_root(stage)
    by_number = {
        number_of: one for root in roots for number_of, one in by_root.get(root, {}).items()
    }
    return tuple(by_number[number_of] for number_of in sorted(by_number))


@once_per_stage
def _by_root(stage: StageModel) -> Mapping[str, Mapping[int, Command]]:
    """Map each root of an articulation to its commands, numbered as the stage has them."""
    by_root: dict[str, dict[int, Command]] = {}
    for number_of, command in enumerate(commands(stage)):
        for root in command.roots:
            by_root.setdefault(root, {})[number_of] = command
    return by_root


@listed_once
def commands(stage: StageModel) -> Iterator[Command]:
    """Yield every live node that moves joints, in the order of the stage."""
    live = live_nodes(stage)
    for node, ports in nodes_with(lambda kind: kind.drives, stage):
        path = effective_value(node, ports.path, live)
        is_by_path = path is None or bool(path)
        aim = str(path or "") if is_by_path else next(iter(node.targets(ports.target)), "")
        names, listing = listed_names(node, ports.joints, live), _listing(node, ports.joints, stage)
        if not names and listing is not None:
            names = _found_joints(*listing, stage)
        is_numbered = node.sources(ports.indices) or effective_value(node, ports.indices, live)
        is_by_number = bool(is_numbered) and not unused_indices(node, ports, stage)
        yield Command(
            node=node,
            ports=ports,
            port=ports.path if is_by_path else ports.target,
            robot=aim,
            roots=tuple(articulations(aim, stage)) if aim else (),
            names=None if is_by_number and not names else names,
            unknown=stage.unknown_below(aim) if aim else None,
            marked_by="" if listing is None else listing[1].attribute,
        )


def _listing(node: Node, port: str, stage: StageModel) -> tuple[Node, JointList] | None:
    """Return the node that finds the joints of an input by an attribute, None for none."""
    for source, output in live_sources(node, port, live_nodes(stage)):
        listing = None if source.type is None else source.type.lists_joints
        if listing is not None and output == listing.output:
            return source, listing
    return None


def _found_joints(source: Node, listing: JointList, stage: StageModel) -> tuple[str, ...] | None:
    """Return the names of the joints that a node finds by an attribute, None for unknown."""
    live = live_nodes(stage)
    by_path = effective_value(source, listing.by_path, live) is True
    path = effective_value(source, listing.path, live) if by_path else None
    robot = path if by_path else next(iter(source.targets(listing.prim)), None)
    if not isinstance(robot, str) or stage.prim(robot) is None or stage.unknown_below(robot):
        return None
    below = stage.below(robot)
    return tuple(prim.name for prim in below if listing.attribute in prim.attributes)


def unused_indices(node: Node, ports: DrivePorts, stage: StageModel) -> Value | None:
    """Return the numbers of joints that this release ignores because all are 0, None for others."""
    facts = None if node.type is None else stage.platform.joints.get(node.type.type)
    indices = effective_value(node, ports.indices, live_nodes(stage))
    if facts is None or not isinstance(indices, tuple) or not indices or any(indices):
        return None
    return indices if is_release_within(stage.platform.release, "", facts.zeros_until) else None


def articulations(top: str, stage: StageModel) -> Sequence[str]:
    """Return the roots of articulations at and below a prim."""
    return _roots_by_top(stage).get(top, ())


@once_per_stage
def _roots_by_top(stage: StageModel) -> Mapping[str, Sequence[str]]:
    """Map each prim to the roots of articulations at and below it."""
    below: dict[str, list[str]] = {}
    for prim in stage.with_api(ARTICULATION_API):
        if is_articulated(prim):
            for top in ("/", *upwards(prim.path)):
                below.setdefault(top, []).append(prim.path)
    return below


def is_empty(root: str, stage: StageModel) -> bool:
    """Whether nothing moves in an articulation: joints tie no bodies to its root.

    A missing asset beside the root may hold joints.
    """
    prim = stage.prim(root)
    may_have_joints = stage.unknown_below(root.rpartition("/")[0] or root)
    if prim is None or is_joint_type(prim.type) or may_have_joints:
        return False
    links = articulation_links(prim, stage) or {}
    return not any(
        joint.type != FIXED and not is_switched_off(joint, JOINT_ENABLED)
        for joint in joints_at(links, stage)
    )


def joints_of(command: Command, stage: StageModel) -> dict[str, Prim]:
    """Return the joints of a robot that can move, by name.

    Joints may be anywhere in the stage: those count that are in the robot's subtree or connect a
    body of it. The subtree is that of the target and of the articulation root; for joints of other
    names also that of the prim directly above the root, since links may be siblings of the root.
    """
    return _joints_of(stage, command.robot, command.roots)


@once_per_stage
def _joints_of(stage: StageModel, robot: str, roots: tuple[str, ...]) -> dict[str, Prim]:
    inside = {robot, *roots}
    around = {root.rpartition("/")[0] or root for root in roots}
    by_name: dict[str, Prim] = {}
    for tops in (inside, around):
        places = {place for top in tops for place in _first_joints(stage).get(top, {}).items()}
        for name, (_, joint) in sorted(places, key=lambda place: place[1][0]):
            by_name.setdefault(name, joint)
    return by_name


@once_per_stage
def _first_joints(stage: StageModel) -> Mapping[str, Mapping[str, tuple[int, Prim]]]:
    """Return the joints that can move of each prim, by name, numbered as the stage has them.

    They are those that stand at or below the prim or tie a body there, the first of each name.
    """
    first: dict[str, dict[str, tuple[int, Prim]]] = {}
    for number_of_joint, joint in enumerate(stage.of_type(is_joint_type)):
        if joint.present and joint.type != FIXED and not is_excluded(joint):
            for path in (joint.path, *ends(joint)):
                for top in ("/", *upwards(path)):
                    first.setdefault(top, {}).setdefault(joint.name, (number_of_joint, joint))
    return first


@once_per_stage
def cut_off(stage: StageModel) -> Mapping[str, Prim]:
    """Map each joint that no articulation has to the joint, excluded from it, that cuts it off.

    An articulation goes from its root as far as joints lead that are not excluded (PhysX).
    """
    working = joints(stage)
    if not any(map(is_excluded, working)):
        return {}
    carrier, body_paths = joined_bodies(stage).carrier, rigid_bodies(stage)
    ties: dict[str, list[Prim]] = {}
    for joint in working:
        for body in dict.fromkeys(filter(None, map(carrier, ends(joint)))):
            ties.setdefault(body, []).append(joint)
    roots = articulations("/", stage)
    # A root that is no body may stand for several articulations.
    reached: dict[str, Prim | None] = {path: None for path in roots if path in body_paths}
    ahead = list(reached)
    behind: list[tuple[Prim, str]] = []
    cut: dict[str, Prim] = {}
    while ahead or behind:
        if ahead:
            body = ahead.pop(0)
            cause = reached[body]
        else:
            cause, body = behind.pop(0)
            if body in reached:
                continue
            reached[body] = cause
        for joint in ties.get(body, ()):
            far_bodies = [end for end in map(carrier, ends(joint)) if end and end != body]
            if cause is not None and not is_excluded(joint):
                cut.setdefault(joint.path, cause)
            for other in (end for end in far_bodies if end not in reached):
                if is_excluded(joint) or cause is not None:
                    behind.append((cause or joint, other))
                else:
                    reached[other] = None
                    ahead.append(other)
    return cut


def is_loose(joint: Prim, command: Command, stage: StageModel) -> bool:
    """Whether a joint ties no body of a robot: its articulation has no axis there."""
    joined = joined_bodies(stage)
    own = {joined.owner(body) for root in command.roots for body in bodies_below(stage, root)}
    tied = {joined.robots[body] for end in ends(joint) if (body := joined.carrier(end))}
    return bool(own) and own.isdisjoint(tied) and stage.unknown(*ends(joint)) is None


def has_joint(joints: Mapping[str, Prim], name: str) -> bool:
    """Whether a robot has a joint of this name, or an axis of one.

    A joint of several axes has one for each: `joint:0`, `joint:1`, `joint:2`. Source: `backend.py`
    of Isaac Sim's Newton tensors, :712-721.
    """
    stem, colon, axis = name.rpartition(":")
    is_axis = bool(colon) and axis.isdecimal() and stem in joints
    return name in joints or (is_axis and joints[stem].type not in DRIVEN_AXES)


def joints_commanded(command: Command, port: str, stage: StageModel) -> list[Prim]:
    """Return the joints that a command surely moves: those that are named, or all of the robot.

    Without names, each joint gets a command only if there are as many commands as joints, and none
    of the joints is fixed.
    """
    if command.names:
        joint_of = joints_of(command, stage)
        return [joint_of[name] for name in dict.fromkeys(command.names) if name in joint_of]
    value = effective_value(command.node, port, live_nodes(stage))
    if isinstance(value, tuple):
        is_moving = all(value)
    else:
        is_moving = controller_of(command, stage) is not None
    joints = _axes(command, stage) if is_moving and command.names == () else []
    return joints if number_of_commands(command, port, stage) == len(joints) else []


def named_joints(command: Command, stage: StageModel) -> list[str] | None:
    """Return the names of the joints that a command is about, None where they are unknown.

    Joint numbers follow PhysX's own order, which no file contains. So the names are known only if
    the numbers are those of all axes.
    """
    if command.names is not None:
        return list(command.names or joints_of(command, stage))
    numbers = list_at(command.node, command.ports.indices, live_nodes(stage))
    axes = [joint.name for joint in _axes(command, stage)]
    is_whole = numbers is not None and sorted(map(str, numbers)) == sorted(
        map(str, range(len(axes)))
    )
    return axes if axes and is_whole else None


def reached_joints(command: Command, stage: StageModel, *, with_wheels: bool = False) -> list[Prim]:
    """Return the joints of a robot that messages can name and that are to be commanded.

    Left out are joints that another controller names, that follow another joint, that roll freely
    (casters; wheels unless `with_wheels`), and joints without a drive in a closed chain. A joint
    with a drive outside the articulation is included, unless it closes a chain.
    """
    links = {
        path
        for root in command.roots
        for prim in [stage.prim(root)]
        for path in (None if prim is None else articulation_links(prim, stage)) or {}
    }
    joints = joints_at(links, stage)
    tied = [joint for joint in joints if len(ends(joint)) == len(BODIES)]
    pairs = {frozenset(ends(joint)) for joint in tied if not is_switched_off(joint, JOINT_ENABLED)}
    is_fixed = any(len(ends(joint)) < len(BODIES) for joint in joints)  # to the world
    is_chain = len(pairs) < len({path for pair in pairs for path in pair})
    commanded_elsewhere = {
        name
        for other in commands_of(command.roots, stage)
        if other is not command
        for name in other.names or ()
    }
    return [
        joint
        for joint in joints
        if joint.type in DRIVEN_AXES
        and joint.name not in commanded_elsewhere
        and (not command.marked_by or command.marked_by in joint.attributes)
        and not any(_MIMIC in api for api in joint.apis)
        and (is_fixed or (with_wheels and _has_drive(joint)) or not _rolls(joint, joints, stage))
        and (is_chain or (_has_drive(joint) and not is_excluded(joint)))
        and (_has_drive(joint) or not (is_excluded(joint) or is_switched_off(joint, JOINT_ENABLED)))
    ]


def _has_drive(joint: Prim) -> bool:
    return any(api.startswith(f"{DRIVE}:") for api in joint.apis)


def _rolls(joint: Prim, joints: Iterable[Prim], stage: StageModel) -> bool:
    """Whether a joint turns something with a shape freely, as wheels and casters do.

    It carries no other joint, or has no drive.
    """
    link = next(iter(joint.relationships.get(BODIES[1], ())), "")
    if not stage.colliders.below(link):
        return False
    carries = any(other is not joint and link in ends(other) for other in joints)
    if carries and _has_drive(joint):
        return False
    low, high = joint_limits(joint.attributes)
    return joint.type == REVOLUTE and high - low > FAR and gains_of(joint)[0] <= 0.0


def _axes(command: Command, stage: StageModel) -> list[Prim]:
    """Return the joints of the one robot of a command, none where they are not all plain axes."""
    root = stage.prim(command.roots[0]) if len(command.roots) == 1 else None
    links = (None if root is None else articulation_links(root, stage)) or {}
    joints = [
        joint for joint in joints_of(command, stage).values() if set(ends(joint)) & set(links)
    ]
    # A plain axis moves by itself, and not as another joint does.
    are_plain = all(
        joint.type in DRIVEN_AXES
        and not any(_MIMIC in api for api in joint.apis)
        and not is_switched_off(joint, JOINT_ENABLED)
        for joint in joints
    )
    return joints if are_plain else []


def number_of_axes(command: Command, stage: StageModel) -> int | None:
    """Return how many joints a robot has to command, None where that is not sure.

    Each joint must tie two bodies; together they must form no loop. One between two equal limits
    counts (NVIDIA-Omniverse/PhysX, UsdInterface.cpp:757-770).
    """
    axes = _axes(command, stage)
    around = {path for joint in axes for path in ends(joint)}
    tied = [pair for joint in joints_at(around, stage) if len(pair := ends(joint)) == len(BODIES)]
    is_tree = len({path for pair in tied for path in pair}) > len(tied)
    are_free = all(len(ends(joint)) == len(BODIES) for joint in axes)
    return len(axes) if axes and is_tree and are_free and around <= rigid_bodies(stage) else None


def wired_commands(command: Command) -> list[str]:
    """Return the kinds of commands that a node gives: the names of its inputs."""
    given = []
    for port in command.ports.commands:
        state = command.node.state(port)
        if state is not None and (state.sources or state.value):
            given.append(port)
    return given


def gains_of(joint: Prim) -> tuple[float, float]:
    """Return the stiffness and damping of a joint's drive, zeros for a joint without one."""
    drive = read_drive(joint.type, joint.apis, joint.attributes)
    return (drive.stiffness or 0.0, drive.damping or 0.0) if drive.api else (0.0, 0.0)


def leaves_joints(command: Command, port: str, stage: StageModel) -> bool:
    """Whether speeds that come in as positions or efforts surely move none of the joints.

    A drive without stiffness goes to no position; damping holds a joint against a small effort.
    """
    joints = joints_commanded(command, port, stage) if command.roots else []
    told = {joint.name for joint in joints}
    other_lists = (
        named_joints(other, stage)
        for other in commands_of(command.roots, stage)
        if other is not command
    )
    is_alone = wired_commands(command) == [port] and all(
        names is not None and not told & set(names) for names in other_lists
    )
    return (
        is_alone and bool(joints) and all(_leaves(joint, port, command.ports) for joint in joints)
    )


def _leaves(joint: Prim, port: str, ports: DrivePorts) -> bool:
    position, _, effort = ports.commands
    stiffness, damping = gains_of(joint)
    if port == position:
        return stiffness <= 0.0
    return port == effort and joint.type == REVOLUTE and damping >= _HOLDING


def number_of_commands(command: Command, port: str, stage: StageModel) -> int | None:
    """Return how many values come into an input for commands, None where nothing tells it."""
    sources = live_sources(command.node, port, live_nodes(stage))
    if len(sources) > 1:
        return None
    for source, out in sources:
        kind = source.type
        if kind is not None and out in kind.sizes:
            return kind.sizes[out]
        if kind is not None and kind.dynamic is not None:
            count = effective_value(source, INPUT + kind.dynamic.count, live_nodes(stage))
            return count if isinstance(count, int) else None
    value = effective_value(command.node, port, live_nodes(stage))
    return len(value) if isinstance(value, tuple) else None


def controller_of(command: Command, stage: StageModel) -> Node | None:
    """Return the node that computes the wheel speeds of a command, None for several or none."""
    for port in command.ports.commands:
        for source, _ in live_sources(command.node, port, live_nodes(stage)):
            if source.type is not None and source.type.step_limits:
                return source
    return None


def driven_pairs(stage: StageModel) -> Iterator[tuple[Command, Node, tuple[Prim, Prim]]]:
    """Yield the commands of two wheels, with what computes them and the joints in its order."""
    for command, controller, wheels in driven_wheels(stage):
        if len(wheels) == _PAIR:
            yield command, controller, (wheels[0], wheels[1])


@listed_once
def driven_wheels(stage: StageModel) -> Iterator[tuple[Command, Node, tuple[Prim, ...]]]:
    """Yield the commands of wheels, with what computes them and the joints in its order."""
    for command in commands(stage):
        controller = controller_of(command, stage)
        joints = joints_of(command, stage) if command.roots and controller is not None else {}
        names = command.names or ()
        if controller is not None and names and all(name in joints for name in names):
            yield command, controller, tuple(joints[name] for name in names)
