"""Graphs that a stage adds to a robot behind a payload: which are graphs, and which are not."""

from __future__ import annotations

from pathlib import Path

import pytest
from foreign_robots import CONTEXT, TICK, TIME, empty_stage, write_graph
from pxr import Sdf, Usd

from lab3_usd.pipeline.stage import lint_stage

GRAPH = "/World/Robot/Graph"
NODES = {"tick": TICK, "time": TIME, "context": CONTEXT, "clock": ("ros.ROS2PublishClock", {})}
WIRES = (
    "tick.tick -> clock.execIn",
    "time.simulationTime -> clock.timeStamp",
    "context.context -> clock.context",
)


def robot(path: Path, *, has_graph: bool) -> None:
    stage = empty_stage("Z", 1.0)
    stage.SetDefaultPrim(stage.DefinePrim("/Robot", "Xform"))
    if has_graph:
        write_graph(stage, "/Robot/Graph", NODES, WIRES)
    stage.GetRootLayer().Export(str(path))


def with_payload(folder: Path, payload: str, *, is_over: bool) -> Path:
    """Write a stage whose graph stands on a payloaded robot, as a def or as an over alone."""
    path = folder / "stage.usda"
    layer = Sdf.Layer.CreateNew(str(path))
    stage = Usd.Stage.Open(layer)
    for name, value in (("upAxis", "Z"), ("metersPerUnit", 1.0)):
        stage.SetMetadata(name, value)
    stage.DefinePrim("/World/Robot").GetPayloads().AddPayload(f"./{payload}")
    write_graph(stage, GRAPH, NODES, WIRES)
    if is_over:
        spec = layer.GetPrimAtPath(GRAPH)
        spec.specifier, spec.typeName = Sdf.SpecifierOver, ""
    layer.Save()
    return path


@pytest.mark.parametrize("is_over", [False, True])
def test_a_graph_that_somebody_defines_runs(tmp_path: Path, *, is_over: bool) -> None:
    robot(tmp_path / "robot.usda", has_graph=is_over)
    assert lint_stage(with_payload(tmp_path, "robot.usda", is_over=is_over)).findings == ()


def test_an_over_that_the_payload_makes_no_graph_holds_nodes_that_never_compute(
    tmp_path: Path,
) -> None:
    robot(tmp_path / "robot.usda", has_graph=False)
    (found,) = lint_stage(with_payload(tmp_path, "robot.usda", is_over=True)).findings
    assert (found.rule, found.severity, found.prim) == ("K02", "error", GRAPH)


@pytest.mark.parametrize("is_over", [False, True])
def test_what_a_missing_payload_would_make_of_it_is_not_known(
    tmp_path: Path, *, is_over: bool
) -> None:
    findings = lint_stage(with_payload(tmp_path, "gone.usda", is_over=is_over)).findings
    assert [(finding.rule, finding.severity) for finding in findings] == [("F02", "note")]
