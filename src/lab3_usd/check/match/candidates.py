"""Which graph of a stage is meant to be which graph of the spec."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from lab3_usd.model.stage import GraphModel, StageModel
from lab3_usd.spec.graph import GraphSpec

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
