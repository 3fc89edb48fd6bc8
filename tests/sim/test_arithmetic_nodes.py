"""Kit's pure nodes against cases worked out by hand, and graphs that use them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from any_stages import bad, by_name, played
from foreign_robots import connect, rover, write_node
from lone_nodes import node, world
from pxr import Sdf, Usd

from lab3_usd.model.dry_run import Scene, SceneGraph

KIT = "omni.graph.nodes."


@pytest.mark.parametrize(
    ("name", "values", "output", "result"),
    [
        ("Add", {"a": 1.5, "b": 2}, "sum", 3.5),
        ("Add", {"a": (1.0, 2.0), "b": (3.0, 4.0)}, "sum", (4.0, 6.0)),
        ("Subtract", {"a": 1.5, "b": 2.0}, "difference", -0.5),
        ("Multiply", {"a": 3.0, "b": -0.5}, "product", -1.5),
        ("Multiply", {"a": (1.0, 2.0, 3.0), "b": 2.0}, "product", (2.0, 4.0, 6.0)),
        ("Multiply", {"a": 2.0, "b": (1.0, 2.0)}, "product", (2.0, 4.0)),
        ("Divide", {"a": 1.0, "b": 4.0}, "result", 0.25),
        ("Negate", {"input": (1.0, -2.0)}, "output", (-1.0, 2.0)),
        ("Clamp", {"input": (-3.0, 0.5, 3.0), "lower": -1.0, "upper": 1.0}, "result", (-1, 0.5, 1)),
        ("ToDouble", {"value": True}, "converted", 1.0),
        ("ToFloat", {"value": 3}, "converted", 3.0),
        ("ToString", {"value": 3}, "converted", "3"),
        ("MakeVector3", {"x": 1.0, "y": 2.0, "z": 3.0}, "tuple", (1.0, 2.0, 3.0)),
    ],
)
def test_arithmetic(name: str, values: dict[str, Any], output: str, result: object) -> None:
    calculator = node(KIT + name, values)
    assert calculator.compute(world())
    assert calculator.outputs[output] == result


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("Add", {"a": 1.0}),
        ("Divide", {"a": 1.0, "b": 0.0}),
        ("Negate", {"input": "a"}),
        ("Clamp", {"input": 1.0, "lower": 2.0, "upper": 1.0}),
        ("ToDouble", {"value": "a"}),
        ("MakeVector3", {"x": 1.0, "y": 2.0}),
    ],
)
def test_what_is_no_number_is_not_calculated(name: str, values: dict[str, Any]) -> None:
    calculator = node(KIT + name, values)
    assert not calculator.compute(world())
    assert calculator.failure is not None


def test_a_variable_of_the_graph_is_read() -> None:
    graph = SceneGraph(
        "/Graph", "execution", "pipelineStageSimulation", "Automatic", (), {"speed": 2.0}
    )
    here = world(scene=Scene(1.0, "Z", (graph,), {}, {}))
    read = node("omni.graph.core.ReadVariable", {"variableName": "speed"})
    assert read.compute(here)
    assert read.outputs["value"] == 2.0
    assert not node("omni.graph.core.ReadVariable", {"variableName": "none"}).compute(here)


def test_text_that_is_printed_stops_no_signal() -> None:
    printer = node("omni.graph.ui_nodes.PrintText")
    assert printer.compute(world())
    assert printer.enabled == ["execOut"]


@pytest.mark.parametrize(("condition", "way"), [(True, "execTrue"), (False, "execFalse")])
def test_a_branch_goes_one_way(condition: object, way: str) -> None:
    branch = node("omni.graph.action.Branch", {"condition": condition})
    assert branch.compute(world())
    assert branch.enabled == [way]


def halved() -> Usd.Stage:
    """The rover, whose turning goes through a product with a variable of its graph."""
    stage = rover()
    graph = stage.GetPrimAtPath("/World/Drive")
    graph.CreateAttribute("graph:variable:part", Sdf.ValueTypeNames.Double).Set(0.5)
    write_node(stage, "/World/Drive/part", "omni.graph.core.ReadVariable", {"variableName": "part"})
    write_node(stage, "/World/Drive/times", "nodes.Multiply", {})
    stage.GetAttributeAtPath("/World/Drive/drive.inputs:angularVelocity").ClearConnections()
    connect(stage, "/World/Drive", "angular.z", "times.a")
    connect(stage, "/World/Drive", "part.value", "times.b")
    connect(stage, "/World/Drive", "times.product", "drive.angularVelocity")
    return stage


def test_numbers_go_through_arithmetic(tmp_path: Path) -> None:
    found = by_name(played(halved(), tmp_path))["follows"]
    assert (found.kind, found.message.startswith("commanded 92 degrees left, turned 45")) == (
        "wrong-turn",
        True,
    )


@pytest.mark.parametrize("port", ["deltaSeconds", "time", "frame"])
def test_what_a_tick_tells_goes_on_over_wires(port: str, tmp_path: Path) -> None:
    """On Tick is not among the node types that the catalog describes."""
    stage = halved()
    write_node(stage, "/World/Drive/clock", "omni.graph.action.OnTick", {})
    connect(stage, "/World/Drive", f"clock.{port}", "times.b")
    assert by_name(played(stage, tmp_path))["follows"].kind == "wrong-turn"


def test_a_variable_that_a_node_writes_is_not_known(tmp_path: Path) -> None:
    stage = halved()
    write_node(stage, "/World/Drive/write", "omni.graph.core.WriteVariable", {})
    found = played(stage, tmp_path)
    assert (by_name(found)["follows"].verdict, bad(found)) == ("not judged", set())
