"""A stage to which Python adds graphs: by recipes, or node by node, checked when they are made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from foreign_robots import ROVER, add_rover, new_stage, rover_at
from pxr import Usd

from lab3_usd import AmbiguousError, GraphError, NewFindingsError, Stage, UsageError
from lab3_usd.pipeline.stage import lint_stage


def test_a_graph_made_by_hand_runs_and_lints(tmp_path: Path) -> None:
    stage = Stage.open(rover_at(tmp_path))
    graph = stage.graph("/World/Graphs/Battery")
    tick, volts = graph.node("OnPlaybackTick"), graph.node("ConstantDouble", "volts", value=12.6)
    battery = graph.node(
        "ROS2Publisher", messagePackage="std_msgs", messageName="Float64", topicName="/volts"
    )
    graph.wire(tick.tick, battery.execIn)
    graph.wire(volts.value, battery.data)
    saved = stage.save(tmp_path / "ros.usda")
    assert [f.rule for f in lint_stage(saved).findings if f.severity != "note"] == []
    written = Usd.Stage.Open(str(saved))
    attribute = written.GetAttributeAtPath("/World/Graphs/Battery/ros2_publisher.inputs:data")
    assert [*map(str, attribute.GetConnections())] == ["/World/Graphs/Battery/volts.inputs:value"]


def test_recipes_and_hand_made_graphs_know_of_each_other(tmp_path: Path) -> None:
    stage = Stage.open(rover_at(tmp_path))
    drive = stage.add("drive", robot=stage.robot(), topic="/go")
    assert (drive.path, drive.facts["topic"]) == ("/World/Graphs/Drive", ("/go", "given"))
    graph = stage.graph(drive.path)
    limits = graph.node("ConstantDouble", "limit", value=0.4)
    graph.wire(limits.value, graph["differential_controller"].maxLinearSpeed)
    assert stage.layer().GetPrimAtPath("/World/Graphs/Drive/limit")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda graph: graph.node("ROS2Publsher"), "did you mean 'ROS2Publisher'"),
        (lambda graph: graph.node("ConstantDouble", vlue=1.0), "did you mean 'value'"),
        (lambda graph: graph.node("ConstantDouble", value="a"), "constant_double"),
        (lambda graph: graph.node("ConstantDouble", "a b"), "cannot be the name of a prim"),
        (lambda graph: graph.node("OnPlaybackTick").tock, "did you mean 'tick'"),
        (
            lambda graph: graph.wire(
                graph.node("OnPlaybackTick").tick, graph.node("ROS2PublishClock").timeStamp
            ),
            "on_playback_tick.tick -> ros2_publish_clock.timeStamp",
        ),
    ],
)
def test_what_isaac_sim_does_not_have_is_refused_where_it_is_made(
    tmp_path: Path, make: Callable[[Any], object], said: str
) -> None:
    graph = Stage.open(rover_at(tmp_path)).graph("/World/Graph")
    with pytest.raises(GraphError, match=said):
        make(graph)


def test_a_second_wire_into_an_input_is_refused(tmp_path: Path) -> None:
    graph = Stage.open(rover_at(tmp_path)).graph("/World/Graph")
    tick, clock = graph.node("OnPlaybackTick"), graph.node("ROS2PublishClock")
    graph.wire(tick.tick, clock.execIn)
    with pytest.raises(GraphError, match="connected already"):
        graph.wire(tick.tick, clock.execIn)


def test_several_robots_are_named(tmp_path: Path) -> None:
    path = tmp_path / "two.usda"
    two = new_stage(path)
    add_rover(two, "/World/alpha")
    add_rover(two, "/World/beta")
    two.Save()
    stage = Stage.open(path)
    with pytest.raises(AmbiguousError) as error:
        stage.robot()
    assert len(error.value.candidates) == len(stage.robots())
    assert stage.add("drive", robot=stage.robot("/World/beta")).path == "/World/Graphs/Drive"


def test_new_findings_keep_a_stage_from_being_saved(tmp_path: Path) -> None:
    stage = Stage.open(rover_at(tmp_path))
    stage.graph("/World/Graph").node("ROS2PublishClock")
    with pytest.raises(NewFindingsError) as error:
        stage.save(tmp_path / "ros.usda")
    assert error.value.findings
    assert not (tmp_path / "ros.usda").exists()
    assert stage.save(tmp_path / "ros.usda", check=False).exists()


def test_nothing_is_written_over_another_file(tmp_path: Path) -> None:
    stage, other = Stage.open(rover_at(tmp_path)), rover_at(tmp_path, "other.usda")
    stage.add("clock")
    with pytest.raises(UsageError):
        stage.save(other)
    assert other.read_bytes() == ROVER.read_bytes()


def test_a_stage_that_changed_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    stage = Stage.open(path)
    stage.add("clock")
    path.write_bytes(ROVER.read_bytes() + b"\n")
    with pytest.raises(UsageError, match="changed meanwhile"):
        stage.save()


def test_an_option_that_is_misspelt_is_told_with_the_one_that_is_meant(tmp_path: Path) -> None:
    stage = Stage.open(rover_at(tmp_path))
    with pytest.raises(UsageError, match="'topc' is not an option of drive; did you mean topic"):
        stage.add("drive", topc="/cmd_vel")
