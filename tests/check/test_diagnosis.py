"""Likely mistakes in wires, each with the message that explains it."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import broken, judged, place
from pxr import Sdf

from lab3_usd.model.finding import Finding, ordered

ROBOT = "/turtlebot3_burger"
DRIVE = "/turtlebot3_burger/ROS_Drive"


def told(*steps: dict[str, Any]) -> tuple[Finding, ...]:
    """Errors and warnings of checkpoint 05 after these steps."""
    judgement = judged(broken("05", list(steps)), "05")
    assert not judgement.crashes
    return ordered(finding for finding in judgement.findings if finding.severity != "note")


def the_only(*steps: dict[str, Any]) -> Finding:
    findings = told(*steps)
    assert [(finding.rule, finding.prim) for finding in findings[1:]] == []
    return findings[0]


def assert_words(finding: Finding, *words: str) -> None:
    """The message says what is there, what should be, and what explains it."""
    assert [word for word in words if word not in finding.message] == []


LEFT = "ROS_Drive/constant_left_joint"
RIGHT = "ROS_Drive/constant_right_joint"
CONTROLLER = "ROS_Drive/differential_controller"


def test_swapped_wheel_tokens() -> None:
    finding = the_only({"swap": [f"{LEFT}.inputs:value", f"{RIGHT}.inputs:value"]})
    assert (finding.rule, finding.prim) == ("P07", place(LEFT))
    assert (finding.actual, finding.expected) == ("'wheel_right_joint'", "'wheel_left_joint'")
    assert finding.related == (f"{place(RIGHT)}.inputs:value",)
    assert_words(finding, "constant_right_joint holds the value that belongs here")


def test_reversed_inputs_of_the_array() -> None:
    array = "ROS_Drive/make_array"
    finding = the_only({"swap": [f"{array}.inputs:input0", f"{array}.inputs:input1"]})
    assert (finding.rule, finding.prim, finding.property) == ("W06", place(array), "inputs:input0")
    assert finding.related == (f"{place(array)}.inputs:input1",)
    assert_words(finding, "are exchanged")


@pytest.mark.parametrize(
    ("node", "words"),
    [
        ("ros2_publish_odometry", "signals once after Play: that opens the topic, and nothing is"),
        ("isaac_compute_odometry", "signals only once after Play"),
    ],
)
def test_a_wire_from_what_signals_once(node: str, words: str) -> None:
    once = "ROS_OdomTF/once"
    extra, finding = told(
        {"copy": ["ROS_Camera/isaac_run_one_simulation_frame", once]},
        {"connect": [f"{once}.inputs:execIn", "ROS_OdomTF/on_playback_tick.outputs:tick"]},
        {"connect": [f"ROS_OdomTF/{node}.inputs:execIn", f"{once}.outputs:step"]},
    )
    found = sorted([extra, finding], key=lambda each: each.rule)
    assert [(each.rule, each.prim) for each in found] == [
        ("N02", place(once)),
        ("W02", place(f"ROS_OdomTF/{node}")),
    ]
    assert_words(found[1], words, "expected")


def test_tokens_and_inputs_both_reversed_are_right_again() -> None:
    array = "ROS_Drive/make_array"
    steps = (
        {"swap": [f"{LEFT}.inputs:value", f"{RIGHT}.inputs:value"]},
        {"swap": [f"{array}.inputs:input0", f"{array}.inputs:input1"]},
    )
    assert told(*steps) == ()


@pytest.mark.parametrize("axis", ["x", "y"])
def test_another_axis_instead_of_z(axis: str) -> None:
    source = f"ROS_Drive/break_angular_velocity.outputs:{axis}"
    finding = the_only({"connect": [f"{CONTROLLER}.inputs:angularVelocity", source]})
    assert (finding.rule, finding.prim) == ("W02", place(CONTROLLER))
    assert finding.property == "inputs:angularVelocity"
    assert_words(
        finding, f"break_angular_velocity.outputs:{axis}", "break_angular_velocity.outputs:z"
    )
    assert finding.handout == "C7"


def test_linear_for_angular_velocity() -> None:
    finding = the_only(
        {"swap": [f"{CONTROLLER}.inputs:linearVelocity", f"{CONTROLLER}.inputs:angularVelocity"]}
    )
    assert finding.rule == "W06"
    assert_words(finding, "are exchanged")


@pytest.mark.parametrize("is_left_hanging", [False, True])
def test_a_vector_wired_past_the_scale_node(is_left_hanging: bool) -> None:  # noqa: FBT001
    steps: list[dict[str, Any]] = [
        {
            "connect": [
                "ROS_Drive/break_linear_velocity.inputs:tuple",
                "ROS_Drive/ros2_subscribe_twist.outputs:linearVelocity",
            ]
        }
    ]
    if is_left_hanging:
        steps.append({"disconnect": "ROS_Drive/scale_linear_velocity.inputs:value"})
    finding = the_only(*steps)
    assert (finding.rule, finding.prim) == ("W02", f"{DRIVE}/break_linear_velocity")
    assert_words(finding, "goes past scale_linear_velocity")


def test_odometry_published_past_its_computation() -> None:
    finding = the_only(
        {
            "connect": [
                "ROS_OdomTF/ros2_publish_odometry.inputs:execIn",
                "ROS_OdomTF/on_playback_tick.outputs:tick",
            ]
        }
    )
    assert_words(finding, "goes past isaac_compute_odometry")


EXEC_OUT = ["ROS_Drive/differential_controller.inputs:execIn"]
EXEC_OUT += ["ROS_Drive/ros2_subscribe_twist.outputs:execOut"]


@pytest.mark.parametrize("how", ["connect", "add source"])
def test_the_subscriber_drives_the_controller_alone_and_beside_the_tick(how: str) -> None:
    finding = the_only({how: EXEC_OUT})
    assert (finding.rule, finding.prim) == ("W10", place(CONTROLLER))
    assert_words(finding, "the handout forbids", "on_playback_tick.outputs:tick")
    assert finding.handout == "C8"


def test_the_forbidden_wire_is_found_among_wrong_ones() -> None:
    other = "ROS_Drive/on_playback_tick.outputs:time"
    finding = the_only({"connect": [EXEC_OUT[0], other, EXEC_OUT[1]]})
    assert finding.rule == "W10"


@pytest.mark.parametrize(("how", "rule"), [("connect", "W07"), ("add source", "W04")])
def test_a_context_of_another_graph_is_told_by_its_whole_path(how: str, rule: str) -> None:
    finding = the_only(
        {how: ["ROS_Drive/ros2_subscribe_twist.inputs:context", _CONTEXT_OF_CLOCK]},
    )
    assert finding.rule == rule
    assert_words(finding, "/World/ROS_Clock/ros2_context.outputs:context")


_CONTEXT_OF_CLOCK = "ROS_Clock/ros2_context.outputs:context"


def test_a_context_of_another_graph_for_one_that_is_missing() -> None:
    finding = the_only(
        {"connect": ["ROS_Drive/ros2_subscribe_twist.inputs:context", _CONTEXT_OF_CLOCK]},
        {"remove": "ROS_Drive/ros2_context"},
    )
    assert (finding.rule, finding.prim) == ("N01", DRIVE)


def test_make_array_that_is_not_make_array() -> None:
    finding = the_only({"set": ["ROS_Drive/make_array.node:type", "omni.graph.nodes.MakeArray"]})
    assert (finding.rule, finding.prim) == ("N03", f"{DRIVE}/make_array")
    assert_words(finding, "omni.graph.nodes.MakeArray", "the name looks alike")
    assert finding.expected == "omni.graph.nodes.ConstructArray"


def test_a_constant_wired_from_the_output_that_the_handout_names() -> None:
    finding = the_only(
        {"connect": ["ROS_Drive/make_array.inputs:input0", f"{LEFT}.outputs:value"]},
    )
    assert finding.rule == "W03"
    assert_words(finding, "outputs:value, which does not exist", "constant_left_joint.inputs:value")


def test_on_tick_instead_of_on_playback_tick() -> None:
    finding = the_only(
        {"set": ["ROS_Camera/on_playback_tick.node:type", "omni.graph.action.OnTick"]}
    )
    assert (finding.rule, finding.property) == ("N03", "node:type")
    assert_words(finding, "omni.graph.action.OnTick", "On Playback Tick")


def test_a_node_of_no_type_is_told_as_that() -> None:
    finding = the_only({"clear": "ROS_Drive/scale_linear_velocity.node:type"})
    assert finding.rule == "N03"
    assert_words(finding, "of no type", "Scale To/From Stage Units")


@pytest.mark.parametrize("parent", ["world", "odom", "map"])
def test_a_transform_that_nobody_may_publish_is_told_once(parent: str) -> None:
    raw = "ROS_OdomTF/ros2_publish_raw_transform_tree"
    findings = told(
        {"set": [f"{raw}.inputs:parentFrameId", parent]},
        {"set": [f"{raw}.inputs:childFrameId", "odom"]},
    )
    assert [finding.rule[0] for finding in findings] == ["T"]


def test_a_graph_at_the_wrong_path_is_known_by_its_content() -> None:
    finding = the_only({"move": ["ROS_Clock", "/World/ActionGraph"]})
    assert (finding.rule, finding.prim) == ("G02", "/World/ActionGraph")
    assert finding.expected == "/World/ROS_Clock"


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        ({"deactivate": "ROS_Clock/ros2_context"}, "deactivated"),
        ({"over": "ROS_Clock/ros2_context"}, "an over without a def"),
        ({"move": ["ROS_Clock/ros2_context", "/World/ros2_context"]}, "outside every graph"),
    ],
)
def test_why_a_node_is_absent_is_said(step: dict[str, Any], reason: str) -> None:
    finding = the_only(step)
    assert (finding.rule, finding.prim) == ("N01", "/World/ROS_Clock")
    assert_words(finding, "ROS2 Context", reason)
    assert len(finding.related) == 1


def test_a_node_in_another_graph_is_named_and_not_added_again() -> None:
    node, other = "ROS_Drive/ros2_subscribe_twist", "/World/Listening"
    steps = [{"define": [other, "OmniGraph"]}, {"move": [node, f"{other}/ros2_subscribe_twist"]}]
    found = [
        finding for finding in judged(broken("02", steps), "02").findings if finding.rule == "N01"
    ]
    assert [each.related for each in found] == [(f"{other}/ros2_subscribe_twist",)]
    assert_words(found[0], f"{other}/ros2_subscribe_twist is in another graph")
    assert found[0].fix is None


def test_a_node_of_a_type_that_other_graphs_have_is_not_sought_there() -> None:
    assert the_only({"remove": "ROS_Clock/ros2_context"}).related == ()


def test_the_asset_that_could_have_brought_a_node_is_named() -> None:
    stage = broken("01", [{"over": "ROS_Clock/ros2_context"}])
    stage.GetPrimAtPath("/World/ROS_Clock").GetPayloads().AddPayload("clock.usd")
    (finding,) = [each for each in judged(stage, "01").findings if each.severity == "error"]
    assert_words(finding, "ROS2 Context", "an over without a def", "clock.usd")


@pytest.mark.parametrize(
    "steps",
    [
        ({"deactivate": RIGHT}, {"deactivate": LEFT}),
        ({"move": [RIGHT, "/World/a/constant_right_joint"]}, {"move": [LEFT, "/World/b/left"]}),
        ({"move": [LEFT, "/World/b/constant_left_joint"]}, {"move": [RIGHT, "/World/a/right"]}),
    ],
)
def test_of_two_absent_nodes_each_is_told_where_its_name_says(
    steps: tuple[dict[str, Any], ...],
) -> None:
    homes = ({"define": ["/World/a", "Xform"]}, {"define": ["/World/b", "Xform"]})
    findings = told(*homes, *steps)
    assert [each.rule for each in findings] == ["N01", "N01"]
    for side, finding in zip(("left", "right"), findings, strict=True):
        assert f"constant_{side}_joint) is missing" in finding.message
        assert side in finding.related[0]


@pytest.mark.parametrize("step", ["deactivate", "over"])
def test_why_a_graph_is_absent_is_said(step: str) -> None:
    finding = the_only({step: "ROS_Clock"})
    assert (finding.rule, finding.prim) == ("G01", "/World/ROS_Clock")
    assert_words(finding, "deactivated or only an over")


def test_a_wire_that_went_into_another_input() -> None:
    node = "ROS_OdomTF/ros2_publish_raw_transform_tree"
    finding = the_only(
        {"disconnect": f"{node}.inputs:timeStamp"},
        {
            "connect": [
                f"{node}.inputs:queueSize",
                "ROS_OdomTF/isaac_read_simulation_time.outputs:simulationTime",
            ]
        },
    )
    assert (finding.rule, finding.property) == ("W01", "inputs:timeStamp")
    assert_words(finding, "that wire goes into ros2_publish_raw_transform_tree.inputs:queueSize")


def test_a_cut_wire_is_not_sought_where_its_source_belongs() -> None:
    finding = the_only({"disconnect": f"{CONTROLLER}.inputs:execIn"})
    assert (finding.rule, finding.related) == ("W01", ())
    assert "instead" not in finding.message


def test_a_cut_wire_is_not_sought_in_wires_of_another_source() -> None:
    findings = told(
        {"disconnect": f"{CONTROLLER}.inputs:execIn"},
        {
            "connect": [
                f"{CONTROLLER}.inputs:maxWheelSpeed",
                "ROS_Drive/on_playback_tick.outputs:time",
            ]
        },
    )
    assert [(finding.rule, finding.related) for finding in findings] == [("W01", ()), ("W05", ())]


def test_one_wire_gone_astray_explains_one_cut_wire() -> None:
    findings = told(
        {"disconnect": "ROS_OdomTF/ros2_publish_odometry.inputs:timeStamp"},
        {"disconnect": "ROS_OdomTF/ros2_publish_raw_transform_tree.inputs:timeStamp"},
        {
            "connect": [
                "ROS_OdomTF/ros2_publish_raw_transform_tree.inputs:queueSize",
                "ROS_OdomTF/isaac_read_simulation_time.outputs:simulationTime",
            ]
        },
    )
    assert [finding.rule for finding in findings] == ["W01", "W01"]
    assert [len(finding.related) for finding in findings] == [0, 1]


def test_literals_in_the_array_are_two_missing_nodes() -> None:
    array = "ROS_Drive/make_array"
    findings = told(
        {"remove": LEFT},
        {"remove": RIGHT},
        {"declare": [f"{array}.inputs:input0", "token", "wheel_left_joint"]},
        {"declare": [f"{array}.inputs:input1", "token", "wheel_right_joint"]},
    )
    assert [(finding.rule, finding.prim) for finding in findings] == [
        ("N01", DRIVE),
        ("N01", DRIVE),
    ]


PUBLISHER = "ROS_OdomTF/ros2_publish_transform_tree"
COMPUTED = "ROS_OdomTF/isaac_compute_transform_tree"


@pytest.mark.parametrize(
    ("step", "rule"),
    [
        ({"swap": [f"{PUBLISHER}.inputs:parentFrames", f"{PUBLISHER}.inputs:childFrames"]}, "W06"),
        (
            {"connect": [f"{PUBLISHER}.inputs:childFrames", f"{COMPUTED}.outputs:parentFrames"]},
            "W02",
        ),
        (
            {"connect": [f"{PUBLISHER}.inputs:parentFrames", f"{COMPUTED}.outputs:childFrames"]},
            "W02",
        ),
    ],
)
def test_frames_that_wires_exchange_are_told_as_wires_only(step: dict[str, Any], rule: str) -> None:
    finding = the_only(step)
    assert (finding.rule, finding.prim) == (rule, place(PUBLISHER))


def test_another_mistake_at_the_publisher_hides_no_missing_frame() -> None:
    links = ["base_link", "base_scan", "caster_back_link", "wheel_left_link", "wheel_right_link"]
    findings = told(
        {"set": [f"{PUBLISHER}.inputs:queueSize", 3]},
        {"targets": [f"{COMPUTED}.inputs:targetPrims", *(f"{ROBOT}/{link}" for link in links)]},
    )
    assert [(finding.rule, finding.prim) for finding in findings] == [
        ("T01", place(COMPUTED)),
        ("P01", place(PUBLISHER)),
    ]


def test_a_missing_node_silences_its_wires_though_not_others() -> None:
    findings = told(
        {"remove": "ROS_OdomTF/isaac_compute_odometry"},
        {"disconnect": "ROS_OdomTF/ros2_publish_odometry.inputs:timeStamp"},
    )
    assert [finding.rule for finding in findings] == ["N01", "W01"]


def test_two_mistakes_are_two_findings() -> None:
    findings = told(
        {"disconnect": "ROS_Clock/ros2_publish_clock.inputs:timeStamp"},
        {"swap": [f"{LEFT}.inputs:value", f"{RIGHT}.inputs:value"]},
    )
    assert [finding.rule for finding in findings] == ["W01", "P07"]


def test_two_mistakes_at_one_node_are_two_findings() -> None:
    findings = told(
        {"disconnect": f"{CONTROLLER}.inputs:execIn"},
        {"set": [f"{CONTROLLER}.inputs:wheelRadius", 0.033]},
    )
    assert [(finding.rule, finding.property) for finding in findings] == [
        ("W01", "inputs:execIn"),
        ("P01", "inputs:wheelRadius"),
    ]


def test_of_two_dead_sources_the_input_is_named_once() -> None:
    port = "ROS_Clock/ros2_publish_clock.inputs:timeStamp"
    finding = the_only({"connect": [port, "ROS_Clock/a.outputs:x", "ROS_Clock/b.outputs:x"]})
    assert finding.rule == "W03"


def test_two_nodes_that_trigger_each_other() -> None:
    findings = told(
        {
            "connect": [
                "ROS_OdomTF/isaac_compute_odometry.inputs:execIn",
                "ROS_OdomTF/isaac_compute_transform_tree.outputs:execOut",
            ]
        },
        {
            "connect": [
                "ROS_OdomTF/isaac_compute_transform_tree.inputs:execIn",
                "ROS_OdomTF/isaac_compute_odometry.outputs:execOut",
            ]
        },
    )
    assert [finding.rule for finding in findings] == ["W02", "W02"]


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


def test_a_twin_may_take_the_place_of_a_source_but_not_stand_beside_it() -> None:
    tick, publisher = "ROS_Clock/on_playback_tick", "ROS_Clock/ros2_publish_clock"
    twin = {"copy": [tick, f"{tick}_01"]}
    beside = {"add source": [f"{publisher}.inputs:execIn", f"{tick}_01.outputs:tick"]}
    found = {(each.rule, each.severity, each.prim) for each in told(twin, beside)}
    assert ("W04", "error", place(publisher)) in found


def test_helpers_that_keep_their_stamps_as_the_clock_does_are_right() -> None:
    helper = "ROS_Lidar2D/ros2_rtx_lidar_helper"
    assert told({"set": [f"{helper}.inputs:resetSimulationTimeOnStop", False]}) == ()


def test_a_value_from_the_input_of_another_node_is_wrong_and_no_leftover() -> None:
    helper, odometry = "ROS_Lidar2D/ros2_rtx_lidar_helper", "ROS_OdomTF/ros2_publish_odometry"
    wire = [f"{helper}.inputs:topicName", f"{odometry}.inputs:topicName"]
    found = told({"connect": wire})
    assert [(each.rule, each.property) for each in found] == [("P01", "inputs:topicName")]
    assert "delete the wire" in (found[0].hint or "")


def test_a_signal_from_an_input_is_none() -> None:
    tick = "ROS_Clock/ros2_publish_clock.inputs:execIn"
    other = "ROS_OdomTF/ros2_publish_odometry.inputs:execIn"
    assert [each.rule for each in told({"connect": [tick, other]})] == ["W03"]


def test_a_limit_that_comes_by_a_wire_is_one_finding_that_says_so() -> None:
    limit = "ROS_Drive/differential_controller.inputs:maxAcceleration"
    radius = "ROS_Drive/differential_controller.inputs:wheelRadius"
    found = told({"connect": [limit, radius]})
    assert [each.rule for each in found] == ["P11"]
    assert "delete the wire" in (found[0].hint or "")


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
