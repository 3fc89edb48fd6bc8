"""Matches the nodes of a graph to the roles of its spec so that the fewest differences remain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct, field

from lab3_usd.check.match.conformance import setting_matches, source_path, target_matches
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.behaviour import Scripts
from lab3_usd.isaac.node_types import INPUT
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


def best_roles(spec: GraphSpec, graph: GraphModel) -> Pairs:
    """Return the node of each role, None where the graph has too few of its type.

    Of all assignments that leave as few roles as possible without a node, the one with the
    fewest differences is taken; ties go to names, then values, then the order of roles and paths.
    """
    by_type: dict[str, list[Node]] = {}
    for node in sorted(graph.nodes, key=lambda node: node.path):
        if node.type is not None:
            by_type.setdefault(node.type.type, []).append(node)
    nodes = {role: by_type.get(demand.type.type, []) for role, demand in spec.nodes.items()}
    pairs: Pairs = {}
    spare: dict[str, int] = {}
    for kind, roles in spec.roles_by_type.items():
        candidates = by_type.get(kind, [])
        spare[kind] = len(roles) - len(candidates)
        if len(roles) == 1 and len(candidates) <= 1:
            pairs[roles[0]] = candidates[0] if candidates else None
    # Roles with few candidates come first: they say most about the others.
    order = sorted(
        (role for role in spec.nodes if role not in pairs), key=lambda role: len(nodes[role])
    )
    own = {
        (role, node.path): _own_cost(spec.nodes[role], node)
        for role in order
        for node in nodes[role]
    }
    least = [(0, 0, 0)]
    for role in reversed(order):
        costs = [own[role, node.path] for node in nodes[role]]
        if costs and spare[spec.nodes[role].type.type] <= 0:
            unmet, names, values = zip(*costs, strict=True)
            least.append(_sum(least[-1], (min(unmet), min(names), min(values))))
        else:
            least.append(least[-1])
    # Each wire is filed under the later one of its two roles, unless neither is in the order.
    depth = {role: number for number, role in enumerate(order)}
    wires: dict[str, list[Wire]] = {role: [] for role in order}
    for wire in spec.wires:
        ends = [role for role in (wire.source.role, wire.target.role) if role in depth]
        if ends:
            wires[max(ends, key=depth.__getitem__)].append(wire)
    search = _Search(spec, order, nodes, spare, wires, own, least[::-1], pairs)
    _descend(search, 0, (0, 0, 0))
    best = search.best or {}
    return {role: best.get(role) for role in spec.nodes}


def _own_cost(spec: NodeSpec, node: Node) -> _Cost:
    """Count what differs between a role and a node, its wires left out."""
    unmet = sum(
        not setting_matches(node, setting, node.value(setting.port)) for setting in spec.settings
    )
    unmet += sum(not target_matches(node, target) for target in spec.targets)
    return unmet, int(node.name != spec.role), unmet


def _sum(cost: _Cost, added: _Cost) -> _Cost:
    return cost[0] + added[0], cost[1] + added[1], cost[2] + added[2]


def _descend(search: _Search, depth: int, cost: _Cost) -> None:
    if search.best is not None and (
        search.steps <= 0 or _sum(cost, search.least[depth]) >= search.cost
    ):
        return  # the roles that remain cannot improve on the best
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
    return complete_roles(spec, graph, best_roles(spec, graph), graph.nodes, scripts)


def complete_roles(
    spec: GraphSpec,
    graph: GraphModel,
    node_of: Pairs,
    offered: Sequence[Node],
    scripts: Scripts,
) -> Roles:
    """Return the roles as assigned, and what the other nodes are; `offered` may be extra nodes."""
    role_of = {node.path: role for role, node in node_of.items() if node is not None}
    unmatched = sorted(
        (node for node in graph.nodes if node.path not in role_of), key=lambda node: node.path
    )
    free = {node.path for node in offered}
    extra = [node for node in unmatched if node.path in free]
    # A node that talks to ROS 2 or runs a script does not stand in another's place.
    idle = [
        node
        for node in extra
        if not scripts.runs(node.type_name) and (node.type is None or not node.type.role)
    ]
    retyped = _retyped(spec, node_of, idle)
    used = {node.path for node in retyped.values()}
    return Roles(
        graph=graph,
        node_of=node_of,
        role_of=role_of,
        equivalents=_stand_ins(
            node_of,
            [node for node in unmatched if node.path not in used],
            {node.path: node for node in graph.nodes},
        ),
        extra=tuple(node for node in extra if node.path not in used),
        retyped=retyped,
    )


def _stand_ins(
    pairs: Pairs, unmatched: Sequence[Node], nodes: Mapping[str, Node]
) -> dict[str, str]:
    """Map each unmatched node that does the same as a matched one to that one's role.

    A wire from a stand-in counts as a wire from the matched node.
    """
    role_of: dict[str, str] = {}
    before = -1
    while len(role_of) > before:
        before = len(role_of)
        for node in unmatched:
            role = None if node.path in role_of else _same_as(node, pairs, role_of, nodes)
            if role is not None:
                role_of[node.path] = role
    return role_of


def _same_as(
    node: Node, pairs: Pairs, role_of: Mapping[str, str], nodes: Mapping[str, Node]
) -> str | None:
    """Return the role of the node's type that is played by one with the same effective inputs."""
    players = {path: matched for path, role in role_of.items() if (matched := pairs[role])}
    for role, matched in pairs.items():
        if matched is not None and node.type is not None and node.type is matched.type:
            names = {
                port.name
                for port in node.type.ports.values()
                if not port.is_source or port.output_only
            }
            # Inputs that the node has beyond those of its type, such as the items of an array.
            names |= {
                name
                for name in (*node.ports, *matched.ports)
                if name.startswith(INPUT) and node.type.port(name) is not None
            }
            if all(_same_input(node, matched, name, players, nodes) for name in names):
                return role
    return None


def _same_input(
    node: Node, matched: Node, port: str, players: Mapping[str, Node], nodes: Mapping[str, Node]
) -> bool:
    """Whether the same reaches two inputs: over wires, as a value, as targets."""
    # The node that plays the role takes the place of the one that stands in for it.
    ends = [[path.rpartition(".") for path in end.sources(port)] for end in (node, matched)]
    sources = [
        sorted(
            f"{players[path].path}.{output}" if path in players else f"{path}.{output}"
            for path, _, output in paths
        )
        for paths in ends
    ]
    if any(sources) and sources[0] == sources[1]:
        return True
    if node.targets(port) != matched.targets(port):
        return False
    values = [effective_value(end, port, nodes) for end in (node, matched)]
    is_known = values[0] is not None or not any(sources)
    return is_known and values[0] == values[1]


def _retyped(spec: GraphSpec, pairs: Pairs, extra: Sequence[Node]) -> dict[str, Node]:
    """Pair each role without a node with the node of another type that stands in its place.

    Its place is known by the wires that run to and from it, or by its name.
    """
    retyped: dict[str, Node] = {}
    for role in spec.nodes:
        if pairs[role] is None and extra:
            taken = {node.path for node in retyped.values()}
            offers = sorted(
                (-_overlap(spec, pairs, role, node), node.path, node)
                for node in extra
                if node.path not in taken
            )
            if offers and offers[0][0] < 0:
                retyped[role] = offers[0][2]
    return retyped


def _overlap(spec: GraphSpec, pairs: Pairs, role: str, node: Node) -> int:
    """Count the wires of `role` that this node has to the right neighbours."""
    shared = int(node.name == role)
    for wire in spec.wires:
        target = pairs[wire.target.role] if wire.source.role == role else None
        if target is not None:
            sources = target.sources(wire.target.port)
            shared += any(source.startswith(f"{node.path}.") for source in sources)
        source_node = pairs[wire.source.role] if wire.target.role == role else None
        if source_node is not None:
            shared += source_path(source_node, wire) in node.sources(wire.target.port)
    return shared
