"""Kit's pure nodes against cases worked out by hand, and graphs that use them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from dry_runs import FIXED, WHOLE, bad, by_name, played
from foreign_robots import add_api, connect, revolute, rover, wheel, write_node
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
        ("ToToken", {"value": "arm"}, "converted", "arm"),
        ("BuildString", {"a": "arm", "b": "/joints"}, "value", "arm/joints"),
        ("ToHalf", {"value": 3}, "converted", 3.0),
        ("ToInt", {"value": (2.9, -2.9)}, "converted", (2, -2)),
        ("ToInt64", {"value": 7.5}, "converted", 7),
        ("ToUint", {"value": True}, "converted", 1),
        ("ToUint64", {"value": 3.0}, "converted", 3),
        ("ToUchar", {"value": 65.2}, "converted", 65),
        ("ToBool", {"value": (0.0, 0.5)}, "converted", (False, True)),
        ("ToDeg", {"radians": math.pi / 2}, "degrees", 90.0),
        ("ToRad", {"degrees": 180.0}, "radians", math.pi),
        ("Sin", {"value": 30.0}, "value", 0.5),
        ("Cos", {"value": (0.0, 60.0)}, "value", (1.0, 0.5)),
        ("Tan", {"value": 45.0}, "value", 1.0),
        ("Asin", {"value": 1.0}, "value", 90.0),
        ("Acos", {"value": 0.5}, "value", 60.0),
        ("Atan", {"value": 1.0}, "value", 45.0),
        ("ATan2", {"a": 1.0, "b": -1.0}, "result", 135.0),
        ("Absolute", {"input": (-1.5, 2)}, "absolute", (1.5, 2)),
        ("Floor", {"a": -1.2}, "result", -2.0),
        ("Ceil", {"a": -1.2}, "result", -1.0),
        ("Round", {"input": 2.345, "decimals": 1}, "output", 2.3),
        ("Modulo", {"a": -7, "b": 4}, "result", -3),
        ("Exponent", {"base": 3.0, "exponent": 2}, "result", 9.0),
        ("NthRoot", {"value": 27.0, "nthRoot": 3}, "result", 3.0),
        ("Increment", {"value": 2.0, "increment": 0.5}, "result", 2.5),
        ("ConstantPi", {"factor": 2.0}, "value", 2 * math.pi),
        ("ConstantE", {"exponent": 0.0}, "value", 1.0),
        ("MakeVector2", {"x": 1.0, "y": 2.0}, "tuple", (1.0, 2.0)),
        ("MakeVector3", {"x": 1.0, "y": 2.0, "z": 3.0}, "tuple", (1.0, 2.0, 3.0)),
        ("MakeVector4", {"x": 1.0, "y": 2.0, "z": 3.0, "w": 4.0}, "tuple", (1.0, 2.0, 3.0, 4.0)),
        ("BreakVector2", {"tuple": (1.0, 2.0)}, "y", 2.0),
        ("BreakVector4", {"tuple": (1.0, 2.0, 3.0, 4.0)}, "w", 4.0),
        ("Magnitude", {"input": (3.0, 4.0)}, "magnitude", 5.0),
        ("Normalize", {"vector": (0.0, 2.0)}, "result", (0.0, 1.0)),
        ("DotProduct", {"a": (1.0, 2.0), "b": (3.0, 4.0)}, "product", 11.0),
        ("CrossProduct", {"a": (1.0, 0.0, 0.0), "b": (0.0, 1.0, 0.0)}, "product", (0.0, 0.0, 1.0)),
        ("ArrayIndex", {"array": (5.0, 6.0, 7.0), "index": 1}, "value", 6.0),
        ("ArrayIndex", {"array": ("left", "right"), "index": -1}, "value", "right"),
        ("ArrayGetSize", {"array": (5.0, 6.0)}, "size", 2),
        ("ArraySetIndex", {"array": (5.0, 6.0), "index": -1, "value": 1.0}, "array", (5.0, 1.0)),
        (
            "ArraySetIndex",
            {"array": (5.0,), "index": 2, "value": 1.0, "resizeToFit": True},
            "array",
            (5.0, 0, 1.0),
        ),
        ("AppendArray", {"input0": (1.0,), "input1": (2.0, 3.0)}, "array", (1.0, 2.0, 3.0)),
        ("ArrayReverse", {"array": (1.0, 2.0)}, "array", (2.0, 1.0)),
        ("Compare", {"a": 1.0, "b": 2.0, "operation": "<"}, "result", True),
        ("Compare", {"a": "x", "b": "y", "operation": "=="}, "result", False),
        ("BooleanAnd", {"a": True, "b": False}, "result", False),
        ("BooleanOr", {"a": True, "b": False}, "result", True),
        ("BooleanXor", {"a": True, "b": True}, "result", False),
        ("BooleanXor", {"a": True, "b": False}, "result", True),
        ("BooleanXor", {"a": True, "b": True, "input2": True}, "result", True),
        ("BooleanXor", {"a": True, "b": True, "input2": False}, "result", False),
        ("BooleanNand", {"a": True, "b": True}, "result", False),
        ("BooleanNor", {"a": False, "b": False}, "result", True),
        ("BooleanNot", {"valueIn": True}, "valueOut", False),
        ("SelectIf", {"condition": True, "ifTrue": 1.0, "ifFalse": 2.0}, "result", 1.0),
    ],
)
def test_arithmetic(name: str, values: dict[str, Any], output: str, result: object) -> None:
    calculator = node(KIT + name, values)
    assert calculator.compute(world())
    assert calculator.outputs[output] == pytest.approx(result)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("Add", {"a": 1.0}),
        ("Divide", {"a": 1.0, "b": 0.0}),
        ("Negate", {"input": "a"}),
        ("Clamp", {"input": 1.0, "lower": 2.0, "upper": 1.0}),
        ("ToDouble", {"value": "a"}),
        ("MakeVector3", {"x": 1.0, "y": 2.0}),
        ("ArrayIndex", {"array": (5.0, 6.0), "index": 2}),
        ("ArraySetIndex", {"array": (5.0, 6.0), "index": 2, "value": 1.0}),
        ("Asin", {"value": 2.0}),
        ("Modulo", {"a": 1, "b": 0}),
        ("BreakVector4", {"tuple": (1.0, 2.0)}),
        ("Compare", {"a": 1.0, "b": "x", "operation": "<"}),
        ("Normalize", {"vector": 1.0}),
        ("Magnitude", {"input": "a"}),
        ("CrossProduct", {"a": (1.0, 0.0), "b": (0.0, 1.0)}),
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


def test_once_signals_at_one_output_and_then_at_the_other_until_stop() -> None:
    first, said = node("omni.graph.action.Once", {}), []
    for _ in range(3):
        assert first.compute(world())
        said += first.enabled
    assert said == ["once", "after", "after"]
    first.reset()
    assert first.compute(world())
    assert first.enabled == ["once"]


@pytest.mark.parametrize(("condition", "way"), [(True, "execTrue"), (False, "execFalse")])
def test_a_branch_goes_one_way(condition: object, way: str) -> None:
    branch = node("omni.graph.action.Branch", {"condition": condition})
    assert branch.compute(world())
    assert branch.enabled == [way]


@pytest.mark.parametrize("kind", ["Sequence", "Multisequence"])
def test_a_sequence_goes_on_at_its_outputs_in_turn(kind: str) -> None:
    sequence = node(f"omni.graph.action.{kind}")
    sequence.follows.update({f"output{number}": [] for number in (10, 2, 0)})
    assert sequence.compute(world())
    assert sequence.enabled == ["output0", "output2", "output10"]


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


def skid_steered() -> Usd.Stage:
    """The rover with a second pair of wheels, and its two commands spread over all four."""
    stage = rover()
    robot, graph = "/World/Rover", "/World/Drive"
    for side, y in (("left", 20), ("right", -20)):
        for path, x in ((f"{side}_wheel", -15), (f"{side}_front_wheel", 15)):
            moved = f"{robot}/{path}"
            if path != f"{side}_wheel":
                add_api(wheel(stage, moved, (x, y, 10), 10.0), "IsaacLinkAPI")
                revolute(stage, f"{moved}_joint", f"{robot}/chassis", moved, (x, y, 0), "Y")
            stage.GetPrimAtPath(moved).GetAttribute("xformOp:translate").Set((x, y, 10))
            stage.GetPrimAtPath(f"{moved}_joint").GetAttribute("physics:localPos0").Set((x, y, 0))
    for side, index in (("left", 0), ("right", 1)):
        write_node(stage, f"{graph}/{side}_of", "nodes.ArrayIndex", {"index": index})
        name = {"value": f"{side}_front_wheel_joint"}
        write_node(stage, f"{graph}/{side}_front", "nodes.ConstantToken", name)
        connect(stage, graph, "drive.velocityCommand", f"{side}_of.array")
    spread = {"arraySize": 4, "arrayType": "double[]"}
    write_node(stage, f"{graph}/spread", "nodes.ConstructArray", spread)
    stage.GetAttributeAtPath(f"{graph}/names.inputs:arraySize").Set(4)
    for number, source in enumerate(("left_front", "right_front"), 2):
        connect(stage, graph, f"{source}.value", f"names.input{number}")
    for number in range(4):
        connect(stage, graph, f"{('left', 'right')[number % 2]}_of.value", f"spread.input{number}")
    stage.GetAttributeAtPath(f"{graph}/move.inputs:velocityCommand").ClearConnections()
    connect(stage, graph, "spread.array", "move.velocityCommand")
    return stage


def test_two_commands_drive_four_wheels(tmp_path: Path) -> None:
    behaviour = played(skid_steered(), tmp_path)
    assert behaviour.not_simulated == ()
    assert by_name(behaviour)["follows"].verdict == "ok"


def test_numbers_go_through_arithmetic(tmp_path: Path) -> None:
    found = by_name(played(halved(), tmp_path, drive=FIXED, longest=WHOLE))["follows"]
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
