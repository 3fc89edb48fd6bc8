"""Which nodes compute once the timeline plays, and what value reaches an input."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache

from lab3_usd.check.model import GraphModel, Node, StageModel
from lab3_usd.spec.catalog import INPUT, Value
from lab3_usd.spec.spec import Lab

ENABLED = "inputs:enabled"
Nodes = Mapping[str, Node]


@lru_cache(maxsize=1)  # every rule of one stage asks for the same
def live_nodes(stage: StageModel, lab: Lab) -> dict[str, Node]:
    """Return the nodes of all active graphs by path, leaving out what the application made."""
    return {
        node.path: node
        for graph in stage.graphs
        if graph.active and not _is_ignored(graph.path, lab)
        for node in graph.nodes
    }


def _is_ignored(path: str, lab: Lab) -> bool:
    return any(f"{path}/".startswith(f"{top}/") for top in lab.catalog.graph.ignored_below)


@lru_cache(maxsize=1)  # every rule of one stage asks for the same
def running_nodes(stage: StageModel, lab: Lab) -> dict[str, Node]:
    """Return the nodes that an event reaches over execution wires, by path.

    A graph that the application does not evaluate while it plays runs none of its nodes, and a
    node that is switched off passes no signal on.
    """
    live = live_nodes(stage, lab)
    evaluated = {
        node.path: node
        for graph in stage.graphs
        if _is_evaluated(graph, lab)
        for node in graph.nodes
        if node.path in live
    }
    events = {lab.catalog.modern(name) for name in lab.catalog.events}
    followers = _followers(evaluated)
    ahead = [
        path for path, node in evaluated.items() if lab.catalog.modern(node.type_name) in events
    ]
    reached = set(ahead)
    while ahead:
        path = ahead.pop()
        if not is_switched_on(live[path], live):
            continue
        new = [follower for follower in followers.get(path, ()) if follower not in reached]
        reached.update(new)
        ahead.extend(new)
    return {path: node for path, node in evaluated.items() if path in reached}


def _is_evaluated(graph: GraphModel, lab: Lab) -> bool:
    """Whether the graph runs with the timeline; an attribute that is absent is as good."""
    return graph.active and all(
        graph.attributes.get(attribute.name, attribute.value) in attribute.accepted
        for attribute in lab.catalog.graph.attributes
        if attribute.required
    )


def _followers(nodes: Nodes) -> dict[str, list[str]]:
    """Map each node to those that its execution outputs trigger."""
    followers: dict[str, list[str]] = {}
    for node in nodes.values():
        for port in signal_inputs(node):
            for source, _ in live_sources(node, port, nodes):
                followers.setdefault(source.path, []).append(node.path)
    return followers


def signal_inputs(node: Node) -> Iterator[str]:
    """Yield the execution inputs; every input where the type is unknown."""
    for name in node.ports if node.type is None else node.type.ports:
        if name.startswith(INPUT) and (node.type is None or node.type.ports[name].is_execution):
            yield name


def is_switched_on(node: Node, live: Nodes) -> bool:
    """Whether the node's own switch is on, or it has none."""
    return effective(node, ENABLED, live) is not False


def live_sources(node: Node, port: str, live: Nodes) -> Iterator[tuple[Node, str]]:
    """Yield the nodes and ports that really feed an input: the application drops dead wires."""
    for path in node.sources(port):
        prim, _, source_port = path.rpartition(".")
        source = live.get(prim)
        if source is not None and source.has_port(source_port):
            yield source, source_port


def effective(node: Node, port: str, live: Nodes, depth: int = 8) -> Value | None:
    """Return the value that reaches an input; None where a wire brings one nobody can know.

    A wire from a constant (an input drawn as an output) brings that constant's value. `depth`
    ends the search where constants feed each other in a ring.
    """
    wired = list(live_sources(node, port, live))
    if not wired:
        return node.value(port)
    source, source_port = wired[0]
    known = None if source.type is None else source.type.port(source_port)
    if len(wired) > 1 or known is None or not known.output_only or not depth:
        return None
    return effective(source, source_port, live, depth - 1)
