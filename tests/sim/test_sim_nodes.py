"""What each node computes, against cases worked out by hand from the source named there."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from breaking import correct_stage, the_lab
from lone_nodes import node, world

from lab3_usd.model.dry_run import Input, Scene, SceneGraph, SceneNode
from lab3_usd.model.qos import Qos
from lab3_usd.physics.machines import Machines
from lab3_usd.sim.execution.node_instance import NodeInstance, functions
from lab3_usd.sim.execution.program import compile_graphs
from lab3_usd.sim.execution.recording import Message, Odometry, Scan, Transform, View
from lab3_usd.sim.execution.world import Network, World, profile_of, trimmed, world_of
from lab3_usd.sim.timeline import render
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

ISAAC, ROS = "isaacsim.core.nodes.", "isaacsim.ros2.bridge."
ROBOT = "/turtlebot3_burger"
HALF = math.sqrt(0.5)


@pytest.fixture
def stage() -> World:
    """The stage of 05 before it plays."""
    return world_of(read_scene(correct_stage("05"), load_platform()), load_platform())


@pytest.mark.parametrize("name", ["omni.graph.action.OnPlaybackTick", "omni.graph.action.OnTick"])
def test_a_tick_is_an_execution_and_the_time_of_a_frame(name: str) -> None:
    tick = node(name)
    assert tick.compute(world())
    assert tick.enabled == ["tick"]
    assert tick.outputs["deltaSeconds"] == 0.5


def test_a_physics_step_is_an_execution() -> None:
    step = node(f"{ISAAC}OnPhysicsStep")
    assert step.compute(world())
    assert step.enabled == ["step"]
    assert step.outputs["deltaSimulationTime"] == 0.5


@pytest.mark.parametrize(
    ("values", "passed"), [({"step": 0}, []), ({}, [1, 2, 3, 4, 5, 6, 7]), ({"step": 3}, [3, 6])]
)
def test_a_gate_lets_every_so_many_signals_pass_and_counts_on_over_stop(
    values: dict[str, int], passed: list[int]
) -> None:
    gate = node(f"{ISAAC}IsaacSimulationGate", values)
    found = []
    for signal in range(1, 8):
        gate.compute(world())
        found += [signal] if gate.enabled == ["execOut"] else []
        if signal == 4:
            gate.reset()
    assert found == passed


@pytest.mark.parametrize(
    "name", ["omni.graph.nodes.StopTimeline", "omni.graph.action.ExitApplication"]
)
def test_the_first_node_that_stops_the_timeline_is_named(name: str) -> None:
    now = world(stopped_by="")
    first, second = node(name), node(name)
    first.path = "/Graph/first"
    assert first.compute(now)
    assert second.compute(now)
    assert now.stopped_by == "/Graph/first"


def test_system_time_is_that_of_the_wall() -> None:
    read = node(f"{ISAAC}IsaacReadSystemTime")
    assert read.compute(world())
    assert read.outputs["systemTime"] == 100.0


def test_simulation_time_starts_anew_only_if_told_to(subtests: pytest.Subtests) -> None:
    for reset, time in ((True, 2.0), (False, 7.0)):
        with subtests.test(reset=reset, time=time):
            read = node(f"{ISAAC}IsaacReadSimulationTime", {"resetOnStop": reset})
            assert read.compute(world())
            assert read.outputs["simulationTime"] == time


@pytest.mark.parametrize(
    ("use", "environment", "domain"),
    [(False, "7", 3), (True, "7", 7), (True, "", 3), (True, "seven", 3)],
)
def test_a_context_takes_the_environment_only_if_it_is_a_number(
    use: object, environment: str, domain: int
) -> None:
    here = world(network=Network(environment))
    context = node(f"{ROS}ROS2Context", {"domain_id": 3, "useDomainIDEnvVar": use})
    assert context.compute(here)
    assert here.network.domain(context.outputs["context"]) == domain
    assert here.network.domain(99) is None
    assert here.network.domain(0) == (7 if environment == "7" else 0)


def test_a_twist_is_held_and_told_once() -> None:
    here = world()
    subscriber = node(f"{ROS}ROS2SubscribeTwist")
    assert subscriber.compute(here)  # opens
    here.network.tell(((0.2, 0.0, 0.0), (0.0, 0.0, 0.5)))
    assert subscriber.compute(here)
    assert subscriber.enabled == ["execOut"]
    assert subscriber.outputs["angularVelocity"] == (0.0, 0.0, 0.5)
    assert not subscriber.compute(here)
    assert subscriber.enabled == []
    assert subscriber.outputs["linearVelocity"] == (0.2, 0.0, 0.0)
    elsewhere = node(f"{ROS}ROS2SubscribeTwist", {"topicName": "cmd"})
    elsewhere.compute(here)
    here.network.tell(((0.2, 0.0, 0.0), (0.0, 0.0, 0.5)))
    assert not elsewhere.compute(here)


@pytest.mark.parametrize(
    ("conversion", "result"),
    [("Convert to stage units", (20.0, 0.0, -10.0)), ("Convert to meters", (0.002, 0.0, -0.001))],
)
def test_scale_by_the_unit_of_the_stage(conversion: str, result: tuple[float, ...]) -> None:
    centimetres = world(scene=Scene(0.01, "Z", (), {}, {}))
    values = {"conversion": conversion, "value": (0.2, 0.0, -0.1)}
    scale = node(f"{ISAAC}OgnIsaacScaleToFromStageUnit", values)
    assert scale.compute(centimetres)
    assert scale.outputs["result"] == pytest.approx(result)
    scale.values["conversion"] = "to feet"
    assert not scale.compute(centimetres)


def test_break_a_vector() -> None:
    broken = node("omni.graph.nodes.BreakVector3", {"tuple": (1.0, 2.0, 3.0)})
    assert broken.compute(world())
    assert [broken.outputs[each] for each in "xyz"] == [1.0, 2.0, 3.0]
    assert not node("omni.graph.nodes.BreakVector3", {"tuple": 1.0}).compute(world())


def test_a_constant_computes_nothing() -> None:
    assert node("omni.graph.nodes.ConstantToken", {"value": "a"}).compute(world())


@pytest.mark.parametrize(
    ("values", "array"),
    [
        ({"arraySize": 2, "arrayType": "token[]", "input0": "a", "input1": "b"}, ("a", "b")),
        ({"arraySize": 1, "arrayType": "token[]", "input0": "a", "input1": "b"}, ("a",)),
        ({"arraySize": 2, "arrayType": "auto", "input0": "a"}, ("a", "")),
        ({"arraySize": 1, "arrayType": "double[]", "input0": "a"}, ()),
        ({"arraySize": 0, "arrayType": "token[]"}, ()),
    ],
)
def test_make_array(values: dict[str, Any], array: tuple[str, ...]) -> None:
    make = node("omni.graph.nodes.ConstructArray", values)
    make.compute(world())
    assert make.outputs["array"] == array


DIFFERENTIAL = "isaacsim.robot.wheeled_robots.DifferentialController"
SIZES = {"wheelRadius": 0.025, "wheelDistance": 0.16}


@pytest.mark.parametrize(
    ("values", "wheels"),
    [
        ({"linearVelocity": 0.1}, (4.0, 4.0)),
        ({"angularVelocity": 1.0}, (-3.2, 3.2)),
        ({"linearVelocity": 0.1, "angularVelocity": 1.0}, (0.8, 7.2)),
        ({"linearVelocity": 9.0, "maxLinearSpeed": 0.22}, (8.8, 8.8)),
        ({"angularVelocity": -9.0, "maxAngularSpeed": 1.0}, (3.2, -3.2)),
        ({"linearVelocity": 0.1, "maxWheelSpeed": 3.0}, (3.0, 3.0)),
        # half a second at 0.1 m/s2 from rest is 0.05 m/s; one limit alone is none
        (
            {"linearVelocity": 0.1, "maxAcceleration": 0.1, "maxDeceleration": 1.0, "dt": 0.5},
            (2.0, 2.0),
        ),
        ({"linearVelocity": 0.1, "maxAcceleration": 0.1, "dt": 0.5}, (4.0, 4.0)),
        ({"angularVelocity": 1.0, "maxAngularAcceleration": 1.0, "dt": 0.5}, (-1.6, 1.6)),
    ],
)
def test_wheel_speeds(values: dict[str, float], wheels: tuple[float, float]) -> None:
    drive = node(DIFFERENTIAL, {**SIZES, **values})
    assert drive.compute(world())
    assert drive.outputs["velocityCommand"] == pytest.approx(wheels)


def test_no_wheel_speeds_without_sizes_or_with_limits_and_no_time() -> None:
    assert not node(DIFFERENTIAL, {"wheelRadius": 0.025}).compute(world())
    assert not node(DIFFERENTIAL, {**SIZES, "maxAngularAcceleration": 1.0}).compute(world())


CONTROLLER = f"{ISAAC}IsaacArticulationController"
BOTH = ("wheel_left_joint", "wheel_right_joint")


@pytest.mark.parametrize(
    ("target", "values", "speeds"),
    [
        ("", {"jointNames": BOTH}, (1.0, 2.0)),
        ("", {"jointNames": BOTH[::-1]}, (2.0, 1.0)),
        ("", {}, (1.0, 2.0)),  # all joints, in the order of the articulation
        ("", {"jointNames": (BOTH[0], "wheel")}, (0.0, 0.0)),
        ("", {"jointNames": BOTH[:1]}, (0.0, 0.0)),  # one joint, two speeds
        ("", {"jointIndices": (1, 0)}, (2.0, 1.0)),
        ("/base_footprint", {}, (1.0, 2.0)),
        ("/base_link", {}, (0.0, 0.0)),
        ("/joints", {}, (0.0, 0.0)),
        ("/base_link", {"robotPath": ROBOT}, (1.0, 2.0)),
        ("", {"robotPath": "/World"}, (0.0, 0.0)),
    ],
)
def test_commands_reach_the_joints_that_are_named(
    stage: World, target: str, values: dict[str, Any], speeds: tuple[float, float]
) -> None:
    command = {"velocityCommand": (1.0, 2.0), **values}
    controller = node(CONTROLLER, command, targetPrim=ROBOT + target)
    assert controller.compute(stage) == (speeds != (0.0, 0.0))
    machine = stage.machines.articulation(ROBOT)
    assert machine is not None
    assert tuple(machine.joints[each].target_velocity for each in BOTH) == speeds


def test_one_frame_is_one_step() -> None:
    once = node(f"{ISAAC}OgnIsaacRunOneSimulationFrame")
    once.compute(world())
    assert once.enabled == ["step"]
    once.compute(world())
    assert once.enabled == []
    once.reset()
    once.compute(world())
    assert once.enabled == ["step"]


PRODUCT = f"{ISAAC}IsaacCreateRenderProduct"
LIDAR, CAMERA = f"{ROBOT}/base_scan/Lidar2D", f"{ROBOT}/base_footprint/Camera_1"


def product(stage: World, camera: str, **values: Any) -> NodeInstance:
    made = node(
        PRODUCT, {"enabled": True, "width": 640, "height": 480, **values}, cameraPrim=camera
    )
    made.compute(stage)
    return made


def test_render_products_are_shared_by_sensor_and_size(stage: World) -> None:
    one, other = product(stage, LIDAR), product(stage, LIDAR)
    assert one.enabled == ["execOut"]
    assert one.outputs["renderProductPath"] == other.outputs["renderProductPath"]
    larger = product(stage, LIDAR, width=1280)
    assert larger.outputs["renderProductPath"] != one.outputs["renderProductPath"]
    assert product(stage, LIDAR, enabled=False).enabled == []
    assert product(stage, "/nowhere").enabled == []


def published(stage: World, frames: int = 1) -> list[Any]:
    for _ in range(frames):
        stage.since_play += stage.dt
        render(stage)
    return stage.network.sent


def test_a_lidar_publishes_what_stands_around_it(stage: World) -> None:
    path = product(stage, LIDAR).outputs["renderProductPath"]
    values = {"type": "laser_scan", "frameId": "f", "topicName": "~/s", "renderProductPath": path}
    helper = node(f"{ROS}ROS2RtxLidarHelper", values)
    assert helper.compute(stage)
    sent = published(stage, 60)
    assert len(sent) == 10
    assert (sent[0].topic, sent[0].frame) == ("/s", "f")
    scan = sent[0].data
    assert isinstance(scan, Scan)
    assert len(scan.ranges) == 360
    # ahead: the wall from x = 2.35, seen from x = 1.8 - 0.032
    assert scan.ranges[180] == pytest.approx(2.35 - 1.768, abs=1e-4)
    # to the left: the wall from y = 4.45, but the slanted corner from (1.35, 4.45) to (2.35, 3.65)
    assert scan.ranges[270] == pytest.approx(4.45 - 0.8 * (1.768 - 1.35), abs=1e-3)


def test_a_lidar_helper_wants_a_lidar(stage: World, subtests: pytest.Subtests) -> None:
    for sensor, kind, fault in (
        (CAMERA, "laser_scan", "not-a-lidar"),
        (LIDAR, "none", "unknown-output"),
    ):
        with subtests.test(sensor=sensor, kind=kind, fault=fault):
            path = product(stage, sensor).outputs["renderProductPath"]
            helper = node(f"{ROS}ROS2RtxLidarHelper", {"type": kind, "renderProductPath": path})
            assert not helper.compute(stage)
            assert helper.failure is not None
            assert helper.failure.kind == fault
    assert not node(f"{ROS}ROS2RtxLidarHelper").compute(stage)
    assert published(stage) == []


def test_a_camera_publishes_at_its_rate(stage: World) -> None:
    path = product(stage, CAMERA).outputs["renderProductPath"]
    values = {"topicName": "/i", "frameId": "c", "renderProductPath": path, "frameSkipCount": 1}
    assert node(f"{ROS}ROS2CameraHelper", values).compute(stage)
    sent = published(stage, 60)
    assert [each.type for each in sent] == ["sensor_msgs/msg/Image"] * 5
    values = {"type": "thermal", "renderProductPath": path}
    assert not node(f"{ROS}ROS2CameraHelper", values).compute(stage)


def test_camera_info_is_of_the_lens(stage: World) -> None:
    path = product(stage, CAMERA).outputs["renderProductPath"]
    values = {"topicName": "/i", "renderProductPath": path}
    assert node(f"{ROS}ROS2CameraInfoHelper", values).compute(stage)
    view = published(stage)[0].data
    assert isinstance(view, View)
    focal = 640 * 18.0 / 20.955
    assert view.matrix == pytest.approx((focal, 0, 320, 0, focal, 240, 0, 0, 1))


def test_nothing_of_a_helper_that_is_off(stage: World) -> None:
    path = product(stage, CAMERA).outputs["renderProductPath"]
    helper = node(f"{ROS}ROS2CameraHelper", {"renderProductPath": path})
    helper.compute(stage)
    helper.values["enabled"] = False
    helper.compute(stage)
    assert published(stage, 10) == []


def test_a_clock_opens_first_and_then_publishes() -> None:
    here = world()
    clock = node(f"{ROS}ROS2PublishClock", {"timeStamp": 3.5})
    assert clock.compute(here)
    assert here.network.sent == []
    assert clock.compute(here)
    assert [(each.topic, each.stamp) for each in here.network.sent] == [("/clock", 3.5)]


@pytest.mark.parametrize(
    ("space", "topic"), [("/", "/clock"), (" ", "/clock"), ("~/a/b/", "/a/b/clock")]
)
def test_a_namespace_loses_what_is_no_letter_at_its_ends(space: str, topic: str) -> None:
    here = world()
    clock = node(f"{ROS}ROS2PublishClock", {"nodeNamespace": space})
    for _ in range(2):
        clock.compute(here)
    assert [each.topic for each in here.network.sent] == [topic]


@pytest.mark.parametrize(
    "values", [{"topicName": ""}, {"topicName": "a b"}, {"context": 5}, {"qosProfile": "fast"}]
)
def test_a_publisher_that_cannot_open_stays_silent(values: dict[str, Any]) -> None:
    here = world()
    clock = node(f"{ROS}ROS2PublishClock", values)
    for _ in range(3):
        assert not clock.compute(here)
    assert here.network.sent == []


@pytest.mark.parametrize("static", [False, True])
def test_a_static_publisher_does_not_read_its_profile(*, static: bool) -> None:
    here = world()
    values = {"staticPublisher": static, "qosProfile": "fast", "childFrameId": "base"}
    raw = node(f"{ROS}ROS2PublishRawTransformTree", values)
    for _ in range(2):
        raw.compute(here)
    assert bool(here.network.sent) == static


def test_odometry_is_the_way_since_play_in_the_frame_of_the_start(stage: World) -> None:
    machine = stage.machines.articulation(ROBOT)
    assert machine is not None
    machine.yaw = math.pi / 2  # it starts looking along y
    odometry = node(f"{ISAAC}IsaacComputeOdometry", chassisPrim=f"{ROBOT}/base_footprint")
    stage.machines.step(0.0)
    assert odometry.compute(stage)
    assert odometry.enabled == ["execOut"]
    machine.y, machine.yaw, machine.velocity = 2.0, math.pi, (0.3, 0.0, 0.5)
    machine.now = None
    odometry.compute(stage)
    assert odometry.outputs["position"] == pytest.approx((2.0, 0.0, 0.0))
    assert odometry.outputs["orientation"] == pytest.approx((0.0, 0.0, HALF, HALF))
    assert odometry.outputs["linearVelocity"] == pytest.approx((0.3, 0.0, 0.0))
    assert odometry.outputs["globalLinearVelocity"] == pytest.approx((-0.3, 0.0, 0.0))
    assert odometry.outputs["angularVelocity"] == pytest.approx((0.0, 0.0, 0.5))


@pytest.mark.parametrize(
    ("chassis", "works"), [("", True), ("/joints", False), ("/base_link", True)]
)
def test_odometry_wants_a_body(stage: World, chassis: str, works: object) -> None:
    odometry = node(f"{ISAAC}IsaacComputeOdometry", chassisPrim=ROBOT + chassis)
    assert odometry.compute(stage) == works


def test_odometry_is_told_along_the_robot() -> None:
    here = world()
    values = {
        "linearVelocity": (1.0, 2.0, 3.0),
        "angularVelocity": (4.0, 5.0, 6.0),
        "position": (7.0, 8.0, 9.0),
        "robotFront": (0.0, 2.0, 1.0),
        "timeStamp": 1.5,
    }
    publish = node(f"{ROS}ROS2PublishOdometry", values)
    publish.compute(here)
    publish.compute(here)
    message = here.network.sent[0]
    assert (message.frame, message.stamp) == ("odom", 1.5)
    # the front is +y, so the side is -x
    assert message.data == Odometry(
        "base_link", (7.0, 8.0, 9.0), (1.0, 0.0, 0.0, 0.0), (2.0, -1.0, 3.0), (0.0, 0.0, 6.0)
    )
    publish.values["publishRawVelocities"] = True
    publish.compute(here)
    assert here.network.sent[1].data.linear == (1.0, 2.0, 3.0)


def test_a_raw_transform_is_as_given_and_once_if_static(subtests: pytest.Subtests) -> None:
    for static, count in ((False, 3), (True, 1)):
        with subtests.test(static=static, count=count):
            here = world()
            values = {"translation": (1.0, 2.0, 0.0), "staticPublisher": static}
            publish = node(f"{ROS}ROS2PublishRawTransformTree", values)
            publish.wires["rotation"] = (node("omni.graph.nodes.ConstantToken"), "q")
            publish.wires["rotation"][0].outputs["q"] = (0.0, 0.0, HALF, HALF)
            for _ in range(4):
                publish.compute(here)
            assert len(here.network.sent) == count
            said = Transform("odom", "base_link", (1.0, 2.0, 0.0), (HALF, 0.0, 0.0, HALF))
            assert here.network.sent[0].transforms == (said,)


def test_tf2_takes_a_slash_off_before_the_frames_of_a_transform() -> None:
    said = Transform("/odom", "//base_link", (1.0, 2.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    (taken,) = Message("tf2_msgs/msg/TFMessage", 0.0, data=(said,)).transforms
    assert (taken.parent, taken.child) == ("odom", "/base_link")
    assert (taken.translation, taken.rotation) == (said.translation, said.rotation)


TREE = f"{ISAAC}IsaacComputeTransformTree"


def test_a_parent_that_is_not_there_names_the_frame_above(stage: World) -> None:
    made = node(TREE, parentPrim=f"{ROBOT}/base_foot", targetPrims=f"{ROBOT}/base_link")
    assert made.compute(stage)
    assert made.outputs["parentFrames"] == ("base_foot",)


def tree(stage: World, parent: str, *targets: str) -> dict[str, Any]:
    made = node(TREE, parentPrim=ROBOT + parent)
    made.node.targets["inputs:targetPrims"] = tuple(ROBOT + target for target in targets)
    made.compute(stage)
    return made.outputs


def edges(outputs: dict[str, Any]) -> list[tuple[str, str]]:
    return list(zip(outputs["parentFrames"], outputs["childFrames"], strict=True))


def test_frames_of_single_prims(stage: World) -> None:
    outputs = tree(stage, "/base_footprint", "/base_scan", "/base_footprint/Camera_1", "/gone")
    assert edges(outputs) == [("base_footprint", "base_scan"), ("base_footprint", "Camera_1")]
    assert outputs["translations"][0] == pytest.approx((-0.032, 0.0, 0.182))
    # the optical frame: 180 degrees about X behind the camera's own rotation
    assert outputs["orientations"][1] == pytest.approx((-0.5, 0.5, -0.5, 0.5))


def test_frames_of_a_robot_hang_as_its_joints_do(stage: World) -> None:
    assert sorted(edges(tree(stage, "/base_footprint", ""))) == [
        ("base_footprint", "base_link"),
        ("base_link", "base_scan"),
        ("base_link", "caster_back_link"),
        ("base_link", "wheel_left_link"),
        ("base_link", "wheel_right_link"),
    ]


def test_an_articulation_root_gives_the_bodies_below_it(stage: World) -> None:
    outputs = tree(stage, "/base_footprint", "/base_footprint")
    assert edges(outputs) == [("base_footprint", "base_footprint")]


def test_a_transform_publisher_decides_once_where_from() -> None:
    here = world()
    publish = node(f"{ROS}ROS2PublishTransformTree")
    publish.compute(here)  # no arrays, no targets: no publisher
    arrays = {
        "parentFrames": ("a",),
        "childFrames": ("b",),
        "translations": ((1.0, 0.0, 0.0),),
        "orientations": ((0.0, 0.0, HALF, HALF),),
    }
    publish.values.update(arrays)
    publish.compute(here)
    publish.compute(here)
    assert here.network.sent[0].transforms == (
        Transform("a", "b", (1.0, 0.0, 0.0), (HALF, 0.0, 0.0, HALF)),
    )
    publish.values["childFrames"] = ("b", "c")
    publish.compute(here)
    assert len(here.network.sent) == 1


def test_a_transform_publisher_with_targets_of_its_own(stage: World) -> None:
    publish = node(f"{ROS}ROS2PublishTransformTree", targetPrims=f"{ROBOT}/base_scan")
    publish.compute(stage)
    publish.compute(stage)
    said = stage.network.sent[0].transforms[0]
    assert (said.parent, said.child) == ("world", "base_scan")
    assert said.translation == pytest.approx((1.768, 0.0, 0.182))


def test_a_transform_is_that_of_its_moment_whenever_one_looks_at_it(stage: World) -> None:
    publish = node(f"{ROS}ROS2PublishTransformTree", targetPrims=f"{ROBOT}/base_scan")
    for _ in range(2):
        publish.compute(stage)
    machine = stage.machines.articulation(ROBOT)
    assert machine is not None
    machine.x, machine.now = 5.0, None
    publish.compute(stage)
    before, after = (message.transforms[0].translation[0] for message in stage.network.sent)
    assert after - before == pytest.approx(5.0)


JOINED = [
    ("base_footprint", "base_link"),
    ("base_link", "base_scan"),
    ("base_link", "caster_back_link"),
    ("base_link", "wheel_left_link"),
    ("base_link", "wheel_right_link"),
]


@pytest.mark.parametrize(
    ("parent", "target", "known"),
    [
        ("/base_footprint", "", [("base_footprint", "turtlebot3_burger")]),
        ("/base_footprint", "/base_footprint", JOINED),
        ("", "/base_footprint", [("turtlebot3_burger", "base_footprint"), *JOINED]),
        ("/base_link", "/base_link", []),
        ("/base_footprint/Camera_1", "/base_footprint/Camera_1", [("Camera_1", "Camera_1")]),
    ],
)
def test_a_transform_publisher_expands_articulations_only_and_leaves_out_own_parents(
    stage: World, parent: str, target: str, known: list[tuple[str, str]]
) -> None:
    name = f"{ROS}ROS2PublishTransformTree"
    publish = node(name, parentPrim=ROBOT + parent, targetPrims=ROBOT + target)
    publish.compute(stage)
    publish.compute(stage)
    sent = stage.network.sent[0].transforms
    assert sorted((each.parent, each.child) for each in sent) == sorted(known)


def test_a_frame_name_that_is_taken_becomes_the_path(stage: World) -> None:
    stage.scene.prims[f"{ROBOT}/base_scan"].values["isaac:nameOverride"] = "base_link"
    publish = node(f"{ROS}ROS2PublishTransformTree")
    targets = tuple(f"{ROBOT}/base_{each}" for each in ("link", "scan"))
    publish.node.targets["inputs:targetPrims"] = targets
    publish.compute(stage)
    publish.compute(stage)
    known = ["base_link", "turtlebot3_burger_base_scan"]
    assert [each.child for each in stage.network.sent[0].transforms] == known


@pytest.mark.parametrize(
    ("name", "known"), [("/scan", "scan"), ("//scan/", "scan"), ("~/a/b_", "a/b"), ("_", "")]
)
def test_names_lose_what_is_no_letter_at_their_ends(name: str, known: str) -> None:
    assert trimmed(name) == known


PROFILE = {
    "history": "keepLast", "depth": 1, "reliability": "bestEffort", "durability": "volatile",
    "deadline": 0.0, "lifespan": 0.0, "liveliness": "automatic", "leaseDuration": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "wrong",
    [
        {"reliability": "relyable"},
        {"history": "keep_last"},
        {"durability": None},
        {"liveliness": "manualByNode"},
        {"depth": 10.0},
        {"depth": -1},
        {"depth": True},
        {"deadline": 0},
        {"lifespan": -1.0},
        {"leaseDuration": math.inf},
    ],
    ids=str,
)
def test_a_profile_is_taken_only_as_isaac_sim_writes_it(wrong: dict[str, Any]) -> None:
    assert profile_of(json.dumps(PROFILE | wrong), 0) is None


def test_a_profile_is_whole_or_nothing() -> None:
    kept = {"history": "keepAll", "reliability": "reliable", "durability": "transientLocal"}
    assert profile_of("", 5) == Qos(depth=5)
    once = profile_of(json.dumps(PROFILE), 5)
    assert once is not None
    assert (once.depth, once.reliability) == (1, "best_effort")
    forever = profile_of(json.dumps(PROFILE | kept), 5)
    assert forever is not None
    assert (forever.history, forever.durability) == ("keep_all", "transient_local")
    assert profile_of('{"depth": 1}', 5) is None
    assert profile_of("1", 5) is None


@pytest.mark.parametrize(("version", "looks"), [(1, False), (2, True)])
def test_an_older_context_does_not_look_at_the_environment(version: int, looks: object) -> None:
    saved = {"inputs:useDomainIDEnvVar": Input("bool")}
    context = SceneNode("/Graph/context", f"{ROS}ROS2Context", version, saved, {})
    graph = SceneGraph("/Graph", "execution", "pipelineStageSimulation", "Automatic", (context,))
    program = compile_graphs(Scene(1.0, "Z", (graph,), {}, {}), the_lab().platform)
    assert program.nodes["/Graph/context"].values["useDomainIDEnvVar"] is looks


def test_links_stand_where_their_joints_put_them() -> None:
    scene = read_scene(correct_stage("05"), load_platform())
    machines = Machines(scene)
    left = machines.place(f"{ROBOT}/wheel_left_link").origin
    assert left == pytest.approx((1.8, 0.08, 0.033), abs=1e-6)
    assert machines.articulation(f"{ROBOT}/base_link") is None


@pytest.mark.parametrize(
    ("values", "depth", "is_reliable"),
    [
        ({}, 10, True),
        ({"createProfile": "Custom", "depth": 3, "reliability": "bestEffort"}, 3, False),
        ({"createProfile": "Sensor Data", "depth": 3}, 5, False),
        ({"createProfile": "System Default"}, 1, True),
    ],
)
def test_a_node_makes_a_profile_of_its_preset_or_its_policies(
    values: dict[str, Any],
    depth: int,
    is_reliable: bool,  # noqa: FBT001
) -> None:
    made = node("isaacsim.ros2.bridge.ROS2QoSProfile", values)
    assert made.compute(world())
    profile = profile_of(made.outputs["qosProfile"], 7)
    assert profile is not None
    assert (profile.depth, profile.reliability == "reliable") == (depth, is_reliable)


def test_every_function_has_a_test() -> None:
    """Each type stands in a call of `node`, with its whole name or with its last part."""
    tests = sorted(Path(__file__).parent.glob("test_*_nodes.py"))
    text = "".join(path.read_text(encoding="utf-8") for path in tests)
    assert [
        function for function in functions() if re.search(rf'{function}(Token)?"', text) is None
    ] == []
