"""What is said of assets that cannot be found, and what they excuse."""

from __future__ import annotations

from pathlib import Path

import pytest
from breaking import judged
from layerings import LACKING, behind_a_missing_robot, over_an_asset
from pxr import Sdf, Usd, UsdGeom, UsdPhysics
from scene_stages import (
    CAMERA,
    FLOOR,
    LIDAR,
    ROBOT,
    TICK,
    built,
    deactivate,
    findings_of,
    found_after,
    model_of,
    put,
    refer,
    remove,
    told,
    told_after,
    without_api,
)

from lab3_usd.check.registry import rules_of

DRIVE = f"{ROBOT}/ROS_Drive"


@pytest.mark.parametrize("checkpoint", ["00", "02", "05"])
def test_a_missing_robot_is_one_note(checkpoint: str) -> None:
    found = findings_of(behind_a_missing_robot(checkpoint), checkpoint)
    assert [(each.rule, each.severity, each.prim) for each in found] == [("F02", "note", ROBOT)]


def test_graphs_below_a_missing_robot_are_in_the_scene() -> None:
    model = model_of(behind_a_missing_robot("05"))
    assert [graph.path for graph in model.graphs if not graph.active] == []


def test_a_link_deactivated_on_purpose_is_a_fault_over_a_missing_robot() -> None:
    stage = behind_a_missing_robot("02")
    deactivate(f"{ROBOT}/base_link")(stage)
    assert ("S01", f"{ROBOT}/base_link", None) in told(stage, "02")


def test_what_the_file_says_itself_is_judged_over_a_missing_robot() -> None:
    stage = behind_a_missing_robot("05")
    put(CAMERA, TICK, 30.0)(stage)
    stage.GetPrimAtPath(f"{ROBOT}/base_link").CreateAttribute(
        "physics:mass", Sdf.ValueTypeNames.Float
    ).Set(3.0)
    without_api(LIDAR, "OmniSensorGenericLidarCoreAPI")(stage)
    assert told(stage, "05") == [
        ("C07", CAMERA, TICK),
        ("F02", ROBOT, None),
        ("S04", f"{ROBOT}/base_link", "physics:mass"),
    ]


def test_a_missing_environment_is_one_note() -> None:
    stage = built("05")
    for child in list(stage.GetPrimAtPath("/Environment").GetChildren()):
        stage.RemovePrim(child.GetPath())
    refer("/Environment", "room.usd")(stage)
    assert told(stage, "05") == [("F02", "/Environment", None)]


@pytest.mark.parametrize(
    ("asset_at", "removed", "site"),
    [
        ("/Environment", f"{ROBOT}/base_scan", ("S01", f"{ROBOT}/base_scan", None)),
        (f"{ROBOT}/base_link/visuals", FLOOR, ("S13", "/Environment", None)),
    ],
)
def test_a_missing_asset_excuses_nothing_elsewhere(
    asset_at: str, removed: str, site: tuple[str, str, None]
) -> None:
    assert site in told_after("05", refer(asset_at, "asset.usd"), remove(removed))


def test_wheel_shapes_behind_a_missing_asset_are_not_verifiable() -> None:
    stage = built("01")
    wheel = f"{ROBOT}/wheel_left_link/collisions"
    stage.GetPrimAtPath(wheel).GetReferences().ClearReferences()
    refer(wheel, "tyre.usd")(stage)
    assert told(stage, "01") == [("F02", wheel, None)]


def test_an_asset_that_is_missing_twice_is_noted_once() -> None:
    stage = built("01")
    define = UsdGeom.Xform.Define
    for name in ("A", "B"):
        refer(str(define(stage, f"/World/{name}").GetPath()), "chair.usd")(stage)
    (found,) = findings_of(stage, "01")
    assert (found.prim, found.related, found.actual) == ("/World/A", ("/World/B",), "chair.usd")


def test_an_address_is_told_as_it_was_written() -> None:
    (found,) = found_after("01", refer("/Environment/Walls", "https://assets.example/walls.usd"))
    assert found.actual == "https://assets.example/walls.usd"


def test_a_reference_to_a_prim_that_was_deleted_hides_nothing() -> None:
    found = told_after("01", remove(f"{ROBOT}/colliders/wheel"))
    assert [each[0] for each in found] == ["S06", "S06"]


def test_a_missing_sublayer_is_one_error() -> None:
    stage = built("05")
    stage.GetRootLayer().subLayerPaths.append("edits.usda")
    found = findings_of(stage, "05")
    assert [(each.rule, each.severity, each.actual) for each in found] == [
        ("F03", "error", "edits.usda")
    ]


def test_a_shape_below_an_over_is_not_solid_beside_a_missing_sublayer() -> None:
    """An over is in the scene only where another layer defines it."""
    stage = built("05")
    box = UsdGeom.Cube.Define(stage, f"{ROBOT}/base_link/old/box").GetPrim()
    UsdPhysics.CollisionAPI.Apply(box)
    box.GetParent().SetSpecifier(Sdf.SpecifierOver)
    assert told(stage, "05") == []
    stage.GetRootLayer().subLayerPaths.append("gone.usda")
    assert [rule for rule, _, _ in told(stage, "05")] == ["F03"]


def test_what_a_missing_sublayer_may_hold_is_not_reported_one_by_one() -> None:
    stage = built("05")
    for path in (f"{ROBOT}/base_scan", "/physicsScene", f"{ROBOT}/joints", FLOOR):
        remove(path)(stage)
    stage.GetRootLayer().subLayerPaths.append("starter.usda")
    assert told(stage, "05") == [("F03", "/", None)]


def test_graphs_over_a_missing_sublayer_are_in_the_scene() -> None:
    stage = built("05")
    stage.GetRootLayer().GetPrimAtPath("/World").specifier = Sdf.SpecifierOver
    stage.GetRootLayer().subLayerPaths.append("starter.usda")
    assert [graph.path for graph in model_of(stage).graphs if not graph.active] == []


def test_a_prim_below_an_over_is_absent_where_nothing_is_missing() -> None:
    stage = built("01")
    stage.GetRootLayer().GetPrimAtPath("/World").specifier = Sdf.SpecifierOver
    assert [graph.path for graph in model_of(stage).graphs if not graph.active] == [
        "/World/ROS_Clock"
    ]


def test_a_class_is_not_in_the_scene() -> None:
    stage = built("05")
    stage.CreateClassPrim("/Prototypes")
    stage.DefinePrim("/Prototypes/Lidar", "OmniLidar")
    assert told(stage, "05") == []


def test_an_asset_is_told_as_the_file_names_it(tmp_path: Path) -> None:
    path = tmp_path / "work" / "stage.usda"
    path.parent.mkdir()
    stage = built("01")
    refer("/Environment/Walls", "../assets/walls.usd")(stage)
    stage.GetRootLayer().subLayerPaths.append("./edits.usda")
    stage.GetRootLayer().Export(str(path))
    found = findings_of(Usd.Stage.Open(str(path)), "01")
    assert [each.actual for each in found] == ["../assets/walls.usd", "./edits.usda"]


def test_an_unreadable_file_is_told_with_its_reason() -> None:
    found = rules_of("file", "F")
    problems = [list(each.check("is empty")) for each in found if each.id == "F01"]
    assert [(problem.prim, problem.message) for problem in problems[0]] == [("/", "is empty")]


@pytest.mark.parametrize("payload", [False, True])
def test_a_missing_sublayer_of_an_asset_is_a_note_where_the_asset_is_used(
    tmp_path: Path, *, payload: bool
) -> None:
    (found,) = findings_of(over_an_asset(tmp_path, LACKING, payload=payload), "05")
    assert (found.rule, found.severity, found.prim) == ("F02", "note", "/Environment/More")
    assert found.actual == "./edits.usda"
    assert "walls.usda" in found.message


def test_a_missing_sublayer_of_an_asset_hides_nothing_elsewhere(tmp_path: Path) -> None:
    stage = over_an_asset(tmp_path, LACKING)
    gone = [f"{ROBOT}/base_scan", f"{ROBOT}/wheel_left_link"]
    for path in gone:
        remove(path)(stage)
    assert {("S01", path, None) for path in gone} <= set(told(stage, "05"))


def test_an_asset_that_is_nothing_but_a_missing_sublayer_is_not_verifiable(tmp_path: Path) -> None:
    stage = over_an_asset(tmp_path, '(subLayers = [@./edits.usda@]\n defaultPrim = "Walls")\n')
    assert told(stage, "05") == [("F02", "/Environment/More", None)]


def test_an_asset_of_an_asset_that_lacks_a_sublayer_is_told_where_it_is(tmp_path: Path) -> None:
    inner = 'def "in" (prepend references = @./in.usda@</Walls>)\n    {\n    }\n'
    outer = f'def Xform "Walls"\n{{\n    {inner}}}\n'
    (tmp_path / "in.usda").write_text(f"#usda 1.0\n{LACKING}")
    stage = over_an_asset(tmp_path, outer)
    assert told(stage, "05") == [("F02", "/Environment/More/in", None)]
    stage.GetPrimAtPath("/Environment/More").SetInstanceable(True)  # noqa: FBT003 - pxr takes it so
    assert told(stage, "05") == [("F02", "/Environment/More/in", None)]


def test_a_layer_may_be_missing_from_the_stage_and_from_an_asset(tmp_path: Path) -> None:
    stage = over_an_asset(tmp_path, LACKING)
    stage.GetRootLayer().subLayerPaths.append("edits.usda")
    assert told(stage, "05") == [("F02", "/Environment/More", None), ("F03", "/", None)]


def drive_in_a_sublayer(folder: Path, *, muted: bool, prim: str = DRIVE) -> Usd.Stage:
    """A stage with one prim in a sublayer, which its list of muted layers names."""
    whole = built("05").GetRootLayer()
    part = Sdf.Layer.CreateNew(str(folder / "drive.usda"))
    Sdf.CreatePrimInLayer(part, Sdf.Path(prim).GetParentPath())
    Sdf.CopySpec(whole, prim, part, prim)
    part.Save()
    edit = Sdf.BatchNamespaceEdit()
    edit.Add(prim, Sdf.Path.emptyPath)
    assert whole.Apply(edit)
    whole.subLayerPaths.append("./drive.usda")
    whole.customLayerData = {"omni_layer": {"locked": {}, "muteness": {"./drive.usda": muted}}}
    whole.Export(str(folder / "stage.usda"))
    return Usd.Stage.Open(str(folder / "stage.usda"))


def test_a_muted_sublayer_with_a_graph_of_the_lab_is_a_warning(tmp_path: Path) -> None:
    (found,) = findings_of(drive_in_a_sublayer(tmp_path, muted=True), "05")
    assert (found.rule, found.severity, found.actual) == ("F04", "warning", "./drive.usda")
    assert found.related == (DRIVE,)


def test_a_layer_that_is_muted_under_two_spellings_is_one_warning(tmp_path: Path) -> None:
    stage = drive_in_a_sublayer(tmp_path, muted=True)
    muteness = {"./drive.usda": True, "drive.usda": True, str(tmp_path / "drive.usda"): True}
    stage.GetRootLayer().customLayerData = {"omni_layer": {"muteness": muteness}}
    assert [finding.rule for finding in findings_of(stage, "05")] == ["F04"]


def test_a_sublayer_that_is_muted_no_more_or_holds_nothing_of_the_lab_is_none(
    tmp_path: Path,
) -> None:
    assert told(drive_in_a_sublayer(tmp_path, muted=False), "05") == []
    other = tmp_path / "other"
    other.mkdir()
    assert told(drive_in_a_sublayer(other, muted=True, prim="/Environment/Walls"), "05") == []


def test_a_muted_sublayer_with_a_link_of_the_robot_is_a_warning(tmp_path: Path) -> None:
    stage = drive_in_a_sublayer(tmp_path, muted=True, prim=f"{ROBOT}/base_link")
    (found,) = findings_of(stage, "05")
    assert (found.rule, found.related) == ("F04", (ROBOT,))


@pytest.mark.parametrize("data", [{"omni_layer": 3}, {"omni_layer": {"muteness": "x"}}, {}])
def test_odd_lists_of_muted_layers_hide_nothing(data: dict[str, object]) -> None:
    stage = built("05")
    stage.GetRootLayer().customLayerData = data
    assert told(stage, "05") == []


def overs_of_a_graph(stage: Usd.Stage) -> None:
    """Leave of the drive graph what is saved over a graph that an asset holds."""
    graph = stage.GetRootLayer().GetPrimAtPath(DRIVE)
    graph.specifier, graph.typeName = Sdf.SpecifierOver, ""


def test_nodes_over_a_graph_of_a_missing_asset_are_not_outside_every_graph() -> None:
    stage = behind_a_missing_robot("05")
    overs_of_a_graph(stage)
    found = [finding for finding in judged(stage, "05").findings if finding.severity != "note"]
    assert [(each.rule, each.prim) for each in found] == [("G01", DRIVE)]
    assert "./turtlebot3_burger.usd" in found[0].message


def test_nodes_over_a_missing_asset_are_missing_once_for_their_graph() -> None:
    stage = behind_a_missing_robot("05")
    nodes = stage.GetRootLayer().GetPrimAtPath(DRIVE).nameChildren
    for node in nodes:
        node.specifier = Sdf.SpecifierOver
    (found,) = [finding for finding in judged(stage, "05").findings if finding.severity != "note"]
    assert (found.rule, found.prim) == ("N01", DRIVE)
    assert set(found.related) == {f"{DRIVE}/{node.name}" for node in nodes}
    assert "./turtlebot3_burger.usd" in found.message


def test_a_node_that_is_deactivated_is_told_beside_those_of_a_missing_asset() -> None:
    stage = behind_a_missing_robot("05")
    nodes = list(stage.GetRootLayer().GetPrimAtPath(DRIVE).nameChildren)
    for node in nodes[1:]:
        node.specifier = Sdf.SpecifierOver
    stage.GetPrimAtPath(nodes[0].path).SetActive(False)  # noqa: FBT003 - USD's signature
    found = [finding for finding in judged(stage, "05").findings if finding.rule == "N01"]
    assert [len(each.related) for each in found] == [len(nodes) - 1, 1]


def test_nodes_over_no_asset_are_outside_every_graph() -> None:
    stage = built("05")
    overs_of_a_graph(stage)
    stage.GetPrimAtPath(DRIVE).SetSpecifier(Sdf.SpecifierDef)
    rules = [finding.rule for finding in judged(stage, "05").findings if finding.severity != "note"]
    assert set(rules) == {"G01", "N09"}


def test_what_an_instance_does_not_take_up_is_told_with_its_reason() -> None:
    stage = built("05")
    asset = Sdf.Layer.CreateAnonymous(".usda")
    for path in (ROBOT, DRIVE):
        Sdf.CreatePrimInLayer(asset, path)
    Sdf.CopySpec(stage.GetRootLayer(), ROBOT, asset, ROBOT)
    edit = Sdf.BatchNamespaceEdit()
    edit.Add(DRIVE, Sdf.Path.emptyPath)
    assert asset.Apply(edit)
    stage.GetPrimAtPath(ROBOT).GetReferences().AddReference(asset.identifier, ROBOT)
    stage.GetPrimAtPath(ROBOT).SetInstanceable(True)  # noqa: FBT003 - pxr takes it so
    (missing,) = [finding for finding in judged(stage, "05").findings if finding.rule == "G01"]
    assert missing.prim == DRIVE
    assert f"{ROBOT} is an instance" in missing.message
