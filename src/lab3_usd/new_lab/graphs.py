"""Describes the Action Graphs of a stage and the node types that they add."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.errors import GraphError
from lab3_usd.isaac.graph import checked_value
from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType, can_connect
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value, fits_type, is_known_type
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.new_lab.checkpoints import TREE_GROUP, part_letter
from lab3_usd.new_lab.yaml_text import as_typed, document
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.graph_file import parse_graph
from lab3_usd.spec.scene import SCENE_GROUP

_HEAD = "Node types of the stage that are not public types of Isaac Sim, and earlier names."
_NOTES = {
    "renamed": "Names of earlier releases.",
    "types": "The ports are those that the stage uses: describe them.",
}
_SIGNAL = re.compile(r"exec", re.IGNORECASE)


def unknown_types(nodes: Iterable[Node]) -> dict[str, dict[str, Any]]:
    """Describe the types that no platform has by the ports that the nodes show."""
    types: dict[str, dict[str, Any]] = {}
    for node in nodes:
        if node.type is not None or not node.type_name:
            continue
        word = node.type_name.rpartition(".")[2]
        prim_name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", word).lower()
        entry = types.setdefault(
            node.type_name,
            {"version": 1, "name": word, "prim": prim_name, "inputs": {}, "outputs": {}},
        )
        entry["version"] = max(entry["version"], node.version or 1)
        for name, state in node.ports.items():
            side = "inputs" if name.startswith(INPUT) else "outputs"
            short = name.removeprefix(INPUT).removeprefix(OUTPUT)
            if entry[side].get(short, "union") != "union":
                continue
            ogn_type = state.usd_type if is_known_type(state.usd_type) else "union"
            if state.usd_type == "rel":
                ogn_type = "target"
            elif _SIGNAL.match(short):
                ogn_type = "execution"
            entry[side][short] = ogn_type
    return types


def catalog_text(used: Mapping[str, str], platform: Platform, unknown: Mapping[str, Any]) -> str:
    """Return `node_types.yaml`, '' where every type of the stage is a public one of today.

    `used` maps the names of types as the stage writes them to those of today, `platform` is the
    bundled lab's platform.
    """
    old = {name: new for name, new in sorted(used.items()) if platform.type_name(name) != new}
    data: dict[str, Any] = {}
    if old:
        data["renamed"] = old
    if unknown:
        data["types"] = unknown
    return document(_HEAD, data, _NOTES) if data else ""


class GraphText(Struct, frozen=True):
    """One graph: its data in the form of its file, the spec that this gives, and what it lacks.

    `prims` are the paths of its nodes by role.
    """

    data: Mapping[str, Any]
    spec: GraphSpec
    left_out: tuple[str, ...]
    prims: Mapping[str, str]


def running_graphs(stage: StageModel) -> dict[str, GraphModel]:
    """Return the graphs that a lab can ask for, by path."""
    return {
        graph.path: graph
        for graph in stage.graphs
        if graph.active and not graph.instanced and graph.nodes
    }


def describe_graphs(
    graphs: Iterable[GraphModel], lab: Lab, since: Mapping[str, int]
) -> tuple[GraphText, ...]:
    """Describe graphs in the order of a course: clock, drive, sensors, odometry.

    `since` is the number of the first stage that holds a graph, by path; empty where there is one
    stage for all. `lab` has every node type of the stage.

    Raises:
        SpecError: a graph has a name or path that no file of a lab can have.
    """
    ordered = sorted(graphs, key=lambda graph: (since.get(graph.path, 0), _course_order(graph)))
    names: dict[str, GraphModel] = {}
    for graph in ordered:
        name = graph.name
        above = graph.path.split("/")[-2::-1]
        while name in (*names, TREE_GROUP, SCENE_GROUP):  # which are other groups
            name = f"{above.pop(0) or 'other'}_{name}"
        names[name] = graph
    return tuple(
        describe_graph(name, graph, part_letter(since.get(graph.path, number)), lab)
        for number, (name, graph) in enumerate(names.items(), start=1)
    )


def _course_order(graph: GraphModel) -> int:
    """Return the place of a graph in a course: publishers without prims, drives, sensors, TF."""
    kinds = [node.type for node in graph.nodes if node.type is not None]
    if any(kind.tf is not None for kind in kinds):
        return 3
    if any(kind.drives is not None or kind.role == "subscriber" for kind in kinds):
        return 1
    has_targets = any(state.targets for node in graph.nodes for state in node.ports.values())
    return 2 if has_targets else 0


def describe_graph(name: str, graph: GraphModel, part: str, lab: Lab) -> GraphText:
    """Describe one graph, in a part of the handout.

    Raises:
        SpecError: it has a name or path that no file of a lab can have.
    """
    below = len(graph.path) + 1
    roles = {node.path: node.path[below:].replace("/", "_") for node in graph.nodes}
    left_out: list[str] = []
    nodes = {
        roles[node.path]: _node(node, lab, left_out)
        for node in graph.nodes
        if node.type is not None
    }
    wires = list(_wires(graph, roles, left_out))
    data = {
        "graph": name,
        "path": graph.path,
        "handout": f"{part}1",
        "nodes": nodes,
        "wires": wires,
    }
    variables = dict(_variables(graph, left_out))
    data |= {"variables": variables} if variables else {}
    left_out += (f"{n.path}: has no type" for n in graph.nodes if n.type is None)
    spec = parse_graph(data, lab.platform, f"{name}.yaml")
    return GraphText(data, spec, tuple(left_out), {role: path for path, role in roles.items()})


def _variables(graph: GraphModel, left_out: list[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the variables of a graph that have a value, by name."""
    for name, variable in graph.variables.items():
        if variable.value is not None and fits_type(variable.value, variable.usd_type):
            yield name, {"type": variable.usd_type, "value": as_typed(variable.value)}
        else:
            left_out.append(f"{graph.path}.{VARIABLE}{name}: has no value of a known type")


def _node(node: Node, lab: Lab, left_out: list[str]) -> dict[str, Any]:
    kind = node.type
    assert kind is not None  # noqa: S101 - only nodes of a known type are described
    at = [
        int(number) if number.is_integer() else round(number, 3) for number in node.position or ()
    ]
    place = {"at": at} if at else {}
    data: dict[str, Any] = {"type": kind.type, **place}
    values = dict(_values(node, kind, lab, left_out))
    ports = {name: port for name in node.ports if (port := kind.port(name)) is not None}
    targets = {
        name[len(INPUT) :]: list(node.ports[name].targets)
        for name, port in ports.items()
        if node.ports[name].targets and port.is_target
    }
    inputs = [name for name in ports if name.startswith(INPUT)]
    grown = [name[len(INPUT) :] for name in inputs if name not in kind.ports]
    data |= {"set": values} if values else {}
    data |= {"targets": targets} if targets else {}
    data |= {"ports": sorted(grown)} if grown else {}
    frames = kind.tf.prims[1][len(INPUT) :] if kind.tf is not None and kind.tf.prims else ""
    return data | ({"frames_from": [frames]} if frames in targets else {})


def _values(
    node: Node, kind: NodeType, lab: Lab, left_out: list[str]
) -> Iterator[tuple[str, Value]]:
    """Yield the inputs that the stage sets, also to their defaults, as people write their values.

    What stays at its default in every graph is demanded for all of them.
    """
    kept = (*lab.policy.keep_default, lab.platform.ros.namespace)
    for name, state in node.ports.items():
        port = kind.port(name)
        if not name.startswith(INPUT) or state.sources or state.usd_type == "rel":
            continue
        if port is None:
            if state.value is not None:
                left_out.append(f"{node.path}.{name}: {kind.type} has no such input")
            continue
        if node.wrong_type(name):
            wrong = f"{state.value!r} is not a value of {port.ogn_type}"
            left_out.append(f"{node.path}.{name}: {wrong}")
            continue
        value = node.value(name)
        if port.is_execution or port.is_target or value is None:
            continue
        if value == port.default and (state.value is None or port.short in kept):
            continue
        try:
            checked_value(port, value)
        except GraphError:
            left_out.append(f"{node.path}.{name}: {value!r} is not a value of {port.ogn_type}")
        else:
            yield port.short, as_typed(value)


def _wires(graph: GraphModel, roles: Mapping[str, str], left_out: list[str]) -> Iterator[str]:
    nodes = {node.path: node for node in graph.nodes}
    for node in graph.nodes:
        for name, state in node.ports.items():
            taken = False
            for source in state.sources:
                text = _wire(node, name, source, nodes, roles)
                if text and not taken:
                    taken = True
                    yield text
                    continue
                several = f"one of {len(state.sources)} wires into one input"
                reason = several if text else "joins no known ports"
                left_out.append(f"{source} -> {node.path}.{name}: {reason}")


def _wire(
    node: Node, name: str, source: str, nodes: Mapping[str, Node], roles: Mapping[str, str]
) -> str:
    """Return a wire as files write it, '' for one that no file can hold."""
    path, _, port = source.rpartition(".")
    feeder = nodes.get(path)
    if feeder is None or feeder.type is None or node.type is None:
        return ""
    short = port.removeprefix(OUTPUT).removeprefix(INPUT)
    start, end = feeder.type.source(short), node.type.port(name)
    if start is None or end is None or start.name != port or not can_connect(start, end):
        return ""
    return f"{roles[path]}.{short} -> {roles[node.path]}.{end.short}"
