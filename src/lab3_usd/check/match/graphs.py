"""Which graph of a stage is which graph of the lab; several of them may have been built in one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.match.roles import NO_SCRIPTS, Pairs, assign, complete_roles, match
from lab3_usd.check.match.subject import Roles
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.spec.catalog import Scripts
from lab3_usd.spec.graph import GraphSpec, NodeSpec

LEAST_SHARE = 0.5  # of a spec's nodes that a graph must hold to be recognised by its content


def find_graphs(specs: Mapping[str, GraphSpec], stage: StageModel) -> dict[str, GraphModel | None]:
    """Return the graph of the stage for each graph of the spec, None where there is none.

    A live graph at the right path is taken as it is, unless it is empty and another one fits, or
    holds nothing of this spec and what another one asks for. Other specs are given the remaining
    graph whose node types fit best, as long as it holds half of what the spec asks for.
    """
    by_path = {graph.path: graph for graph in stage.graphs if graph.active}
    filled = {graph.path: graph for graph in by_path.values() if graph.nodes}
    found = {
        name: None if _is_another(name, filled.get(spec.path), specs) else filled.get(spec.path)
        for name, spec in specs.items()
    }
    taken = {graph.path for graph in found.values() if graph is not None}
    free = [graph for graph in by_path.values() if graph.path not in taken]
    offers = sorted(
        (-_likeness(specs[name], graph), order, graph.path, name)
        for order, (name, graph_found) in enumerate(found.items())
        if graph_found is None
        for graph in free
    )
    for likeness, _, path, name in offers:
        if found[name] is None and path not in taken and likeness < 0:
            found[name] = by_path[path]
            taken.add(path)
    left = {path: graph for path, graph in by_path.items() if path not in taken}
    return {name: graph or left.get(specs[name].path) for name, graph in found.items()}


def _is_another(name: str, graph: GraphModel | None, specs: Mapping[str, GraphSpec]) -> bool:
    """Whether a graph does nothing of what this spec asks for, and what another one does."""
    if graph is None or _speaks_of(specs[name], graph):
        return False
    return any(_likeness(spec, graph) > 0 for spec in specs.values())


def _speaks_of(spec: GraphSpec, graph: GraphModel) -> bool:
    """Whether the graph holds a node that only this spec asks for."""
    telling = spec.telling_types
    return any(node.type is not None and node.type.type in telling for node in graph.nodes)


def _likeness(spec: GraphSpec, graph: GraphModel) -> float:
    """Return how much of spec and graph is the same, by node types: 1 for all of both, else less.

    It is 0 for a graph that holds too little of the spec. Nodes that every graph has (tick,
    context, time) are worth little on their own: a graph must hold something that only this spec
    asks for.
    """
    asked = Counter(node.type.type for node in spec.nodes.values())
    held = Counter(node.type.type for node in graph.nodes if node.type is not None)
    shared = sum((asked & held).values())
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

    One that is nowhere by itself may be part of another: its roles are played by nodes that the
    other one does not ask for, and by nodes that both ask for alike (tick, context, time).
    """
    graphs = find_graphs(specs, stage)
    found = {name: match(spec, graphs[name], scripts) for name, spec in specs.items()}
    hosts = [
        _Host(roles.graph, {name: dict(roles.node_of)})
        for name, roles in found.items()
        if roles.graph is not None and roles.graph.nodes
    ]
    for name, spec in specs.items():
        graph = graphs[name]
        if graph is None or not graph.nodes:
            offers = [(pairs, host) for host in hosts if (pairs := _inside(spec, host, specs))]
            if offers:
                pairs, host = max(offers, key=lambda offer: _count(offer[0]))
                host.held[name] = pairs
    for host in hosts:
        if len(host.held) > 1:
            found |= _shared_out(specs, host, scripts)
    return found


def _count(pairs: Pairs) -> int:
    return sum(node is not None for node in pairs.values())


def _users(host: _Host, specs: Specs) -> dict[str, list[NodeSpec]]:
    """Map each node that plays roles to them."""
    users: dict[str, list[NodeSpec]] = {}
    for name, pairs in host.held.items():
        for role, node in pairs.items():
            if node is not None:
                users.setdefault(node.path, []).append(specs[name].nodes[role])
    return users


def _inside(spec: GraphSpec, host: _Host, specs: Specs) -> Pairs | None:
    """Return who plays the roles of `spec` in a graph that holds others, None where it does not.

    A node that others ask for as well counts where it is wired to one that only `spec` asks for.
    """
    users = _users(host, specs)
    free = [node for node in host.graph.nodes if node.path not in users]
    if not any(node.type is not None and node.type.type in spec.telling_types for node in free):
        return None
    usable = [node for node in host.graph.nodes if _is_free_for(spec, node, users)]
    pairs = assign(spec, replace(host.graph, nodes=tuple(usable)))
    players = [node for node in pairs.values() if node is not None]
    own = {node.path for node in players if node.path not in users}
    kept = [node for node in players if node.path in own or _touches(node, own, pairs)]
    return pairs if own and len(kept) >= LEAST_SHARE * len(spec.nodes) else None


def _is_free_for(spec: GraphSpec, node: Node, users: Mapping[str, list[NodeSpec]]) -> bool:
    """Whether nobody else needs the node, or somebody who asks the same of it."""
    kinds = [each for each in spec.nodes.values() if each.type is node.type]
    others = users.get(node.path, [])
    return not others or any(_alike(kind, other) for kind in kinds for other in others)


def _alike(one: NodeSpec, other: NodeSpec) -> bool:
    asked = [
        {(setting.port, setting.value) for setting in spec.settings}
        | {(target.port, target.prims) for target in spec.targets}
        for spec in (one, other)
    ]
    return one.type is other.type and asked[0] == asked[1]


def _touches(node: Node, own: set[str], pairs: Pairs) -> bool:
    """Whether a wire joins the node to one of those in `own`."""
    if any(_leads_from(node, path) for path in own):
        return True
    mine = (pair for pair in pairs.values() if pair is not None and pair.path in own)
    return any(_leads_from(each, node.path) for each in mine)


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
    found: dict[str, Roles] = {}
    for name in names:
        roles = complete_roles(specs[name], host.graph, host.held[name], spare, scripts)
        spare = []  # what is left over is reported once
        found[name] = replace(roles, merged_graphs=names)
    return found
