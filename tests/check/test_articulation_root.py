"""The articulation root on the robot root: what is the right target then, and what is built."""

from __future__ import annotations

from pathlib import Path

import pytest
from breaking import correct_stage, judged
from pxr import Usd
from scene_stages import Change, several, switch, with_api, without_api
from starters import ROBOT, changed

from lab3_usd import cli
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.stage.write.builder import build_checkpoint

API = "PhysicsArticulationRootAPI"
BASE = f"{ROBOT}/base_footprint"
NODE = f"{ROBOT}/ROS_Drive/articulation_controller"
ON_ROOT = several(without_api(BASE, API), with_api(ROBOT, API))
ON_BOTH = with_api(ROBOT, API)
OFF_ON_ROOT = several(ON_BOTH, switch(ROBOT, "physxArticulation:articulationEnabled"))


def told(change: Change, *targets: str, checkpoint: str = "05") -> list[tuple[str, str, str]]:
    """Rule, severity and prim of what is said of a stage whose controller names these prims."""
    stage = correct_stage(checkpoint)
    change(stage)
    port = stage.GetPrimAtPath(NODE).GetRelationship("inputs:targetPrim")
    port.SetTargets(list(targets))
    return [
        (finding.rule, finding.severity, finding.prim)
        for finding in judged(stage, checkpoint).findings
        if finding.severity != "note" and finding.rule in {"R01", "R02", "S11"}
    ]


def test_on_the_base_the_handouts_target_is_right() -> None:
    assert told(lambda _: None, BASE) == []
    assert told(lambda _: None, ROBOT) == [("R02", "error", NODE)]


@pytest.mark.parametrize(
    ("targets", "said"),
    [
        ([ROBOT], []),
        ([BASE], [("R02", "warning", NODE)]),
        ([f"{ROBOT}/base_link"], [("R02", "error", NODE)]),
        ([f"{ROBOT}/joints"], [("R02", "error", NODE)]),
        (["/World"], [("R02", "error", NODE)]),
        ([], [("R01", "error", NODE)]),
    ],
)
def test_on_the_root_the_root_is_the_target_and_the_handouts_a_warning(
    targets: list[str], said: list[tuple[str, str, str]]
) -> None:
    assert told(ON_ROOT, *targets) == said


@pytest.mark.parametrize("change", [ON_BOTH, OFF_ON_ROOT])
def test_while_the_base_is_articulated_its_target_is_right(change: Change) -> None:
    assert ("R02", "warning", NODE) not in told(change, BASE)
    assert ("R02", "error", NODE) in told(change, ROBOT)


def test_the_warning_costs_no_requirement_and_odometry_looks_at_the_rigid_body() -> None:
    stage = correct_stage("05")
    ON_ROOT(stage)
    found = judged(stage, "05")
    lost = [requirement.id for requirement in found.requirements if not requirement.met]
    assert "ROS_Drive/target/articulation_controller.targetPrim" not in lost
    assert [each.prim for each in found.findings if each.rule in {"R01", "R02"}] == [NODE]


@pytest.mark.parametrize(("change", "target"), [(ON_ROOT, ROBOT), (lambda _: None, BASE)])
def test_the_builder_names_the_target_that_works(
    change: Change, target: str, tmp_path: Path
) -> None:
    starter = changed(tmp_path / "starter.usda", change)
    built = build_checkpoint(starter, "02", tmp_path / "Lab3_02.usda")
    stage = Usd.Stage.Open(str(built))
    port = stage.GetPrimAtPath(NODE).GetRelationship("inputs:targetPrim")
    assert [str(path) for path in port.GetTargets()] == [target]
    assert check_stage(built, "02").verdict == "pass"
    assert [
        finding.rule for finding in check_stage(built, "02").findings if finding.rule == "R02"
    ] == []


def test_building_on_an_articulated_root_warns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    starter = changed(tmp_path / "starter.usda", ON_ROOT)
    arguments = ["build", str(starter), "--out", str(tmp_path / "out"), "--only", "02"]
    monkeypatch.setattr("sys.argv", ["lab3", *arguments])
    cli.main()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"warning: {ROBOT}: ")
    assert BASE in line
