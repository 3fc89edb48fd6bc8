"""A graph written as a script and as a stage: the same is found in both."""

from __future__ import annotations

from pathlib import Path

import pytest
import quick_yaml
from linting import broken_robot
from places import TESTS
from pxr import Usd
from robot_kinds import KINDS
from scripted import as_script

from lab3_usd.pipeline.stage import JudgeSettings, lint_stage

CASES = {path.stem: path for path in sorted((TESTS / "lint_cases").glob("*.yaml"))}
UNLIKE = {
    "K20": "a name of no node stops a script (B02)",
    "K29": "a port of another release stops a script (B01)",
    "K36": "a port of another release stops a script (B01)",
    "K39": "a script has the defaults of the release that runs it",
    "K48": "types are renamed only when a stage is opened",
}


def found(path: Path, scene: str | None = None) -> set[tuple[str, str, str | None]]:
    findings = lint_stage(path, JudgeSettings(scene=scene)).findings
    return {(f.rule, f.prim, f.property) for f in findings if f.severity != "note"}


def found_in_both(stage: Usd.Stage, folder: Path) -> list[set[tuple[str, str, str | None]]]:
    file = folder / "robot.usda"
    stage.GetRootLayer().Export(str(file))
    script, scene = as_script(file, folder)
    return [found(file), found(script, str(scene))]


@pytest.mark.parametrize("kind", KINDS)
def test_a_right_robot_is_right_as_a_script(kind: str, tmp_path: Path) -> None:
    assert found_in_both(KINDS[kind](), tmp_path) == [set(), set()]


@pytest.mark.parametrize("rule", sorted({*CASES} - {*UNLIKE}))
def test_a_fault_of_a_stage_is_found_in_the_script(rule: str, tmp_path: Path) -> None:
    case = quick_yaml.load(CASES[rule].read_text(encoding="utf-8"))
    stage = broken_robot(case.get("robot", "rover"), case["break"])
    in_stage, in_script = found_in_both(stage, tmp_path)
    assert in_script == in_stage
