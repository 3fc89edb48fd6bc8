"""Variables of graphs: described, built, compared, read off a stage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from in_process import invoke
from other_labs import copied
from pxr import Sdf

from lab3_usd.errors import SpecError
from lab3_usd.spec.load.loader import load_lab

CLOCK = "/World/ROS_Clock"
RUNNING = f"{CLOCK}.graph:variable:running"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A lab whose clock graph has two variables, one of which a node reads."""
    folder = copied(tmp_path / "lab")
    graph = folder / "ROS_Clock.yaml"
    content = quick_yaml.load(graph.read_text())
    content["nodes"]["reading"] = {
        "type": "omni.graph.core.ReadVariable",
        "set": {"variableName": "running"},
    }
    content["variables"] = {
        "running": {"type": "bool", "value": True},
        "speed": {"type": "float3", "value": [0, 0.4, 0]},
    }
    graph.write_text(quick_yaml.dump(content))
    return folder


def built(folder: Path) -> Path:
    out = folder.parent / "built"
    result = invoke("--lab", folder, "build", "--out", out)
    assert result.exit_code == 0, result.output
    return next(path for path in sorted(out.iterdir()) if "graph:variable" in path.read_text())


def findings(folder: Path, stage: Path) -> list[str]:
    """Return the errors as rule, site and message."""
    result = invoke("--lab", folder, "check", stage, "--format", "json")
    return [
        f"{finding['rule']} {finding['prim']} {finding['property']}: {finding['message']}"
        for file in quick_yaml.load(result.output)["results"]
        for finding in file["findings"]
        if finding["severity"] == "error"
    ]


def edited(stage: Path, **change: Any) -> Path:
    layer = Sdf.Layer.FindOrOpen(str(stage))
    prim = layer.GetPrimAtPath(CLOCK)
    prim.RemoveProperty(prim.properties["graph:variable:running"])
    if change:
        kind, value = change["kind"], change["value"]
        Sdf.AttributeSpec(prim, "graph:variable:running", kind).default = value
    path = stage.parent.parent / stage.name
    layer.Export(str(path))
    layer.Reload(force=True)
    return path


def test_a_built_graph_has_its_variables_with_type_and_value(folder: Path) -> None:
    layer = Sdf.Layer.FindOrOpen(str(built(folder)))
    running = layer.GetAttributeAtPath(RUNNING)
    assert (str(running.typeName), running.default, running.custom) == ("bool", True, True)
    speed = layer.GetAttributeAtPath(f"{CLOCK}.graph:variable:speed")
    assert (str(speed.typeName), tuple(speed.default)) == ("float3", pytest.approx((0, 0.4, 0)))


def test_a_built_graph_passes(folder: Path) -> None:
    assert findings(folder, built(folder)) == []


@pytest.mark.parametrize(
    ("change", "actual"),
    [
        ({}, "missing"),
        ({"kind": Sdf.ValueTypeNames.Bool, "value": False}, "bool False"),
        ({"kind": Sdf.ValueTypeNames.Int, "value": 1}, "int 1"),
    ],
    ids=["missing", "another value", "another type"],
)
def test_a_wrong_variable_is_an_error_at_the_graph(
    folder: Path, change: dict[str, Any], actual: str
) -> None:
    stage = edited(built(folder), **change)
    message = f"variable 'running' is {actual}, expected bool True"
    assert findings(folder, stage) == [f"G08 {CLOCK} graph:variable:running: {message}"]


def test_a_wrong_variable_fails_its_own_requirement_alone(folder: Path) -> None:
    stage = edited(built(folder))
    output = invoke("--lab", folder, "check", "--quiet", stage).output
    right = invoke("--lab", folder, "check", "--quiet", folder.parent / "built" / stage.name).output
    met = [int(text.split(" met")[0].split(", ")[-1].split()[0]) for text in (output, right)]
    assert met[1] - met[0] == 1


def test_a_missing_variable_is_repaired(folder: Path) -> None:
    stage = edited(built(folder))
    result = invoke("--lab", folder, "fix", stage, "--in-place")
    assert "1 repaired, 0 left" in result.output
    assert findings(folder, stage) == []


def test_a_variable_that_a_graph_reads_and_does_not_have_is_said(folder: Path) -> None:
    graph = folder / "ROS_Clock.yaml"
    content = quick_yaml.load(graph.read_text())
    del content["variables"]["running"]
    graph.write_text(quick_yaml.dump(content))
    lines = [
        line for line in invoke("lab", "check", folder).output.splitlines() if "running" in line
    ]
    assert len(lines) == 1
    assert "'running' is not a variable of the graph" in lines[0]


def test_what_the_built_stage_shows_as_well_is_said_once(shared: Path) -> None:
    said = invoke("lab", "check", shared / "courses" / "yard").output.splitlines()
    assert [line.partition(" (")[0] for line in said[:-1]] == [
        "warning Belt.yaml: running: variableName: 'running' is not a variable of the graph",
        "warning Belt.yaml: speed: variableName: 'speed' is not a variable of the graph",
    ]


def test_a_value_of_another_type_stops_every_command(folder: Path) -> None:
    graph = folder / "ROS_Clock.yaml"
    content = quick_yaml.load(graph.read_text())
    content["variables"]["running"]["value"] = "yes"
    graph.write_text(quick_yaml.dump(content))
    with pytest.raises(
        SpecError, match="variables: running is 'yes', expected a value of type bool"
    ):
        load_lab(folder)


def test_a_description_after_a_stage_has_its_variables(folder: Path, tmp_path: Path) -> None:
    result = invoke("lab", "new", tmp_path / "new", built(folder))
    assert result.exit_code == 0, result.output
    content = quick_yaml.load((tmp_path / "new" / "ROS_Clock.yaml").read_text())
    assert content["variables"]["running"] == {"type": "bool", "value": True}
