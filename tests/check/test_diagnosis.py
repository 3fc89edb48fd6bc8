"""Likely mistakes in wires, each with the message that explains it."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import broken, judged, place
from pxr import Sdf

from lab3_usd.model.finding import Finding, ordered


def told(*steps: dict[str, Any]) -> tuple[Finding, ...]:
    """Errors and warnings of checkpoint 05 after these steps."""
    judgement = judged(broken("05", list(steps)), "05")
    assert not judgement.crashes
    return ordered(finding for finding in judgement.findings if finding.severity != "note")


def assert_words(finding: Finding, *words: str) -> None:
    """The message says what is there, what should be, and what explains it."""
    assert [word for word in words if word not in finding.message] == []


LEFT = "ROS_Drive/constant_left_joint"
RIGHT = "ROS_Drive/constant_right_joint"


def test_tokens_and_inputs_both_reversed_are_right_again() -> None:
    array = "ROS_Drive/make_array"
    steps = (
        {"swap": [f"{LEFT}.inputs:value", f"{RIGHT}.inputs:value"]},
        {"swap": [f"{array}.inputs:input0", f"{array}.inputs:input1"]},
    )
    assert told(*steps) == ()


EXEC_OUT = ["ROS_Drive/differential_controller.inputs:execIn"]
EXEC_OUT += ["ROS_Drive/ros2_subscribe_twist.outputs:execOut"]


@pytest.mark.parametrize("parent", ["world", "odom", "map"])
def test_a_transform_that_nobody_may_publish_is_told_once(parent: str) -> None:
    raw = "ROS_OdomTF/ros2_publish_raw_transform_tree"
    findings = told(
        {"set": [f"{raw}.inputs:parentFrameId", parent]},
        {"set": [f"{raw}.inputs:childFrameId", "odom"]},
    )
    assert [finding.rule[0] for finding in findings] == ["T"]


def test_a_node_in_another_graph_is_named_and_not_added_again() -> None:
    node, other = "ROS_Drive/ros2_subscribe_twist", "/World/Listening"
    steps = [{"define": [other, "OmniGraph"]}, {"move": [node, f"{other}/ros2_subscribe_twist"]}]
    found = [
        finding for finding in judged(broken("02", steps), "02").findings if finding.rule == "N01"
    ]
    assert [each.related for each in found] == [(f"{other}/ros2_subscribe_twist",)]
    assert_words(found[0], f"{other}/ros2_subscribe_twist is in another graph")
    assert found[0].fix is None


def test_the_asset_that_could_have_brought_a_node_is_named() -> None:
    stage = broken("01", [{"over": "ROS_Clock/ros2_context"}])
    stage.GetPrimAtPath("/World/ROS_Clock").GetPayloads().AddPayload("clock.usd")
    (finding,) = [each for each in judged(stage, "01").findings if each.severity == "error"]
    assert_words(finding, "ROS2 Context", "an over without a def", "clock.usd")


@pytest.mark.parametrize(
    ("sensor", "home", "rule"),
    [
        ("/turtlebot3_burger/base_scan/Lidar2D", "/turtlebot3_burger/base_link/Lidar2D", "L02"),
        (
            "/turtlebot3_burger/base_footprint/Camera_1",
            "/turtlebot3_burger/base_link/Camera_1",
            "C02",
        ),
    ],
)
def test_a_misplaced_sensor_takes_its_graph_along(sensor: str, home: str, rule: str) -> None:
    findings = told({"move": [sensor, home]})
    assert [(finding.rule, finding.prim) for finding in findings] == [(rule, home)]


@pytest.mark.parametrize(("checkpoint", "rule"), [("05", "P04"), ("06", "Q04")])
def test_a_profile_by_wire_is_told_once_in_every_checkpoint(checkpoint: str, rule: str) -> None:
    steps: list[dict[str, Any]] = [
        {"node": ["ROS_Clock/profile", "isaacsim.ros2.bridge.ROS2QoSProfile"]},
        {
            "connect": [
                "ROS_Clock/ros2_publish_clock.inputs:qosProfile",
                "ROS_Clock/profile.outputs:qosProfile",
            ]
        },
    ]
    findings = judged(broken(checkpoint, steps), checkpoint).findings
    assert [finding.rule for finding in findings if finding.severity == "error"] == [rule]


def test_every_finding_says_what_to_do() -> None:
    findings = told(
        {"remove": "ROS_Clock"},
        {"remove": "ROS_Drive/ros2_context"},
        {"connect": EXEC_OUT},
        {"disconnect": "ROS_OdomTF/ros2_publish_odometry.inputs:timeStamp"},
        {"targets": ["ROS_Drive/articulation_controller.inputs:targetPrim"]},
        {"clear": "ROS_Camera/ros2_context.inputs:useDomainIDEnvVar"},
    )
    assert len(findings) == 6
    assert [finding.rule for finding in findings if not finding.hint or not finding.handout] == []


def test_helpers_that_keep_their_stamps_as_the_clock_does_are_right() -> None:
    helper = "ROS_Lidar2D/ros2_rtx_lidar_helper"
    assert told({"set": [f"{helper}.inputs:resetSimulationTimeOnStop", False]}) == ()


def test_a_target_that_is_not_there_is_told_with_the_frame_that_it_costs() -> None:
    stage = broken("05", [])
    node = stage.GetPrimAtPath(place("ROS_OdomTF/isaac_compute_transform_tree"))
    targets = node.GetRelationship("inputs:targetPrims")
    kept = targets.GetTargets()
    robot = kept[0].GetParentPath()
    for listed, rules in (
        ([robot.AppendChild("base"), *kept[1:]], ["T01"]),
        ([robot.AppendChild("base"), *kept], ["R03"]),
        ([robot.AppendChild("base"), robot.AppendChild("base_footprint"), *kept], ["R03", "T09"]),
    ):
        targets.SetTargets(listed)
        found = [finding for finding in judged(stage, "05").findings if finding.severity != "note"]
        assert [each.rule for each in found] == rules


@pytest.mark.parametrize("is_extra", [True, False])
def test_a_node_that_should_go_is_not_told_to_have_another_frame(is_extra: bool) -> None:  # noqa: FBT001
    stage = broken("05", [{"define": ["/World/Imu", "OmniGraph"]}])
    home = place("ROS_Clock") if is_extra else "/World/Imu"
    tick = f"{home}/on_playback_tick"
    if not is_extra:
        Sdf.CopySpec(
            stage.GetRootLayer(), place("ROS_Clock/on_playback_tick"), stage.GetRootLayer(), tick
        )
    imu = stage.DefinePrim(f"{home}/imu", "OmniGraphNode")
    kind = "isaacsim.ros2.bridge.ROS2PublishImu"
    imu.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set(kind)
    exec_in = imu.CreateAttribute("inputs:execIn", Sdf.ValueTypeNames.UInt)
    exec_in.SetConnections([f"{tick}.outputs:tick"])
    found = [finding for finding in judged(stage, "05").findings if finding.prim == f"{home}/imu"]
    assert [each.rule for each in found] == (["N02"] if is_extra else ["T11"])
