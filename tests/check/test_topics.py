"""The topics of a stage: names, types, frames, QoS and pace, as Isaac Sim would have them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import models as m
import pytest
from foreign_robots import connect, rover, write_node
from in_process import invoke
from msgspec.structs import replace
from pxr import Sdf, Usd

from lab3_usd.facts.endpoints import Endpoint, endpoints, read_profile, ros_name
from lab3_usd.isaac.values import Value
from lab3_usd.model.qos import Qos
from lab3_usd.model.stage import Node, PortState, StageModel
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.builder import build_checkpoint

LIDAR, CAMERA, INFO = "ros2_rtx_lidar_helper", "ros2_camera_helper", "ros2_camera_info_helper"
QOS_TYPE = "isaacsim.ros2.bridge.ROS2QoSProfile"
PROFILE = {
    "history": "keepLast",
    "depth": 5,
    "reliability": "bestEffort",
    "durability": "transientLocal",
    "deadline": 0.0,
    "lifespan": 0.5,
    "liveliness": "manualByTopic",
    "leaseDuration": 0.0,
}


def found(stage: StageModel) -> dict[tuple[str | None, str], Endpoint]:
    return {(endpoint.topic, endpoint.node.name): endpoint for endpoint in endpoints(stage)}


def of(stage: StageModel, role: str) -> Endpoint:
    (endpoint,) = [each for each in endpoints(stage) if each.node.name == role]
    return endpoint


def changed(role: str, graph: str, **inputs: Value) -> StageModel:
    stage = m.stage()
    node = m.role(stage, role, graph)
    for name, value in inputs.items():
        node = m.valued(node, f"inputs:{name}", value)
    return m.with_node(stage, node)


@pytest.mark.parametrize(
    ("namespace", "written", "topic"),
    [
        ("", "scan", "/scan"),
        ("", "/scan", "/scan"),
        ("", "//scan/", "/scan"),
        ("", "~/scan", "/scan"),
        ("", "_scan_", "/scan"),
        ("ns", "scan", "/ns/scan"),
        ("/a/b/", "/camera/image_raw", "/a/b/camera/image_raw"),
        ("", "", None),
        ("", "///", None),
        ("", "a b", None),
        ("", "a//b", None),
        ("", "a/2b", None),
        ("ns", "", None),
    ],
)
def test_names_resolve_as_the_bridge_writes_them(
    namespace: str, written: str, topic: str | None
) -> None:
    assert ros_name(namespace, written) == topic


def test_the_lab_has_its_topics() -> None:
    table = {(e.topic, e.type, e.direction, e.frames, e.runs) for e in endpoints(m.stage())}
    assert table >= {
        ("/camera/camera_info", "sensor_msgs/msg/CameraInfo", "publishes", ("Camera_1",), True),
        ("/camera/image_raw", "sensor_msgs/msg/Image", "publishes", ("Camera_1",), True),
        ("/clock", "rosgraph_msgs/msg/Clock", "publishes", (), True),
        ("/cmd_vel", "geometry_msgs/msg/Twist", "subscribes", (), True),
        ("/odom", "nav_msgs/msg/Odometry", "publishes", ("odom", "base_footprint"), True),
        ("/scan", "sensor_msgs/msg/LaserScan", "publishes", ("base_scan",), True),
        ("/tf", "tf2_msgs/msg/TFMessage", "publishes", ("odom", "base_footprint"), True),
        ("/tf", "tf2_msgs/msg/TFMessage", "publishes", (), True),
    }


def test_a_topic_left_alone_is_the_default() -> None:
    stage = changed(LIDAR, "ROS_Lidar2D", topicName=None, frameId=None)
    assert (of(stage, LIDAR).topic, of(stage, LIDAR).frames) == ("/scan", ("sim_lidar",))


def test_the_type_follows_the_setting() -> None:
    assert (
        of(changed(LIDAR, "ROS_Lidar2D", type="point_cloud"), LIDAR).type
        == "sensor_msgs/msg/PointCloud2"
    )


def test_a_namespace_of_the_node_moves_its_topic() -> None:
    assert of(changed(LIDAR, "ROS_Lidar2D", nodeNamespace="tb3"), LIDAR).topic == "/tb3/scan"


def test_a_namespace_above_the_sensor_moves_a_helpers_topic() -> None:
    stage = m.with_prim(m.stage(), f"{m.ROBOT}/base_scan", attributes={"isaac:namespace": "front"})
    stage = m.with_prim(stage, m.ROBOT, attributes={"isaac:namespace": "tb3"})
    assert of(stage, LIDAR).topic == "/tb3/front/scan"
    assert of(stage, CAMERA).topic == "/tb3/camera/image_raw"


def test_a_tf_publisher_takes_the_outermost_namespace_only() -> None:
    stage = m.stage()
    for role in (m.RAW, "ros2_publish_odometry"):
        stage = m.with_node(stage, replace(m.role(stage, role), namespaces=("a/b", "c")))
    assert of(stage, m.RAW).topic == "/a/b/tf"
    assert of(stage, "ros2_publish_odometry").topic == "/a/b/c/odom"


def test_a_second_topic_counts_once_it_is_switched_on() -> None:
    assert ("/semantic_labels", CAMERA) not in found(m.stage())
    stage = changed(CAMERA, "ROS_Camera", type="semantic_segmentation", enableSemanticLabels=True)
    assert found(stage)["/semantic_labels", CAMERA].type == "std_msgs/msg/String"


def test_a_topic_of_other_messages_does_not_count() -> None:
    stage = changed(CAMERA, "ROS_Camera", enableSemanticLabels=True)
    assert ("/semantic_labels", CAMERA) not in found(stage)


def test_the_right_camera_counts_once_it_has_a_render_product() -> None:
    stage = m.stage()
    info = m.role(stage, INFO, "ROS_Camera")
    source = info.sources("inputs:renderProductPath")[0]
    stage = m.with_node(stage, m.wired(info, "inputs:renderProductPathRight", source))
    right = found(stage)["/camera_info_right", INFO]
    assert (right.frames, right.runs) == (("sim_camera_right",), True)


def test_a_generic_publisher_has_the_type_it_names() -> None:
    generic = m.node(
        "/World/ROS_Clock/any", m.PUBLISHER_TYPE, topicName="map", messagePackage="nav_msgs"
    )
    assert of(m.with_node(m.stage(), generic), "any").type is None
    named = m.valued(generic, "inputs:messageName", "OccupancyGrid")
    assert of(m.with_node(m.stage(), named), "any").type == "nav_msgs/msg/OccupancyGrid"


# ---- what runs, and at what pace


def lidar_without(port: str) -> StageModel:
    stage = m.stage()
    return m.with_node(stage, m.wired(m.role(stage, LIDAR, "ROS_Lidar2D"), port))


def without_product() -> StageModel:
    stage = m.stage()
    return m.without_node(stage, m.role(stage, "isaac_create_render_product", "ROS_Lidar2D").path)


@pytest.mark.parametrize(
    "stage",
    [
        changed(LIDAR, "ROS_Lidar2D", enabled=False),
        changed("isaac_create_render_product", "ROS_Lidar2D", enabled=False),
        without_product(),
        lidar_without("inputs:renderProductPath"),
        lidar_without("inputs:execIn"),
    ],
    ids=["helper off", "product off", "no product", "product not wired", "not driven"],
)
def test_a_helper_without_its_sensor_publishes_nothing(stage: StageModel) -> None:
    assert not of(stage, LIDAR).runs
    assert of(stage, CAMERA).runs


@pytest.mark.parametrize(
    ("role", "graph", "kind", "runs"),
    [
        (CAMERA, "ROS_Camera", "camera_info", False),
        (CAMERA, "ROS_Camera", "Depth", False),
        (CAMERA, "ROS_Camera", "", False),
        (CAMERA, "ROS_Camera", "distance_to_camera", False),
        (CAMERA, "ROS_Camera", "distance_to_image_plane", True),
        (CAMERA, "ROS_Camera", "depth", True),
        (CAMERA, "ROS_Camera", "rgb_h264", True),
        (LIDAR, "ROS_Lidar2D", "scan", False),
        (LIDAR, "ROS_Lidar2D", "point_cloud", True),
    ],
)
def test_a_helper_of_a_kind_that_is_refused_publishes_nothing(
    role: str, graph: str, kind: str, *, runs: bool
) -> None:
    endpoint = of(changed(role, graph, type=kind), role)
    assert endpoint.runs is runs
    assert (endpoint.type is not None) is runs


def test_a_helper_that_tells_no_kind_is_not_refused() -> None:
    assert of(m.stage(), INFO).runs


def test_the_second_camera_of_a_refused_kind_competes_with_nobody() -> None:
    stage = m.stage()
    helper = m.role(stage, CAMERA, "ROS_Camera")
    other = m.valued(replace(helper, path=f"{helper.path}_01"), "inputs:type", "camera_info")
    assert not of(m.with_node(stage, other), f"{CAMERA}_01").runs


def test_a_helper_that_the_tick_drives_still_needs_a_render_product() -> None:
    stage = changed("isaac_create_render_product", "ROS_Lidar2D", enabled=False)
    helper = m.role(stage, LIDAR, "ROS_Lidar2D")
    tick = f"{helper.path.rpartition('/')[0]}/on_playback_tick.outputs:tick"
    driven = m.with_node(stage, m.wired(helper, "inputs:execIn", tick))
    assert not of(driven, LIDAR).runs
    on = changed("isaac_create_render_product", "ROS_Lidar2D", enabled=True)
    assert of(m.with_node(on, m.wired(helper, "inputs:execIn", tick)), LIDAR).runs


@pytest.mark.parametrize(("skipped", "rate"), [(None, 10), (0, 10), (1, 5), (4, 2), (-1, 10)])
def test_frames_that_a_helper_skips_lower_its_rate(skipped: int | None, rate: int) -> None:
    stage = changed(LIDAR, "ROS_Lidar2D", frameSkipCount=skipped)
    assert of(stage, LIDAR).rate == f"sensor at {rate} Hz"


def test_the_pace_is_the_events_or_the_sensors() -> None:
    stage = m.stage()
    assert of(stage, LIDAR).rate == "sensor at 10 Hz"  # as its schema says
    sensor = f"{m.ROBOT}/base_scan/Lidar2D"
    stage = m.with_prim(stage, sensor, attributes={"omni:sensor:tickRate": 20.0})
    assert of(stage, LIDAR).rate == "sensor at 20 Hz"
    stage = m.with_prim(stage, sensor, attributes={"omni:sensor:tickRate": 0.0})
    assert of(stage, LIDAR).rate == "On Playback Tick"
    assert (
        of(changed(m.RAW, m.ODOM_TF, staticPublisher=True), m.RAW).rate
        == "once after On Playback Tick"
    )


def test_a_node_that_no_event_reaches_never_publishes() -> None:
    stage = m.without_node(m.stage(), m.role(m.stage(), "on_playback_tick", "ROS_Clock").path)
    assert of(stage, "ros2_publish_clock").rate == "never"


def test_a_node_that_is_signalled_once_never_publishes() -> None:
    stage = m.stage()
    clock = m.role(stage, "ros2_publish_clock", "ROS_Clock")
    place = clock.path.rpartition("/")[0]
    once = m.node(f"{place}/once", "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame")
    stage = m.with_node(
        stage, m.wired(once, "inputs:execIn", f"{place}/on_playback_tick.outputs:tick")
    )
    stage = m.with_node(stage, m.wired(clock, "inputs:execIn", f"{once.path}.outputs:step"))
    found = of(stage, "ros2_publish_clock")
    assert (found.runs, found.rate) == (False, "never")
    assert of(stage, LIDAR).runs


def test_what_an_unknown_event_starts_perhaps_publishes() -> None:
    stage = m.stage()
    tick = m.role(stage, "on_playback_tick", "ROS_Clock")
    event = m.node(tick.path, "omni.graph.action.OnCustomEvent")
    event = replace(event, ports={"outputs:tick": PortState("outputs:tick")})
    clock = of(m.with_node(stage, event), "ros2_publish_clock")
    assert (clock.runs, clock.sure, clock.rate) == (True, False, "perhaps On Custom Event")
    assert of(stage, "ros2_publish_clock").sure


def test_a_push_graph_publishes_with_every_update() -> None:
    stage = m.stage()
    clock, *others = stage.graphs
    cut = m.wired(m.role(stage, "ros2_publish_clock", "ROS_Clock"), "inputs:execIn")
    push = {**clock.attributes, "evaluator:type": "push"}
    nodes = tuple(cut if node.path == cut.path else node for node in clock.nodes)
    pushed = replace(stage, graphs=(replace(clock, attributes=push, nodes=nodes), *others))
    found = of(pushed, "ros2_publish_clock")
    assert (found.runs, found.sure, found.rate) == (True, True, "every update")


# ---- QoS


def test_the_default_profile_keeps_as_many_messages_as_the_queue_holds() -> None:
    assert of(m.stage(), LIDAR).qos == Qos("keep_last", 10, "reliable", "volatile")
    assert of(changed(LIDAR, "ROS_Lidar2D", queueSize=3), LIDAR).qos == Qos(depth=3)


def test_a_static_publisher_keeps_one_message_for_late_subscribers() -> None:
    stage = changed(m.RAW, m.ODOM_TF, staticPublisher=True, qosProfile=json.dumps(PROFILE))
    assert of(stage, m.RAW).qos == Qos(depth=1, durability="transient_local")


def test_a_profile_is_decoded() -> None:
    stage = changed(LIDAR, "ROS_Lidar2D", qosProfile=json.dumps(PROFILE))
    assert of(stage, LIDAR).qos == Qos(
        "keep_last", 5, "best_effort", "transient_local", 0.0, 0.5, "manual_by_topic", 0.0
    )


@pytest.mark.parametrize(
    "text",
    [
        "SensorData",
        "[]",
        "{}",
        json.dumps({key: PROFILE[key] for key in list(PROFILE)[1:]}),
        json.dumps({**PROFILE, "reliability": "best_effort"}),
        json.dumps({**PROFILE, "depth": -1}),
        json.dumps({**PROFILE, "depth": True}),
        json.dumps({**PROFILE, "deadline": "0"}),
        "[" * 100_000,
    ],
)
def test_a_profile_that_isaac_sim_refuses_is_none(text: str) -> None:
    assert read_profile(text) is None


def with_maker(**inputs: Value) -> StageModel:
    """The lidar with a profile from a node that makes profiles."""
    stage = m.stage()
    helper = m.role(stage, LIDAR, "ROS_Lidar2D")
    maker = m.node(f"{helper.path.rpartition('/')[0]}/profile", QOS_TYPE, **inputs)
    stage = m.with_node(stage, maker)
    return m.with_node(
        stage, m.wired(helper, "inputs:qosProfile", f"{maker.path}.outputs:qosProfile")
    )


@pytest.mark.parametrize(
    ("preset", "profile"),
    [
        ("Default for publishers/subscribers", Qos()),
        ("Services", Qos()),
        ("Sensor Data", Qos(depth=5, reliability="best_effort")),
        ("System Default", Qos("keep_last", 1, "reliable", "transient_local")),  # by Fast DDS
    ],
)
def test_a_preset_replaces_the_fields(preset: str, profile: Qos) -> None:
    assert of(with_maker(createProfile=preset, depth=99), LIDAR).qos == profile


@pytest.mark.parametrize("preset", ["Custom", None])
def test_without_a_preset_the_fields_count(preset: str | None) -> None:
    stage = with_maker(createProfile=preset, depth=7, durability="transientLocal")
    assert of(stage, LIDAR).qos == Qos(depth=7, durability="transient_local")


def test_a_profile_that_something_else_brings_is_none() -> None:
    stage = m.stage()
    helper = m.role(stage, LIDAR, "ROS_Lidar2D")
    source = helper.sources("inputs:renderProductPath")[0]
    assert of(m.with_node(stage, m.wired(helper, "inputs:qosProfile", source)), LIDAR).qos is None


# ---- the command


def text_of(*arguments: str) -> str:
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    last = list(m.lab().checkpoints)[-1]
    return build_checkpoint(None, last, tmp_path_factory.mktemp("built") / "stage.usda")


def test_the_table_has_a_row_for_each_topic(built: Path) -> None:
    heading, *rows = text_of("topics", "-v", str(built)).splitlines()
    assert heading.split() == "TOPIC TYPE DIRECTION NODE FRAMES QUEUE QOS RATE".split()  # noqa: SIM905
    assert [row.split()[0] for row in rows] == [e.topic for e in endpoints(m.stage())]
    assert "keep_last 10, reliable, volatile" in rows[0]
    assert "7 frames" in rows[-1]


def test_name_type_direction_and_node_fit_80_columns(built: Path) -> None:
    lines = text_of("topics", str(built)).splitlines()
    assert max(map(len, lines[::2])) <= 80
    assert [line.split() for line in lines[:2]] == [["TOPIC", "TYPE", "DIRECTION"], ["NODE"]]
    nodes = [line.strip() for line in lines[3::2]]
    assert nodes == [end.node.path for end in endpoints(m.stage())]


def test_a_table_that_fits_has_the_nodes_in_its_rows(tmp_path: Path) -> None:
    built = build_checkpoint(None, "01", tmp_path / "stage.usda")
    heading, row = text_of("topics", str(built)).splitlines()
    assert heading.split() == ["TOPIC", "TYPE", "DIRECTION", "NODE"]
    assert row.split()[-1].endswith("/ros2_publish_clock")


def test_topics_are_drawn_between_their_nodes(built: Path, tmp_path: Path) -> None:
    dot = tmp_path / "topics.dot"
    assert text_of("topics", str(built), "--graph", str(dot)) == f"{dot}\n"
    drawn = dot.read_text()
    ends = endpoints(m.stage())
    assert drawn.count(" -> ") == len(ends)
    assert all(str(end.topic) in drawn and end.node.name in drawn for end in ends)


def test_what_is_not_judged_is_told_under_topics_and_frames(tmp_path: Path) -> None:
    built = build_checkpoint(None, "05", tmp_path / "stage.usda")
    stage = Usd.Stage.Open(str(built))
    node = stage.DefinePrim("/World/ROS_Clock/mine", "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set("my.Node")
    stage.Save()
    for command in ("topics", "tf"):
        told = " ".join(text_of(command, str(built)).split())
        assert "1 of 35 nodes not judged (1 has the unknown type my.Node)" in told
    dot = tmp_path / "topics.dot"
    text_of("topics", str(built), "--graph", str(dot))
    assert "not judged: my.Node" in dot.read_text()


def test_frames_are_drawn_with_publisher_and_rate(built: Path, tmp_path: Path) -> None:
    dot = tmp_path / "tf.dot"
    text_of("tf", str(built), "--graph", str(dot))
    assert "by ros2_publish_transform_tree, On Playback Tick" in dot.read_text()
    told = text_of("tf", "-v", str(built))
    assert "ros2_publish_transform_tree (/tf, On Playback Tick)" in told


def test_the_json_has_whole_profiles_and_the_frames_of_the_tree(built: Path) -> None:
    data = json.loads(text_of("topics", str(built), "--format", "json"))
    *_, tree = data["topics"]
    assert tree["frames"] == ["base_footprint", *m.LINKS[1:], "Camera_1"]
    assert tree["qos"]["durability"] == "volatile"
    assert tree["domain"] == 0
    assert data["file"] == str(built)


def test_frames_that_a_missing_asset_could_tell_are_unknown(tmp_path: Path) -> None:
    built = build_checkpoint(None, "05", tmp_path / "stage.usda")
    stage = Usd.Stage.Open(str(built))
    robot = stage.GetPrimAtPath(m.ROBOT)
    robot.GetReferences().AddReference("missing.usd")
    target = stage.GetPrimAtPath(f"{m.ROBOT}/{m.ODOM_TF}/{m.COMPUTE}")
    target.GetRelationship("inputs:targetPrims").SetTargets([m.ROBOT, f"{m.ROBOT}/arm"])
    stage.Save()
    assert "6 frames, 2 frames: asset not found" in text_of("topics", "-v", str(built))
    assert f"? links of {m.ROBOT}: asset not found: missing.usd" in text_of("tf", str(built))
    *_, tree = json.loads(text_of("topics", str(built), "--format", "json"))["topics"]
    assert tree["unknown_frames"] == [f"links of {m.ROBOT}", f"frame of {m.ROBOT}/arm"]


def test_the_csv_has_a_row_for_each_topic(built: Path) -> None:
    lines = text_of("topics", str(built), "--format", "csv").splitlines()
    assert lines[0] == "topic,type,direction,node,frames,queue,qos,rate"
    rows = [*csv.DictReader(lines)]
    assert len(rows) == len(endpoints(m.stage()))
    frames = {row["topic"]: row["frames"] for row in rows}
    assert frames["/clock"] == ""
    assert frames["/scan"] == "base_scan"


def test_a_stage_without_topics_says_so(tmp_path: Path) -> None:
    built = build_checkpoint(None, "00", tmp_path / "stage.usda")
    assert text_of("topics", str(built)).splitlines() == [
        "no topics are published or subscribed",
        "there are no graph nodes to judge",
    ]


def test_a_node_of_the_stage_cannot_write_to_the_terminal() -> None:
    from lab3_usd.report.topic_table import TopicReport, as_csv, as_table

    evil: Node = m.node("/World/ROS_Clock/any", m.PUBLISHER_TYPE, topicName="=1+\x1b[2J")
    report = TopicReport("x", endpoints(m.with_node(m.stage(), evil)), ())
    assert "\x1b" not in "\n".join(as_table(report)) + as_csv(report)


def named_by(kind: str, **ports: str) -> tuple[Endpoint, ...]:
    """Return the topics of a robot whose clock gets its name from a node."""
    stage = rover()
    write_node(stage, "/World/Clock/name", kind, ports)
    connect(stage, "/World/Clock", "name.value", "clock.topicName")
    return endpoints(read_model(stage, m.lab().platform, "x"))


def test_a_name_is_made_of_texts_in_their_order() -> None:
    topics = [end.topic for end in named_by("nodes.BuildString", a="sim", d="ck", c="clo", b="/")]
    assert "/sim/clock" in topics


def test_how_a_fraction_is_written_is_not_known() -> None:
    stage = rover()
    write_node(stage, "/World/Clock/half", "nodes.ConstantDouble", {"value": 0.5})
    write_node(stage, "/World/Clock/name", "nodes.ToString", {})
    connect(stage, "/World/Clock", "half.value", "name.value")
    connect(stage, "/World/Clock", "name.converted", "clock.topicName")
    ends = endpoints(read_model(stage, m.lab().platform, "x"))
    assert [end.written for end in ends if end.node.name == "clock"] == [""]


def test_a_name_that_a_wire_brings_is_unknown_and_not_invalid() -> None:
    from lab3_usd.report.topic_table import TopicReport, as_csv

    table = as_csv(TopicReport("x", named_by("core.IsaacReadEnvVar"), ()))
    assert "? (a wire brings it)" in table
    assert "no valid name" not in table


def test_every_column_is_there_where_the_terminal_is_narrow() -> None:
    from lab3_usd.report.topic_table import TopicReport, as_table, cells

    report = TopicReport("x", endpoints(m.stage()), ())
    lines = list(as_table(report, 100, verbose=True))
    assert max(map(len, lines)) <= 100
    for endpoint in report.endpoints:
        told = [cell for cell in cells(endpoint, report) if cell != "-"]
        assert [cell for cell in told if cell not in "\n".join(lines)] == []


@pytest.mark.parametrize(
    ("role", "graph", "port", "target", "topic", "why"),
    [
        (
            "isaac_compute_odometry",
            m.ODOM_TF,
            "inputs:chassisPrim",
            f"{m.ROBOT}/gone",
            "/odom",
            ": inputs:chassisPrim names /turtlebot3_burger/gone, which is missing",
        ),
        (
            "isaac_create_render_product",
            "ROS_Lidar2D",
            "inputs:cameraPrim",
            m.BASE,
            "/scan",
            "/turtlebot3_burger/base_footprint is no OmniLidar",
        ),
    ],
)
def test_a_node_with_a_prim_that_is_no_good_publishes_nothing_and_says_why(
    role: str, graph: str, port: str, target: str, topic: str, why: str
) -> None:
    stage = m.stage()
    stage = m.with_node(stage, m.aimed(m.role(stage, role, graph), port, target))
    (silent,) = (end for end in endpoints(stage) if end.topic == topic)
    assert not silent.runs
    assert silent.silence.endswith(why)


def test_a_render_product_that_shows_no_camera_publishes_nothing_and_says_why() -> None:
    helper = m.wired(m.role(m.stage(), CAMERA, "ROS_Camera"), "inputs:renderProductPath")
    named = m.valued(helper, "inputs:renderProductPath", "/World/Product")
    silent = of(m.with_node(m.stage(), named), CAMERA)
    assert not silent.runs
    assert "/World/Product, which shows no camera" in silent.silence


def test_nothing_is_sent_in_a_domain_that_ros_2_does_not_have() -> None:
    stage = m.stage()
    context = m.valued(m.role(stage, "ros2_context", "ROS_Clock"), "inputs:domain_id", 250)
    silent = of(m.with_node(stage, context), "ros2_publish_clock")
    assert not silent.runs
    assert "ROS 2 has no domain 250" in silent.silence


def test_a_context_of_an_unregistered_type_leaves_the_domain_to_the_environment() -> None:
    stage = m.stage()
    context = replace(
        m.role(stage, "ros2_context", "ROS_Clock"),
        type=None,
        type_name="isaacsim.ros2.nodes.ROS2Context",
    )
    domain = of(m.with_node(stage, context), "ros2_publish_clock").domain
    assert (domain.number, domain.from_environment) == (0, True)


def test_a_radar_sends_clouds_of_points() -> None:
    stage = rover()
    helper = {"topicName": "radar"}
    write_node(stage, "/World/Lidar/radar", "ros.ROS2RtxRadarHelper", helper)
    ends = endpoints(read_model(stage, load_platform(), ""))
    assert {end.type for end in ends if end.topic == "/radar"} == {"sensor_msgs/msg/PointCloud2"}
