"""What a node lacks is its fault, and it computes and sends nothing."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import correct_stage
from lone_nodes import node

from lab3_usd.sim.execution.node_instance import functions
from lab3_usd.sim.execution.world import World, world_of
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

KIT, ISAAC, ROS = "omni.graph.nodes.", "isaacsim.core.nodes.", "isaacsim.ros2.bridge."
ROBOT = "/turtlebot3_burger"
LIDAR, CAMERA = f"{ROBOT}/base_scan/Lidar2D", f"{ROBOT}/base_footprint/Camera_1"
PUBLISHERS = sorted(
    name for name in functions() if name.startswith("ROS2Publish") and name != "ROS2Publisher"
)
WHEELS = {"wheelRadius": (0.1, 0.1), "wheelPositions": ((1.0, 1.0, 0.0),)}
LACKING: list[tuple[str, dict[str, Any], dict[str, str], str]] = [
    (f"{KIT}Clamp", {"input": "a", "lower": 1.0, "upper": 2.0}, {}, "no-number-input"),
    (f"{KIT}Clamp", {"input": 1.0, "lower": 3.0, "upper": 2.0}, {}, "no-number-input"),
    (f"{KIT}BreakVector3", {"tuple": (1.0, 2.0)}, {}, "no-vector-input"),
    (f"{ISAAC}OgnIsaacScaleToFromStageUnit", {"value": "a"}, {}, "no-number-input"),
    (f"{ISAAC}OgnIsaacScaleToFromStageUnit", {"conversion": "no"}, {}, "invalid-conversion"),
    (f"{ISAAC}IsaacArticulationState", {}, {"targetPrim": "/nowhere"}, "no-articulation"),
    (
        f"{ISAAC}IsaacArticulationState",
        {"jointNames": ("none",)},
        {"targetPrim": ROBOT},
        "unknown-joint",
    ),
    ("isaacsim.sensors.physics.IsaacReadJointState", {}, {}, "no-articulation"),
    (f"{ROS}ROS2CameraHelper", {"enabled": False}, {}, "switched-off"),
    (f"{ROS}ROS2CameraHelper", {}, {}, "no-render-product"),
    (f"{ROS}ROS2PublishTransformTree", {}, {}, "no-frames-input"),
    ("isaacsim.robot.wheeled_robots.HolonomicController", WHEELS, {}, "invalid-wheel-size"),
    ("isaacsim.robot.wheeled_robots.HolonomicController", {}, {}, "invalid-wheel-size"),
    ("isaacsim.robot.wheeled_robots.HolonomicRobotUsdSetup", {}, {}, "invalid-wheel-size"),
    (
        "isaacsim.robot.wheeled_robots.HolonomicRobotUsdSetup",
        {},
        {"robotPrim": ROBOT, "comPrim": ROBOT},
        "invalid-wheel-size",
    ),
]


@pytest.fixture(scope="module")
def stage() -> World:
    return world_of(read_scene(correct_stage("05"), load_platform()))


@pytest.mark.parametrize(("name", "values", "targets", "kind"), LACKING)
def test_a_node_that_lacks_something_says_what(
    stage: World, name: str, values: dict[str, Any], targets: dict[str, str], kind: str
) -> None:
    lacking = node(name, values, **targets)
    for _ in range(2):
        lacking.compute(stage)
    assert lacking.failure is not None
    assert (lacking.failure.kind, lacking.enabled) == (kind, [])
    assert stage.network.sent == []


@pytest.mark.parametrize("name", PUBLISHERS)
def test_a_publisher_whose_topic_is_no_name_stays_silent(stage: World, name: str) -> None:
    publisher = node(f"{ROS}{name}", {"topicName": "a b"}, targetPrims=ROBOT, targetPrim=ROBOT)
    for _ in range(3):
        assert not publisher.compute(stage)
    assert publisher.failure is not None
    assert publisher.failure.kind == "invalid-topic-name"
    assert stage.network.sent == []


def test_joints_are_also_named_by_their_numbers(stage: World) -> None:
    values = {"jointIndices": (1, 7)}
    state = node(f"{ISAAC}IsaacArticulationState", values, targetPrim=ROBOT)
    assert state.compute(stage)
    assert state.outputs["jointNames"] == ("wheel_right_joint",)


def test_a_number_is_scaled_as_a_vector_is(stage: World) -> None:
    values = {"value": 3.0, "conversion": "Convert to stage units"}
    scaled = node(f"{ISAAC}OgnIsaacScaleToFromStageUnit", values)
    assert scaled.compute(stage)
    assert scaled.outputs["result"] == 3.0 / stage.scene.meters_per_unit
