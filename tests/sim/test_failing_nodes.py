"""What a node lacks is its fault, and it computes and sends nothing."""

from __future__ import annotations

import math
from typing import Any

import pytest
from breaking import correct_stage
from lone_nodes import node
from msgspec.structs import replace

from lab3_usd.sim.execution.node_instance import functions
from lab3_usd.sim.execution.world import World, world_of
from lab3_usd.sim.nodes.sensors import _beam, values_in
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

KIT, ISAAC, ROS = "omni.graph.nodes.", "isaacsim.core.nodes.", "isaacsim.ros2.bridge."
ROBOT = "/turtlebot3_burger"
LIDAR, CAMERA = f"{ROBOT}/base_scan/Lidar2D", f"{ROBOT}/base_footprint/Camera_1"
PUBLISHERS = sorted(
    name for name in functions() if name.startswith("ROS2Publish") and name != "ROS2Publisher"
)
WHEELS = {"wheelRadius": (0.1, 0.1), "wheelPositions": ((1.0, 1.0, 0.0),)}
THREE = {
    "wheelRadius": (0.1,),
    "mecanumAngles": (90.0,),
    "wheelPositions": ((0.2, 0.0, 0.0), (-0.1, 0.2, 0.0), (-0.1, -0.2, 0.0)),
    "wheelOrientations": ((1.0, 0.0, 0.0, 0.0),) * 3,
}
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
    *(
        (
            "isaacsim.robot.wheeled_robots.HolonomicController",
            {**THREE, name: (1.0, odd, 1.0)},
            {},
            "invalid-wheel-size",
        )
        for name, odd in (
            ("wheelRadius", 0.0),
            ("wheelRadius", -1.0),
            ("wheelRadius", math.inf),
            ("wheelRadius", math.nan),
            ("mecanumAngles", math.inf),
            ("mecanumAngles", math.nan),
        )
    ),
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
    return world_of(read_scene(correct_stage("05"), load_platform()), load_platform())


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
    values = {"jointIndices": (1,)}
    state = node(f"{ISAAC}IsaacArticulationState", values, targetPrim=ROBOT)
    assert state.compute(stage)
    assert state.outputs["jointNames"] == ("wheel_right_joint",)


@pytest.mark.parametrize("name", ["IsaacArticulationState", "IsaacArticulationController"])
@pytest.mark.parametrize("number", [2, 7, -1, -(2**31), 2**31 - 1])
def test_a_joint_number_that_the_robot_does_not_have_is_a_fault(
    stage: World, name: str, number: int
) -> None:
    values = {"jointIndices": (1, number), "velocityCommand": (1.0, 1.0)}
    reading = node(f"{ISAAC}{name}", values, targetPrim=ROBOT)
    for _ in range(2):
        assert not reading.compute(stage)
        assert reading.failure is not None
        assert reading.failure.kind == "unknown-joint"
    machine = stage.machines.articulation(ROBOT)
    assert machine is not None
    assert all(joint.target_velocity == 0 for joint in machine.joints.values())


@pytest.mark.parametrize("angle", [0.3, -0.3])
def test_a_car_without_a_wheel_base_drives_straight_on_and_cannot_turn(
    stage: World, angle: float
) -> None:
    values = {"frontWheelRadius": 0.1, "speed": 1.0, "trackWidth": 0.4, "wheelBase": 0.0}
    car = node("isaacsim.robot.wheeled_robots.AckermannController", values)
    assert car.compute(stage)
    assert car.outputs["wheelRotationVelocity"] == pytest.approx((10.0,) * 4)
    car.values["steeringAngle"] = angle
    assert not car.compute(stage)
    assert car.failure is not None
    assert (car.failure.kind, "wheelBase is 0" in car.failure.reason) == (
        "invalid-wheel-size",
        True,
    )


@pytest.mark.parametrize(
    ("turns", "firings", "is_scan"),
    [
        (10, 3600, True),
        (3600, 3600, True),
        (3601, 3600, False),
        (4_000_000_000, 3600, False),
        (0, 3600, False),
        (-1, -1, False),
        (math.nan, 3600, False),
        (10.0, math.nan, False),
        (math.inf, math.inf, False),
        (10, 2**32 - 1, False),
    ],
)
def test_a_lidar_scans_where_it_fires_in_each_turn_and_not_too_often(
    stage: World, turns: float, firings: float, *, is_scan: bool
) -> None:
    lidar = stage.scene.prims[LIDAR]
    names = stage.platform.sensor_models.lidar
    rates = {names.turns: turns, names.firings: firings}
    values = values_in(stage, replace(lidar, values={**lidar.values, **rates}))
    assert (_beam(values, names) is not None) == is_scan


def test_a_number_is_scaled_as_a_vector_is(stage: World) -> None:
    values = {"value": 3.0, "conversion": "Convert to stage units"}
    scaled = node(f"{ISAAC}OgnIsaacScaleToFromStageUnit", values)
    assert scaled.compute(stage)
    assert scaled.outputs["result"] == 3.0 / stage.scene.meters_per_unit


TEXTS, NUMBERS = ("a", "b", "c", "d"), (1.0, 2.0, 3.0, 4.0)
HOLONOMIC = "isaacsim.robot.wheeled_robots.HolonomicController"


@pytest.mark.parametrize(
    ("name", "values"),
    [
        (HOLONOMIC, {**THREE, "wheelRadius": ("a",)}),
        (HOLONOMIC, {**THREE, "wheelPositions": NUMBERS[:3]}),
        (HOLONOMIC, {**THREE, "wheelOrientations": (NUMBERS[:3],) * 3}),
        (
            f"{ROS}ROS2PublishJointState",
            {
                "jointNames": TEXTS,
                "jointPositions": TEXTS,
                "jointVelocities": NUMBERS,
                "jointEfforts": NUMBERS,
                "jointDofTypes": NUMBERS,
                "stageMetersPerUnit": 1.0,
            },
        ),
        (
            f"{ROS}ROS2PublishTransformTree",
            {
                "parentFrames": TEXTS,
                "childFrames": TEXTS,
                "translations": NUMBERS,
                "orientations": (NUMBERS,) * 4,
            },
        ),
        (f"{ISAAC}IsaacSimulationGate", {"step": math.nan}),
        (f"{ISAAC}IsaacCreateRenderProduct", {"enabled": True, "width": math.inf, "height": 1}),
    ],
)
def test_what_is_no_number_where_one_belongs_is_a_fault(
    stage: World, name: str, values: dict[str, Any]
) -> None:
    odd = node(name, values, cameraPrim=LIDAR)
    for _ in range(3):
        odd.compute(stage)
    assert odd.failure is not None
    assert (odd.enabled, stage.network.sent) == ([], [])


def test_vectors_and_arrays_of_texts_are_as_good_as_none(stage: World) -> None:
    reading = node(f"{ISAAC}IsaacArticulationState", {"robotPath": ROBOT, "jointIndices": TEXTS})
    assert reading.compute(stage)
    assert len(reading.outputs["jointNames"]) == 2
    assert reading.vector("jointIndices", stage) == (0.0, 0.0, 0.0)
    assert reading.vectors("jointIndices", stage, 4) == ()
