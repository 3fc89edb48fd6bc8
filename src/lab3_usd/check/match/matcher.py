"""Matches the nodes of a graph to the roles of its spec so that the fewest differences remain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lab3_usd.check.match.assignment import Pairs, assign
from lab3_usd.check.match.conformance import source_path
from lab3_usd.check.match.result import Roles
from lab3_usd.check.ros.running import effective_value
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.catalog import INPUT, Port, Scripts
from lab3_usd.spec.graph import GraphSpec

NO_SCRIPTS = Scripts((), ())


def match(spec: GraphSpec, graph: GraphModel | None, scripts: Scripts = NO_SCRIPTS) -> Roles:
    """Assign the graph's nodes to roles of the same type.

    Among all assignments the one is taken that leaves the fewest differences in wires, values
    and targets; then the fewest in names, then in values alone; then the first in the order of
    roles and paths. Prim names decide nothing else, the order of the nodes decides nothing. A node
    that runs one of `scripts` stands in no other's place.
    """
    if graph is None:
        return Roles(None, dict.fromkeys(spec.nodes), {})
    return complete_roles(spec, graph, assign(spec, graph), graph.nodes, scripts)


def complete_roles(
    spec: GraphSpec,
    graph: GraphModel,
    node_of: Pairs,
    offered: Sequence[Node],
    scripts: Scripts,
) -> Roles:
    """Return the roles as assigned, and what the other nodes are; `offered` may be extra nodes."""
    taken = {node.path for node in node_of.values() if node is not None}
    others = sorted(
        (node for node in graph.nodes if node.path not in taken), key=lambda node: node.path
    )
    free = {node.path for node in offered}
    extra = [node for node in others if node.path in free]
    retyped = _retyped(spec, node_of, [node for node in extra if not _has_a_job(node, scripts)])
    used = {node.path for node in retyped.values()}
    return Roles(
        graph=graph,
        node_of=node_of,
        role_of={node.path: role for role, node in node_of.items() if node is not None},
        equivalents=_stand_ins(
            node_of,
            [node for node in others if node.path not in used],
            {node.path: node for node in graph.nodes},
        ),
        extra=tuple(node for node in extra if node.path not in used),
        retyped=retyped,
    )


def _stand_ins(pairs: Pairs, others: Sequence[Node], nodes: Mapping[str, Node]) -> dict[str, str]:
    """Map each other node that does the same as a matched one to that one's role.

    What is wired from a stand-in counts as wired from the node that it stands in for.
    """
    found: dict[str, str] = {}
    before = -1
    while len(found) > before:
        before = len(found)
        for node in others:
            role = None if node.path in found else _same_as(node, pairs, found, nodes)
            if role is not None:
                found[node.path] = role
    return found


def _same_as(
    node: Node, pairs: Pairs, found: Mapping[str, str], nodes: Mapping[str, Node]
) -> str | None:
    """Return the role of the node's type that is played by one with the same effective inputs."""
    players = {path: matched for path, role in found.items() if (matched := pairs[role])}
    for role, matched in pairs.items():
        if matched is not None and node.type is not None and node.type is matched.type:
            names = {port.name for port in node.type.ports.values() if not _is_output(port)}
            names |= {name for each in (node, matched) for name in each.ports if _grows(each, name)}
            if all(_same_input(node, matched, name, players, nodes) for name in names):
                return role
    return None


def _is_output(port: Port) -> bool:
    return port.is_source and not port.output_only


def _grows(node: Node, name: str) -> bool:
    return name.startswith(INPUT) and node.type is not None and node.type.port(name) is not None


def _same_input(
    one: Node, other: Node, port: str, players: Mapping[str, Node], nodes: Mapping[str, Node]
) -> bool:
    """Whether the same reaches two inputs: over wires, as a value, as targets."""
    sources = [_played(each.sources(port), players) for each in (one, other)]
    if any(sources) and sources[0] == sources[1]:
        return True
    if one.targets(port) != other.targets(port):
        return False
    values = [effective_value(each, port, nodes) for each in (one, other)]
    is_known = values[0] is not None or not any(sources)
    return is_known and values[0] == values[1]


def _played(sources: Sequence[str], players: Mapping[str, Node]) -> list[str]:
    """Return the sources with the node that plays the role in the place of one that stands in."""
    ends = (source.rpartition(".") for source in sources)
    return sorted(
        f"{players[path].path}.{port}" if path in players else f"{path}.{port}"
        for path, _, port in ends
    )


def _has_a_job(node: Node, scripts: Scripts) -> bool:
    """Whether the node talks to ROS 2 or runs a script, and so stands in nobody's place."""
    return scripts.runs(node.type_name) or (node.type is not None and bool(node.type.role))


def _retyped(spec: GraphSpec, pairs: Pairs, extra: Sequence[Node]) -> dict[str, Node]:
    """Pair each role without a node with the node of another type that stands in its place.

    Its place is known by the wires that run to and from it, or by its name.
    """
    found: dict[str, Node] = {}
    for role in spec.nodes:
        if pairs[role] is not None:
            continue
        offers = (
            sorted(
                (-_overlap(spec, pairs, role, node), node.path, node)
                for node in extra
                if node.path not in {each.path for each in found.values()}
            )
            if extra
            else []
        )
        if offers and offers[0][0] < 0:
            found[role] = offers[0][2]
    return found


def _overlap(spec: GraphSpec, pairs: Pairs, role: str, node: Node) -> int:
    """Count the wires of `role` that this node has to the right neighbours."""
    shared = int(node.name == role)
    for wire in spec.wires:
        other = pairs[wire.target.role] if wire.source.role == role else None
        if other is not None:
            sources = other.sources(wire.target.port)
            shared += any(source.startswith(f"{node.path}.") for source in sources)
        other = pairs[wire.source.role] if wire.target.role == role else None
        if other is not None:
            shared += source_path(other, wire) in node.sources(wire.target.port)
    return shared
