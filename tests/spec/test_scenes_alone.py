"""A course of scenes: no robot, and no graph."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import invoke
from pxr import Sdf, Usd, UsdGeom, UsdPhysics

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
        "checkpoint hall, pass, 14 of 14 met"
        in invoke("lab", "new", tmp_path / "lab", stage).output
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


PROPS = """
props:
  floor: {path: /Hall/Floor, handout: A, apis: [PhysicsCollisionAPI]}
  lamp: {path: /Hall/Lamp, handout: A, set: {"inputs:intensity": 900.0}}
  gravity: {path: /Hall/Physics, handout: A, set: {"physics:gravityMagnitude": 9.81}}
"""


@pytest.mark.parametrize(
    ("path", "part", "value", "group"),
    [
        ("/Hall/Floor", "PhysicsCollisionAPI", None, "ground"),
        ("/Hall/Lamp", "inputs:intensity", 0.0, "light"),
        ("/Hall/Physics", "physics:gravityMagnitude", 0.0, "physics_scene"),
    ],
)
def test_what_is_asked_of_a_thing_and_of_the_world_is_told_once_and_costs_both(
    hall: Path, path: str, part: str, value: float | None, group: str
) -> None:
    scene = hall.parent / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().partition("\nprops:")[0] + PROPS)
    stage = Usd.Stage.Open(str(hall))
    UsdPhysics.Scene.Get(stage, "/Hall/Physics").CreateGravityMagnitudeAttr(9.81)
    prim = stage.GetPrimAtPath(path)
    if value is None:
        prim.RemoveAppliedSchema(part)
    else:
        prim.CreateAttribute(part, Sdf.ValueTypeNames.Float).Set(value)
    stage.Save()
    result = check_stage(hall, "hall", load_lab(hall.parent / "lab"))
    assert [(each.rule, each.prim, each.property) for each in result.findings] == [
        ("S36", path, part)
    ]
    unmet = {each.id for each in result.requirements if not each.met}
    names = {"ground": "floor", "light": "lamp", "physics_scene": "gravity"}
    assert unmet == {f"Scene/{group}", f"Scene/prop/{names[group]}/{part}"}


def test_a_hall_is_built_from_its_own_starter(hall: Path) -> None:
    folder = hall.parent / "lab"
    made = invoke("--lab", folder, "build", "--out", hall.parent / "built")
    assert (made.exit_code, Path(made.output.strip()).name) == (0, "hall.usda")


@pytest.fixture
def theatre(tmp_path: Path) -> Path:
    """The hall with Y up and in centimetres, with a plane for a floor."""
    stage = tmp_path / "hall.usda"
    text = HALL.replace('"Z"', '"Y"').replace("metersPerUnit = 1", "metersPerUnit = 0.01")
    text = text.replace("def Cube", "def Plane")
    stage.write_text(text.replace("double3", 'uniform token axis = "Y"\n        double3'))
    said = invoke("lab", "new", tmp_path / "lab", stage).output
    assert "checkpoint hall, pass, 15 of 15 met" in said
    scene = tmp_path / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().partition("\nprops:")[0])
    return stage


def gravity(stage: Path, direction: tuple[int, int, int], strength: float) -> list[tuple[str, str]]:
    """What is found where gravity has this direction and strength, and what it should be."""
    opened = Usd.Stage.Open(str(stage))
    scene = UsdPhysics.Scene(opened.GetPrimAtPath("/Hall/Physics"))
    scene.CreateGravityDirectionAttr(direction)
    scene.CreateGravityMagnitudeAttr(strength)
    opened.Save()
    findings = check_stage(stage, "hall", load_lab(stage.parent / "lab")).findings
    return [(finding.rule, finding.expected or "") for finding in findings]


def test_gravity_pulls_down_along_y(theatre: Path) -> None:
    assert gravity(theatre, (0, -1, 0), 981.0) == []


def test_gravity_along_z_pulls_aside_with_y_up(theatre: Path) -> None:
    assert gravity(theatre, (0, 0, -1), 981.0) == [("S15", "(0, -1, 0)")]


def test_gravity_is_in_units_of_the_stage(theatre: Path) -> None:
    assert gravity(theatre, (0, -1, 0), 5.0) == []
    assert gravity(theatre, (0, -1, 0), 0.5) == [("S15", "981")]


def test_a_place_that_is_elsewhere_by_a_wrong_unit_alone_is_not_said(hall: Path) -> None:
    opened = Usd.Stage.Open(str(hall))
    UsdGeom.SetStageMetersPerUnit(opened, 0.1)
    opened.Save()
    findings = check_stage(hall, "hall", load_lab(hall.parent / "lab")).findings
    assert [finding.rule for finding in findings] == ["S02"]


def test_a_wrong_unit_is_said_alone_whatever_gravity_is_in_it(theatre: Path) -> None:
    opened = Usd.Stage.Open(str(theatre))
    UsdGeom.SetStageMetersPerUnit(opened, 1.0)
    opened.Save()
    assert gravity(theatre, (0, -1, 0), 981.0) == [("S02", "0.01")]


def test_a_floor_that_faces_z_carries_nothing_with_y_up(theatre: Path) -> None:
    opened = Usd.Stage.Open(str(theatre))
    UsdGeom.Plane(opened.GetPrimAtPath("/Hall/Floor")).GetAxisAttr().Set("Z")
    opened.Save()
    findings = check_stage(theatre, "hall", load_lab(theatre.parent / "lab")).findings
    assert [finding.rule for finding in findings] == ["S13"]


def test_what_later_stages_add_and_remove_is_described(hall: Path) -> None:
    later = hall.with_name("hall_2.usda")
    stage = Usd.Stage.Open(str(hall))
    stage.RemovePrim("/Hall/Lamp")
    stage.DefinePrim("/Hall/Rack/Board", "Cube")
    stage.DefinePrim("/Hall/Rack", "Xform")
    stage.Export(str(later))
    first = hall.rename(hall.with_name("hall_1.usda"))
    told = invoke("lab", "new", hall.parent / "two", first, later).output
    assert "left out" not in told
    rubric = (hall.parent / "two" / "rubric.yaml").read_text()
    assert "robot" not in rubric
    assert "rules: [U], " in rubric  # S would judge what students do as the supplied scene
    lab = load_lab(hall.parent / "two")
    assert (lab.scene.props["board"].path, lab.scene.props["board"].since) == (
        "/Hall/Rack/Board",
        "2",
    )
    assert lab.checkpoints["2"].removed == ("/Hall/Lamp",)
    assert not lab.checkpoints["2"].topics


LIFT = """#usda 1.0
(
    defaultPrim = "Hall"
    metersPerUnit = 0.01
    kilogramsPerUnit = 1
    upAxis = "Z"
)
def Xform "Hall"
{
    def Xform "Lift" (prepend apiSchemas = ["PhysicsArticulationRootAPI"])
    {
        def Xform "base" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
        {
            float physics:mass = 5
        }
        def Xform "fork" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
        {
            float physics:mass = 2
        }
        def PhysicsPrismaticJoint "rise"
        {
            rel physics:body0 = </Hall/Lift/base>
            rel physics:body1 = </Hall/Lift/fork>
            uniform token physics:axis = "Z"
            float physics:lowerLimit = 0
            float physics:upperLimit = 40
        }
    }
}
"""


def test_a_way_is_described_in_metres_whatever_the_unit_of_the_stage(tmp_path: Path) -> None:
    path = tmp_path / "lift.usda"
    path.write_text(LIFT)
    invoke("lab", "new", tmp_path / "lab", path)
    lab = load_lab(tmp_path / "lab")
    assert lab.scene.robot.joints["rise"].limits == (0.0, 0.4)
    stage = Usd.Stage.Open(str(path))
    messages = [each.message for each in check_stage(path, "lift", lab).findings]
    assert messages == []
    stage.SetMetadata("metersPerUnit", 1.0)
    stage.Save()
    assert [each.rule for each in check_stage(path, "lift", lab).findings] == ["S02"]
    stage.SetMetadata("metersPerUnit", 0.01)
    stage.GetPrimAtPath("/Hall/Lift/rise").GetAttribute("physics:upperLimit").Set(0.4)
    stage.Save()
    messages = [each.message for each in check_stage(path, "lift", lab).findings]
    assert messages == ["the upper limit of rise is 0.4, expected 40"]


def test_a_joint_without_limits_is_described_and_one_that_gets_some_is_told(tmp_path: Path) -> None:
    path = tmp_path / "lift.usda"
    free = LIFT.replace("lowerLimit = 0", "lowerLimit = -inf").replace("Limit = 40", "Limit = inf")
    path.write_text(free)
    invoke("lab", "new", tmp_path / "lab", path)
    lab = load_lab(tmp_path / "lab")
    assert lab.scene.robot.joints["rise"].limits == (float("-inf"), float("inf"))
    stage = Usd.Stage.Open(str(path))
    upper = stage.GetPrimAtPath("/Hall/Lift/rise").GetAttribute("physics:upperLimit")
    told = []
    for change in (upper.Clear, lambda: upper.Set(40.0)):
        change()
        stage.Save()
        told.append([each.message for each in check_stage(path, "lift", lab).findings])
    assert told == [[], ["the upper limit of rise is 40, expected inf"]]
