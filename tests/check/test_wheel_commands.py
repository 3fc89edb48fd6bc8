"""Who commands the wheels beside the lab, and how sure that is."""

from __future__ import annotations

import models as m
import pytest
from msgspec.structs import replace

from lab3_usd.check.registry import rules_of
from lab3_usd.check.robot.wheels import listed_names
from lab3_usd.check.rule_runs import problems_of
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.model.stage import GraphModel, Node, PortState, StageModel, UnresolvedAsset

DRIVE = m.lab().graphs["ROS_Drive"]
PLACE = "/Graph/drive"
MOVER = f"{PLACE}/articulation_controller"
CUSTOM = "omni.graph.action.OnCustomEvent"
UNKNOWN = "omni.graph.nodes.Concatenate"


def said(stage: StageModel) -> list[tuple[str, str | None]]:
    (rule,) = (rule for rule in rules_of("robot", "N") if rule.id == "N12")
    return [(p.prim, p.severity) for p in problems_of(rule, m.subject(stage, "02"))]


def copied(*changed: Node) -> GraphModel:
    """The drive graph once more, with a wheel radius of its own and some nodes changed."""
    graph = m.graph_of(DRIVE, PLACE)
    radius = m.valued(
        next(node for node in graph.nodes if node.name == "differential_controller"),
        "inputs:wheelRadius",
        0.033,
    )
    nodes = {node.path: node for node in (*graph.nodes, radius, *changed)}
    return replace(graph, nodes=tuple(nodes.values()))


def mover() -> Node:
    return next(node for node in m.graph_of(DRIVE, PLACE).nodes if node.path == MOVER)


def unknown(name: str) -> Node:
    made = m.node(f"{PLACE}/{name}", UNKNOWN)
    return replace(made, ports={"outputs:value": PortState("outputs:value")})


def test_a_copy_that_drives_otherwise_is_an_error() -> None:
    assert said(m.stage(copied())) == [(MOVER, None)]
    assert said(m.stage(m.graph_of(DRIVE, PLACE))) == []


def test_what_an_unknown_event_starts_is_a_warning() -> None:
    event = m.node(f"{PLACE}/on_playback_tick", CUSTOM)
    event = replace(event, ports={"outputs:tick": PortState("outputs:tick")})
    assert said(m.stage(copied(event))) == [(MOVER, "warning")]


def test_a_robot_that_a_wire_names_is_a_warning() -> None:
    wired = m.wired(mover(), "inputs:robotPath", f"{PLACE}/path.outputs:value")
    assert said(m.stage(copied(wired, unknown("path")))) == [(MOVER, "warning")]


def test_joints_that_nobody_can_know_may_be_the_wheels() -> None:
    array = next(node for node in copied().nodes if node.name == "make_array")
    sized = m.wired(array, "inputs:arraySize", f"{PLACE}/size.outputs:value")
    live = live_nodes(m.stage(copied(sized, unknown("size"))))
    assert listed_names(live[MOVER], "inputs:jointNames", live) is None
    assert said(m.stage(copied(sized, unknown("size")))) == [(MOVER, None)]


def test_the_names_of_an_array_are_followed() -> None:
    live = live_nodes(m.stage(copied()))
    assert listed_names(live[MOVER], "inputs:jointNames", live) == (
        "wheel_left_joint",
        "wheel_right_joint",
    )


@pytest.mark.parametrize(
    ("target", "count"), [(m.ROBOT, 1), (m.BASE, 1), ("/", 1), ("/World/arm", 0), ("", 0)]
)
def test_where_the_robot_is_not_found_its_path_decides(target: str, count: int) -> None:
    aimed = m.aimed(mover(), "inputs:targetPrim", *filter(None, [target]))
    stage = replace(
        m.stage(copied(aimed)), unresolved=(UnresolvedAsset(m.ROBOT, "robot.usd", "reference"),)
    )
    assert len(said(stage)) == count


def test_without_the_labs_own_nobody_is_second() -> None:
    stage = m.stage(copied())
    without = tuple(graph for graph in stage.graphs if graph.path != DRIVE.path)
    found = replace(stage, graphs=without)
    subject = m.subject(found, "02")
    (rule,) = (rule for rule in rules_of("robot", "N") if rule.id == "N12")
    roles = {name: r for name, r in subject.roles.items() if name != "ROS_Drive"}
    assert list(problems_of(rule, replace(subject, roles=roles))) == []
