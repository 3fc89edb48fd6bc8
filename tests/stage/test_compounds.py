"""Compounds: what stands in one is judged and played as if it stood in the graph around it."""

from __future__ import annotations

from pathlib import Path

import pytest
from breaking import correct_stage
from lone_nodes import COMPOUND, into_compound
from msgspec.structs import replace
from pxr import Sdf, Usd

from lab3_usd.fix.repairing import FixOptions, fix_stage
from lab3_usd.isaac.names import OtherName
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab, load_platform
from lab3_usd.stage.read.scene import read_scene

GRAPH = "/turtlebot3_burger/ROS_Drive"
NAMES = ["constant_left_joint", "constant_right_joint", "make_array"]
SELECTIONS = [
    ["make_array"],
    ["break_linear_velocity", "break_angular_velocity"],
    NAMES,
    ["differential_controller", "articulation_controller"],
]


def with_compound(folder: Path, names: list[str]) -> Path:
    path = folder / "Lab3_05_odometry_tf.usda"
    stage = correct_stage("05")
    into_compound(stage, GRAPH, names, "group")
    stage.Export(str(path))
    return path


@pytest.mark.parametrize("names", SELECTIONS, ids=" ".join)
def test_nodes_in_a_compound_are_right(names: list[str], tmp_path: Path) -> None:
    result = check_stage(with_compound(tmp_path, names))
    assert (result.verdict, [f.rule for f in result.findings]) == ("pass", ["P09"])


def test_a_compound_in_a_compound_is_right(tmp_path: Path) -> None:
    path = with_compound(tmp_path, NAMES)
    stage = Usd.Stage.Open(str(path))
    into_compound(stage, GRAPH, ["group", "articulation_controller"], "all")
    stage.Save()
    assert check_stage(path).verdict == "pass"


def test_a_robot_drives_whose_graph_has_a_compound(tmp_path: Path) -> None:
    behaviour = dry_run(with_compound(tmp_path, SELECTIONS[1]), load_lab(), "05").behaviour
    assert (behaviour.verdict, behaviour.not_simulated) == ("ok", ())


def test_a_wire_out_of_a_compound_comes_from_a_port_by_its_own_name() -> None:
    kind, out = "isaacsim.robot.wheeled_robots.DifferentialController", "outputs:velocityCommand"
    platform = load_platform()
    names = replace(platform.names, ports={kind: {"outputs:speeds": OtherName(out, "4.5")}})
    layer = Sdf.Layer.CreateAnonymous(".usda")
    text = correct_stage("05").ExportToString()
    layer.ImportFromString(text.replace(out, "outputs:speeds"))
    stage = Usd.Stage.Open(layer)
    into_compound(stage, GRAPH, ["differential_controller"], "group")
    scene = read_scene(stage, replace(platform, names=names))
    nodes = {node.path: node for graph in scene.graphs for node in graph.nodes}
    taken = nodes[f"{GRAPH}/articulation_controller"].inputs["inputs:velocityCommand"].sources
    assert taken == (f"{GRAPH}/group/Graph/differential_controller.{out}",)


def test_a_joint_that_is_misspelt_in_a_compound_is_found(tmp_path: Path) -> None:
    path = with_compound(tmp_path, NAMES)
    stage = Usd.Stage.Open(str(path))
    node = f"{GRAPH}/group/Graph/constant_left_joint"
    stage.GetAttributeAtPath(f"{node}.inputs:value").Set("wheel_lft_joint")
    stage.Save()
    errors = [f for f in check_stage(path).findings if f.severity == "error"]
    assert [(finding.rule, finding.prim) for finding in errors] == [("P01", node)]
    assert dry_run(path, load_lab(), "05").behaviour.verdict == "bad"


def test_a_value_of_the_compound_itself_passes_through_its_port(tmp_path: Path) -> None:
    path = with_compound(tmp_path, ["differential_controller"])
    stage = Usd.Stage.Open(str(path))
    compound = stage.GetPrimAtPath(f"{GRAPH}/group")
    radius = compound.CreateAttribute("inputs:radius", Sdf.ValueTypeNames.Double)
    radius.Set(0.5)
    inner = stage.GetAttributeAtPath(
        f"{GRAPH}/group/Graph/differential_controller.inputs:wheelRadius"
    )
    inner.SetConnections([radius.GetPath()])
    stage.Save()
    (wrong,) = [f for f in check_stage(path).findings if f.severity == "error"]
    assert (wrong.rule, wrong.property, wrong.actual) == ("P01", "inputs:wheelRadius", "0.5")


def test_no_repair_writes_over_a_compound(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05_odometry_tf.usda"
    stage = correct_stage("05")
    stage.RemovePrim(f"{GRAPH}/make_array")
    into_compound(stage, GRAPH, NAMES[:2], "make_array")
    stage.Export(str(path))
    for is_unsafe in (False, True):
        fixed = fix_stage(path, "05", load_lab(), FixOptions(unsafe=is_unsafe))
        edits = [edit for repair in fixed.repairs for edit in repair.edits]
        assert not [edit for edit in edits if getattr(edit, "property", "") == "node:type"]
    assert COMPOUND in path.read_text()
