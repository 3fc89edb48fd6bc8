"""A node below another prim of its graph: whether Isaac Sim runs it is not public."""

from __future__ import annotations

from pathlib import Path

import pytest
from breaking import correct_stage
from pxr import Usd

from lab3_usd.pipeline.stage import check_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab

GRAPH = "/turtlebot3_burger/ROS_Drive"
NODE = "articulation_controller"


@pytest.fixture
def nested(tmp_path: Path) -> Path:
    """A right stage whose articulation controller was dragged below a scope, with its wires."""
    stage = correct_stage("05")
    stage.DefinePrim(f"{GRAPH}/group", "Scope")
    editor = Usd.NamespaceEditor(stage)
    assert editor.MovePrimAtPath(f"{GRAPH}/{NODE}", f"{GRAPH}/group/{NODE}")
    assert editor.ApplyEdits()
    path = tmp_path / "Lab3_05_odometry_tf.usda"
    stage.Export(str(path))
    return path


def test_a_check_does_not_pass_it(nested: Path) -> None:
    result = check_stage(nested)
    assert result.verdict == "not judged"
    assert [gap.split(" ")[0] for gap in result.gaps] == [f"{GRAPH}/group/{NODE}"]
    left_open = {item.id for item in result.requirements if not item.judged}
    assert f"ROS_Drive/node/{NODE}" in left_open
    assert all(NODE in name for name in left_open)


def test_a_dry_run_does_not_judge_what_depends_on_it(nested: Path) -> None:
    behaviour = dry_run(nested, load_lab(), "05").behaviour
    assert behaviour.verdict == "not judged"
    assert [unknown.prim for unknown in behaviour.not_simulated] == [f"{GRAPH}/group/{NODE}"]
    assert {check.name for check in behaviour.checks if check.verdict == "ok"} >= {"scan", "clock"}
