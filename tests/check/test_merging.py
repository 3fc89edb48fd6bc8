"""Several graphs of the lab in one: one finding says so, and each part is judged as it is."""

from __future__ import annotations

import pytest
from breaking import the_lab
from models import valued
from msgspec.structs import replace
from plain_graphs import (
    correct_model,
    graph_of,
    judged_model,
    node_of,
    renamed,
    with_nodes,
    without_nodes,
)

from lab3_usd.check.match.graphs import match_all
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.report.pictures.graph_picture import stage_pictures

GRAPHS = ("ROS_Clock", "ROS_Drive", "ROS_Lidar2D", "ROS_Camera", "ROS_OdomTF")
FLAT = "/World/ActionGraph"
ALIKE = ("on_playback_tick", "ros2_context", "isaac_read_simulation_time")


def flat(*names: str, path: str = FLAT, share: bool = False) -> GraphModel:
    """One graph with the nodes of these, which may share tick, context and time."""
    nodes: dict[str, Node] = {}
    for name in names:
        graph = graph_of(name)
        own = {
            node.name: node.name if share and node.name in ALIKE else f"{name}_{node.name}"
            for node in graph.nodes
        }
        for node in renamed(graph, own).nodes:
            moved = _moved(node, graph.path, path)
            nodes.setdefault(moved.path, moved)
    return replace(graph_of(names[0]), path=path, nodes=tuple(nodes.values()))


def _moved(node: Node, old: str, new: str) -> Node:
    ports = {
        name: replace(
            state,
            sources=tuple(
                new + source.removeprefix(old) if source.startswith(f"{old}/") else source
                for source in state.sources
            ),
        )
        for name, state in node.ports.items()
    }
    return replace(node, path=new + node.path.removeprefix(old), ports=ports)


def stage_with(graph: GraphModel, *names: str) -> StageModel:
    """The correct stage with this graph in the place of those that are named."""
    kept = tuple(each for each in correct_model().graphs if each.name not in names)
    return replace(correct_model(), graphs=(*kept, graph))


def told(found: RuleResults) -> list[tuple[str, str]]:
    return [
        (finding.rule, finding.prim) for finding in found.findings if finding.severity != "note"
    ]


def test_what_graphs_share_is_repaired_once() -> None:
    graph = flat(*GRAPHS, share=True)
    context = next(node for node in graph.nodes if node.name == "ros2_context")
    faulty = {
        "G03": replace(graph, attributes={**graph.attributes, "pipelineStage": "onDemand"}),
        "N01": replace(graph, nodes=tuple(node for node in graph.nodes if node is not context)),
        "P01": with_nodes(graph, valued(context, "inputs:domain_id", 7)),
    }
    for rule, changed in faulty.items():
        findings = judged_model(stage_with(changed, *GRAPHS)).findings
        (repair,) = [finding.fix for finding in findings if finding.rule == rule]
        assert repair is not None
        assert len(repair.edits) == 1


@pytest.mark.parametrize("share", [False, True])
@pytest.mark.parametrize("path", [FLAT, "/turtlebot3_burger/ROS_Drive", "/World/ROS_Clock"])
def test_all_graphs_in_one_are_one_finding(path: str, *, share: bool) -> None:
    found = judged_model(stage_with(flat(*GRAPHS, path=path, share=share), *GRAPHS))
    assert told(found) == [("G05", path)]
    assert all(name in found.findings[0].message for name in GRAPHS)
    assert [requirement.id for requirement in found.requirements if not requirement.met] == [
        "ROS_Clock/other/G05"
    ]


def test_graphs_in_one_cost_the_part_that_was_added_last() -> None:
    found = judged_model(stage_with(flat(*GRAPHS[:2]), *GRAPHS[:2]), "02")
    assert {finding.rule: finding.costs for finding in found.findings}["G05"] == (GRAPHS[1],)


@pytest.mark.parametrize("share", [False, True])
@pytest.mark.parametrize(
    "names",
    [
        ("ROS_Lidar2D", "ROS_Camera"),
        ("ROS_Clock", "ROS_OdomTF"),
        ("ROS_Clock", "ROS_Drive", "ROS_OdomTF"),
    ],
    ids=" and ".join,
)
def test_some_graphs_in_one_are_one_finding(names: tuple[str, ...], *, share: bool) -> None:
    found = judged_model(stage_with(flat(*names, share=share), *names))
    assert told(found) == [("G05", FLAT)]


def test_what_is_missing_or_wrong_in_one_part_is_told_once() -> None:
    whole = flat(*GRAPHS, share=True)
    radius = valued(
        node_of(whole, "ROS_Drive_differential_controller"), "inputs:wheelRadius", 0.033
    )
    graph = without_nodes(with_nodes(whole, radius), "ROS_OdomTF_isaac_compute_transform_tree")
    found = judged_model(stage_with(graph, *GRAPHS))
    assert sorted(told(found)) == [("G05", FLAT), ("N01", FLAT), ("P01", radius.path)]


def test_a_shared_node_that_is_wrong_is_told_once() -> None:
    whole = flat(*GRAPHS, share=True)
    graph = with_nodes(whole, valued(node_of(whole, "ros2_context"), "inputs:domain_id", 7))
    found = judged_model(stage_with(graph, *GRAPHS))
    assert sorted(told(found)) == [("G05", FLAT), ("P01", f"{FLAT}/ros2_context")]


def test_a_node_that_no_part_asks_for_is_extra_once() -> None:
    other = Node(f"{FLAT}/to_string", "omni.graph.nodes.ToString", None, 1, {})
    found = judged_model(stage_with(with_nodes(flat(*GRAPHS), other), *GRAPHS))
    assert sorted(told(found)) == [("G05", FLAT), ("N02", other.path)]


def test_a_part_of_a_later_checkpoint_is_named_as_that() -> None:
    graph = flat("ROS_Clock", "ROS_Drive", "ROS_OdomTF")
    found = judged_model(stage_with(graph, *GRAPHS), "02")
    (several,) = [finding for finding in found.findings if finding.rule == "G05"]
    assert "ROS_OdomTF belongs to a later checkpoint" in several.message
    assert [finding.prim for finding in found.findings if finding.rule == "N02"] == []


def test_a_whole_graph_beside_its_copy_in_another_is_not_part_of_that() -> None:
    graph = flat("ROS_Drive", "ROS_Clock", path="/turtlebot3_burger/ROS_Drive")
    roles = match_all(the_lab().graphs, stage_with(graph, "ROS_Drive"))
    assert [name for name, each in roles.items() if each.merged_graphs] == []


def test_each_part_is_drawn_by_itself() -> None:
    lab, stage = the_lab(), stage_with(flat(*GRAPHS, share=True), *GRAPHS)
    pictures = list(stage_pictures(lab, lab.checkpoints["05"], stage))
    drawn = [each for each in pictures if each.kind == "graph"]
    assert [each.title for each in drawn] == list(GRAPHS)
    for picture in drawn:
        assert {box.state for box in picture.boxes} == {"ok"}
        assert len(picture.boxes) == len(lab.graphs[picture.title].nodes)


def test_a_node_of_one_part_does_not_stand_for_the_missing_one_of_another() -> None:
    whole = flat("ROS_Lidar2D", "ROS_Camera")
    graph = without_nodes(whole, "ROS_Camera_isaac_create_render_product")
    found = judged_model(stage_with(graph, "ROS_Lidar2D", "ROS_Camera"))
    (missing,) = [finding for finding in found.findings if finding.rule == "N01"]
    assert missing.prim == FLAT
