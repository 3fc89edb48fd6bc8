"""A course of scenes: no robot, and no graph."""

from __future__ import annotations

from pathlib import Path

import pytest
from invoking import invoke
from pxr import Usd

from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab

HALL = """#usda 1.0
(
    defaultPrim = "Hall"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Hall"
{
    def Cube "Floor" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double3 xformOp:translate = (8, 0, -1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def SphereLight "Lamp"
    {
        float inputs:intensity = 900
    }
    def PhysicsScene "Physics"
    {
    }
}
"""


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    stage = tmp_path / "hall.usda"
    stage.write_text(HALL)
    assert (
        "checkpoint hall, pass, 8 of 8 met" in invoke("lab", "new", tmp_path / "lab", stage).output
    )
    return stage


def test_a_hall_without_a_robot_is_no_robot(hall: Path) -> None:
    lab = load_lab(hall.parent / "lab")
    assert lab.scene.robots == ()
    assert lab.scene.world.light is not None


@pytest.mark.parametrize(
    ("path", "rule"),
    [("/Hall/Floor", "S13"), ("/Hall/Lamp", "S14"), ("/Hall/Physics", "S15"), ("/Hall", "S01")],
)
def test_a_scene_without_a_robot_is_judged(hall: Path, path: str, rule: str) -> None:
    stage = Usd.Stage.Open(str(hall))
    stage.RemovePrim(path)
    stage.Save()
    lab = load_lab(hall.parent / "lab")
    found = [each.rule for each in check_stage(hall, "hall", lab).findings]
    assert found == [rule]


def test_a_hall_is_built_from_its_own_starter(hall: Path) -> None:
    folder = hall.parent / "lab"
    made = invoke("--lab", folder, "build", "--out", hall.parent / "built")
    assert (made.exit_code, Path(made.output.strip()).name) == (0, "hall.usda")
