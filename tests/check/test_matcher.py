"""Nodes are told apart by what they are, hold and are wired to, whatever they are called."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations, product

import pytest
from breaking import the_lab
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from models import valued, wired
from msgspec.structs import replace
from plain_graphs import (
    doubled,
    errors_of,
    graph_of,
    judged_model,
    node_of,
    numbered,
    renamed,
    shuffled,
    with_graphs,
    with_nodes,
)

from lab3_usd.check.match.conformance import setting_matches, target_matches
from lab3_usd.check.match.roles import match
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.graph import GraphSpec

GRAPHS = ("ROS_Clock", "ROS_Drive", "ROS_Lidar2D", "ROS_Camera", "ROS_OdomTF")
SLOW = settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))


def roles(graph: GraphModel) -> Roles:
    return match(the_lab().graphs[graph.name], graph)


def names(found: Roles) -> dict[str, str | None]:
    return {role: node and node.name for role, node in found.node_of.items()}


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize("seed", range(5))
def test_prim_names_do_not_matter(name: str, seed: int) -> None:
    graph, new = numbered(graph_of(name), seed)
    assert names(roles(graph)) == new


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("constant_left_joint", "constant_right_joint"),
        ("break_linear_velocity", "break_angular_velocity"),
    ],
)
def test_exchanged_names_do_not_matter(one: str, other: str) -> None:
    graph = renamed(graph_of("ROS_Drive"), {one: other, other: one})
    found = names(roles(graph))
    assert (found[one], found[other]) == (other, one)
    assert errors_of(with_graphs(graph)) == []


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize("seed", range(4))
def test_a_doubled_graph_is_matched_to_one_whole_copy(name: str, seed: int) -> None:
    graph, new = numbered(doubled(graph_of(name)), seed)
    old = {after: before for before, after in new.items()}
    found = roles(graph)
    played = {role: old[str(node)] for role, node in names(found).items()}
    assert len({name.endswith("_01") for name in played.values()}) == 1
    assert {role: each.removesuffix("_01") for role, each in played.items()} == {
        role: role for role in played
    }


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize("seed", range(4))
def test_no_wire_of_a_doubled_graph_is_wrong(name: str, seed: int) -> None:
    graph, _ = numbered(doubled(graph_of(name)), seed)
    rules = {error.rule for error in errors_of(with_graphs(graph))}
    assert rules <= {"N07", "T04"}


def test_a_node_with_a_wrong_value_still_plays_its_role() -> None:
    drive = graph_of("ROS_Drive")
    constant = valued(node_of(drive, "constant_left_joint"), "inputs:value", "left")
    graph, new = numbered(with_nodes(drive, constant), 1)
    assert names(roles(graph)) == new


def test_of_two_that_fit_the_one_with_the_right_value_is_taken() -> None:
    clock = graph_of("ROS_Clock")
    good = node_of(clock, "ros2_publish_clock")
    bad = valued(replace(good, path=f"{clock.path}/a_clock"), "inputs:topicName", "/time")
    assert names(roles(with_nodes(clock, bad)))["ros2_publish_clock"] == "ros2_publish_clock"


def test_of_two_that_fit_the_one_that_is_wired_is_taken() -> None:
    clock = graph_of("ROS_Clock")
    time = node_of(clock, "isaac_read_simulation_time")
    spare = replace(time, path=f"{clock.path}/a_time")
    found = roles(renamed(with_nodes(clock, spare), {time.name: "z_time"}))
    assert names(found)["isaac_read_simulation_time"] == "z_time"


def test_of_two_equal_nodes_the_one_named_as_the_handout_does_is_taken() -> None:
    clock = graph_of("ROS_Clock")
    context = node_of(clock, "ros2_context")
    publisher = wired(node_of(clock, "ros2_publish_clock"), "inputs:context")
    first = replace(context, path=f"{clock.path}/a_context")
    found = roles(with_nodes(clock, publisher, first))
    assert names(found)["ros2_context"] == "ros2_context"
    assert found.equivalents == {first.path: "ros2_context"}
    assert [node.name for node in found.extra] == ["a_context"]


def test_fewer_nodes_than_roles_leave_the_role_that_fits_worst() -> None:
    drive = graph_of("ROS_Drive")
    nodes = tuple(node for node in drive.nodes if node.name != "break_linear_velocity")
    left = renamed(replace(drive, nodes=nodes), {"break_angular_velocity": "b"})
    found = names(roles(left))
    assert found["break_linear_velocity"] is None
    assert found["break_angular_velocity"] == "b"


def test_a_graph_without_nodes_leaves_every_role_open() -> None:
    graph = replace(graph_of("ROS_Drive"), nodes=())
    assert set(roles(graph).node_of.values()) == {None}


def test_without_a_graph_every_role_is_open() -> None:
    found = match(the_lab().graphs["ROS_Clock"], None)
    assert found.graph is None
    assert set(found.node_of.values()) == {None}


def test_a_retyped_node_is_known_by_its_wires() -> None:
    drive = graph_of("ROS_Drive")
    scale = replace(node_of(drive, "scale_linear_velocity"), type_name="other.Scale", type=None)
    graph, new = numbered(with_nodes(drive, scale), 2)
    found = roles(graph)
    assert found.node_of["scale_linear_velocity"] is None
    assert found.retyped["scale_linear_velocity"].name == new["scale_linear_velocity"]
    assert found.extra == ()


def test_an_extra_node_without_wires_or_name_is_not_taken_for_a_missing_one() -> None:
    clock = graph_of("ROS_Clock")
    other = Node(f"{clock.path}/to_string", "omni.graph.nodes.ToString", None, 1, {})
    nodes = tuple(node for node in clock.nodes if node.name != "ros2_context")
    found = roles(replace(clock, nodes=(*nodes, other)))
    assert found.retyped == {}
    assert found.extra == (other,)


# Many nodes of one type.


def crowded(name: str, kinds: Sequence[str], count: int) -> GraphModel:
    graph = graph_of(name)
    more = [
        replace(node_of(graph, kind), path=f"{graph.path}/{kind}_{number:03}")
        for kind in kinds
        for number in range(count)
    ]
    return with_nodes(graph, *more)


def test_a_hundred_contexts_hide_nothing() -> None:
    graph, new = numbered(crowded("ROS_Drive", ["ros2_context"], 100), 1)
    assert names(roles(graph))["ros2_context"] == new["ros2_context"]
    assert errors_of(with_graphs(graph)) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_crowd_of_every_type_is_matched_the_same_in_any_order(seed: int) -> None:
    kinds = [node.name for node in graph_of("ROS_Drive").nodes]
    graph = crowded("ROS_Drive", kinds, 40)
    order = list(range(len(graph.nodes)))
    random.Random(seed).shuffle(order)  # noqa: S311 - the same on every run
    assert names(roles(shuffled(graph, order))) == names(roles(graph))


def test_the_search_ends_where_nothing_is_wired() -> None:
    kinds = [node.name for node in graph_of("ROS_Drive").nodes]
    graph = crowded("ROS_Drive", kinds, 30)
    bare = tuple(replace(node, ports={}) for node in graph.nodes)
    assert None not in roles(replace(graph, nodes=bare)).node_of.values()


# The order of nodes never changes what is said.


@st.composite
def _broken(draw: st.DrawFn) -> GraphModel:
    """A graph with some wires cut or crossed, values changed and nodes gone."""
    graph = graph_of(draw(st.sampled_from(GRAPHS)))
    nodes = list(graph.nodes)
    for _ in range(draw(st.integers(0, 4))):
        number = draw(st.integers(0, len(nodes) - 1))
        nodes[number] = draw(_changed(graph, nodes[number]))
    gone = draw(st.sets(st.integers(0, len(nodes) - 1), max_size=2))
    kept = tuple(node for number, node in enumerate(nodes) if number not in gone)
    return replace(graph, nodes=kept)


def _changed(graph: GraphModel, node: Node) -> st.SearchStrategy[Node]:
    ports = [port for port in node.ports if port.startswith("inputs:")] or ["outputs:tick"]
    sources = [
        f"{each.path}.{port}"
        for each in graph.nodes
        for port in each.ports
        if port.startswith("outputs:")
    ]
    rewired = st.builds(
        lambda port, found: wired(node, port, *found),
        st.sampled_from(ports),
        st.lists(st.sampled_from(sources), max_size=2, unique=True),
    )
    other = st.builds(lambda port: valued(node, port, "other"), st.sampled_from(ports))
    return st.one_of(rewired, other)


def _differences(spec: GraphSpec, given: Mapping[str, Node | None]) -> tuple[int, int]:
    """Count what is unmet under an assignment, and the names that differ, the plain way."""
    unmet = 0
    for role, node in given.items():
        for setting in spec.nodes[role].settings if node else ():
            unmet += not setting_matches(node, setting, node.value(setting.port))
        for target in spec.nodes[role].targets if node else ():
            unmet += not target_matches(node, target)
    for wire in spec.wires:
        source, end = given[wire.source.role], given[wire.target.role]
        if source and end:
            unmet += f"{source.path}.{wire.source.port}" not in end.sources(wire.target.port)
    return unmet, sum(node.name != role for role, node in given.items() if node)


def _every_way(spec: GraphSpec, graph: GraphModel) -> Iterator[dict[str, Node | None]]:
    kinds = dict.fromkeys(each.type.type for each in spec.nodes.values())
    parts = []
    for kind in kinds:
        wanted = [role for role, each in spec.nodes.items() if each.type.type == kind]
        nodes: list[Node | None] = [
            node for node in graph.nodes if node.type and node.type.type == kind
        ]
        nodes += [None] * (len(wanted) - len(nodes))
        parts.append(
            [dict(zip(wanted, way, strict=False)) for way in permutations(nodes, len(wanted))]
        )
    for combination in product(*parts):
        yield {role: node for part in combination for role, node in part.items()}


@SLOW
@given(_broken(), st.data())
def test_no_assignment_leaves_fewer_differences_than_the_one_taken(
    graph: GraphModel, data: st.DataObject
) -> None:
    spec = the_lab().graphs[graph.name]
    copied = data.draw(st.lists(st.sampled_from(graph.nodes), max_size=3, unique_by=_path))
    copies = [replace(node, path=f"{node.path}_copy") for node in copied]
    crowded = replace(graph, nodes=(*graph.nodes, *copies))
    taken = _differences(spec, roles(crowded).node_of)
    assert taken == min(_differences(spec, each) for each in _every_way(spec, crowded))


def _path(node: Node) -> str:
    return node.path


def said(graph: GraphModel) -> list[Finding]:
    judgement = judged_model(with_graphs(graph))
    assert not judgement.crashes
    return sorted(judgement.findings, key=repr)


@settings(SLOW, max_examples=5)
@given(_broken(), st.randoms(use_true_random=False))
def test_the_order_of_nodes_never_changes_the_findings(
    graph: GraphModel, rng: random.Random
) -> None:
    order = list(range(len(graph.nodes)))
    rng.shuffle(order)
    assert said(shuffled(graph, order)) == said(graph)


@settings(SLOW, max_examples=5)
@given(_broken(), st.integers(0, 1000))
def test_names_never_change_how_much_is_wrong(graph: GraphModel, seed: int) -> None:
    other, _ = numbered(graph, seed)
    counts = [len(errors_of(with_graphs(each))) for each in (graph, other)]
    assert counts[0] == counts[1]
