"""What an edit leaves in the layers of a stage, and what a prim or property is restored to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from breaking import correct_stage
from msgspec.structs import replace
from pxr import Gf, Sdf, Usd, UsdGeom

from lab3_usd.model.changes import (
    Activate,
    AddGraph,
    ClearValue,
    Connect,
    Edit,
    MovePrim,
    RemoveSchema,
    Restore,
    Retarget,
    SetValue,
)
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditSession, Reference

LAB = load_lab()
ROBOT = LAB.scene.robot.path
BASE = f"{ROBOT}/base_link"
JOINT = f"{ROBOT}/joints/wheel_left_joint"
SUN = "/Environment/Lights/Sun"
COLLIDER = f"{ROBOT}/wheel_left_link/collisions/tyre"

# What is referred to says a value, a connection and targets, each in the way that is added to.
ASSET = """#usda 1.0
def "Node"
{
    int x = 1
    prepend int x.connect = </Node/old.y>
    prepend rel prims = </Node/old>
}
"""
OVER = """#usda 1.0
def "Node" (
    prepend references = @asset.usda@</Node>
)
{
}
"""


def edited(stage: Usd.Stage, *edits: Edit, starter: Path | None = None) -> Usd.Stage:
    path = str(starter) if starter else None
    session = EditSession(stage, LAB.platform, Reference(LAB, LAB.checkpoints["00"], path))
    for edit in edits:
        apply_edit(session, edit)
    return stage


@pytest.fixture
def over(tmp_path: Path) -> Usd.Stage:
    """A stage that refers to a prim of another file."""
    (tmp_path / "asset.usda").write_text(ASSET)
    (tmp_path / "stage.usda").write_text(OVER)
    return Usd.Stage.Open(str(tmp_path / "stage.usda"))


def test_a_connection_replaces_that_of_the_asset(over: Usd.Stage) -> None:
    edited(over, Connect("/Node", "x", "int", ("/Node/new.y",)))
    assert over.GetAttributeAtPath("/Node.x").GetConnections() == ["/Node/new.y"]


def test_what_is_disconnected_is_no_longer_connected_by_the_asset(over: Usd.Stage) -> None:
    wires = [Connect("/Node", "x", "int", ("/Node/new.y",)), Connect("/Node", "x", "int")]
    edited(over, *wires)
    assert over.GetAttributeAtPath("/Node.x").GetConnections() == []


def test_targets_replace_those_of_the_asset(over: Usd.Stage) -> None:
    edited(over, Retarget("/Node", "prims", ("/Node/new",)))
    assert over.GetRelationshipAtPath("/Node.prims").GetTargets() == ["/Node/new"]


@pytest.mark.parametrize("edit", [Retarget("/Node", "prims"), ClearValue("/Node", "prims")])
def test_targets_that_are_taken_away_do_not_come_back_from_the_asset(
    edit: Edit, over: Usd.Stage
) -> None:
    edited(over, edit)
    assert over.GetRelationshipAtPath("/Node.prims").GetTargets() == []


def test_a_cleared_value_does_not_come_back_from_the_asset(over: Usd.Stage) -> None:
    edited(over, SetValue("/Node", "x", "int", 2), ClearValue("/Node", "x"))
    assert over.GetAttributeAtPath("/Node.x").Get() is None


def test_the_file_of_the_asset_is_not_edited(over: Usd.Stage) -> None:
    edited(over, SetValue("/Node", "x", "int", 2), Retarget("/Node", "prims"))
    dirty = [layer.identifier for layer in over.GetUsedLayers() if layer.dirty]
    assert dirty == [over.GetRootLayer().identifier]


def test_a_value_that_replaces_another_type_keeps_its_connection() -> None:
    stage = Usd.Stage.CreateInMemory()
    wrong = stage.DefinePrim("/Node").CreateAttribute("x", Sdf.ValueTypeNames.String)
    wrong.AddConnection("/Node/old.y")
    wrong.SetCustomDataByKey("why", "a student's note")
    attribute = edited(stage, SetValue("/Node", "x", "double", 2.5)).GetAttributeAtPath("/Node.x")
    assert (attribute.GetTypeName(), attribute.Get()) == (Sdf.ValueTypeNames.Double, 2.5)
    assert attribute.GetConnections() == ["/Node/old.y"]
    assert attribute.GetCustomData() == {"why": "a student's note"}


def test_a_value_replaces_samples_over_time() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/Node").CreateAttribute("x", Sdf.ValueTypeNames.Int).Set(1, 5.0)
    attribute = edited(stage, SetValue("/Node", "x", "int", 2)).GetAttributeAtPath("/Node.x")
    assert (attribute.Get(5.0), attribute.GetTimeSamples()) == (2, [])


def test_metadata_is_restored() -> None:
    stage = correct_stage("00")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    edited(stage, Restore("/", "metersPerUnit"))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0


def test_targets_are_restored() -> None:
    stage = correct_stage("00")
    body = stage.GetPrimAtPath(JOINT).GetRelationship("physics:body1")
    body.SetTargets([BASE])
    edited(stage, Restore(JOINT, "physics:body1"))
    assert body.GetTargets() == [f"{ROBOT}/wheel_left_link"]


def test_a_property_that_the_starter_does_not_have_is_removed() -> None:
    stage = correct_stage("00")
    stage.GetPrimAtPath(BASE).CreateAttribute("physics:density", Sdf.ValueTypeNames.Float).Set(9.0)
    edited(stage, Restore(BASE, "physics:density"))
    assert not stage.GetPrimAtPath(BASE).GetAttribute("physics:density").IsAuthored()


def over_asset(stage: Usd.Stage, path: str, text: str) -> Usd.Prim:
    """Let a prim of a stage refer to what a text says of `/A`."""
    asset = Sdf.Layer.CreateAnonymous(".usda")
    asset.ImportFromString(f"#usda 1.0\n{text}")
    prim = stage.GetPrimAtPath(path)
    prim.GetReferences().AddReference(asset.identifier, "/A")
    return prim


@pytest.mark.parametrize(("name", "value"), [("physics:density", 0.0), ("colour", None)])
def test_a_value_of_an_asset_gives_way_to_the_default(name: str, value: float | None) -> None:
    stage = correct_stage("00")
    base = over_asset(stage, BASE, f'def "A"\n{{\n    float {name} = 9\n}}\n')
    edited(stage, Restore(BASE, name))
    assert base.GetAttribute(name).Get() == value


Break = Callable[[UsdGeom.Xformable], object]
MOVED: dict[str, tuple[Break, str]] = {
    "moved": (lambda base: base.GetTranslateOp().Set(Gf.Vec3d(1, 2, 3)), "xformOp:translate"),
    "turned once more": (lambda base: base.AddRotateZOp().Set(90.0), "xformOp:rotateZ"),
    "no turn": (lambda base: base.SetXformOpOrder([base.GetTranslateOp()]), "xformOp:orient"),
    "no operations": (lambda base: base.ClearXformOpOrder(), "xformOpOrder"),
    "not below its parent": (lambda base: base.SetResetXformStack(True), "xformOpOrder"),  # noqa: FBT003
}


@pytest.mark.parametrize("name", MOVED)
@pytest.mark.parametrize("is_whole", [True, False])
def test_a_pose_is_restored(name: str, *, is_whole: bool) -> None:
    stage = correct_stage("00")
    prim = stage.GetPrimAtPath(BASE)
    base = UsdGeom.Xformable(prim)
    pose, order = base.GetLocalTransformation(), base.GetXformOpOrderAttr().Get()
    properties = prim.GetAuthoredPropertyNames()
    move, property_name = MOVED[name]
    move(base)
    edited(stage, Restore(BASE, None if is_whole else property_name))
    assert base.GetLocalTransformation() == pose
    assert base.GetXformOpOrderAttr().Get() == order
    assert prim.GetAuthoredPropertyNames() == properties


def test_a_prim_comes_below_its_parent_again_where_it_stands() -> None:
    stage = correct_stage("00")
    base = UsdGeom.Xformable(stage.GetPrimAtPath(BASE))
    base.SetResetXformStack(True)  # noqa: FBT003 - of USD
    base.GetTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    edited(stage, Restore(BASE, "xformOpOrder"))
    assert not base.GetResetXformStack()
    assert base.GetTranslateOp().Get() == Gf.Vec3d(1, 2, 3)


def test_one_operation_of_a_pose_is_restored_alone() -> None:
    stage = correct_stage("00")
    base = UsdGeom.Xformable(stage.GetPrimAtPath(BASE))
    place = base.GetTranslateOp().Get()
    base.GetTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    base.GetScaleOp().Set(Gf.Vec3d(2, 2, 2))
    edited(stage, Restore(BASE, "xformOp:translate"))
    assert base.GetTranslateOp().Get() == place
    assert base.GetScaleOp().Get() == Gf.Vec3d(2, 2, 2)


def test_a_removed_prim_comes_back_with_what_is_below_it() -> None:
    stage = correct_stage("00")
    stage.RemovePrim(f"{ROBOT}/wheel_left_link")
    edited(stage, Restore(f"{ROBOT}/wheel_left_link"))
    assert stage.GetPrimAtPath(COLLIDER).GetTypeName() == "Cylinder"


def test_what_is_missing_or_inactive_below_a_prim_comes_back() -> None:
    stage = correct_stage("00")
    stage.RemovePrim(COLLIDER)
    stage.GetPrimAtPath(f"{ROBOT}/wheel_left_link/visuals").SetActive(False)  # noqa: FBT003 - of USD
    edited(stage, Restore(f"{ROBOT}/wheel_left_link"))
    assert stage.GetPrimAtPath(COLLIDER).IsValid()
    assert stage.GetPrimAtPath(f"{ROBOT}/wheel_left_link/visuals").IsActive()


@pytest.mark.parametrize("place", ["/Clock", "/World/Clock"])
def test_a_graph_is_added_at_the_root_or_below_a_prim(place: str) -> None:
    stage = edited(
        correct_stage("00"), AddGraph.of(replace(LAB.graphs["ROS_Clock"].graph, path=place))
    )
    graph = stage.GetPrimAtPath(place)
    assert [child.GetName() for child in graph.GetChildren()] == [*LAB.graphs["ROS_Clock"].nodes]


def test_a_type_is_restored() -> None:
    stage = correct_stage("00")
    stage.GetPrimAtPath(SUN).SetTypeName("SphereLight")
    edited(stage, Restore(SUN))
    assert stage.GetPrimAtPath(SUN).GetTypeName() == "DistantLight"


def test_prims_that_name_a_restored_one_come_back() -> None:
    stage = correct_stage("00")
    stage.RemovePrim(JOINT)
    edited(stage, Restore(f"{ROBOT}/wheel_left_link"))
    assert stage.GetPrimAtPath(JOINT).GetTypeName() == "PhysicsRevoluteJoint"


def test_prims_that_do_not_name_a_restored_one_stay_away() -> None:
    stage = correct_stage("00")
    stage.RemovePrim(JOINT)
    edited(stage, Restore(f"{ROBOT}/wheel_right_link"))
    assert not stage.GetPrimAtPath(JOINT)


@pytest.fixture
def lamp() -> Usd.Stage:
    """A stage whose sun refers to a lamp, of which it moves, sizes and switches off a part."""
    stage = correct_stage("00")
    asset = 'def "A"\n{\n    def Xform "Part"\n    {\n        int size = 1\n    }\n}\n'
    over_asset(stage, SUN, asset)
    part = stage.GetPrimAtPath(f"{SUN}/Part")
    UsdGeom.XformCommonAPI(part).SetTranslate((1, 2, 3))
    part.GetAttribute("size").Set(2)
    part.AddAppliedSchema("PhysicsMassAPI")
    part.SetActive(False)  # noqa: FBT003 - of USD
    return stage


def test_overs_below_a_restored_prim_keep_what_is_no_pose_of_their_own(lamp: Usd.Stage) -> None:
    part = edited(lamp, Restore(SUN)).GetPrimAtPath(f"{SUN}/Part")
    assert part.IsActive()
    assert part.GetAppliedSchemas() == []
    assert part.GetAttribute("size").Get() == 2
    assert UsdGeom.Xformable(part).GetLocalTransformation() == Gf.Matrix4d(1)


@pytest.mark.parametrize(
    "edit", [Restore(SUN), Restore("/", "metersPerUnit"), Restore(SUN, "xformOpOrder")]
)
def test_a_closed_session_leaves_the_stage_as_it_was(edit: Edit, lamp: Usd.Stage) -> None:
    UsdGeom.SetStageMetersPerUnit(lamp, 0.01)
    UsdGeom.Xformable(lamp.GetPrimAtPath(SUN)).ClearXformOpOrder()
    text = lamp.GetRootLayer().ExportToString()
    session = EditSession(lamp, LAB.platform, Reference(LAB, LAB.checkpoints["00"]))
    apply_edit(session, edit)
    assert lamp.GetRootLayer().ExportToString() != text
    session.close()
    assert lamp.GetRootLayer().ExportToString() == text


@pytest.fixture
def wheels(tmp_path: Path) -> tuple[Usd.Stage, Path]:
    """A stage with a prim that refers to another, and the starter that it was."""
    stage = correct_stage("00")
    wheel = stage.DefinePrim("/Wheel")
    wheel.CreateAttribute("radius", Sdf.ValueTypeNames.Double).Set(0.5)
    stage.DefinePrim("/Left").GetReferences().AddInternalReference("/Wheel")
    stage.GetRootLayer().Export(str(tmp_path / "starter.usda"))
    return stage, tmp_path / "starter.usda"


@pytest.mark.parametrize("place", ["/Wheel", "/Left"])
def test_a_value_is_restored_where_it_is_said(place: str, wheels: tuple[Usd.Stage, Path]) -> None:
    stage, starter = wheels
    stage.GetAttributeAtPath(f"{place}.radius").Set(9.0)
    edited(stage, Restore("/Left", "radius"), starter=starter)
    assert stage.GetRootLayer().GetAttributeAtPath("/Wheel.radius").default == 0.5
    assert stage.GetRootLayer().GetAttributeAtPath("/Left.radius") is None


def test_a_value_that_is_gone_is_restored_at_the_prim_that_is_referred_to(
    wheels: tuple[Usd.Stage, Path],
) -> None:
    stage, starter = wheels
    stage.GetPrimAtPath("/Wheel").RemoveProperty("radius")
    edited(stage, Restore("/Left", "radius"), starter=starter)
    assert stage.GetRootLayer().GetAttributeAtPath("/Wheel.radius").default == 0.5
    assert stage.GetRootLayer().GetAttributeAtPath("/Left.radius") is None


def test_a_property_is_removed_at_the_prim_that_is_referred_to(
    wheels: tuple[Usd.Stage, Path],
) -> None:
    stage, starter = wheels
    stage.GetPrimAtPath("/Wheel").CreateAttribute("colour", Sdf.ValueTypeNames.Float).Set(1.0)
    edited(stage, Restore("/Left", "colour"), starter=starter)
    assert not stage.GetPrimAtPath("/Left").HasAttribute("colour")


def test_a_session_names_the_overs_that_it_edited(lamp: Usd.Stage) -> None:
    session = EditSession(lamp, LAB.platform, Reference(LAB, LAB.checkpoints["00"]))
    apply_edit(session, Restore(SUN))
    assert f"{SUN}/Part" in session.begin(lamp.GetRootLayer()).touched


ROVER = """#usda 1.0
def Xform "Rover" (
    prepend apiSchemas = ["PhysicsMassAPI", "PhysicsRigidBodyAPI"]
)
{
    def Scope "part" (
        active = false
    )
    {
        int out = 1
    }
    def Scope "node"
    {
        prepend int in.connect = </Rover/arm.out>
        prepend rel prims = [</Rover/arm>, </Rover/part>]
    }
    def Scope "arm"
    {
        int out = 1
    }
}
"""


@pytest.fixture
def rover(tmp_path: Path) -> Usd.Stage:
    """A robot that is an asset, below another prim."""
    (tmp_path / "rover.usda").write_text(ROVER)
    (tmp_path / "stage.usda").write_text(
        '#usda 1.0\ndef "World"\n{\n    def "Rover" (\n'
        '        prepend apiSchemas = ["PhysicsArticulationRootAPI"]\n'
        "        prepend references = @rover.usda@</Rover>\n    )\n    {\n    }\n}\n"
    )
    return Usd.Stage.Open(str(tmp_path / "stage.usda"))


def test_a_schema_is_taken_from_the_layer_and_from_its_asset(rover: Usd.Stage) -> None:
    prim = rover.GetPrimAtPath("/World/Rover")
    edited(rover, RemoveSchema("/World/Rover", "PhysicsArticulationRootAPI"))
    assert prim.GetAppliedSchemas() == ["PhysicsMassAPI", "PhysicsRigidBodyAPI"]
    assert "apiSchemas" not in rover.GetRootLayer().ExportToString()
    edited(rover, RemoveSchema("/World/Rover", "PhysicsMassAPI"))
    assert prim.GetAppliedSchemas() == ["PhysicsRigidBodyAPI"]


def test_what_an_asset_deactivates_is_activated_over_it(rover: Usd.Stage) -> None:
    edited(rover, Activate("/World/Rover/part"))
    assert rover.GetPrimAtPath("/World/Rover/part").IsActive()


def test_a_prim_of_an_asset_is_moved_as_a_copy_and_what_names_it_follows(rover: Usd.Stage) -> None:
    edited(rover, MovePrim("/World/Rover/arm", "/World/arm"))
    assert rover.GetPrimAtPath("/World/arm").GetAttribute("out").Get() == 1
    assert not rover.GetPrimAtPath("/World/Rover/arm").IsActive()
    node = rover.GetPrimAtPath("/World/Rover/node")
    assert node.GetAttribute("in").GetConnections() == ["/World/arm.out"]
    assert node.GetRelationship("prims").GetTargets() == ["/World/arm", "/World/Rover/part"]


@pytest.mark.parametrize(
    ("prim", "to"),
    [
        ("/World/Rover", "/World/Rover/arm/Rover"),  # below itself
        ("/World/Rover/arm", "/World/Rover/node"),  # taken
        ("/World/Rover/arm", "/Nowhere/arm"),
        ("/World/nothing", "/World/arm"),
    ],
)
def test_a_move_that_cannot_be_changes_nothing(prim: str, to: str, rover: Usd.Stage) -> None:
    before = rover.GetRootLayer().ExportToString()
    edited(rover, MovePrim(prim, to))
    assert rover.GetRootLayer().ExportToString() == before
