"""Repairs that nobody has to allow leave no stage worse than it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from agreement import Subject, all_subjects
from breaking import Step, correct_stage, the_lab
from fixing import worsened
from linting import broken_robot
from pxr import Sdf, Usd

from lab3_usd.fix.repairing import Fixed, FixOptions, compatible, fix_linted, fix_stage
from lab3_usd.model.changes import ClearValue, Connect, Repair, SetValue

EVERY = 41  # of some two thousand stages, a prime that falls into each family
HELPER, DRIVE, MOVE = "/World/Camera/helper", "/World/Drive/drive", "/World/Drive/move"
RENAMED: Step = {"set": [f"{HELPER}.node:type", "omni.isaac.ros2_bridge.ROS2CameraHelper"]}
INFO: Step = {"declare": [f"{HELPER}.inputs:type", "token", "camera_info"]}


def repaired(steps: list[Any], folder: Path, release: str = "6.0") -> tuple[Fixed, Usd.Stage]:
    path = folder / "rover.usda"
    broken_robot("rover", [dict(step) for step in steps]).GetRootLayer().Export(str(path))
    fixed = fix_linted(path, release, FixOptions())
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(fixed.files.get(path, path.read_bytes()).decode())
    return fixed, Usd.Stage.Open(layer)


def value(stage: Usd.Stage, path: str) -> Any:
    return stage.GetAttributeAtPath(path).Get()


def sources(stage: Usd.Stage, path: str) -> list[str]:
    return [str(source) for source in stage.GetAttributeAtPath(path).GetConnections()]


@pytest.mark.parametrize("subject", all_subjects()[::EVERY], ids=lambda subject: subject.name)
def test_no_stage_is_worse_after_safe_repairs(subject: Subject, tmp_path: Path) -> None:
    assert worsened(subject, tmp_path) == []


@pytest.mark.parametrize("release", ["5.1", "6.0", "6.2"])
def test_a_type_that_two_rules_change_becomes_the_right_one(release: str, tmp_path: Path) -> None:
    _, stage = repaired([RENAMED, INFO], tmp_path, release)
    kind = value(stage, f"{HELPER}.node:type")
    assert kind == "isaacsim.ros2.bridge.ROS2CameraInfoHelper"


def test_a_controller_of_other_ports_takes_the_place_of_none(tmp_path: Path) -> None:
    old = "omni.isaac.wheeled_robots.AckermannController"
    fixed, stage = repaired([{"set": [f"{DRIVE}.node:type", old]}], tmp_path)
    assert value(stage, f"{DRIVE}.node:type") == old
    assert "K30" in {finding.rule for finding in fixed.left}


def test_a_type_that_lacks_a_wired_port_is_not_given(tmp_path: Path) -> None:
    prefixed = "isaacsim.ros2.nodes.ROS2PublishClock"
    steps: list[Step] = [
        {"set": ["/World/Clock/clock.node:type", prefixed]},
        {"declare": ["/World/Clock/clock.inputs:frames", "token"]},
        {
            "connect": [
                "/World/Clock/clock.inputs:frames",
                "/World/Drive/left.inputs:value",
            ]
        },
    ]
    _, stage = repaired(steps, tmp_path)
    assert value(stage, "/World/Clock/clock.node:type") == prefixed


def test_a_compound_keeps_its_type(tmp_path: Path) -> None:
    prefixed = "isaacsim.ros2.nodes.ROS2PublishClock"
    steps: list[Step] = [
        {"set": ["/World/Clock/clock.node:type", prefixed]},
        {"define": ["/World/Clock/clock/inner", "OmniGraph"]},
    ]
    _, stage = repaired(steps, tmp_path)
    assert value(stage, "/World/Clock/clock.node:type") == prefixed


@pytest.mark.parametrize("quantity", ["effort", "position"])
def test_speeds_are_not_wired_into_other_commands(quantity: str, tmp_path: Path) -> None:
    port = f"{MOVE}.inputs:{quantity}Command"
    steps: list[Step] = [
        {"declare": [port, "double[]"]},
        {"connect": [port, f"{DRIVE}.outputs:{quantity}Command"]},
    ]
    _, stage = repaired(steps, tmp_path)
    assert f"{DRIVE}.outputs:velocityCommand" not in sources(stage, port)


def test_of_two_repairs_of_one_property_the_first_is_made() -> None:
    one = Repair("", (SetValue("/World", "node:type", "token", "a"),))
    other = Repair("", (ClearValue("/World", "node:type"), Connect("/World", "inputs:x", "int")))
    apart = Repair("", (SetValue("/World", "node:typeVersion", "int", 1),))
    assert compatible([one, other, apart]) == [one, apart]


def test_two_repairs_that_make_the_same_edit_are_made() -> None:
    one = Repair("", (SetValue("/World", "node:type", "token", "a"),))
    other = Repair("", (*one.edits, SetValue("/World", "node:typeVersion", "int", 1)))
    assert compatible([one, other]) == [one, other]


def test_a_compound_gets_no_type_of_the_lab(tmp_path: Path) -> None:
    stage = correct_stage("02")
    node = "/turtlebot3_burger/ROS_Drive/differential_controller"
    compound = "omni.graph.nodes.CompoundSubgraph"
    stage.GetAttributeAtPath(f"{node}.node:type").Set(compound)
    stage.DefinePrim(f"{node}/inner", "OmniGraph")
    path = tmp_path / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    fixed = fix_stage(path, "02", the_lab(), FixOptions())
    edits = {edit for repair in fixed.repairs for edit in repair.edits}
    assert not any(getattr(edit, "property", "") == "node:type" for edit in edits)
    assert any(finding.expected and "Differential" in finding.expected for finding in fixed.before)
