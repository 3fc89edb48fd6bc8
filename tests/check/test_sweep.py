"""Every single fault is found, at its place, and said once, and what it costs is explained.

An evenly spread part of them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from types import ModuleType
from typing import Any

import pytest
from benchmark import load_benchmark
from breaking import the_lab
from failing_students import unexplained
from models import valued, wired
from msgspec.structs import replace
from plain_graphs import (
    errors_of,
    graph_of,
    node_of,
    numbered,
    with_graphs,
    with_nodes,
)

from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.graph import GraphSpec

GRAPHS = ("ROS_Clock", "ROS_Drive", "ROS_Lidar2D", "ROS_Camera", "ROS_OdomTF")
MOST_PER_FAULT = 1.15  # error findings, on average over many single faults
# One part of the faults of each checkpoint: every so many, from so many on.
PARTS = {"00": (13, 0), "01": (23, 1), "02": (61, 2), "03": (83, 3), "04": (97, 4), "05": (103, 0)}


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    return load_benchmark("sweep")


@pytest.mark.parametrize("checkpoint", PARTS)
def test_single_faults_are_found_at_their_place(benchmark: ModuleType, checkpoint: str) -> None:
    outcomes = list(benchmark.sweep(checkpoint, *PARTS[checkpoint]))
    assert len(outcomes) >= 5
    assert [outcome.fault.name for outcome in outcomes if not outcome.found] == []
    assert [outcome.fault.name for outcome in outcomes if not outcome.at_place] == []
    of_graphs = [outcome for outcome in outcomes if outcome.fault.kind != "scene"]
    assert [graph.fault.name for graph in of_graphs if not graph.errors] == []
    mean = sum(len(outcome.errors) for outcome in outcomes) / len(outcomes)
    assert mean <= MOST_PER_FAULT
    assert [outcome.fault.name for outcome in outcomes if points_without_a_word(outcome)] == []


def points_without_a_word(outcome: Any) -> list[str]:
    """Return the points that a fault costs and no finding explains."""
    found = outcome.judged
    return unexplained(the_lab(), outcome.stage, found.requirements, found.findings)


def test_later_checkpoints_find_what_the_fifth_finds(benchmark: ModuleType) -> None:
    outcomes = list(benchmark.sweep("08", 149, 7))
    assert len(outcomes) >= 5
    missed = [outcome.fault.name for outcome in outcomes if not outcome.at_place]
    assert missed == []


# The same on graphs whose prims have names that say nothing, as plain data and therefore many.


def _sources(graph: GraphModel) -> list[str]:
    return [
        f"{node.path}.{port}"
        for node in graph.nodes
        for port in node.ports
        if port.startswith("outputs:") or "Constant" in node.type_name
    ]


def _single(spec: GraphSpec) -> Iterator[tuple[str, GraphModel, str]]:
    """Yield what is wrong, the graph with that fault, and the prim to be named."""
    graph, new = numbered(graph_of(spec.name), 7)
    for role in spec.nodes:
        node = node_of(graph, new[role])
        others = tuple(each for each in graph.nodes if each is not node)
        yield f"{role} removed", replace(graph, nodes=others), graph.path
        other = replace(node, type_name="another.Type", type=None)
        yield f"{role} retyped", with_nodes(graph, other), node.path
    for wire in spec.wires:
        node, port = node_of(graph, new[wire.target.role]), wire.target.port
        right = node.sources(port)[0]
        yield f"{wire} cut", with_nodes(graph, wired(node, port)), node.path
        for source in _sources(graph):
            if source != right:
                changed = wired(node, port, source)
                yield f"{wire} from {source}", with_nodes(graph, changed), node.path
                changed = wired(node, port, right, source)
                yield f"{wire} and from {source}", with_nodes(graph, changed), node.path


@pytest.mark.parametrize("name", GRAPHS)
def test_names_that_say_nothing_hide_no_fault(name: str) -> None:
    faults = list(_single(the_lab().graphs[name]))
    counts = []
    for what, graph, site in faults[:: 1 if len(faults) < 20 else 47]:
        errors = errors_of(with_graphs(graph))
        assert site in {error.prim for error in errors}, what
        counts.append(len(errors))
    assert sum(counts) / len(counts) <= 1.02


def _places(spec: GraphSpec) -> Iterator[tuple[str, str, Node]]:
    """Yield a node, a port, and that node with this port cut off or set to something else."""
    graph = graph_of(spec.name)
    for wire in spec.wires:
        node = node_of(graph, wire.target.role)
        yield node.path, wire.target.port, wired(node, wire.target.port)
    for role, node_spec in spec.nodes.items():
        for setting in node_spec.settings:
            is_text = isinstance(setting.value, str)
            node = node_of(graph, role)
            yield node.path, setting.port, valued(node, setting.port, "other" if is_text else 77)


@pytest.mark.parametrize("name", GRAPHS)
def test_two_mistakes_are_two_findings(name: str) -> None:
    graph = graph_of(name)
    pairs = [
        pair
        for pair in combinations(_places(the_lab().graphs[name]), 2)
        if pair[0][0] != pair[1][0]
    ]
    for (prim, port, node), (other_prim, other_port, other) in pairs[:: 1 + len(pairs) // 9]:
        errors = errors_of(with_graphs(with_nodes(graph, node, other)))
        found = sorted((error.prim, error.property) for error in errors)
        assert found == sorted([(prim, port), (other_prim, other_port)])
