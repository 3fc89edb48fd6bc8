"""Matches the nodes of a graph to the roles of its spec so that the fewest differences remain."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations, product

from lab3_usd.check.met import setting_met, source_path, target_met
from lab3_usd.check.model import GraphModel, Node
from lab3_usd.check.subject import Roles
from lab3_usd.spec.spec import GraphSpec, NodeSpec

# More combinations than this are only found in files made to be slow; they are matched type by
# type instead, which is exact wherever the types do not depend on each other.
MOST_COMBINATIONS = 5000

_Pairs = dict[str, Node | None]


def match(spec: GraphSpec, graph: GraphModel | None) -> Roles:
    """Assign the graph's nodes to roles of the same type.

    Among all assignments the one is taken that leaves the fewest differences in wires, values
    and targets; then the fewest in names, then in values alone; then the first in the order of
    roles and paths. Prim names decide nothing else.
    """
    if graph is None:
        return Roles(None, dict.fromkeys(spec.nodes), {})
    best = _best_pairs(spec, graph)
    taken = {node.path for node in best.values() if node is not None}
    extra = [node for node in graph.nodes if node.path not in taken]
    retyped = _retyped(spec, best, extra)
    node_of = {role: best[role] for role in spec.nodes}
    used = {node.path for node in retyped.values()}
    extra = [node for node in extra if node.path not in used]
    return Roles(
        graph=graph,
        node_of=node_of,
        role_of={node.path: role for role, node in node_of.items() if node is not None},
        stand_ins=_stand_ins(node_of, extra),
        extra=tuple(extra),
        retyped=retyped,
    )


def _best_pairs(spec: GraphSpec, graph: GraphModel) -> _Pairs:
    groups = _groups(spec, graph)
    fixed: _Pairs = dict.fromkeys(spec.nodes)
    open_groups = []
    for roles, nodes in groups:
        if len(roles) == 1 and len(nodes) <= 1:
            fixed[roles[0]] = nodes[0] if nodes else None
        else:
            open_groups.append((roles, nodes))
    if math.prod(_count(roles, nodes) for roles, nodes in open_groups) <= MOST_COMBINATIONS:
        return _exact(spec, fixed, open_groups)
    for roles, nodes in open_groups:
        fixed.update(_greedy(spec, fixed, roles, nodes))
    return fixed


_Group = tuple[list[str], list[Node]]


def _groups(spec: GraphSpec, graph: GraphModel) -> list[_Group]:
    """Put the roles and the nodes of each type together."""
    roles: dict[str, list[str]] = {}
    for role, node_spec in spec.nodes.items():
        roles.setdefault(node_spec.type.type, []).append(role)
    nodes: dict[str, list[Node]] = {}
    for node in graph.nodes:
        if node.type is not None:
            nodes.setdefault(node.type.type, []).append(node)
    return [(names, nodes.get(kind, [])) for kind, names in roles.items()]


def _count(roles: list[str], nodes: list[Node]) -> int:
    larger, smaller = max(len(roles), len(nodes)), min(len(roles), len(nodes))
    return math.perm(larger, smaller)


def _assignments(roles: list[str], nodes: list[Node]) -> Iterator[_Pairs]:
    """Yield every way to give the roles different nodes, leaving as few as possible without."""
    if len(nodes) >= len(roles):
        for chosen in permutations(nodes, len(roles)):
            yield dict(zip(roles, chosen, strict=True))
        return
    for filled in permutations(roles, len(nodes)):
        pairs: _Pairs = dict.fromkeys(roles)
        pairs.update(zip(filled, nodes, strict=True))
        yield pairs


def _exact(spec: GraphSpec, fixed: _Pairs, groups: list[_Group]) -> _Pairs:
    best, least = fixed, None
    for combination in product(*(list(_assignments(*group)) for group in groups)):
        pairs = dict(fixed)
        for part in combination:
            pairs.update(part)
        cost = _cost(spec, pairs)
        if least is None or cost < least:
            best, least = pairs, cost
    return best


def _greedy(spec: GraphSpec, fixed: _Pairs, roles: list[str], nodes: list[Node]) -> _Pairs:
    """Give each role in turn the node that differs least, all others as they are so far."""
    pairs: _Pairs = {}
    left = list(nodes)
    for role in roles:
        if not left:
            break
        best = min(left, key=lambda node: _cost(spec, {**fixed, **pairs, role: node}))
        pairs[role] = best
        left.remove(best)
    return pairs


def _cost(spec: GraphSpec, pairs: Mapping[str, Node | None]) -> tuple[int, int, int]:
    values = sum(
        _differences(node_spec, node)
        for role, node_spec in spec.nodes.items()
        for node in [pairs[role]]
        if node is not None
    )
    names = sum(node is not None and node.name != role for role, node in pairs.items())
    return values + _wires_unmet(spec, pairs), names, values


def _differences(spec: NodeSpec, node: Node) -> int:
    unmet = sum(not setting_met(node, each, node.value(each.port)) for each in spec.settings)
    return unmet + sum(not target_met(node, target) for target in spec.targets)


def _wires_unmet(spec: GraphSpec, pairs: Mapping[str, Node | None]) -> int:
    unmet = 0
    for wire in spec.wires:
        source, target = pairs[wire.source.role], pairs[wire.target.role]
        if source is None or target is None:
            continue
        unmet += source_path(source, wire) not in target.sources(wire.target.port)
    return unmet


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


def _retyped(spec: GraphSpec, pairs: _Pairs, extra: Sequence[Node]) -> dict[str, Node]:
    """Pair each role without a node with the node of another type that stands in its place.

    Its place is known by the wires that run to and from it, or by its name.
    """
    found: dict[str, Node] = {}
    for role in spec.nodes:
        if pairs[role] is not None:
            continue
        offers = sorted(
            (-_overlap(spec, pairs, role, node), node.path, node)
            for node in extra
            if node.path not in {each.path for each in found.values()}
        ) if extra else []
        if offers and offers[0][0] < 0:
            found[role] = offers[0][2]
    return found


def _overlap(spec: GraphSpec, pairs: _Pairs, role: str, node: Node) -> int:
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
