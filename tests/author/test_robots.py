"""Robots are measured whatever they are called, and whether anything commands them or not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from foreign_robots import (
    ROVER,
    add_joint,
    add_lidar,
    add_link,
    add_rover,
    add_wheel,
    new_stage,
)
from in_process import invoke
from pxr import Gf, UsdGeom, UsdPhysics
from robot_kinds import rollers

from lab3_usd.facts.robots import Robot, robots
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.read.stage_reader import read_stage


def robots_of(path: Path) -> tuple[Robot, ...]:
    return robots(read_stage(path, lint_platform()))


def sides(robot: Robot) -> dict[str, tuple[str, float | None]]:
    return {
        wheel.joint.name: (wheel.side, wheel.radius and round(wheel.radius, 6))
        for wheel in robot.wheels
    }


def test_sides_are_told_by_place_and_not_by_name(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "bot.usda")
    add_rover(stage, names=("right", "left"))
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    assert sides(robot) == {"right_joint": ("left", 0.05), "left_joint": ("right", 0.05)}


@pytest.mark.parametrize("metres", [1.0, 0.01, 0.001])
def test_sizes_are_metres_in_any_unit(tmp_path: Path, metres: float) -> None:
    stage = new_stage(tmp_path / "bot.usda", metres)
    add_rover(stage, radius=0.08, distance=0.5)
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    assert [round(wheel.place[1], 6) for wheel in robot.wheels] == [0.25, -0.25]
    assert {round(wheel.radius or 0, 6) for wheel in robot.wheels} == {0.08}


def test_a_robot_that_stands_turned_has_its_own_left(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "bot.usda")
    add_rover(stage)
    UsdGeom.Xformable(stage.GetPrimAtPath("/World/Bot")).AddRotateZOp().Set(135.0)
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    assert sides(robot) == {"left_joint": ("left", 0.05), "right_joint": ("right", 0.05)}


def test_a_mecanum_wheel_is_a_wheel_and_its_rollers_are_none(tmp_path: Path) -> None:
    assert rollers().Export(str(tmp_path / "bot.usda"))
    shown = json.loads(invoke("robots", tmp_path / "bot.usda", "--format", "json").output)
    wheels = {
        wheel["joint"]: (wheel["side"], wheel["radius"], wheel["roller_angle"])
        for wheel in shown["robots"][0]["wheels"]
    }
    assert wheels == {
        "front_left_joint": ("left", 0.1, -135.0),
        "front_right_joint": ("right", 0.1, -45.0),
        "rear_left_joint": ("left", 0.1, -45.0),
        "rear_right_joint": ("right", 0.1, -135.0),
    }


def test_a_castor_is_no_wheel(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "bot.usda")
    add_rover(stage)
    add_link(stage, "/World/Bot/fork", Gf.Vec3d(-0.2, 0, 0.05))
    add_wheel(stage, "/World/Bot/roll", Gf.Vec3d(-0.2, 0, 0.02), 0.02)
    add_joint(
        stage, "/World/Bot/joints/swivel", ("/World/Bot/base", "/World/Bot/fork"),
        Gf.Vec3d(-0.2, 0, 0), "Z", gains=None,
    )  # fmt: skip
    add_joint(
        stage, "/World/Bot/joints/roll", ("/World/Bot/fork", "/World/Bot/roll"),
        Gf.Vec3d(0, 0, -0.03), gains=None,
    )  # fmt: skip
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    assert set(sides(robot)) == {"left_joint", "right_joint"}


def test_a_wheel_that_turns_with_its_axle_is_steered(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "bot.usda")
    add_rover(stage)
    add_link(stage, "/World/Bot/knuckle", Gf.Vec3d(0.3, 0, 0.05))
    add_wheel(stage, "/World/Bot/front", Gf.Vec3d(0.3, 0, 0.05), 0.05)
    add_joint(
        stage, "/World/Bot/joints/steer", ("/World/Bot/base", "/World/Bot/knuckle"),
        Gf.Vec3d(0.3, 0, 0), "Z", gains=(1000.0, 100.0), limits=(-30.0, 30.0),
    )  # fmt: skip
    add_joint(
        stage, "/World/Bot/joints/roll", ("/World/Bot/knuckle", "/World/Bot/front"),
        Gf.Vec3d(0, 0, 0),
    )  # fmt: skip
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    steered = {wheel.joint.name: wheel.steering for wheel in robot.wheels}
    assert steered["roll"] is not None
    assert steered["roll"].name == "steer"
    assert steered["left_joint"] is None


def test_a_cube_has_no_radius(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "bot.usda")
    add_rover(stage)
    stage.RemovePrim("/World/Bot/left_wheel/collider")
    cube = UsdGeom.Cube.Define(stage, "/World/Bot/left_wheel/collider")
    cube.CreateSizeAttr(0.1)
    UsdPhysics.CollisionAPI.Apply(cube.GetPrim())
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    assert sides(robot)["left_joint"] == ("left", None)


def test_bodies_without_an_articulation_root_are_a_robot_without_one(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "bot.usda")
    add_rover(stage)
    stage.GetPrimAtPath("/World/Bot/base").RemoveAPI(UsdPhysics.ArticulationRootAPI)
    stage.Save()
    (robot,) = robots_of(tmp_path / "bot.usda")
    assert (robot.root, robot.path, robot.base) == ("", "/World/Bot", "/World/Bot/base")


def test_two_robots_keep_their_own_sensors(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "two.usda")
    for name in ("alpha", "beta"):
        add_rover(stage, f"/World/{name}")
        add_lidar(stage, f"/World/{name}/base/laser")
    stage.Save()
    found = {
        robot.path: [s.prim.path for s in robot.sensors]
        for robot in robots_of(tmp_path / "two.usda")
    }
    assert found == {
        "/World/alpha": ["/World/alpha/base/laser"],
        "/World/beta": ["/World/beta/base/laser"],
    }


def test_the_command_prints_what_add_knows() -> None:
    answer = invoke("robots", ROVER)
    assert answer.exit_code == 0
    assert "/World/Rover" in answer.output
    assert "radius 0.100 m" in answer.output


def test_its_json_names_each_joint_and_sensor() -> None:
    (robot,) = json.loads(invoke("robots", ROVER, "--format", "json").output)["robots"]
    assert [joint["name"] for joint in robot["joints"]] == ["left_wheel_joint", "right_wheel_joint"]
    assert [(wheel["side"], wheel["radius"]) for wheel in robot["wheels"]] == [
        ("left", 0.1),
        ("right", 0.1),
    ]
    assert {sensor["kind"] for sensor in robot["sensors"]} == {"camera", "lidar"}


def test_a_file_that_is_missing_is_named_once(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "scene.usda")
    for name in ("one", "two"):
        prim = UsdGeom.Xform.Define(stage, f"/World/{name}").GetPrim()
        prim.GetReferences().AddReference("./gone.usda")
    stage.Save()
    assert invoke("robots", tmp_path / "scene.usda").output.count("gone.usda") == 1
