"""How far a stage has a planned graph, and which nodes a graph of it lacks of one."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.articulations import articulations
from lab3_usd.facts.execution_order import event_of, live_nodes, run_states
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.graph import Graph, PortRef, placed
from lab3_usd.isaac.graph import Node as Planned
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.topics import resolved_topic
from lab3_usd.isaac.values import Value
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import GraphModel, Node, StageModel, same_value


class Likeness(Struct, frozen=True):
    """How far a graph of a stage is a planned one.

    `node_of` are its nodes by the roles that they play, `differences` the values that are others,
    in words, `wires_missing` counts wires. It is `whole` where each role is played, and `has_more`
    where there are nodes beside.
    """

    path: str
    node_of: Mapping[str, Node]
    differences: tuple[str, ...]
    wires_missing: int
    whole: bool
    has_more: bool

    @property
    def is_same(self) -> bool:
        """Whether the graph has all that is planned."""
        return self.whole and not (self.differences or self.wires_missing)

    @property
    def is_alike(self) -> bool:
        """Whether the graph is of the same kind, with other values."""
        return self.whole and not (self.wires_missing or self.has_more)


def likeness(planned: Graph, there: GraphModel, stage: StageModel) -> Likeness:
    """Return how far a graph of the stage is a planned one."""
    node_of: dict[str, Node] = {}
    differences: list[str] = []
    missing = 0
    for node in sorted(planned.nodes.values(), key=lambda node: node.place[0]):
        candidates = [
            (*_unlike(node, other, planned, node_of, stage), other)
            for other in there.nodes
            if _may_play(node, other, stage) and other not in node_of.values()
        ]
        if not candidates:
            continue
        wires, unlike, other = min(
            candidates, key=lambda entry: (entry[0], len(entry[1]), entry[2].path)
        )
        node_of[node.role] = other
        missing += wires
        differences += unlike
    is_whole = len(node_of) == len(planned.nodes)
    has_more = len(there.nodes) > len(node_of)
    return Likeness(there.path, node_of, tuple(differences), missing, is_whole, has_more)


def _may_play(planned: Planned, node: Node, stage: StageModel) -> bool:
    """Whether a node is of the type that is planned, or an event that fires as often."""
    if node.type_name == planned.type.type:
        return True
    usual = stage.platform.graph.value(stage.platform.graph.evaluation.stage)
    is_event = planned.type.type in stage.platform.events
    outputs = {port.name for port in planned.type.ports.values() if port.is_execution}
    return (
        is_event
        and node.type is not None
        and event_of(node, stage.platform) == usual
        and run_states(stage).get(node.path) == "runs"
        and outputs <= {*node.type.ports}
    )


def _unlike(
    planned: Planned,
    node: Node,
    graph: Graph,
    node_of: Mapping[str, Node],
    stage: StageModel,
) -> tuple[int, list[str]]:
    """Return how many wires a node lacks or has beside, and which of its values are others."""
    live = live_nodes(stage)
    missing = 0
    wired = {}
    for wire in graph.wires:
        if wire.target.role == planned.role:
            wired[wire.target.port] = wire
            source = node_of.get(wire.source.role)
            expected = f"{source.path}.{wire.source.port}" if source else ""
            missing += expected not in node.sources(wire.target.port)
    unlike: list[str] = []
    if node.type_name != planned.type.type:
        return missing, unlike
    for name, port in planned.type.ports.items():
        if port.is_target and name.startswith(INPUT):
            aims = planned.targets.get(name, ())
            if not _same_targets(planned, name, aims, node, stage):
                unlike.append(f"{node.path}.{name} is {', '.join(node.targets(name)) or 'nothing'}")
        elif name.startswith(INPUT) and not port.is_execution and name not in wired:
            value = planned.values.get(name, planned.type.default(name, None))
            actual = effective_value(node, name, live)
            if actual is None and node.sources(name):
                missing += 1  # what comes over a wire is not what is planned
            elif not _same(planned, name, value, actual):
                unlike.append(f"{node.path}.{name} is {_shown(actual)}, asked {_shown(value)}")
    return missing, unlike


def _same_targets(
    planned: Planned, name: str, aims: tuple[str, ...], node: Node, stage: StageModel
) -> bool:
    drives = planned.type.drives
    if drives is not None and name == drives.target:
        path = node.value(drives.path)
        paths = (path,) if isinstance(path, str) and path else node.targets(name)
        return [*_roots(paths, stage)] == [*_roots(aims, stage)]
    return set(node.targets(name)) == set(aims)


def _roots(paths: Collection[str], stage: StageModel) -> Iterator[str]:
    for path in paths:
        yield from articulations(path, stage)


def _same(planned: Planned, name: str, value: Value | None, actual: Value | None) -> bool:
    if name in planned.type.topics and isinstance(value, str) and isinstance(actual, str):
        return resolved_topic(value) == resolved_topic(actual)
    if value in (None, "", ()) and actual in (None, "", ()):
        return True
    return same_value(value, actual)


def _shown(value: Value | None) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:g}" if isinstance(value, float) else "unset" if value is None else str(value)


def extension(graph: Graph, shared: frozenset[str], own: Likeness, model: StageModel) -> Graph:
    """Return the nodes that a graph of the stage lacks, wired to those that it has."""
    names = {
        role: node.name
        for role, node in own.node_of.items()
        if role in shared and _serves(role, graph, own, model)
    }
    held = graph_at(own.path, model)
    assert held is not None  # noqa: S101 - whose likeness this is
    taken = {node.name for node in held.nodes}
    taken |= {prim.path.rpartition("/")[2] for prim in held.absent}
    renamed = dict(names)
    for role in graph.nodes:
        if role not in names:
            renamed[role] = free_name(role, {*taken, *renamed.values()})
    nodes = {
        renamed[role]: replace(node, role=renamed[role])
        for role, node in graph.nodes.items()
        if role not in names
    }
    wires = tuple(
        replace(
            wire,
            source=PortRef(renamed[wire.source.role], wire.source.port),
            target=PortRef(renamed[wire.target.role], wire.target.port),
        )
        for wire in graph.wires
        if wire.target.role not in names
    )
    there = [node.position[1] for node in held.nodes if node.position]
    offset = max(there, default=-_ROW) + _ROW  # below all that the graph has in the graph editor
    at = {role: (x, y + offset) for role, (x, y) in placed(nodes, wires).items()}
    return Graph(own.path, {role: replace(n, place=at[role]) for role, n in nodes.items()}, wires)


_ROW = 200.0  # units of the graph editor


def _serves(role: str, graph: Graph, own: Likeness, model: StageModel) -> bool:
    """Whether a node of a graph does what is planned for a role, with all that feeds it."""
    part = _upstream(role, graph)
    there = next(model_graph for model_graph in model.graphs if model_graph.path == own.path)
    alone = likeness(part, there, model)
    return alone.is_same and alone.node_of.get(role) is own.node_of[role]


def _upstream(role: str, graph: Graph) -> Graph:
    roles = {role}
    waiting = [role]
    while waiting:
        target = waiting.pop()
        for wire in graph.wires:
            if wire.target.role == target and wire.source.role not in roles:
                roles.add(wire.source.role)
                waiting.append(wire.source.role)
    nodes = {name: node for name, node in graph.nodes.items() if name in roles}
    wires = tuple(w for w in graph.wires if {w.source.role, w.target.role} <= roles)
    return Graph(graph.path, nodes, wires)


def graph_at(path: str, stage: StageModel) -> GraphModel | None:
    """Return the graph at a path, None without one."""
    return next((graph for graph in stage.graphs if graph.path == path), None)


def names_any(nodes: Iterable[Node], tops: Collection[str]) -> bool:
    """Whether a target of nodes is one of these prims, or below one."""
    named = {target for n in nodes for state in n.ports.values() for target in state.targets}
    return any(is_at_or_below(target, top) for target in named for top in tops)


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken: this one, or this one with a number."""
    number = 1
    free = name
    while free in taken:
        free = f"{name}_{number:02}"
        number += 1
    return free
