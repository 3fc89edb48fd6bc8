"""What the topic rules say of a stage, and what they leave to other rules."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import models as m
import pytest
from in_process import invoke
from msgspec.structs import replace
from pxr import Sdf

from lab3_usd.check.lab_topics import publishers_by_topic
from lab3_usd.check.registry import rules_of
from lab3_usd.data import data_folder
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import GraphModel, Node, PortState, StageModel
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab

STEP = "isaacsim.core.nodes.OnPhysicsStep"
TICK_TYPE = m.lab().graphs[m.ODOM_TF].nodes["on_playback_tick"].type.type
RAW_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.RAW].type.type
GENERIC_SUBSCRIBER = "isaacsim.ros2.bridge.ROS2Subscriber"
QOS_TYPE = "isaacsim.ros2.bridge.ROS2QoSProfile"
TOPIC = "inputs:topicName"


def problems(stage: StageModel, checkpoint: str = "06") -> dict[str, list[Problem]]:
    subject = m.subject(stage, checkpoint)
    found = {
        rule.id: list(rule.check(subject)) for rule in rules_of("stage", "Q") if rule.id[0] == "Q"
    }
    return {rule_id: said for rule_id, said in found.items() if said}


def sites(
    stage: StageModel, checkpoint: str = "06", blamed: tuple[str, ...] = ()
) -> list[tuple[str, str, str | None]]:
    return m.left_beside(blamed, problems(stage, checkpoint))


def copy_of(name: str, place: str = "/Graph") -> GraphModel:
    return m.graph_of(m.lab().graphs[name], f"{place}/{name}")


def driven(path: str, type_name: str, **inputs: Value) -> GraphModel:
    """A graph with one node that runs with every frame."""
    place = path.rpartition("/")[0]
    made = m.wired(m.node(path, type_name, **inputs), "inputs:execIn", f"{place}/tick.outputs:tick")
    return m.graph(place, made, m.node(f"{place}/tick", TICK_TYPE))


@pytest.mark.parametrize("checkpoint", sorted(m.lab().checkpoints))
def test_the_complete_stage_has_no_problem(checkpoint: str) -> None:
    assert sites(m.stage(), checkpoint) == []


# ---- Q01


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("ROS_Clock", "ros2_publish_clock"),
        ("ROS_Lidar2D", "ros2_rtx_lidar_helper"),
        ("ROS_Camera", "ros2_camera_info_helper"),
        ("ROS_OdomTF", "ros2_publish_odometry"),
    ],
)
def test_a_copied_graph_is_one_finding(name: str, role: str, subtests: pytest.Subtests) -> None:
    stage = m.stage(copy_of(name))
    for checkpoint in ("05", "06", "08"):
        with subtests.test(checkpoint=checkpoint):
            assert sites(stage, checkpoint) == [("Q01", f"/Graph/{name}/{role}", TOPIC)]


def test_two_publishers_are_judged_from_the_first_graph_on() -> None:
    stage = m.only(copy_of("ROS_Clock", "/World"), copy_of("ROS_Clock"))
    assert sites(stage, "00") == []
    assert sites(stage, "01") == [("Q01", "/Graph/ROS_Clock/ros2_publish_clock", TOPIC)]


def test_the_other_publisher_is_related() -> None:
    (problem,) = problems(m.stage(copy_of("ROS_Clock")))["Q01"]
    assert problem.related == ("/World/ROS_Clock/ros2_publish_clock",)


def test_an_extra_node_in_a_graph_of_the_lab_is_left_to_the_rule_of_nodes() -> None:
    stage = m.stage()
    clock = m.role(stage, "ros2_publish_clock", "ROS_Clock")
    again = replace(clock, path=f"{clock.path}_01")
    assert sites(m.with_node(stage, again), blamed=(again.path,)) == []


def test_a_wrong_topic_in_a_graph_of_the_lab_is_left_to_the_rule_of_settings() -> None:
    stage = m.stage()
    helper = m.role(stage, "ros2_camera_helper", "ROS_Camera")
    assert sites(m.with_node(stage, m.valued(helper, TOPIC, "/camera/camera_info"))) == []


def test_a_stranger_is_not_blamed_for_a_wrong_topic_of_the_lab() -> None:
    stage = m.stage(driven("/Graph/a/imu", m.IMU_TYPE))
    clock = m.role(stage, "ros2_publish_clock", "ROS_Clock")
    assert sites(m.with_node(stage, m.valued(clock, TOPIC, "imu"))) == []


def test_a_publisher_that_is_signalled_once_is_no_second_one(subtests: pytest.Subtests) -> None:
    once = "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame"
    graph = driven("/Graph/a/step", once)
    clock = m.node("/Graph/a/clock", "isaacsim.ros2.bridge.ROS2PublishClock")
    for source, expected in (("step.outputs:step", []), ("tick.outputs:tick", [clock.path])):
        with subtests.test(source=source, expected=expected):
            again = m.wired(clock, "inputs:execIn", f"/Graph/a/{source}")
            found = sites(m.stage(replace(graph, nodes=(*graph.nodes, again))))
            assert found == [("Q01", path, TOPIC) for path in expected]


def test_several_publishers_of_the_tree_are_normal() -> None:
    graph = driven("/Graph/tf/sender", RAW_TYPE, parentFrameId="base_link", childFrameId="imu")
    assert sites(m.stage(graph)) == []


def test_several_publishers_of_the_tree_of_another_robot_are_normal() -> None:
    copy = copy_of("ROS_OdomTF", "/Robot2")
    nodes = tuple(m.valued(node, "inputs:nodeNamespace", "robot2") for node in copy.nodes)
    assert sites(m.stage(replace(copy, nodes=nodes))) == []


def test_a_publisher_whose_topic_the_lab_leaves_at_its_default_has_no_second() -> None:
    lab = m.lab()
    clock = lab.graphs["ROS_Clock"]
    spec = clock.nodes["ros2_publish_clock"]
    kept = replace(spec, settings=tuple(s for s in spec.settings if s.port != TOPIC))
    graph = replace(clock, nodes={**clock.nodes, "ros2_publish_clock": kept})
    lab = replace(lab, graphs={**lab.graphs, "ROS_Clock": graph})
    subject = replace(m.subject(m.stage(copy_of("ROS_Clock"))), lab=lab)
    ((again,),) = [topic.blamed for topic in publishers_by_topic(subject)]
    assert again.node.path == "/Graph/ROS_Clock/ros2_publish_clock"


def test_a_copy_that_does_not_run_is_no_second_publisher() -> None:
    copy = copy_of("ROS_Clock")
    stopped = tuple(node for node in copy.nodes if node.name != "on_playback_tick")
    assert sites(m.stage(replace(copy, nodes=stopped))) == []
    assert sites(m.stage(replace(copy, active=False))) == []


@pytest.mark.parametrize(
    ("event", "attributes", "severity"),
    [
        (STEP, {"pipelineStage": "pipelineStageOnDemand"}, None),
        (STEP, {}, "absent"),
        (TICK_TYPE, {"pipelineStage": "pipelineStageOnDemand"}, "absent"),
        (TICK_TYPE, {"evaluationMode": "Instanced"}, "absent"),
        (TICK_TYPE, {"evaluationMode": "Standalone"}, None),
        ("some.Node", {"evaluator:type": "push"}, None),
        ("some.Node", {"evaluator:type": "dirty_push"}, None),
        ("omni.graph.action.OnCustomEvent", {}, "warning"),
        ("omni.graph.action.OnVariableChange", {}, "warning"),
    ],
)
def test_a_second_publisher_counts_where_it_runs(
    event: str, attributes: dict[str, Value], severity: str | None
) -> None:
    copy = copy_of("ROS_OdomTF")
    nodes = []
    for node in copy.nodes:
        if node.name == "on_playback_tick":
            root = m.node(node.path, event)
            nodes.append(replace(root, ports={"outputs:tick": PortState("outputs:tick")}))
        else:
            nodes.append(m.rewired(node, "outputs:tick", "outputs:step") if event == STEP else node)
    changed = replace(copy, nodes=tuple(nodes), attributes={**copy.attributes, **attributes})
    found = problems(m.stage(changed))
    assert [p.severity for p in found.get("Q01", [])] == [severity] * (severity != "absent")
    assert [p.severity for p in found.get("Q02", [])] == []


def test_a_reader_of_another_type_counts_where_it_runs() -> None:
    graph = driven(
        "/Graph/any/reader", GENERIC_SUBSCRIBER, topicName="cmd_vel",
        messagePackage="geometry_msgs", messageName="TwistStamped",
    )  # fmt: skip
    reader, tick = graph.nodes
    assert "Q02" not in problems(m.stage(replace(graph, nodes=(reader,))), "06")
    custom = replace(tick, type=None, type_name="omni.graph.action.OnCustomEvent")
    custom = replace(custom, ports={"outputs:tick": PortState("outputs:tick")})
    (problem,) = problems(m.stage(replace(graph, nodes=(reader, custom))), "06")["Q02"]
    assert problem.severity == "warning"


def test_a_copy_in_a_namespace_is_no_second_publisher() -> None:
    copy = copy_of("ROS_Clock")
    nodes = tuple(m.valued(node, "inputs:nodeNamespace", "b") for node in copy.nodes)
    assert sites(m.stage(replace(copy, nodes=nodes))) == []


def test_two_strangers_with_one_topic_are_a_finding() -> None:
    one = driven("/Graph/a/imu", m.IMU_TYPE)
    two = driven("/Graph/b/imu", m.IMU_TYPE)
    assert sites(m.stage(one, two)) == [("Q01", "/Graph/b/imu", TOPIC)]


def test_a_publisher_that_is_blamed_already_is_silent() -> None:
    stage = m.stage(copy_of("ROS_Clock"))
    assert sites(stage, blamed=("/Graph/ROS_Clock/ros2_publish_clock",)) == []


# ---- Q02 to Q05


@pytest.mark.parametrize(("message", "count"), [("TwistStamped", 1), ("Twist", 0)])
def test_a_topic_of_the_lab_with_another_type_is_found(message: str, count: int) -> None:
    graph = driven(
        "/Graph/any/reader", GENERIC_SUBSCRIBER, topicName="cmd_vel",
        messagePackage="geometry_msgs", messageName=message,
    )  # fmt: skip
    found = problems(m.stage(graph), "06").get("Q02", [])
    assert [(p.prim, p.actual) for p in found] == [
        ("/Graph/any/reader", "geometry_msgs/msg/TwistStamped")
    ][:count]
    assert len(problems(m.stage(graph), "02").get("Q02", [])) == count
    early = problems(m.stage(graph), "01").get("Q02", [])  # nothing is asked of the topic yet
    assert [p.severity for p in early] == ["warning"] * count


def test_another_type_on_the_topic_of_the_tree_is_found() -> None:
    graph = driven(
        "/Graph/any/sender", "isaacsim.ros2.bridge.ROS2Publisher", topicName="tf",
        messagePackage="std_msgs", messageName="String",
    )  # fmt: skip
    (problem,) = problems(m.stage(graph), "05")["Q02"]
    assert (problem.prim, problem.severity) == ("/Graph/any/sender", None)


def sender(**inputs: Value) -> StageModel:
    names: dict[str, Value] = {"parentFrameId": "base_link", "childFrameId": "imu"}
    return m.stage(driven("/Graph/tf/sender", RAW_TYPE, **names, **inputs))


@pytest.mark.parametrize(
    ("topic", "static", "count"),
    [("tf_static", False, 1), ("tf_static", True, 0), ("tf", True, 1), ("tf", False, 0)],
)
def test_the_durability_of_a_topic_must_be_that_of_g6(
    topic: str, count: int, *, static: bool
) -> None:
    stage = sender(topicName=topic, staticPublisher=static)
    assert sites(stage) == [("Q03", "/Graph/tf/sender", "inputs:staticPublisher")] * count
    assert sites(stage, "05") == []


def wired_profile(role: Node) -> StageModel:
    place = role.path.rpartition("/")[0]
    maker = m.node(f"{place}/profile", QOS_TYPE, createProfile="Sensor Data")
    stage = m.with_node(m.stage(), maker)
    return m.with_node(
        stage, m.wired(role, "inputs:qosProfile", f"{maker.path}.outputs:qosProfile")
    )


def test_a_profile_by_wire_is_found() -> None:
    helper = m.role(m.stage(), "ros2_rtx_lidar_helper", "ROS_Lidar2D")
    stage = wired_profile(helper)
    assert sites(stage) == [("Q04", helper.path, "inputs:qosProfile")]
    assert sites(stage, "05") == []
    (problem,) = problems(stage)["Q04"]
    assert problem.actual == "keep_last 5, best_effort, volatile"


def test_a_profile_as_a_setting_is_left_to_the_rule_of_settings() -> None:
    stage = m.stage()
    helper = m.role(stage, "ros2_rtx_lidar_helper", "ROS_Lidar2D")
    assert sites(m.with_node(stage, m.valued(helper, "inputs:qosProfile", "SensorData"))) == []


def test_a_copied_drive_graph_takes_the_commands_twice() -> None:
    stage = m.stage(copy_of("ROS_Drive"))
    assert sites(stage, "02") == [("Q05", "/Graph/ROS_Drive/ros2_subscribe_twist", TOPIC)]
    assert sites(stage, "01") == []


def test_another_subscriber_in_a_graph_of_the_lab_is_left_to_the_rule_of_nodes() -> None:
    stage = m.stage()
    taker = m.role(stage, "ros2_subscribe_twist", "ROS_Drive")
    assert sites(m.with_node(stage, replace(taker, path=f"{taker.path}_01"))) == []


@pytest.mark.parametrize("event", [TICK_TYPE, "omni.graph.action.OnCustomEvent"])
def test_a_publisher_of_the_commands_is_a_warning_wherever_it_stands(event: str) -> None:
    graph = driven(
        "/Graph/any/sender", m.PUBLISHER_TYPE, topicName="cmd_vel",
        messagePackage="geometry_msgs", messageName="Twist",
    )  # fmt: skip
    sender, tick = graph.nodes
    root = replace(m.node(tick.path, event), ports={"outputs:tick": PortState("outputs:tick")})
    assert sites(m.stage(replace(graph, nodes=(sender, root)))) == [
        ("Q06", "/Graph/any/sender", TOPIC)
    ]
    assert sites(m.stage(replace(graph, nodes=(sender,)))) == []


@pytest.mark.parametrize("space", ["", "mm"])
def test_a_copy_is_found_where_the_lab_writes_a_namespace_on_the_node(
    tmp_path: Path, space: str
) -> None:
    folder = tmp_path / "lab"
    shutil.copytree(data_folder("graphs"), folder, ignore=shutil.ignore_patterns("__pycache__"))
    clock = folder / "ROS_Clock.yaml"
    text = clock.read_text().replace("queueSize: 10", f'queueSize: 10, nodeNamespace: "{space}"')
    clock.write_text(text)
    for file in ("ros.yaml", "submission.yaml", "rubric.yaml"):
        text = (folder / file).read_text()
        (folder / file).write_text(re.sub(r"/clock\b", f"/{space}/clock".replace("//", "/"), text))
    path = tmp_path / "Lab3_01_ros_clock.usda"
    assert invoke("--lab", folder, "build", "-o", tmp_path, "--force").exit_code == 0
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CreatePrimInLayer(layer, "/Graph").specifier = Sdf.SpecifierDef
    Sdf.CopySpec(layer, "/World/ROS_Clock", layer, "/Graph/Copy")
    layer.Save()
    findings = check_stage(path, lab=load_lab(folder)).findings
    blamed = [each.prim for each in findings if each.rule == "Q01"]
    assert blamed == ["/Graph/Copy/ros2_publish_clock"]
