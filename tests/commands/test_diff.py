"""`lab3 diff`: what counts as a difference, what does not, and how each is told."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from breaking import Step, broken, built, correct_stage, place, the_lab
from click.testing import Result
from golden import assert_golden_text
from in_process import invoke
from jsonschema import Draft202012Validator
from pxr import Sdf, Usd, UsdGeom
from scene_stages import (
    aim,
    author,
    deactivate,
    move_prim,
    put,
    retype,
    switch,
    with_api,
    without_api,
)

from lab3_usd.data import data_folder
from lab3_usd.diff import compare_stages
from lab3_usd.errors import StageError, UsageError
from lab3_usd.model.changes import PARTS, StageChange, StageDiff
from lab3_usd.report.diff_report import lines
from lab3_usd.report.options import tool_version
from lab3_usd.report.picture.svg import CHANGED, OF_CHANGES, PALETTES, STROKES
from lab3_usd.stage.read.opening import kept_open

Told = tuple[str, str, str, str]
ROBOT, DRIVE = "/turtlebot3_burger", "ROS_Drive/differential_controller"
TWIST, NEW = "ROS_Drive/ros2_subscribe_twist", "ROS_Drive/another"


def saved(stage: Usd.Stage, folder: Path, name: str = "after.usda") -> Path:
    path = folder / name
    stage.GetRootLayer().Export(str(path))
    return path


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The right stage of checkpoint 05, which is opened once for all."""
    path = saved(correct_stage("05"), tmp_path_factory.mktemp("before"), "before.usda")
    with kept_open():
        yield path


def told(before: Path, after: Path) -> list[Told]:
    """What is said to differ: part, edit, path and property."""
    found = compare_stages(before, after, the_lab()).diff.changes
    return [(each.part, each.edit, each.path, each.property) for each in found]


def diff(*arguments: Path | str) -> Result:
    return invoke("diff", *arguments)


# ---- what makes no difference


def test_a_stage_is_equal_to_itself(right: Path) -> None:
    result = diff(right, right)
    assert result.exit_code == 0
    assert result.stdout.endswith("no differences\n")


def test_the_binary_form_is_equal(right: Path, tmp_path: Path) -> None:
    assert told(right, saved(correct_stage("05"), tmp_path, "after.usdc")) == []


def reversed_content(source: Sdf.Layer) -> Sdf.Layer:
    """The same layer with prims and properties in the reverse order."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(source)
    paths: list[Sdf.Path] = []
    layer.Traverse("/", paths.append)
    for path in paths:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if spec is not None:
            spec.nameChildrenOrder = [each.name for each in spec.nameChildren][::-1]
            spec.propertyOrder = [each.name for each in spec.properties][::-1]
    return layer


def test_the_order_of_prims_and_properties_makes_no_difference(right: Path, tmp_path: Path) -> None:
    after = saved(Usd.Stage.Open(reversed_content(built("05"))), tmp_path)
    opened = [Usd.Stage.Open(str(path)) for path in (right, after)]
    orders = [[str(prim.GetPath()) for prim in stage.Traverse()] for stage in opened]
    assert orders[0] != orders[1]
    assert told(right, after) == []


def test_comments_and_spaces_make_no_difference(right: Path, tmp_path: Path) -> None:
    text = right.read_text()
    after = tmp_path / "after.usda"
    after.write_text(
        text.replace("\n    ", "\n      ").replace("\ndef ", "\n# a comment\n\n\ndef ")
    )
    assert told(right, after) == []


SAME: dict[str, list[Step]] = {
    "a default that is written out": [
        {"declare": [f"{DRIVE}.inputs:maxAcceleration", "double", 0.0]}
    ],
    "a place in the graph editor": [{"set": [f"{DRIVE}.ui:nodegraph:node:pos", (1, 2)]}],
    "single precision": [{"set": [f"{DRIVE}.inputs:wheelRadius", 0.025000000372529]}],
}  # fmt: skip


@pytest.mark.parametrize("steps", SAME.values(), ids=SAME)
def test_what_isaac_sim_reads_alike_makes_no_difference(
    right: Path, tmp_path: Path, steps: list[Step]
) -> None:
    assert told(right, saved(broken("05", steps), tmp_path)) == []


def a_little_heavier(stage: Usd.Stage) -> None:
    mass = stage.GetPrimAtPath(f"{ROBOT}/base_link").GetAttribute("physics:mass")
    mass.Set(mass.Get() * (1 + 5e-7))


@pytest.mark.parametrize(
    "change",
    [a_little_heavier, switch(f"{ROBOT}/base_link", "physics:rigidBodyEnabled", on=True)],
    ids=["single precision", "a default that is written out"],
)
def test_what_a_robot_is_alike_makes_no_difference(
    right: Path, tmp_path: Path, change: Callable[[Usd.Stage], Any]
) -> None:
    stage = correct_stage("05")
    change(stage)
    after = saved(stage, tmp_path)
    assert after.read_text() != right.read_text()
    assert told(right, after) == []


# ---- what is told of graphs

GRAPHS: dict[str, tuple[list[Step], set[Told]]] = {
    "a value": (
        [{"set": [f"{DRIVE}.inputs:wheelRadius", 0.033]}],
        {("value", "changed", DRIVE, "inputs:wheelRadius")},
    ),
    "a value that was left at its default": (
        [{"declare": [f"{DRIVE}.inputs:maxAcceleration", "double", 2.0]}],
        {("value", "changed", DRIVE, "inputs:maxAcceleration")},
    ),
    "a wire that is gone": (
        [{"disconnect": f"{DRIVE}.inputs:linearVelocity"}],
        {("wire", "removed", DRIVE, "inputs:linearVelocity")},
    ),
    "a wire that is new": (
        [{"add source": [f"{DRIVE}.inputs:execIn", f"{TWIST}.outputs:execOut"]}],
        {("wire", "added", DRIVE, "inputs:execIn")},
    ),
    "a target": (
        [{"targets": ["ROS_Drive/articulation_controller.inputs:targetPrim", "/World"]}],
        {("target", "changed", "ROS_Drive/articulation_controller", "inputs:targetPrim")},
    ),
    "a node that is gone": (
        [{"remove": "ROS_Drive/scale_linear_velocity"}],
        {("node", "removed", "ROS_Drive/scale_linear_velocity", "")},
    ),
    "a node that is new": (
        [
            {"node": [NEW, "omni.graph.nodes.ConstantToken"]},
            {"declare": [f"{NEW}.inputs:value", "token", "x"]},
        ],
        {("node", "added", NEW, ""), ("value", "added", NEW, "inputs:value")},
    ),
    "the type of a node": (
        [{"set": ["ROS_Drive/scale_linear_velocity.node:type", "omni.graph.nodes.Add"]}],
        {("node", "changed", "ROS_Drive/scale_linear_velocity", "node:type")},
    ),
    "how a graph is evaluated": (
        [{"set": ["ROS_Drive.pipelineStage", "pipelineStageOnDemand"]}],
        {("graph", "changed", "ROS_Drive", "pipelineStage")},
    ),
    "a graph that is gone": (
        [{"remove": "ROS_Drive"}],
        {("graph", "removed", "ROS_Drive", "")},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("steps", "expected"), GRAPHS.values(), ids=GRAPHS)
def test_a_change_of_a_graph_is_told_once_at_its_place(
    right: Path, tmp_path: Path, steps: list[Step], expected: set[Told]
) -> None:
    after = saved(broken("05", steps), tmp_path)
    found = [each for each in told(right, after) if each[0] not in {"topic", "frame"}]
    where = [(part, edit, place(path), name) for part, edit, path, name in expected]
    assert sorted(found) == sorted(where)


def test_what_is_added_one_way_is_removed_the_other(right: Path, tmp_path: Path) -> None:
    after = saved(broken("05", [{"remove": "ROS_Drive/scale_linear_velocity"}]), tmp_path)
    assert {each[:2] for each in told(right, after) if each[0] == "node"} == {("node", "removed")}
    assert {each[:2] for each in told(after, right) if each[0] == "node"} == {("node", "added")}


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        (f"{ROBOT}/ROS_Drive/make_array", f"{ROBOT}/ROS_Drive/names", "node"),
        (f"{ROBOT}/ROS_Drive", "/World/Drive", "graph"),
    ],
)
def test_a_node_or_graph_with_another_path_is_one_change(
    right: Path, tmp_path: Path, old: str, new: str, part: str
) -> None:
    stage = correct_stage("05")
    move_prim(old, new)(stage)
    assert told(right, saved(stage, tmp_path)) == [(part, "changed", new, "path")]


# ---- what is told of the robot and the scene

SCENE: dict[str, tuple[Callable[[Usd.Stage], Any], list[Told]]] = {
    "a mass": (
        put(f"{ROBOT}/base_link", "physics:mass", 5.0),
        [("robot", "changed", f"{ROBOT}/base_link", "physics:mass")],
    ),
    "a value of the lidar": (
        author(f"{ROBOT}/base_scan/Lidar2D", "omni:sensor:Core:nearRangeM", "Float", 0.5),
        [("robot", "changed", f"{ROBOT}/base_scan/Lidar2D", "omni:sensor:Core:nearRangeM")],
    ),
    "a prim that is deactivated": (
        deactivate("/Environment/Walls"),
        [("scene", "removed", "/Environment/Walls", "")],
    ),
    "a prim that is new": (
        lambda stage: UsdGeom.Cube.Define(stage, "/World/Box/Lid"),
        [("scene", "added", "/World/Box", "")],
    ),
    "a prim that was renamed": (
        move_prim("/Environment/Walls", "/World/Walls"),
        [("scene", "changed", "/World/Walls", "path")],
    ),
    "a schema that is gone": (
        without_api(f"{ROBOT}/base_link", "PhysicsMassAPI"),
        [("robot", "removed", f"{ROBOT}/base_link", "schema")],
    ),
    "a schema that is new": (
        with_api("/World", "PhysicsRigidBodyAPI"),
        [("scene", "added", "/World", "schema")],
    ),
    "a type": (
        retype("/Environment/Lights/Sun", "SphereLight"),
        [("scene", "changed", "/Environment/Lights/Sun", "type")],
    ),
    "a body of a joint": (
        aim(f"{ROBOT}/joints/wheel_left_joint", "physics:body0", "/World"),
        [("robot", "changed", f"{ROBOT}/joints/wheel_left_joint", "physics:body0")],
    ),
    "a place": (
        put(f"{ROBOT}/base_scan/Lidar2D", "xformOp:translate", (0, 0, 1)),
        [("robot", "changed", f"{ROBOT}/base_scan/Lidar2D", "place")],
    ),
    "the units": (
        lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.01),
        [("scene", "changed", "/", "meters_per_unit")],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("change", "expected"), SCENE.values(), ids=SCENE)
def test_a_change_of_the_scene_is_told_once_at_its_place(
    right: Path, tmp_path: Path, change: Callable[[Usd.Stage], Any], expected: list[Told]
) -> None:
    stage = correct_stage("05")
    change(stage)
    assert told(right, saved(stage, tmp_path)) == expected


def test_a_missing_asset_and_an_animation_are_told(right: Path, tmp_path: Path) -> None:
    stage = correct_stage("05")
    stage.DefinePrim("/World/Box").GetReferences().AddReference("./nowhere.usd")
    mass = stage.GetPrimAtPath(f"{ROBOT}/base_link").GetAttribute("physics:mass")
    mass.Set(mass.Get(), 0.0)
    mass.Set(9.0, 10.0)
    found = told(right, saved(stage, tmp_path))
    assert ("scene", "added", "/World/Box", "asset not found") in found
    assert ("scene", "changed", f"{ROBOT}/base_link", "physics:mass (animated)") in found


# ---- what is told of ROS


def over_an_asset(folder: Path, name: str, content: str) -> Path:
    path = folder / name
    path.write_text(
        "#usda 1.0\n"
        'def Xform "World"\n{\n'
        '    def "chair" (prepend references = @./nowhere.usd@)\n    {\n'
        f"        {content}\n"
        "    }\n}\n"
    )
    return path


OVERS = {
    "a pose": (
        'over "leg"\n{\ndouble3 xformOp:translate = (0, 0, 1)\n}',
        ("scene", "changed", "/World/chair/leg", "place"),
    ),
    "a value": (
        'over "leg"\n{\nbool physics:kinematicEnabled = 1\n}',
        ("scene", "changed", "/World/chair/leg", "physics:kinematicEnabled"),
    ),
    "a deactivation": (
        'over "leg" (active = false) { }',
        ("scene", "changed", "/World/chair/leg", "active"),
    ),
    "none": ("", ("scene", "removed", "/World/chair/leg", "")),
}


@pytest.mark.parametrize("edit", OVERS)
def test_an_edit_of_what_only_a_missing_asset_holds_is_told(edit: str, tmp_path: Path) -> None:
    content, change = OVERS[edit]
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    content = content.replace("\n}", f"\n{order}\n}}").replace(" { }", f"\n{{\n{order}\n}}")
    before = over_an_asset(tmp_path, "before.usda", f'over "leg"\n{{\n{order}\n}}')
    assert told(before, over_an_asset(tmp_path, "after.usda", content)) == [change]


def test_an_over_at_the_root_that_comes_or_goes_is_told(tmp_path: Path) -> None:
    plain, over = tmp_path / "plain.usda", tmp_path / "over.usda"
    plain.write_text('#usda 1.0\ndef "World" { }\n')
    over.write_text('#usda 1.0\ndef "World" { }\nover "leg" { }\n')
    assert told(plain, over) == [("scene", "added", "/leg", "")]
    assert told(over, plain) == [("scene", "removed", "/leg", "")]


@pytest.mark.parametrize(
    "metadata", ["defaultPrim = 'World'", "timeCodesPerSecond = 60", "startTimeCode = 3"]
)
def test_what_a_stage_says_of_itself_is_told(metadata: str, tmp_path: Path) -> None:
    before, after = tmp_path / "before.usda", tmp_path / "after.usda"
    before.write_text('#usda 1.0\n(endTimeCode = 9)\ndef "World" { }\n')
    after.write_text(f'#usda 1.0\n(endTimeCode = 9; {metadata})\ndef "World" {{ }}\n')
    name = metadata.partition(" ")[0]
    assert told(before, after) == [("scene", "changed", "/", name)]


def test_the_order_of_layers_is_told(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.usda").write_text('#usda 1.0\ndef "World" { }\n')
    before, after = tmp_path / "before.usda", tmp_path / "after.usda"
    before.write_text("#usda 1.0\n(subLayers = [@./a.usda@, @./b.usda@])\n")
    after.write_text("#usda 1.0\n(subLayers = [@./b.usda@, @./a.usda@])\n")
    assert told(before, after) == [("scene", "changed", "/", "subLayers")]


def test_a_renamed_node_of_a_moved_graph_is_told_from_its_old_name(
    right: Path, tmp_path: Path
) -> None:
    stage = correct_stage("05")
    edits = Sdf.BatchNamespaceEdit()
    edits.Add("/World/ROS_Clock/ros2_context", "/World/ROS_Clock/context")
    edits.Add("/World/ROS_Clock", "/World/Clock")
    assert stage.GetRootLayer().Apply(edits)
    changes = compare_stages(right, saved(stage, tmp_path), the_lab()).diff.changes
    paths = {(each.was, each.now) for each in changes if each.property == "path"}
    assert paths == {
        ("/World/ROS_Clock", "/World/Clock"),
        ("/World/Clock/ros2_context", "/World/Clock/context"),
    }


def test_another_topic_name_is_told_of_the_topic(right: Path, tmp_path: Path) -> None:
    graph = the_lab().graphs["ROS_Lidar2D"]
    role = next(r for r, n in graph.nodes.items() if any("topicName" in s.port for s in n.settings))
    after = saved(broken("05", [{"set": [f"ROS_Lidar2D/{role}.inputs:topicName", "/s"]}]), tmp_path)
    assert [each for each in told(right, after) if each[0] == "topic"] == [
        ("topic", "changed", "/s", "name")
    ]


def test_a_topic_and_a_transform_that_are_gone_are_told(right: Path, tmp_path: Path) -> None:
    after = saved(broken("05", [{"remove": "ROS_OdomTF"}]), tmp_path)
    found = told(right, after)
    assert ("topic", "removed", "/odom", "") in found
    assert ("frame", "removed", "base_footprint", "") in found
    assert ("topic", "added", "/odom", "") in told(after, right)


# ---- how it is told


CHANGES: list[Step] = [
    {"set": [f"{DRIVE}.inputs:wheelRadius", 0.033]},
    {"remove": "ROS_Drive/scale_linear_velocity"},
    {"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"},
    {"copy": ["ROS_Clock", "/World/Clock2"]},
]


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stage with a changed value, a removed node, a removed wire and a new graph."""
    return saved(broken("05", CHANGES), tmp_path_factory.mktemp("changed"))


def test_all_changes_at_once_are_told_as_they_were(right: Path, tmp_path: Path) -> None:
    stage = broken("05", CHANGES)
    for change, _ in SCENE.values():
        change(stage)
    after = saved(stage, tmp_path)
    for form in ("text", "json"):
        shown = diff("--format", form, right, after).stdout.replace(tool_version(), "VERSION")
        for path in (right, after):
            shown = shown.replace(str(path), path.name)
        assert_golden_text(f"diff.{form}", shown)


def test_what_does_not_fit_stands_below_its_place() -> None:
    change = StageChange("value", "changed", "/Robot/wheel", "radius", "0.025", "0.033")
    shown = list(lines(StageDiff("a", "b", (change,)), 24))
    assert shown[-2:] == ["  ~ /Robot/wheel.radius:", "      0.025 -> 0.033"]


def test_json_is_as_the_schema_says(right: Path, changed: Path) -> None:
    result = diff("--format", "json", right, changed)
    document = json.loads(result.stdout)
    schema = json.loads((data_folder("schema") / "diff-1.json").read_text(encoding="utf-8"))
    assert [error.message for error in Draft202012Validator(schema).iter_errors(document)] == []
    parts = schema["properties"]["changes"]["items"]["properties"]["part"]["enum"]
    assert parts == list(PARTS)
    assert (document["equal"], result.exit_code) == (False, 1)
    assert json.loads(diff("--format", "json", right, right).stdout)["equal"] is True


def test_pictures_mark_what_was_removed_changed_and_added(
    right: Path, changed: Path, tmp_path: Path
) -> None:
    assert diff("--pictures", tmp_path / "drawn", right, changed).exit_code == 1
    drawn = {path.name: path.read_text() for path in (tmp_path / "drawn").iterdir()}
    assert set(drawn) == {"ROS_Drive.svg", "ROS_Clock.svg", "Clock2.svg"}
    assert "scale_linear_velocity · removed" in drawn["ROS_Drive.svg"]
    assert "was 0.025" in drawn["ROS_Drive.svg"]
    assert "1 removed" in drawn["ROS_Clock.svg"]
    assert len(re.findall("· added", drawn["Clock2.svg"])) >= 3


def test_pictures_of_changes_have_no_colour_and_no_mark_of_a_fault(
    right: Path, changed: Path, tmp_path: Path
) -> None:
    diff("--pictures", tmp_path / "drawn", right, changed)
    for path in (tmp_path / "drawn").iterdir():
        drawn = path.read_text()
        for theme in ("light", "dark"):
            assert PALETTES[theme]["fault"] not in drawn
            assert OF_CHANGES[theme]["fault"] in drawn
        assert STROKES["wrong"][2] not in drawn
    assert CHANGED in (tmp_path / "drawn" / "ROS_Drive.svg").read_text()


def test_pictures_are_not_replaced_unless_told_so(
    right: Path, changed: Path, tmp_path: Path
) -> None:
    old = tmp_path / "ROS_Drive.svg"
    old.write_text("mine")
    with pytest.raises(UsageError):
        diff("--pictures", tmp_path, right, changed)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]
    assert diff("--pictures", tmp_path, "--force", right, changed).exit_code == 1
    assert old.read_text() != "mine"


def test_what_cannot_be_opened_is_said(right: Path, tmp_path: Path) -> None:
    with pytest.raises(StageError):
        diff(right, tmp_path / "nowhere.usda")
