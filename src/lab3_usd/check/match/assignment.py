"""Gives the roles of a graph spec to nodes of their type so that the fewest differences remain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from msgspec import Struct, field

from lab3_usd.check.match.conformance import setting_matches, source_path, target_matches
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.graph import GraphSpec, NodeSpec, Wire

# Steps of the search. A graph that somebody made takes some dozens; the limit only keeps files
# that were made to be slow from taking longer, and the best assignment so far is used then.
MOST_STEPS = 20_000

Pairs = dict[str, Node | None]
# Differences in wires, values and targets; in names; in values and targets alone.
_Cost = tuple[int, int, int]


class _Search(Struct):
    """A branch-and-bound search over the roles in `order`; the others have no choice.

    `nodes` holds the nodes of each role's type, `spare` how many roles of a type must stay
    without one, `wires` the wires between a role and those before it, `least` what the roles
    from each depth on cost at least.
    """

    spec: GraphSpec
    order: list[str]
    nodes: Mapping[str, list[Node]]
    spare: dict[str, int]
    wires: Mapping[str, list[Wire]]
    own: Mapping[tuple[str, str], _Cost]
    least: list[_Cost]
    pairs: Pairs = field(default_factory=dict)
    best: Pairs | None = None
    cost: _Cost = (0, 0, 0)
    steps: int = MOST_STEPS


def assign(spec: GraphSpec, graph: GraphModel) -> Pairs:
    """Return the node of each role, None where the graph has too few of its type.

    Of all assignments that leave as few roles as possible without a node, the one with the
    fewest differences is taken; ties go to names, then values, then the order of roles and paths.
    """
    search = _search(spec, graph)
    _descend(search, 0, (0, 0, 0))
    best = search.best or {}
    return {role: best.get(role) for role in spec.nodes}


def _search(spec: GraphSpec, graph: GraphModel) -> _Search:
    by_type: dict[str, list[Node]] = {}
    for node in sorted(graph.nodes, key=lambda each: each.path):
        if node.type is not None:
            by_type.setdefault(node.type.type, []).append(node)
    nodes = {role: by_type.get(each.type.type, []) for role, each in spec.nodes.items()}
    asked = Counter(each.type.type for each in spec.nodes.values())
    spare = {kind: count - len(by_type.get(kind, ())) for kind, count in asked.items()}
    pairs = {
        role: next(iter(nodes[role]), None)
        for role, each in spec.nodes.items()
        if asked[each.type.type] == 1 and len(nodes[role]) <= 1
    }
    # Roles with few candidates come first: they say most about the others.
    order = sorted(
        (role for role in spec.nodes if role not in pairs), key=lambda role: len(nodes[role])
    )
    own = {
        (role, node.path): _own(spec.nodes[role], node) for role in order for node in nodes[role]
    }
    least = [(0, 0, 0)]
    for role in reversed(order):
        stays = spare[spec.nodes[role].type.type] > 0
        offers = [] if stays else [own[role, node.path] for node in nodes[role]]
        least.append(_sum(least[-1], _floor(offers)))
    return _Search(spec, order, nodes, spare, _wires(spec, order), own, least[::-1], pairs)


def _floor(offers: list[_Cost]) -> _Cost:
    """Return what a role costs at least in each respect, whichever node plays it."""
    if not offers:
        return (0, 0, 0)
    wires, names, values = zip(*offers, strict=True)
    return min(wires), min(names), min(values)


def _wires(spec: GraphSpec, order: list[str]) -> dict[str, list[Wire]]:
    """File each wire under the later one of its two roles, unless neither is in the order."""
    depth = {role: number for number, role in enumerate(order)}
    wires: dict[str, list[Wire]] = {role: [] for role in order}
    for wire in spec.wires if order else ():
        ends = [role for role in (wire.source.role, wire.target.role) if role in depth]
        if ends:
            wires[max(ends, key=depth.__getitem__)].append(wire)
    return wires


def _own(spec: NodeSpec, node: Node) -> _Cost:
    """Count what differs between a role and a node, its wires left out."""
    unmet = sum(not setting_matches(node, each, node.value(each.port)) for each in spec.settings)
    unmet += sum(not target_matches(node, target) for target in spec.targets)
    return unmet, int(node.name != spec.role), unmet


def _sum(one: _Cost, other: _Cost) -> _Cost:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _descend(search: _Search, depth: int, cost: _Cost) -> None:
    if search.best is not None and _is_hopeless(search, depth, cost):
        return
    if depth == len(search.order):
        search.best, search.cost = dict(search.pairs), cost
        return
    role = search.order[depth]
    kind = search.spec.nodes[role].type.type
    for added, node in sorted(_offers(search, role), key=lambda offer: offer[0]):
        search.steps -= 1
        search.pairs[role] = node
        search.spare[kind] -= node is None
        _descend(search, depth + 1, _sum(cost, added))
        search.spare[kind] += node is None
        del search.pairs[role]


def _is_hopeless(search: _Search, depth: int, cost: _Cost) -> bool:
    """Whether nothing better than the best can come of the roles still open."""
    return search.steps <= 0 or _sum(cost, search.least[depth]) >= search.cost


def _offers(search: _Search, role: str) -> Iterator[tuple[_Cost, Node | None]]:
    """Yield the nodes that are free for a role with what each of them adds to the cost."""
    used = {node.path for node in search.pairs.values() if node is not None}
    for node in search.nodes[role]:
        if node.path not in used:
            unmet = sum(_is_unmet(search, wire, role, node) for wire in search.wires[role])
            yield _sum(search.own[role, node.path], (unmet, 0, 0)), node
    if search.spare[search.spec.nodes[role].type.type] > 0:
        yield (0, 0, 0), None


def _is_unmet(search: _Search, wire: Wire, role: str, node: Node) -> bool:
    source = node if wire.source.role == role else search.pairs[wire.source.role]
    target = node if wire.target.role == role else search.pairs[wire.target.role]
    if source is None or target is None:
        return False
    return source_path(source, wire) not in target.sources(wire.target.port)
