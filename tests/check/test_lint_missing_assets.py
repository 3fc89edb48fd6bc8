"""The linter where assets are missing: what the file defines is judged, the rest is counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import quick_yaml
from foreign_robots import ROBOTS, TICK, body, revolute, rover, write_graph
from layerings import ROVER, rover_of_a_missing_asset
from linting import broken_robot, found_by, said_by
from made_once import copy_of
from places import TESTS
from pxr import Sdf, Usd, UsdPhysics
from robot_kinds import rollers

from lab3_usd.model.finding import NodeCoverage, StageResult
from lab3_usd.pipeline.stage import lint_stage

CLOCK = {"tick": TICK, "clock": ("ros.ROS2PublishClock", {})}
RUNS = ["tick.tick -> clock.execIn"]


def result_of(stage: Usd.Stage, folder: Path) -> StageResult:
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    return lint_stage(path)


def cut(stage: Usd.Stage, *wires: str) -> None:
    for wire in wires:
        attribute = stage.GetAttributeAtPath(wire)
        assert attribute.GetConnections()
        attribute.ClearConnections()


def errors(result: StageResult) -> set[tuple[str, str]]:
    return {
        (finding.rule, finding.prim) for finding in result.findings if finding.severity == "error"
    }


def as_overs(stage: Usd.Stage, graph: str) -> None:
    """Leave of a graph what is saved of one that an asset holds."""
    layer = stage.GetRootLayer()
    for path in (graph, *(f"{graph}/{name}" for name in CLOCK)):
        spec = layer.GetPrimAtPath(path)
        spec.specifier, spec.typeName = Sdf.SpecifierOver, ""
        for name in [each.name for each in spec.properties if each.name.startswith("node:")]:
            spec.RemoveProperty(spec.properties[name])


def test_cut_wires_are_found_beside_a_missing_sublayer(tmp_path: Path) -> None:
    stage = rover()
    stage.GetRootLayer().subLayerPaths.append("./edits.usda")
    cut(stage, "/World/Clock/clock.inputs:timeStamp", "/World/Clock/clock.inputs:execIn")
    result = result_of(stage, tmp_path)
    assert result.verdict == "fail"
    assert errors(result) == {("K01", "/World/Clock/clock"), ("K10", "/World/Clock/clock")}


def test_a_body_that_a_missing_asset_may_hold_is_not_said_to_be_missing(tmp_path: Path) -> None:
    stage = rover()
    stage.DefinePrim("/World/Part").GetReferences().AddReference("./part.usda")
    joint = stage.GetPrimAtPath("/World/Rover/left_wheel_joint")
    joint.GetRelationship("physics:body0").SetTargets(["/World/Part/link"])
    assert "K61" not in {rule for rule, _ in errors(result_of(stage, tmp_path))}


def test_cut_wires_are_found_below_a_missing_robot(tmp_path: Path) -> None:
    stage = rover_of_a_missing_asset()
    graph = f"{ROVER}/Graph"
    nodes = {
        **CLOCK,
        "time": ("core.IsaacReadSimulationTime", {}),
        "odometry": ("ros.ROS2PublishOdometry", {}),
        "late": ("ros.ROS2PublishClock", {"topicName": "late"}),
    }
    write_graph(stage, graph, nodes, RUNS)
    result = result_of(stage, tmp_path)
    assert result.verdict == "fail"
    assert {("K10", f"{graph}/clock"), ("K01", f"{graph}/odometry"), ("K01", f"{graph}/late")} <= (
        errors(result)
    )


def test_a_cycle_and_a_wire_of_the_wrong_type_are_found_below_a_missing_robot(
    tmp_path: Path,
) -> None:
    stage = rover_of_a_missing_asset()
    graph = f"{ROVER}/Graph"
    nodes = {**CLOCK, "twist": ("ros.ROS2SubscribeTwist", {})}
    wires = ["tick.tick -> twist.execIn", "twist.linearVelocity -> clock.timeStamp"]
    write_graph(stage, graph, nodes, [*RUNS, *wires])
    assert ("K22", f"{graph}/clock") in errors(result_of(stage, tmp_path))


def test_a_wire_from_a_node_that_a_defined_graph_does_not_have_is_found(tmp_path: Path) -> None:
    stage = rover_of_a_missing_asset()
    graph = f"{ROVER}/Graph"
    write_graph(stage, graph, CLOCK, RUNS)
    stage.GetAttributeAtPath(f"{graph}/clock.inputs:execIn").SetConnections(
        [Sdf.Path(f"{graph}/gone.outputs:tick")]
    )
    assert ("K20", f"{graph}/clock") in errors(result_of(stage, tmp_path))


def test_a_wire_from_a_node_that_the_asset_may_have_is_not_judged(tmp_path: Path) -> None:
    stage = rover_of_a_missing_asset()
    graph = f"{ROVER}/Graph"
    write_graph(stage, graph, CLOCK, [*RUNS])
    layer = stage.GetRootLayer()
    tick = layer.GetPrimAtPath(f"{graph}/tick")
    tick.specifier, tick.typeName = Sdf.SpecifierOver, ""
    assert ("K20", f"{graph}/clock") not in errors(result_of(stage, tmp_path))


def test_a_wire_from_a_node_that_a_missing_sublayer_may_have_is_a_warning(tmp_path: Path) -> None:
    stage = rover()
    write_graph(stage, "/World/Own", CLOCK, RUNS)
    del stage.GetRootLayer().GetPrimAtPath("/World/Own").nameChildren["tick"]
    assert ("K20", "/World/Own/clock") in errors(result_of(stage, tmp_path))
    stage.GetRootLayer().subLayerPaths.append("./gone.usda")
    (wire,) = [each for each in result_of(stage, tmp_path).findings if each.rule == "K20"]
    assert (wire.prim, wire.severity) == ("/World/Own/clock", "warning")


@pytest.mark.parametrize("place", ["", "/tick"])
def test_a_node_that_an_asset_in_the_graph_may_have_is_not_judged(
    place: str, tmp_path: Path
) -> None:
    stage = rover()
    write_graph(stage, "/World/Own", CLOCK, RUNS)
    layer = stage.GetRootLayer()
    del layer.GetPrimAtPath("/World/Own").nameChildren["tick"]
    stage.DefinePrim(f"/World/Own{place}").GetReferences().AddReference("./gone.usd")
    assert ("K20", "/World/Own/clock") not in errors(result_of(stage, tmp_path))


def test_a_joint_that_a_missing_asset_may_have_is_not_judged(tmp_path: Path) -> None:
    stage = rover()
    joint = f"{ROVER}/right_wheel_joint"
    stage.RemovePrim(joint)
    assert ("K61", "/World/Drive/move") in errors(result_of(stage, tmp_path))
    stage.DefinePrim(joint).GetReferences().AddReference("./gone.usd")
    result = result_of(stage, tmp_path)
    assert "K61" not in {rule for rule, _ in errors(result)}
    assert "K61" in {entry.rule for entry in result.not_judged}


def test_a_wheel_that_a_missing_asset_may_make_a_body_is_not_judged(tmp_path: Path) -> None:
    stage = rover()
    wheel = f"{ROVER}/right_wheel"
    stage.RemovePrim(wheel)
    stage.DefinePrim(wheel).GetReferences().AddReference("./gone.usd")
    result = result_of(stage, tmp_path)
    assert errors(result) == set()
    assert "K82" in {entry.rule for entry in result.not_judged}


def test_nodes_that_are_overs_of_a_missing_asset_are_counted_and_not_judged(
    tmp_path: Path,
) -> None:
    stage = rover_of_a_missing_asset()
    for graph in ("/World/Own", f"{ROVER}/Graph"):
        write_graph(stage, graph, CLOCK, RUNS)
    as_overs(stage, f"{ROVER}/Graph")
    result = result_of(stage, tmp_path)
    assert ("K10", "/World/Own/clock") in errors(result)
    assert ("K10", f"{ROVER}/Graph/clock") not in errors(result)
    assert result.coverage is not None
    assert result.coverage.waiting == {"./rover.usd": 2}
    assert result.coverage.judged == result.coverage.nodes - 2
    assert result.gaps == (
        f"no node of {ROVER}/Graph could be judged: ./rover.usd cannot be found",
    )


def test_inputs_of_a_node_of_an_asset_may_come_from_a_missing_sublayer(tmp_path: Path) -> None:
    asset = Usd.Stage.CreateNew(str(tmp_path / "robot.usda"))
    asset.SetDefaultPrim(asset.DefinePrim("/Robot", "Xform"))
    write_graph(asset, "/Robot/Graph", CLOCK, RUNS)
    asset.Save()
    stage = Usd.Stage.CreateInMemory()
    own = {**CLOCK, "clock": ("ros.ROS2PublishClock", {"topicName": "own"})}
    write_graph(stage, "/Own", own, RUNS)
    stage.DefinePrim("/Robot", "Xform").GetReferences().AddReference("./robot.usda")
    result = result_of(stage, tmp_path)
    assert errors(result) == {("K10", "/Own/clock"), ("K10", "/Robot/Graph/clock")}
    stage.GetRootLayer().subLayerPaths.append("./edits.usda")
    result = result_of(stage, tmp_path)
    assert errors(result) == {("K10", "/Own/clock")}
    assert {(entry.rule, entry.prim) for entry in result.not_judged} == {
        ("K10", "/Robot/Graph/clock")
    }


def test_a_graph_of_unknown_types_alone_is_not_judged(tmp_path: Path) -> None:
    stage = rover()
    types = {"one": "somebody.elses.One", "two": "somebody.elses.Two"}
    stage.DefinePrim("/World/Other", "OmniGraph")
    for name, kind in types.items():
        node = stage.DefinePrim(f"/World/Other/{name}", "OmniGraphNode")
        node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set(kind)
    result = result_of(stage, tmp_path)
    assert result.verdict == "not judged"
    assert result.coverage is not None
    assert result.coverage.unknown == dict.fromkeys(types.values(), 1)
    assert [gap for gap in result.gaps if "/World/Other" in gap] == list(result.gaps)


def test_one_node_that_is_known_has_its_graph_judged(tmp_path: Path) -> None:
    stage = rover()
    node = stage.DefinePrim("/World/Clock/other", "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set("somebody.elses.One")
    result = result_of(stage, tmp_path)
    assert (result.verdict, result.gaps) == ("pass", ())
    assert result.coverage is not None
    assert result.coverage.judged == result.coverage.nodes - 1


def test_a_robot_of_a_missing_asset_leaves_nodes_judged_in_part(tmp_path: Path) -> None:
    result = result_of(rover_of_a_missing_asset(), tmp_path)
    assert (result.verdict, result.gaps) == ("pass", ())
    assert result.coverage is not None
    assert result.coverage.judged == result.coverage.nodes > 0
    assert list(result.coverage.partly) == ["./rover.usd"]


def test_a_scene_without_a_graph_is_judged_unless_something_is_missing(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateInMemory()
    chair = stage.DefinePrim("/World/chair", "Xform")
    assert result_of(stage, tmp_path).verdict == "pass"
    chair.GetReferences().AddReference("https://server/chair.usd")
    result = result_of(stage, tmp_path)
    assert (result.verdict, len(result.gaps)) == ("not judged", 1)
    assert "https://server/chair.usd" in result.gaps[0]


def test_everything_is_judged_where_nothing_is_missing(tmp_path: Path) -> None:
    result = result_of(rover(), tmp_path)
    assert result.gaps == ()
    assert result.coverage == NodeCoverage(nodes=result.coverage.nodes if result.coverage else 0)


def drive_module() -> Usd.Stage:
    """A file with a graph and no robot, as robots refer to it."""
    stage = Usd.Stage.CreateInMemory()
    nodes = {
        "tick": TICK,
        "time": ("core.IsaacReadSimulationTime", {}),
        "odometry": ("core.IsaacComputeOdometry", {}),
        "clock": ("ros.ROS2PublishClock", {}),
    }
    wires = ["tick.tick -> odometry.execIn", *RUNS, "time.simulationTime -> clock.timeStamp"]
    write_graph(stage, "/Graph", nodes, wires)
    return stage


def test_a_target_that_a_stage_above_may_name_is_a_warning(tmp_path: Path) -> None:
    result = result_of(drive_module(), tmp_path)
    found = {(each.rule, each.property): each.severity for each in result.findings}
    assert found["K10", "inputs:chassisPrim"] == "warning"
    assert result.verdict == "pass"


def test_the_same_target_is_an_error_in_a_stage_with_a_robot(tmp_path: Path) -> None:
    stage = drive_module()
    stage.DefinePrim("/Robot", "Xform").AddAppliedSchema("PhysicsArticulationRootAPI")
    result = result_of(stage, tmp_path)
    found = {(each.rule, each.property): each.severity for each in result.findings}
    assert found["K10", "inputs:chassisPrim"] == "error"


def test_a_wire_that_is_missing_in_a_module_is_an_error(tmp_path: Path) -> None:
    stage = drive_module()
    cut(stage, "/Graph/clock.inputs:timeStamp")
    assert errors(result_of(stage, tmp_path)) == {("K10", "/Graph/clock")}


@pytest.mark.parametrize(("is_module", "severity"), [(True, "warning"), (False, "error")])
def test_a_target_that_is_elsewhere_may_be_in_a_stage_above(
    is_module: bool,  # noqa: FBT001 - a parameter of the test
    severity: str,
    tmp_path: Path,
) -> None:
    stage = drive_module()
    node = stage.GetPrimAtPath("/Graph/odometry")
    node.CreateRelationship("inputs:chassisPrim").SetTargets([Sdf.Path("/Robot/base")])
    if not is_module:
        stage.DefinePrim("/Camera", "Camera")
    found = {each.rule: each.severity for each in result_of(stage, tmp_path).findings}
    assert found["K14"] == severity


def in_an_asset(layer: Sdf.Layer, place: str) -> None:
    """Leave of a prim what is saved where all of it, and below it, is in an asset."""
    spec = layer.GetPrimAtPath(place)
    for child in [each.name for each in spec.nameChildren]:
        del spec.nameChildren[child]
    for name in [each.name for each in spec.properties]:
        spec.RemoveProperty(spec.properties[name])
    spec.ClearInfo("apiSchemas")
    spec.referenceList.Prepend(Sdf.Reference("./gone.usd"))


def in_a_sublayer(layer: Sdf.Layer, place: str) -> None:
    edit = Sdf.BatchNamespaceEdit()
    edit.Add(Sdf.NamespaceEdit.Remove(place))
    assert layer.Apply(edit)
    layer.subLayerPaths.append("./gone.usda")


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("take_away", [in_an_asset, in_a_sublayer])
def test_what_a_missing_asset_has_is_never_an_error(
    robot: str, take_away: Callable[[Sdf.Layer, str], None]
) -> None:
    stage = ROBOTS[robot]()
    prims = [str(prim.GetPath()) for prim in stage.TraverseAll()]
    places = [place for place in prims if place.count("/") <= 3]
    assert len(places) > 10
    for place in places[take_away is in_a_sublayer :: 2]:
        layer = copy_of(stage.GetRootLayer())
        take_away(layer, place)
        assert said_by(Usd.Stage.Open(layer), "error") == [], place


def test_nodes_of_one_unknown_type_are_one_note_that_names_the_others(tmp_path: Path) -> None:
    stage = rover()
    for name in ("one", "two"):
        node = stage.DefinePrim(f"/World/Clock/{name}", "OmniGraphNode")
        node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set("somebody.elses.One")
    (note,) = [note for note in result_of(stage, tmp_path).findings if note.rule == "K32"]
    assert (note.prim, note.related) == ("/World/Clock/one", ("/World/Clock/two",))


BESIDE = {
    "K15": "",
    "K61": "a joint to the world",
    "K62": "",
    "K64": "",
    "K66": "",
    "K68": "two speeds for all of three joints",
    "K69": "",
    "K87": "",
    "K88": "",
}


@pytest.mark.parametrize("rule", BESIDE)
def test_an_asset_that_is_missing_beside_what_a_finding_reads_hides_nothing(rule: str) -> None:
    case = quick_yaml.load((TESTS / "lint_cases" / f"{rule}.yaml").read_text())
    steps = (case["more"][BESIDE[rule]] if BESIDE[rule] else case)["break"]
    stage = broken_robot(case.get("robot", "rover"), steps)
    found = [finding.prim for finding in found_by(rule, stage).findings]
    assert found
    bodies = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    base = next(prim.GetPath() for prim in bodies if "wheel" not in prim.GetName())
    for place in (base.AppendChild("sensor"), base.GetParentPath().AppendChild("deco")):
        stage.DefinePrim(place).GetReferences().AddReference("./lidar.usd")
    assert [finding.prim for finding in found_by(rule, stage).findings] == found


def test_speeds_for_joints_that_a_missing_asset_may_have_are_not_judged() -> None:
    stage = rover()
    move = stage.GetPrimAtPath("/World/Drive/move")
    move.GetAttribute("inputs:jointNames").ClearConnections()
    speeds = move.GetAttribute("inputs:velocityCommand")
    speeds.ClearConnections()
    speeds.Set([1.0, 2.0, 3.0])
    assert len(found_by("K68", stage).findings) == 1
    stage.DefinePrim(f"{ROVER}/arm").GetReferences().AddReference("./arm.usd")
    assert found_by("K68", stage).findings == ()


def test_an_asset_that_is_missing_in_a_wheel_may_hold_its_shape(tmp_path: Path) -> None:
    stage = rover()
    stage.GetAttributeAtPath("/World/Drive/drive.inputs:wheelRadius").Set(1.0)
    stage.DefinePrim(f"{ROVER}/left_wheel/tyre").GetReferences().AddReference("./tyre.usd")
    assert "K64" not in {finding.rule for finding in result_of(stage, tmp_path).findings}


def test_joints_of_an_arm_are_not_those_that_a_setup_finds_by_their_rollers() -> None:
    stage, robot = rollers(), "/World/Mecanum"
    body(stage, f"{robot}/link", (0, 0, 0.5)).GetReferences().AddReference("gone.usd")
    joint = revolute(stage, f"{robot}/lift", f"{robot}/base", f"{robot}/link", (0, 0, 0.4), "Y")
    UsdPhysics.DriveAPI(joint, "angular").GetStiffnessAttr().Set(3000.0)
    assert found_by("K62", stage).findings == ()
    joint.CreateAttribute("isaacmecanumwheel:angle", Sdf.ValueTypeNames.Float).Set(45.0)
    assert [finding.prim for finding in found_by("K62", stage).findings] == [f"{robot}/lift"]
