"""Which graph of a stage is which graph of the lab; several of them may have been built in one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.match.roles import NO_SCRIPTS, Pairs, best_roles, complete_roles, match
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.isaac.behaviour import Scripts
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.spec.graph import GraphSpec, NodeSpec

LEAST_SHARE = 0.5  # of a spec's nodes that a graph must hold to be recognised by its content


def find_graphs(specs: Mapping[str, GraphSpec], stage: StageModel) -> dict[str, GraphModel | None]:
    """Return the graph of the stage for each graph of the spec, None where there is none.

    A live graph at the right path matches, unless it is empty and another one fits, or holds only
    nodes of another spec. Each other spec gets the remaining graph whose node types fit best, if
    that has at least half of the spec's nodes.
    """
    by_path = {graph.path: graph for graph in stage.graphs if graph.active}
    filled = {graph.path: graph for graph in by_path.values() if graph.nodes}
    graphs = {
        name: None if _is_another(name, filled.get(spec.path), specs) else filled.get(spec.path)
        for name, spec in specs.items()
    }
    taken = {graph.path for graph in graphs.values() if graph is not None}
    free = [graph for graph in by_path.values() if graph.path not in taken]
    offers = sorted(
        (-_similarity(specs[name], graph), order, graph.path, name)
        for order, (name, graph_at_path) in enumerate(graphs.items())
        if graph_at_path is None
        for graph in free
    )
    for similarity, _, path, name in offers:
        if graphs[name] is None and path not in taken and similarity < 0:
            graphs[name] = by_path[path]
            taken.add(path)
    left = {path: graph for path, graph in by_path.items() if path not in taken}
    return {name: graph or left.get(specs[name].path) for name, graph in graphs.items()}


def _is_another(name: str, graph: GraphModel | None, specs: Mapping[str, GraphSpec]) -> bool:
    """Whether a graph does nothing of what this spec asks for, and what another one does."""
    if graph is None:
        return False
    telling = specs[name].telling_types
    if any(node.type is not None and node.type.type in telling for node in graph.nodes):
        return False
    return any(_similarity(spec, graph) > 0 for spec in specs.values())


def _similarity(spec: GraphSpec, graph: GraphModel) -> float:
    """Return how much of spec and graph is the same, by node types: 1 for all of both, else less.

    It is 0 for a graph that holds too little of the spec. Nodes that every graph has (tick,
    context, time) are worth little on their own: a graph must hold something that only this spec
    asks for.
    """
    required = Counter(node.type.type for node in spec.nodes.values())
    held = Counter(node.type.type for node in graph.nodes if node.type is not None)
    shared = sum((required & held).values())
    if not spec.telling_types & set(held) or shared < LEAST_SHARE * len(spec.nodes):
        return 0.0
    return 2 * shared / (len(spec.nodes) + len(graph.nodes))


Specs = Mapping[str, GraphSpec]


class _Host(Struct, frozen=True):
    """A graph of the stage, and the graphs of the lab that it holds with who plays their roles."""

    graph: GraphModel
    held: dict[str, Pairs]


def match_all(specs: Specs, stage: StageModel, scripts: Scripts = NO_SCRIPTS) -> dict[str, Roles]:
    """Find and match every graph of the lab.

    A graph that is missing may be part of another one. Then its roles are played by nodes that the
    other spec does not have, and by nodes that both have in common (tick, context, time).
    """
    graphs = find_graphs(specs, stage)
    matched = {name: match(spec, graphs[name], scripts) for name, spec in specs.items()}
    hosts = [
        _Host(roles.graph, {name: dict(roles.node_of)})
        for name, roles in matched.items()
        if roles.graph is not None and roles.graph.nodes
    ]
    for name, spec in specs.items():
        graph = graphs[name]
        if graph is None or not graph.nodes:
            offers = [(pairs, host) for host in hosts if (pairs := _inside(spec, host, specs))]
            if offers:
                pairs, host = max(offers, key=lambda offer: sum(map(bool, offer[0].values())))
                host.held[name] = pairs
    for host in hosts:
        if len(host.held) > 1:
            matched |= _shared_out(specs, host, scripts)
    return matched


def with_literals(spec: GraphSpec, roles: Roles) -> tuple[GraphSpec, Roles]:
    """Return a spec and its roles without the literal nodes whose values are typed in the stage.

    Their values are asked of the inputs where their wires would end.
    """
    typed = {name for name in spec.nodes if _is_typed(name, spec, roles)}
    if not typed:
        return spec, roles
    left = {name: node for name, node in roles.node_of.items() if name not in typed}
    return spec.with_literals(typed), replace(roles, node_of=left)


def _is_typed(role: str, spec: GraphSpec, roles: Roles) -> bool:
    """Whether a role has no node, and each input that it feeds has a value of its own."""
    if not spec.nodes[role].literal or roles.node_of[role] is not None:
        return False
    fed = [wire.target for wire in spec.wires if wire.source.role == role]
    ends = [(roles.node_of[end.role], end.port) for end in fed]
    states = [node.ports.get(port) for node, port in ends if node is not None]
    return len(ends) == len(states) > 0 and all(
        state is not None and state.value is not None and not state.sources for state in states
    )


def _inside(spec: GraphSpec, host: _Host, specs: Specs) -> Pairs | None:
    """Return the nodes that play the roles of `spec` inside the graph of others, None without any.

    A node that other specs have too counts if it is wired to a node that only `spec` has.
    """
    users: dict[str, list[NodeSpec]] = {}  # the roles that each node plays
    for name, held in host.held.items():
        for role, node in held.items():
            if node is not None:
                users.setdefault(node.path, []).append(specs[name].nodes[role])
    free = [node for node in host.graph.nodes if node.path not in users]
    if not any(node.type is not None and node.type.type in spec.telling_types for node in free):
        return None
    usable = [node for node in host.graph.nodes if _is_free_for(spec, node, users)]
    pairs = best_roles(spec, replace(host.graph, nodes=tuple(usable)))
    players = [node for node in pairs.values() if node is not None]
    own = {node.path for node in players if node.path not in users}
    kept = [node for node in players if node.path in own or _touches(node, own, pairs)]
    return pairs if own and len(kept) >= LEAST_SHARE * len(spec.nodes) else None


def _is_free_for(spec: GraphSpec, node: Node, users: Mapping[str, list[NodeSpec]]) -> bool:
    """Whether no other role needs the node, or one with the same demands."""
    played = [_demands(role) for role in users.get(node.path, [])]
    return not played or any(
        _demands(role) in played for role in spec.nodes.values() if role.type is node.type
    )


def _demands(role: NodeSpec) -> tuple[object, ...]:
    settings = {(setting.port, setting.value) for setting in role.settings}
    return role.type, settings, {(target.port, target.prims) for target in role.targets}


def _touches(node: Node, own: set[str], pairs: Pairs) -> bool:
    """Whether a wire joins the node to one of those in `own`."""
    if any(_leads_from(node, path) for path in own):
        return True
    players = (player for player in pairs.values() if player is not None and player.path in own)
    return any(_leads_from(player, node.path) for player in players)


def _leads_from(node: Node, path: str) -> bool:
    return any(
        source.rpartition(".")[0] == path
        for state in node.ports.values()
        for source in state.sources
    )


def _shared_out(specs: Specs, host: _Host, scripts: Scripts) -> dict[str, Roles]:
    """Return the roles of every graph that the host holds; a node is extra where none needs it."""
    played = {n.path for pairs in host.held.values() for n in pairs.values() if n is not None}
    spare = [node for node in host.graph.nodes if node.path not in played]
    names = tuple(name for name in specs if name in host.held)
    shared: dict[str, Roles] = {}
    for name in names:
        roles = complete_roles(specs[name], host.graph, host.held[name], spare, scripts)
        spare = []  # what is left over is reported once
        shared[name] = replace(roles, merged_graphs=names)
    return shared
