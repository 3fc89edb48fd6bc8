"""Plans the nodes that a graph of a stage lacks, wired to those that it has."""

from __future__ import annotations

from msgspec.structs import replace

from lab3_usd.author.presence import Likeness, likeness
from lab3_usd.isaac.graph import Graph, PortRef, placed
from lab3_usd.model.stage import StageModel


def extension(graph: Graph, shared: frozenset[str], own: Likeness, model: StageModel) -> Graph:
    """Return the nodes that a graph of the stage lacks, wired to those that it has."""
    names = {
        role: node.name
        for role, node in own.node_of.items()
        if role in shared and _serves(role, graph, own, model)
    }
    there = {n.name for g in model.graphs if g.path == own.path for n in g.nodes}
    there |= {
        prim.path.rpartition("/")[2]
        for g in model.graphs
        if g.path == own.path
        for prim in g.absent
    }
    renamed = dict(names)
    for role in graph.nodes:
        if role not in names:
            renamed[role] = _free(role, {*there, *renamed.values()})
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
    places = _below(placed(nodes, wires), own, model)
    return Graph(
        own.path, {role: replace(n, place=places[role]) for role, n in nodes.items()}, wires
    )


def _below(
    places: dict[str, tuple[float, float]], own: Likeness, model: StageModel
) -> dict[str, tuple[float, float]]:
    """Return places below all that a graph has already in the graph editor."""
    graph = next(found for found in model.graphs if found.path == own.path)
    lowest = max((node.position[1] for node in graph.nodes if node.position), default=-_ROW)
    return {role: (x, y + lowest + _ROW) for role, (x, y) in places.items()}


_ROW = 200.0  # units of the graph editor


def _serves(role: str, graph: Graph, own: Likeness, model: StageModel) -> bool:
    """Whether a node of a graph does what is planned for a role, with all that feeds it."""
    part = _upstream(role, graph)
    there = next(found for found in model.graphs if found.path == own.path)
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


def _free(name: str, taken: set[str]) -> str:
    number = 1
    free = name
    while free in taken:
        free = f"{name}_{number:02}"
        number += 1
    return free
