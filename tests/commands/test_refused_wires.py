"""A wire that OmniGraph drops brings nothing, and every command says so."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from in_process import invoke
from pxr import Sdf, Usd

from lab3_usd.stage.write.builder import build_checkpoint

PUBLISHER = "/World/ROS_Clock/ros2_publish_clock"
CONSTANT = "/World/ROS_Clock/constant_int"


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """The clock of the lab with a whole number wired into the name of its topic."""
    path = tmp_path / "Lab3_01_ros_clock.usda"
    build_checkpoint(None, "01", path)
    opened = Usd.Stage.Open(str(path))
    node = opened.DefinePrim(CONSTANT, "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set("omni.graph.nodes.ConstantInt")
    node.CreateAttribute("node:typeVersion", Sdf.ValueTypeNames.Int).Set(1)
    node.CreateAttribute("inputs:value", Sdf.ValueTypeNames.Int).Set(5)
    topic = opened.GetPrimAtPath(PUBLISHER).GetAttribute("inputs:topicName")
    topic.AddConnection(f"{CONSTANT}.inputs:value")
    opened.Save()
    return path


def said(*arguments: object) -> str:
    return invoke(*arguments).output


def test_the_wire_is_at_fault_and_the_topic_keeps_its_name(stage: Path) -> None:
    assert "K22" in said("lint", stage, "--format", "concise")
    checked = said("check", stage, "--format", "concise")
    assert "is 5" not in checked
    assert "P01" not in checked
    topics = json.loads(said("topics", stage, "--format", "json"))
    assert [topic["topic"] for topic in topics["topics"]] == ["/clock"]
    assert "60 Hz" in said("sim", stage)
