"""Recipes write what other authors wrote by hand for the same robot, and the robot drives by it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from in_process import lab3
from pxr import Usd, UsdPhysics
from robot_kinds import car_with_clock, four_wheels, mobile, rollers

from lab3_usd.author.adding import AddOptions, add_graphs
from lab3_usd.author.request import Request
from lab3_usd.facts.robots import robots
from lab3_usd.isaac.releases import BASE
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.stage_reader import read_model

Make = Callable[[], Usd.Stage]
SIZES = {
    "isaacsim.robot.wheeled_robots.DifferentialController": ("wheelRadius", "wheelDistance"),
    "isaacsim.robot.wheeled_robots.AckermannController": (
        "wheelBase",
        "trackWidth",
        "frontWheelRadius",
        "backWheelRadius",
        "invertSteering",
    ),
    "isaacsim.robot.wheeled_robots.HolonomicRobotUsdSetup": ("robotPrim", "comPrim"),
    "isaacsim.robot.wheeled_robots.HolonomicController": ("angularGain",),
    "isaacsim.core.nodes.IsaacArticulationController": ("jointNames", "targetPrim"),
}
DRIVES = [
    (mobile, "drive"),
    (four_wheels, "drive"),
    (car_with_clock, "ackermann"),
    (rollers, "holonomic"),
]


def bare(make: Make, path: Path) -> Path:
    """Write a robot without its graphs."""
    stage = make()
    graphs = [prim.GetPath() for prim in stage.Traverse() if prim.GetTypeName() == "OmniGraph"]
    for graph in graphs:
        stage.RemovePrim(graph)
    stage.GetRootLayer().Export(str(path))
    return path


def added(path: Path, *requests: Request) -> Usd.Stage:
    result = add_graphs(path, requests, AddOptions(BASE))
    assert (result.data is not None, result.new) == (True, ())
    path.write_bytes(result.data or b"")
    stage = Usd.Stage.Open(str(path))
    stage.Reload()
    return stage


def sizes(stage: Usd.Stage) -> list[tuple[str, str, object]]:
    """Return what is written at the ports that say how large a robot is, and what moves."""
    return sorted(
        (
            (kind.rpartition(".")[2], port, shown)
            for prim in stage.Traverse()
            if (kind := prim.GetAttribute("node:type").Get()) in SIZES
            for port in SIZES[kind]
            if (shown := written(prim, f"inputs:{port}")) is not None
        ),
        key=str,
    )


def written(node: Usd.Prim, name: str) -> object:
    relation, attribute = node.GetRelationship(name), node.GetAttribute(name)
    if relation:
        return list(map(str, relation.GetTargets()))
    value = attribute.Get() if attribute and not attribute.GetConnections() else None
    if isinstance(value, float):
        return round(value, 4)
    return list(value) if hasattr(value, "__iter__") else value


@pytest.mark.parametrize(("make", "kind"), DRIVES)
def test_the_sizes_are_those_of_another_author(tmp_path: Path, make: Make, kind: str) -> None:
    stage, other = added(bare(make, tmp_path / "bare.usda"), Request(kind)), sizes(make())
    wired = [] if any(port == "jointNames" for _, port, _ in other) else ["jointNames"]
    assert [size for size in sizes(stage) if size[1] not in wired] == other


def test_a_car_that_its_rear_wheels_steer_is_written_as_one(tmp_path: Path) -> None:
    path = bare(car_with_clock, tmp_path / "bare.usda")
    stage = Usd.Stage.Open(str(path))
    for prim in stage.GetPrimAtPath("/World/Car").GetChildren():
        for name in ("xformOp:translate", "physics:localPos0"):
            place = prim.GetAttribute(name)
            if place.HasAuthoredValue():
                x, y, z = place.Get()
                place.Set(type(place.Get())(-x, y, z))
    stage.Save()
    values = {(kind, port): value for kind, port, value in sizes(added(path, Request("ackermann")))}
    assert values["AckermannController", "invertSteering"] is True
    assert values["AckermannController", "wheelBase"] == 0.6


def test_the_sizes_of_a_car_are_said_with_what_they_lie_between(tmp_path: Path) -> None:
    path = bare(car_with_clock, tmp_path / "bare.usda")
    said = " ".join(lab3("add", "ackermann", path).stdout.split())
    assert "wheel base 0.600 m between front and rear joints" in said
    assert "track 0.400 m between rear_left_joint and rear_right_joint" in said


@pytest.mark.parametrize(("make", "kind"), DRIVES)
def test_a_robot_drives_by_what_three_recipes_write(tmp_path: Path, make: Make, kind: str) -> None:
    path = bare(make, tmp_path / "bare.usda")
    added(path, Request("clock"), Request(kind), Request("odometry"))
    checks = dry_run(path, load_lab(), "").behaviour.checks
    assert [(check.name, check.verdict) for check in checks if check.verdict != "ok"] == []
    assert "follows" in {check.name for check in checks}


def test_a_wheel_that_holds_the_base_by_an_exchanged_joint_is_not_the_base(tmp_path: Path) -> None:
    path = bare(four_wheels, tmp_path / "bare.usda")
    stage = Usd.Stage.Open(str(path))
    joint = next(
        UsdPhysics.Joint(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.RevoluteJoint)
    )
    ends = [joint.GetBody0Rel(), joint.GetBody1Rel()]
    base, wheel = (end.GetTargets() for end in ends)
    ends[0].SetTargets(wheel)
    ends[1].SetTargets(base)
    (robot,) = robots(read_model(stage, lint_platform(), str(path)))
    assert robot.base == str(base[0])
