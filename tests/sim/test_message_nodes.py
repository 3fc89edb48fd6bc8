"""Inertia and messages of any type, against cases worked out by hand from their sources."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from dry_runs import by_name, played
from foreign_robots import arm, connect, rover, write_node
from lone_nodes import node
from pxr import Sdf, UsdPhysics

from lab3_usd.isaac.messages import why_no_message
from lab3_usd.sim.execution.recording import Fields, Inertia
from lab3_usd.sim.execution.world import World, world_of
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

SENSORS, ROS = "isaacsim.sensors.physics.", "isaacsim.ros2.bridge."
TOOL = "/arm/tool/imu"


@pytest.fixture
def stage() -> World:
    return world_of(read_scene(arm(), load_platform()), load_platform())


def test_a_sensor_at_rest_feels_the_ground(stage: World) -> None:
    read = node(f"{SENSORS}IsaacReadIMU", imuPrim=TOOL)
    assert read.compute(stage)
    assert read.outputs["linAcc"] == pytest.approx((0.0, 0.0, 9.80665))
    read.values["readGravity"] = False
    assert read.compute(stage)
    assert read.outputs["linAcc"] == (0.0, 0.0, 0.0)


def test_the_direction_of_gravity_has_no_length() -> None:
    robot = arm()
    scene = UsdPhysics.Scene.Get(robot, "/World/physicsScene")
    scene.CreateGravityDirectionAttr((0.0, 0.0, -2.0))
    scene.CreateGravityMagnitudeAttr(4.0)
    world = world_of(read_scene(robot, load_platform()), load_platform())
    read = node(f"{SENSORS}IsaacReadIMU", imuPrim=TOOL)
    read.compute(world)
    assert read.outputs["linAcc"] == pytest.approx((0.0, 0.0, 4.0))


def test_a_sensor_turns_with_its_link(stage: World) -> None:
    machine = stage.machines.articulation("/arm")
    assert machine is not None
    read = node(f"{SENSORS}IsaacReadIMU", imuPrim=TOOL)
    read.compute(stage)
    machine.joints["shoulder_joint"].position = 0.5 / 60  # in a frame, of 1/60 s
    stage.machines.step(0.0)
    read.compute(stage)
    assert read.outputs["angVel"] == pytest.approx((0.0, 0.0, 0.5))
    x, y, z, w = read.outputs["orientation"]
    assert (x, y, 2 * math.atan2(z, w)) == pytest.approx((0.0, 0.0, 0.5 / 60))


def test_what_is_no_inertial_sensor_gives_nothing(stage: World) -> None:
    read = node(f"{SENSORS}IsaacReadIMU", imuPrim="/arm/tool")
    assert not read.compute(stage)
    assert (read.outputs["linAcc"], read.outputs["angVel"]) == ((0.0,) * 3, (0.0,) * 3)
    assert read.outputs["orientation"] == (0.0, 0.0, 0.0, 1.0)
    assert read.failure is not None
    assert read.failure.kind == "no-inertial-sensor"


def test_what_is_not_published_is_none(stage: World) -> None:
    values = {"linearAcceleration": (1.0, 2.0, 3.0), "publishAngularVelocity": False}
    publisher = node(f"{ROS}ROS2PublishImu", {**values, "frameId": "tool"})
    publisher.compute(stage)
    publisher.compute(stage)
    (message,) = stage.network.sent
    assert (message.topic, message.frame) == ("/imu", "tool")
    assert message.data == Inertia((1.0, 0.0, 0.0, 0.0), None, (1.0, 2.0, 3.0))


def test_an_arm_publishes_its_inertia(tmp_path: Path) -> None:
    found = played(arm(), tmp_path)
    assert found.not_simulated == ()
    assert {topic.name: topic.frame for topic in found.topics}["/imu"] == "tool"


def test_a_message_of_any_type_is_published_from_the_third_signal_on(tmp_path: Path) -> None:
    stage = rover()
    values = {"messagePackage": "std_msgs", "messageName": "Float64", "topicName": "level"}
    publisher = write_node(stage, "/World/Clock/level", "ros.ROS2Publisher", values)
    publisher.CreateAttribute("inputs:data", Sdf.ValueTypeNames.Double).Set(2.5)
    connect(stage, "/World/Clock", "tick.tick", "level.execIn")
    found = played(stage, tmp_path)
    assert {topic.name: topic.type for topic in found.topics}["/level"] == "std_msgs/msg/Float64"
    assert by_name(found)["topics"].verdict == "ok"
    here = world_of(read_scene(stage, load_platform()), load_platform())
    lone = node(f"{ROS}ROS2Publisher", {**values, "messageSubfolder": "msg", "data": 2.5})
    assert [lone.compute(here), lone.compute(here), lone.compute(here)] == [False, True, True]
    (message,) = here.network.sent
    assert message.data == Fields({"data": 2.5})
    assert not node(f"{ROS}ROS2Publisher", {"messagePackage": "std_msgs"}).compute(here)


@pytest.mark.parametrize(
    ("package", "folder", "name", "reason"),
    [
        ("std_msgs", "msg", "Float32.msg", "Float32.msg is not the name of a message"),
        ("geometry_msg", "msg", "Pose", "there is no package geometry_msg, but geometry_msgs"),
        ("std_msgs", "srv", "Empty", "messages are in msg, not in srv"),
        ("geometry_msgs", "msg", "Poses", "geometry_msgs has no Poses"),
    ],
)
def test_a_message_that_cannot_exist_is_not_sent(
    tmp_path: Path, package: str, folder: str, name: str, reason: str
) -> None:
    stage = rover()
    values = {"messagePackage": package, "messageSubfolder": folder, "messageName": name}
    write_node(stage, "/World/Clock/any", "ros.ROS2Publisher", values)
    connect(stage, "/World/Clock", "tick.tick", "any.execIn")
    check = by_name(played(stage, tmp_path))["topics"]
    assert (check.verdict, check.prim) == ("bad", "/World/Clock/any")
    assert reason in check.cause


def test_a_message_of_a_package_of_ones_own_may_exist() -> None:
    assert not why_no_message("our_msgs", "msg", "Level")
    assert not why_no_message("std_msgs", "msg", "Float32")
