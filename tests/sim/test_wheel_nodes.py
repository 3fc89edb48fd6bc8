"""Controllers of cars and of wheels with rollers, by hand from the source named at each node."""

from __future__ import annotations

import math
from typing import Any

import pytest
from lone_nodes import node, world

from lab3_usd.model.dry_run import HERE, Scene, ScenePrim
from lab3_usd.sim.execution.recording import Steering
from lab3_usd.sim.execution.world import RosEndpoint, world_of
from lab3_usd.sim.robots import AHEAD, TURN, _allowed
from lab3_usd.spec.load.loader import load_platform

WHEELED = "isaacsim.robot.wheeled_robots."
ACKERMANN, HOLONOMIC = f"{WHEELED}AckermannController", f"{WHEELED}HolonomicController"
CAR = {"wheelBase": 2.0, "trackWidth": 1.0, "frontWheelRadius": 0.5, "backWheelRadius": 0.25}
LEFT = math.atan(0.5)  # steers a car with 2 m between its axles about a point 4 m to its left


def driven(**values: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    car = node(ACKERMANN, {**CAR, **values})
    assert car.compute(world())
    return car.outputs["wheelAngles"], car.outputs["wheelRotationVelocity"]


def test_a_car_goes_straight() -> None:
    assert driven(speed=2.0) == ((0.0, 0.0), (4.0, 4.0, 8.0, 8.0))


def test_the_wheels_of_a_car_turn_about_one_point() -> None:
    angles, speeds = driven(speed=2.0, steeringAngle=LEFT)
    assert angles == pytest.approx((math.atan(2 / 3.5), math.atan(2 / 4.5)))
    # 0.5 rad/s about the point; the wheels are 3.5 and 4.5 m aside, the front 2 m ahead
    front = [0.5 * math.hypot(aside, 2.0) / 0.5 for aside in (3.5, 4.5)]
    assert speeds == pytest.approx((*front, 0.5 * 3.5 / 0.25, 0.5 * 4.5 / 0.25))
    angles, speeds = driven(speed=2.0, steeringAngle=-LEFT)
    assert angles == pytest.approx((-math.atan(2 / 4.5), -math.atan(2 / 3.5)))
    assert speeds[2:] == pytest.approx((0.5 * 4.5 / 0.25, 0.5 * 3.5 / 0.25))


def test_a_car_may_steer_with_its_rear() -> None:
    angles, speeds = driven(speed=2.0, steeringAngle=LEFT, invertSteering=True)
    assert angles == pytest.approx((-math.atan(2 / 4.5), -math.atan(2 / 3.5)))
    assert speeds[:2] == pytest.approx((0.5 * 3.5 / 0.5, 0.5 * 4.5 / 0.5))


def test_a_car_has_limits_and_ramps() -> None:
    assert driven(speed=9.0, maxWheelVelocity=2.0)[1] == pytest.approx((2.0, 2.0, 2.0, 2.0))
    # half a second at 1 m/s2
    ramp = {"speed": 2.0, "acceleration": 1.0, "dt": 0.5}
    assert driven(**ramp)[1] == pytest.approx((1.0, 1.0, 2.0, 2.0))
    car = node(ACKERMANN, {**CAR, "acceleration": 1.0})
    assert not car.compute(world())
    assert not node(ACKERMANN, {"wheelBase": 2.0}).compute(world())


def test_a_command_to_steer_is_held() -> None:
    here = world()
    here.network.commands = RosEndpoint(0, "/ackermann_cmd")
    subscriber = node("isaacsim.ros2.bridge.ROS2SubscribeAckermannDrive")
    assert subscriber.compute(here)
    here.network.tell(Steering(1.0, 0.2))
    assert subscriber.compute(here)
    assert subscriber.enabled == ["execOut"]
    assert (subscriber.outputs["speed"], subscriber.outputs["steeringAngle"]) == (1.0, 0.2)
    assert not subscriber.compute(here)


def test_a_command_to_steer_is_published() -> None:
    here = world()
    values = {"speed": 1.0, "steeringAngle": 0.2, "frameId": "car"}
    publisher = node("isaacsim.ros2.bridge.ROS2PublishAckermannDrive", values)
    publisher.compute(here)
    publisher.compute(here)
    (message,) = here.network.sent
    assert (message.topic, message.frame, message.data) == (
        "/ackermann_cmd",
        "car",
        Steering(1.0, 0.2),
    )


# Four wheels of rollers at the corners of a square of 2 m, axles along Y; those of the diagonals
# grip at 45 and 135 degrees.
SQUARE = {
    "wheelRadius": (0.1,),
    "wheelPositions": ((1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0)),
    "wheelOrientations": ((1.0, 0.0, 0.0, 0.0),) * 4,
    "mecanumAngles": (-45.0, -135.0, -135.0, -45.0),
    "wheelAxis": (0.0, 1.0, 0.0),
}


@pytest.mark.parametrize(
    ("told", "speeds"),
    [
        # each adds 0.1 / sqrt 2 on its way ahead, so that four of them go 0.4 / sqrt 2
        ((1.0, 0.0, 0.0), (math.sqrt(2) / 0.4,) * 4),
        ((0.0, 1.0, 0.0), tuple(k * math.sqrt(2) / 0.4 for k in (1, -1, -1, 1))),
        ((0.0, 0.0, 0.0), (0.0,) * 4),
    ],
)
def test_wheels_of_rollers_go_any_way(told: tuple[float, ...], speeds: tuple[float, ...]) -> None:
    robot = node(HOLONOMIC, {**SQUARE, "inputVelocity": told})
    assert robot.compute(world())
    assert robot.outputs["jointVelocityCommand"] == pytest.approx(speeds)


def test_wheels_of_rollers_have_a_limit() -> None:
    robot = node(HOLONOMIC, {**SQUARE, "inputVelocity": (1.0, 0.0, 0.0), "maxWheelSpeed": 2.0})
    assert robot.compute(world())
    assert robot.outputs["jointVelocityCommand"] == pytest.approx((2.0,) * 4)
    assert not node(HOLONOMIC, {**SQUARE, "mecanumAngles": ()}).compute(world())


def test_the_wheels_of_a_robot_are_read_from_its_joints() -> None:
    joint = ScenePrim(
        "/robot/joint",
        "PhysicsRevoluteJoint",
        frozenset(),
        HERE,
        {
            "isaacmecanumwheel:angle": -45.0,
            "isaacmecanumwheel:radius": 0.1,
            "physics:localPos0": (1.0, 2.0, 0.0),
            "physics:axis": "Y",
        },
        {"physics:body0": ("/robot",)},
        seen=False,
    )
    robot = ScenePrim("/robot", "Xform", frozenset(), HERE, {}, {}, seen=False)
    scene = Scene(1.0, "Z", (), {prim.path: prim for prim in (robot, joint)}, {})
    here = world_of(scene, load_platform())
    setup = node(f"{WHEELED}HolonomicRobotUsdSetup", robotPrim="/robot", comPrim="/robot")
    assert setup.compute(here)
    assert setup.outputs["wheelPositions"] == ((1.0, 2.0, 0.0),)
    assert setup.outputs["wheelAxis"] == (0.0, 1.0, 0.0)
    assert (setup.outputs["wheelRadius"], setup.outputs["wheelDofNames"]) == ((0.1,), ("joint",))
    assert not node(f"{WHEELED}HolonomicRobotUsdSetup").compute(here)


@pytest.mark.parametrize(
    ("values", "speeds", "ramp"),
    [
        ({}, (AHEAD, TURN), 0.0),
        ({"maxLinearSpeed": 0.1, "maxAngularSpeed": 0.5}, (0.09, 0.45), 0.0),
        ({"maxWheelSpeed": 2.0, "wheelRadius": 0.05, "wheelDistance": 0.4}, (0.09, 0.45), 0.0),
        (
            {"maxLinearSpeed": 0.1, "maxAcceleration": 0.05, "maxDeceleration": 0.1},
            (0.09 / 1.08, TURN / 1.08),  # so that it gets going in 20 s / 12
            20 / 12,
        ),
        ({"maxAngularSpeed": 0.5, "maxAngularAcceleration": 0.9}, (AHEAD, 0.45), 0.5),
    ],
)
def test_a_robot_is_driven_as_fast_as_its_controller_lets_it(
    values: dict[str, float], speeds: tuple[float, float], ramp: float
) -> None:
    controller = node(f"{WHEELED}DifferentialController", values)
    found, seconds = _allowed([controller], world())
    assert found == pytest.approx(speeds)
    assert seconds == pytest.approx(ramp)
