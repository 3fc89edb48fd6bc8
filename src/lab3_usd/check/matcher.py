"""Matches the nodes of a graph to the roles of its spec so that the fewest differences remain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lab3_usd.check.assignment import Pairs, assign
from lab3_usd.check.met import source_path
from lab3_usd.check.model import GraphModel, Node
from lab3_usd.check.subject import Roles
from lab3_usd.spec.spec import GraphSpec


def match(spec: GraphSpec, graph: GraphModel | None) -> Roles:
    """Assign the graph's nodes to roles of the same type.

    Among all assignments the one is taken that leaves the fewest differences in wires, values
    and targets; then the fewest in names, then in values alone; then the first in the order of
    roles and paths. Prim names decide nothing else, the order of the nodes decides nothing.
    """
    if graph is None:
        return Roles(None, dict.fromkeys(spec.nodes), {})
    return cast(spec, graph, assign(spec, graph), graph.nodes)


def cast(spec: GraphSpec, graph: GraphModel, node_of: Pairs, offered: Sequence[Node]) -> Roles:
    """Return the roles as assigned, and what the other nodes are; `offered` may be extra nodes."""
    taken = {node.path for node in node_of.values() if node is not None}
    others = sorted(
        (node for node in graph.nodes if node.path not in taken), key=lambda node: node.path
    )
    free = {node.path for node in offered}
    extra = [node for node in others if node.path in free]
    retyped = _retyped(spec, node_of, extra)
    used = {node.path for node in retyped.values()}
    return Roles(
        graph=graph,
        node_of=node_of,
        role_of={node.path: role for role, node in node_of.items() if node is not None},
        stand_ins=_stand_ins(node_of, [node for node in others if node.path not in used]),
        extra=tuple(node for node in extra if node.path not in used),
        retyped=retyped,
    )


def _stand_ins(node_of: Mapping[str, Node | None], extra: Sequence[Node]) -> dict[str, str]:
    """Map each extra node that does the same as a matched one to that one's role."""
    found = {}
    for node in extra:
        for role, matched in node_of.items():
            if matched is not None and node.type is matched.type and _same_inputs(node, matched):
                found[node.path] = role
                break
    return found


def _same_inputs(one: Node, other: Node) -> bool:
    """Whether two nodes of one type compute the same: values, targets and sources alike."""
    if one.type is None:
        return False
    for port in one.type.ports.values():
        if port.is_source and not port.output_only:
            continue
        alike = one.value(port.name) == other.value(port.name)
        alike = alike and one.targets(port.name) == other.targets(port.name)
        if not alike or one.sources(port.name) != other.sources(port.name):
            return False
    return True


def _retyped(spec: GraphSpec, pairs: Pairs, extra: Sequence[Node]) -> dict[str, Node]:
    """Pair each role without a node with the node of another type that stands in its place.

    Its place is known by the wires that run to and from it, or by its name. A node that talks to
    ROS 2 does a job of its own and stands in nobody's place.
    """
    extra = [node for node in extra if node.type is None or not node.type.role]
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
