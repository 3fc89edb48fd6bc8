"""The wheels of the robot: their joints, and the nodes that command them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msgspec import Struct

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.facts.arrays import listed_names
from lab3_usd.facts.endpoints import names_by_node
from lab3_usd.facts.execution_order import live_nodes, nodes_of, running_nodes
from lab3_usd.facts.reaching_values import Nodes, effective_value
from lab3_usd.isaac.node_types import DrivePorts
from lab3_usd.model.changes import Edit, Restore
from lab3_usd.model.finding import Problem
from lab3_usd.model.joint_drives import JointFault
from lab3_usd.model.physics import (
    ARTICULATION_API,
    BODIES,
    REVOLUTE,
    bodies,
    is_body,
    is_joint,
    joints,
)
from lab3_usd.model.prims import Prim, is_at_or_below, upwards
from lab3_usd.model.stage import GraphModel, Node, StageModel, UnresolvedAsset, once_per_stage

if TYPE_CHECKING:
    from lab3_usd.spec.graph import GraphSpec
    from lab3_usd.spec.scene import RobotSpec


class WheelJoint(Struct, frozen=True, eq=False):
    """One wheel joint that the handout names, and the prim that plays it.

    `path` is where the handout shows it, `link` the path of its wheel. `prim` may be absent from
    the scene or of a wrong type; None where nothing has the name.
    """

    name: str
    path: str
    link: str
    prim: Prim | None

    @property
    def site(self) -> str:
        """Where to report: the prim, else the path of the handout."""
        return self.path if self.prim is None else self.prim.path

    @property
    def related(self) -> tuple[str, ...]:
        """The path of the handout, where the joint stands elsewhere."""
        return () if self.site == self.path else (self.path,)

    @property
    def live(self) -> Prim | None:
        """The prim when it is a revolute joint of the scene, else None."""
        prim = self.prim
        return prim if prim is not None and prim.present and prim.type == REVOLUTE else None


class TiedJoint(WheelJoint, frozen=True, eq=False):
    """A wheel joint that connects its wheel to the robot: which of the bodies is the wheel."""

    prim: Prim
    wheel_side: int

    @property
    def base_side(self) -> int:
        """Which of the two bodies is not the wheel."""
        return 1 - self.wheel_side


@once_per_stage
def wheel_joints(subject: RobotSubject) -> list[WheelJoint]:
    """Return the wheel joints in the order of the scene file."""
    robot = subject.robot
    wheels = []
    for name, wheel in robot.wheels.joints.items():
        link = robot.path_of(wheel)
        prim = _find_joint(subject.stage, robot.path, name, link)
        wheels.append(WheelJoint(name, robot.joint_path(name), link, prim))
    return wheels


def find_joint(stage: StageModel, root: str, name: str) -> Prim | None:
    """Return the prim of a name on a robot, a joint in the scene before others."""
    named = [prim for prim in stage.named(name) if is_at_or_below(prim.path, root)]
    return min(
        named, key=lambda prim: (not prim.present, not is_joint(prim), prim.path), default=None
    )


def link_of(path: str, robot: RobotSpec) -> str:
    """Return the link that a prim is or belongs to, '' for none."""
    holding = (link for link in robot.link_paths if is_at_or_below(path, link))
    return max(holding, key=len, default="")


def _find_joint(stage: StageModel, root: str, name: str, link: str) -> Prim | None:
    joint = find_joint(stage, root, name)
    if joint is not None:
        return joint
    for prim in joints(stage):
        if prim.type == REVOLUTE and any(is_at_or_below(body, link) for body in bodies(prim)):
            return prim
    return None


def unknown_joints(subject: RobotSubject) -> UnresolvedAsset | None:
    """Return the missing asset of the robot, beside those of its links, that could hold joints."""
    robot = subject.robot
    return subject.stage.unknown_below(robot.path, beside=robot.link_paths)


def has_no_joints(subject: RobotSubject) -> bool:
    """Whether the robot is there, and not one joint ties any of its links.

    A robot of one link has none.
    """
    robot, stage = subject.robot, subject.stage
    if len(robot.links) <= 1 or stage.prim(robot.path) is None or unknown_joints(subject):
        return False
    return not any(
        is_at_or_below(body, robot.path) for joint in joints(stage) for body in bodies(joint)
    )


def wheel_side(joint: Prim, wheel: str) -> int | None:
    """Return which of the two bodies is the wheel, None where neither or both are."""
    sides = [is_at_or_below(body, wheel) for body in bodies(joint)]
    return sides.index(True) if sides.count(True) == 1 else None


def wrong_ends(joint: Prim, wheel: str, subject: RobotSubject) -> Iterator[tuple[str, str]]:
    """Yield the property of each body that the joint does not rightly connect, and what it is.

    One end is the wheel, the other a body of the robot, but not a wheel. Ends that are right are
    left out; a link that is missing altogether is not the joint's fault.
    """
    robot = subject.robot
    wheels = [wheel.link for wheel in wheel_joints(subject)]
    plain = [path for path in robot.link_paths if path not in wheels]
    ends, side = bodies(joint), wheel_side(joint, wheel)
    if side is None:
        # An end at the base is right; of two that may be, Body 1 is to be the wheel.
        is_base = [any(is_at_or_below(end, link) for link in plain) for end in ends]
        is_both = all(is_at_or_below(end, wheel) for end in ends)
        wrong = 0 if is_both or is_base == [False, True] else 1
        yield BODIES[wrong], ends[wrong]
        return
    base = ends[1 - side]
    if not any(is_at_or_below(base, link) for link in plain) and not _is_body(base, subject):
        yield BODIES[1 - side], base


def _is_body(path: str, subject: RobotSubject) -> bool:
    """Whether a prim moves with a body of the robot that the handout does not name."""
    robot = subject.robot
    is_link = any(is_at_or_below(path, link) for link in robot.link_paths)
    if is_link or not is_at_or_below(path, robot.path):
        return False
    above = (top for top in upwards(path) if is_at_or_below(top, robot.path))
    prims = map(subject.stage.prim, above)
    return any(prim is not None and is_body(prim) for prim in prims)


def restored(joint: WheelJoint, name: str | None) -> tuple[Edit, ...]:
    """Return what restores a property of a joint; the frames of one turned round are not known."""
    is_turned_round = isinstance(joint, TiedJoint) and joint.base_side == 1
    if name is None or (is_turned_round and name.startswith("physics:local")):
        return ()
    return (Restore(joint.site, name),)


def wheel_problem(
    joint: WheelJoint,
    robot: RobotSpec,
    fault: JointFault,
    asked: str,
    handout: str = "",
    rests_on: UnresolvedAsset | None = None,
) -> Problem:
    """Return that a wheel joint is not as asked, with what it fails, and its property restored."""
    return Problem(
        joint.site,
        fault.text,
        fault.property,
        fault.expected,
        fault.actual,
        handout or robot.wheels.handout,
        joint.related,
        fix=restored(joint, fault.property),
        unmet=(f"{robot.group}/{asked}/{joint.name}",),
        rests_on=rests_on,
    )


@once_per_stage
def turning_joints(subject: RobotSubject) -> dict[WheelJoint, Prim]:
    """Return the wheel joints that can turn, and their prims; the others are S07's."""
    return {
        joint: joint.live
        for joint in wheel_joints(subject)
        if joint.live is not None and subject.stage.prim(joint.link) is not None
    }


@once_per_stage
def tied_joints(subject: RobotSubject) -> list[TiedJoint]:
    """Return the wheel joints that connect what they should; the others are S08's."""
    tied = []
    for joint, prim in turning_joints(subject).items():
        side = wheel_side(prim, joint.link)
        if side is not None and not any(wrong_ends(prim, joint.link, subject)):
            tied.append(TiedJoint(joint.name, joint.path, joint.link, prim, side))
    return tied


def second_commanders(subject: RobotSubject) -> Iterator[tuple[Node, str]]:
    """Yield each running node that commands the wheels beside the lab's own, with the latter.

    A node that tells them the same as the lab's own is left out: one with the same inputs, or in
    a copy of the graph. So is one of an earlier checkpoint that may be left out.
    """
    stage, lab, roles = subject.stage, subject.lab, subject.roles
    live, running = live_nodes(stage), running_nodes(stage)
    driving = {node.path: node for node in nodes_of(lambda kind: kind.drives, stage)}
    own = {
        path: name for name, players in roles.items() for path in players.role_of if path in driving
    }
    added = lab.added_until(subject.checkpoint.id).difference(roles)
    places = {lab.graphs[name].path for name in added if name in lab.graphs}
    for path, node in driving.items() if own else ():
        if path not in running or path.rpartition("/")[0] in places:
            continue
        is_stand_in = any(path in players.equivalents for players in roles.values())
        if path in own or is_stand_in or not _commands_wheels(node, subject, live):
            continue
        graph = _graph_of(path, stage)
        is_copy = any(
            is_same_graph(lab.graphs[name], graph, live)
            and _names(graph, stage) == _names(_graph_of(driver, stage), stage)
            for driver, name in own.items()
        )
        if not is_copy:
            drivers = (path for path in own if _commands_wheels(live[path], subject, live))
            yield node, next(drivers, next(iter(own)))


def _graph_of(path: str, stage: StageModel) -> GraphModel:
    return next(graph for graph in stage.graphs if any(node.path == path for node in graph.nodes))


def _names(graph: GraphModel, stage: StageModel) -> frozenset[tuple[str, str | None, str]]:
    """Return the topics of a graph by their whole names, with direction and domain."""
    by_node = names_by_node(stage)
    return frozenset(name for node in graph.nodes for name in by_node.get(node.path, ()))


def is_same_graph(spec: GraphSpec, graph: GraphModel, live: Nodes) -> bool:
    """Whether a graph does exactly what the spec asks for, wherever it stands."""
    from lab3_usd.check.match.conformance import setting_matches, target_matches
    from lab3_usd.check.match.diagnosis import faulty_wires
    from lab3_usd.check.match.roles import match

    roles = match(spec, graph)
    if roles.extra or faulty_wires(spec, roles, live):
        return False
    for role, demand in spec.nodes.items():
        node = roles.node_of[role]
        if node is None or not all(target_matches(node, target) for target in demand.targets):
            return False
        values = (
            (setting, effective_value(node, setting.port, live)) for setting in demand.settings
        )
        if not all(setting_matches(node, setting, value) for setting, value in values):
            return False
    return True


def _drives(node: Node) -> DrivePorts | None:
    return None if node.type is None else node.type.drives


def _commands_wheels(node: Node, subject: RobotSubject, live: Nodes) -> bool:
    """Whether a running node commands a wheel of the robot."""
    ports = _drives(node)
    if ports is None:
        return False
    # What comes over a wire is a command; a list without entries is none.
    commands = (effective_value(node, port, live) for port in ports.commands)
    if not any(value is None or value != () for value in commands):
        return False
    names = listed_names(node, ports.joints, live)
    wheels = set(subject.robot.wheels.joints)
    if names and not wheels & set(names):
        return False
    return _aims_at_robot(node, ports, subject, live)


def is_doubtful(node: Node, live: Nodes) -> bool:
    """Whether the robot that a node commands is unknown, because a wire brings its path."""
    ports = _drives(node)
    return ports is not None and effective_value(node, ports.path, live) is None


def _aims_at_robot(node: Node, ports: DrivePorts, subject: RobotSubject, live: Nodes) -> bool:
    """Whether the prim that a node looks below holds the robot's articulation."""
    written = effective_value(node, ports.path, live)
    if written is None:
        return True  # see `is_doubtful`
    aim = str(written) or next(iter(node.targets(ports.target)), "")
    stage, robot = subject.stage, subject.robot.path
    if stage.unknown_below(robot):
        return bool(aim) and (is_at_or_below(aim, robot) or is_at_or_below(robot, aim))
    roots = [
        prim.path
        for prim in stage.with_api(ARTICULATION_API)
        if prim.present and is_at_or_below(prim.path, robot)
    ]
    return bool(aim) and any(is_at_or_below(root, aim) for root in roots)
