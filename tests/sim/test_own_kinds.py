"""At a checkpoint the base of each robot is judged as its kind moves, and by its own limits."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from dry_runs import by_name, played
from foreign_robots import car, truck
from in_process import invoke
from pxr import Sdf, Usd, UsdGeom, UsdPhysics
from robot_kinds import by_prefixes, in_namespaces, rollers


def laid_on_ground(stage: Usd.Stage) -> Usd.Stage:
    """Add a floor and what pulls down, as a lab supplies no ground."""
    ground = UsdGeom.Plane.Define(stage, "/World/Ground")
    ground.CreateAxisAttr("Z")
    UsdPhysics.CollisionAPI.Apply(ground.GetPrim())
    UsdPhysics.Scene.Define(stage, "/World/Physics")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/World"))
    return stage


def by_a_lab(stage: Usd.Stage, folder: Path, fault: Usd.Stage | None = None) -> dict[str, str]:
    """Return what a lab that is described after a stage says of it, or of one with a fault."""
    path = folder / "Robots_1.usda"
    laid_on_ground(stage).GetRootLayer().Export(str(path))
    invoke("lab", "new", folder / "lab", "--from", path)
    if fault is not None:
        path = folder / "Other_1.usda"
        fault.GetRootLayer().Export(str(path))
    found = json.loads(invoke("--lab", folder / "lab", "sim", path, "--format", "json").stdout)
    return {
        f"{check.get('of', '')} {check['name']}".strip(): check["verdict"]
        for check in found["checks"]
    }


def test_a_robot_on_rollers_may_go_sideways_at_a_checkpoint(tmp_path: Path) -> None:
    found = by_a_lab(rollers(), tmp_path)
    assert {found[name] for name in ("rest", "follows", "again")} == {"ok"}


def test_a_car_is_driven_at_a_checkpoint(tmp_path: Path) -> None:
    found = by_a_lab(car(), tmp_path)
    assert {found[name] for name in ("rest", "follows", "again")} == {"ok"}


def test_a_car_that_steers_to_the_other_side_fails_at_a_checkpoint(tmp_path: Path) -> None:
    wrong = laid_on_ground(car())
    inverted = wrong.GetPrimAtPath("/World/Drive/ackermann")
    inverted.CreateAttribute("inputs:invertSteering", Sdf.ValueTypeNames.Bool).Set(1)
    assert by_a_lab(car(), tmp_path, wrong)["follows"] == "bad"


def test_a_base_with_y_up_is_not_judged_at_a_checkpoint(tmp_path: Path) -> None:
    found = by_a_lab(truck(), tmp_path)
    assert {found[name] for name in ("rest", "follows", "again")} == {"not judged"}


def with_limits(stage: Usd.Stage) -> Usd.Stage:
    """Give two robots other limits, and name them by their paths."""
    for name, limit in (("alpha", 0.8), ("beta", 1.2)):
        drive, move = (
            stage.GetPrimAtPath(f"/World/{name}_ROS/{node}") for node in ("drive", "move")
        )
        drive.CreateAttribute("inputs:maxLinearSpeed", Sdf.ValueTypeNames.Double).Set(limit)
        (base,) = move.GetRelationship("inputs:targetPrim").GetTargets()
        move.RemoveProperty("inputs:targetPrim")
        move.CreateAttribute("inputs:robotPath", Sdf.ValueTypeNames.String).Set(str(base))
    return stage


@pytest.mark.parametrize("fleet", [in_namespaces, by_prefixes])
def test_each_robot_of_a_fleet_is_held_against_its_own_limit(fleet: object, tmp_path: Path) -> None:
    found = by_a_lab(with_limits(fleet()), tmp_path)  # type: ignore[operator]
    assert {
        found[f"{name} {check}"] for name in ("alpha", "beta") for check in ("limits", "rest")
    } == {"ok"}


@pytest.mark.parametrize("topic", ["/alpha/cmd_vel", "/beta/cmd_vel"])
def test_driving_one_of_two_robots_leaves_the_tree_as_it_is(topic: str, tmp_path: Path) -> None:
    stage = by_prefixes()
    assert by_name(played(stage, tmp_path, topic))["tree"].verdict == "ok"
