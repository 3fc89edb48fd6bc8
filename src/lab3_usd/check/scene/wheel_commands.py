"""The nodes that command the robot's wheels, and which of them are not the lab's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.match.conformance import setting_matches, setting_value, target_matches
from lab3_usd.check.match.result import Roles
from lab3_usd.check.ros.running import (
    Nodes,
    effective_value,
    live_nodes,
    live_sources,
    running_nodes,
)
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import ARTICULATION_API
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.spec.catalog import INPUT, Value
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.port_groups import DrivePorts


def second_commanders(
    stage: StageModel, lab: Lab, roles: Mapping[str, Roles]
) -> Iterator[tuple[Node, str]]:
    """Yield each running node that commands the wheels beside the lab's own, with the latter.

    A node that tells them the same as the lab's own is left out: one with the same inputs, or in
    a copy of the graph.
    """
    live = live_nodes(stage, lab)
    own = {
        path: name
        for name, found in roles.items()
        for path in found.role_of
        if path in live and _drives(live[path]) is not None
    }
    for path, node in running_nodes(stage, lab).items() if own else ():
        if _drives(node) is None:
            continue
        same = any(path in found.equivalents for found in roles.values())
        if path in own or same or not _commands_wheels(node, stage, lab, live):
            continue
        graph = next(each for each in stage.graphs if node in each.nodes)
        if not any(is_same_graph(lab.graphs[name], graph, live) for name in own.values()):
            yield node, next(iter(own))


def is_same_graph(spec: GraphSpec, graph: GraphModel, live: Nodes) -> bool:
    """Whether a graph does exactly what the spec asks for, wherever it stands."""
    from lab3_usd.check.match.diagnosis import diagnose  # noqa: PLC0415 - few graphs are copies
    from lab3_usd.check.match.matcher import match  # noqa: PLC0415

    roles = match(spec, graph)
    if roles.extra or diagnose(spec, roles, live):
        return False
    for role, asked in spec.nodes.items():
        node = roles.node_of[role]
        if node is None or not all(target_matches(node, target) for target in asked.targets):
            return False
        values = ((each, setting_value(live, node, each.port)) for each in asked.settings)
        if not all(setting_matches(node, each, value) for each, value in values):
            return False
    return True


def _drives(node: Node) -> DrivePorts | None:
    return None if node.type is None else node.type.drives


def _commands_wheels(node: Node, stage: StageModel, lab: Lab, live: Nodes) -> bool:
    """Whether a node that runs tells a wheel of the robot anything."""
    ports = _drives(node)
    if ports is None:
        return False
    # What comes by a wire is a command; a list without entries is none.
    commands = (effective_value(node, port, live) for port in ports.commands)
    if not any(value is None or value != () for value in commands):
        return False
    names = joint_names(node, ports.joints, live)
    wheels = set(lab.scene.robot.wheels.joints)
    if names and not wheels & set(names):
        return False
    return _aims_at_robot(node, ports, stage, lab, live)


def joint_names(node: Node, port: str, live: Nodes) -> tuple[str, ...] | None:
    """Return the names that reach an input as a list, None where they are unknown."""
    made = list(live_sources(node, port, live))
    if len(made) == 1 and made[0][0].type is not None and made[0][0].type.dynamic is not None:
        value = _array(made[0][0], live)
    else:
        value = effective_value(node, port, live)
    is_known = isinstance(value, tuple) and all(isinstance(item, str) for item in value)
    return tuple(map(str, value)) if is_known and isinstance(value, tuple) else None


def _array(maker: Node, live: Nodes) -> Value | None:
    """Return the list that a node makes of its numbered inputs."""
    dynamic = None if maker.type is None else maker.type.dynamic
    count = None if dynamic is None else effective_value(maker, INPUT + dynamic.count, live)
    if dynamic is None or not isinstance(count, int):
        return None  # how many they are comes by a wire
    names = [f"{INPUT}{dynamic.prefix}{number}" for number in range(min(count, len(maker.ports)))]
    items = [effective_value(maker, name, live) for name in names]
    return None if None in items else tuple(item for item in items if item is not None)


def is_doubtful(node: Node, live: Nodes) -> bool:
    """Whether the robot that a node commands is unknown, because a wire brings its path."""
    ports = _drives(node)
    return ports is not None and effective_value(node, ports.path, live) is None


def _aims_at_robot(node: Node, ports: DrivePorts, stage: StageModel, lab: Lab, live: Nodes) -> bool:
    """Whether the prim that a node looks below holds the robot's articulation."""
    written = effective_value(node, ports.path, live)
    if written is None:
        return True  # see `is_doubtful`
    aim = str(written) or next(iter(node.targets(ports.target)), "")
    robot = lab.scene.robot.path
    if is_unresolved(stage, robot) or any(is_at_or_below(m.prim, robot) for m in stage.unresolved):
        return bool(aim) and (is_at_or_below(aim, robot) or is_at_or_below(robot, aim))
    roots = [
        prim.path
        for prim in stage.with_api(ARTICULATION_API)
        if prim.present and is_at_or_below(prim.path, robot)
    ]
    return bool(aim) and any(is_at_or_below(root, aim) for root in roots)
