"""Graphs of a correct stage as plain data, and ways to change them without USD."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from functools import cache

from breaking import correct_stage, the_lab
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.model.finding import Finding, ordered
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.stage.read.stage_reader import read_model


@cache
def correct_model(checkpoint: str = "05") -> StageModel:
    return read_model(correct_stage(checkpoint), the_lab().platform, "stage.usda")


def graph_of(name: str) -> GraphModel:
    return next(graph for graph in correct_model().graphs if graph.name == name)


def with_graphs(*graphs: GraphModel, base: StageModel | None = None) -> StageModel:
    """The stage with these graphs in the place of those at the same paths."""
    stage = base or correct_model()
    changed = {graph.path: graph for graph in graphs}
    return replace(stage, graphs=tuple(changed.get(each.path, each) for each in stage.graphs))


def judged_model(stage: StageModel, checkpoint: str = "05") -> RuleResults:
    return judge(the_lab(), the_lab().checkpoints[checkpoint], stage)


def errors_of(stage: StageModel) -> list[Finding]:
    return [each for each in ordered(judged_model(stage).findings) if each.severity == "error"]


def renamed(graph: GraphModel, names: Mapping[str, str]) -> GraphModel:
    """The graph with other names for its nodes, everywhere they are named."""
    top = f"{graph.path}/"

    def path(old: str) -> str:
        if not old.startswith(top):
            return old
        name, dot, port = old[len(top) :].partition(".")
        return f"{top}{names.get(name, name)}{dot}{port}"

    return replace(graph, nodes=tuple(_moved(node, path) for node in graph.nodes))


def _moved(node: Node, path: Callable[[str], str]) -> Node:
    ports = {
        name: replace(state, sources=tuple(map(path, state.sources)))
        for name, state in node.ports.items()
    }
    return replace(node, path=path(node.path), ports=ports)


def shuffled(graph: GraphModel, order: Sequence[int]) -> GraphModel:
    return replace(graph, nodes=tuple(graph.nodes[number] for number in order))


def doubled(graph: GraphModel) -> GraphModel:
    """The graph with a copy of all its nodes, wired among themselves."""
    again = renamed(graph, {node.name: f"{node.name}_01" for node in graph.nodes})
    return replace(graph, nodes=graph.nodes + again.nodes)


def with_nodes(graph: GraphModel, *nodes: Node) -> GraphModel:
    """The graph with these nodes in the place of those at the same paths, or besides."""
    changed = {node.path: node for node in nodes}
    kept = tuple(changed.pop(node.path, node) for node in graph.nodes)
    return replace(graph, nodes=kept + tuple(changed.values()))


def without_nodes(graph: GraphModel, *names: str) -> GraphModel:
    """The graph without the nodes of these names."""
    return replace(graph, nodes=tuple(node for node in graph.nodes if node.name not in names))


def node_of(graph: GraphModel, name: str) -> Node:
    return next(node for node in graph.nodes if node.name == name)


def numbered(graph: GraphModel, seed: int) -> tuple[GraphModel, dict[str, str]]:
    """The graph with names that say nothing, and the names by what they were."""
    numbers = list(range(len(graph.nodes)))
    random.Random(seed).shuffle(numbers)  # noqa: S311 - the same on every run
    new = {node.name: f"n{number:03}" for node, number in zip(graph.nodes, numbers, strict=True)}
    return renamed(graph, new), new
