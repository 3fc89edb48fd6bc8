"""A graph written as a script and as a stage: the same is found in both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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


READ, VOLTS = "/World/Drive/read", "/World/Drive/volts"
READS_A_VARIABLE = [
    {"node": [READ, "omni.graph.core.ReadVariable"]},
    {"declare": [f"{READ}.inputs:variableName", "token", "size"]},
    {"declare": [f"{READ}.outputs:value", "double"]},
    {"connect": ["/World/Drive/drive.inputs:wheelRadius", f"{READ}.outputs:value"]},
]
SENDS_A_NUMBER = [
    {"node": [VOLTS, "isaacsim.ros2.bridge.ROS2Publisher"]},
    {"declare": [f"{VOLTS}.inputs:execIn", "uint"]},
    {"connect": [f"{VOLTS}.inputs:execIn", "/World/Drive/tick.outputs:tick"]},
    {"declare": [f"{VOLTS}.inputs:messagePackage", "string", "std_msgs"]},
    {"declare": [f"{VOLTS}.inputs:messageName", "string", "Float64"]},
    {"declare": [f"{VOLTS}.inputs:topicName", "string", "/volts"]},
]


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        (
            [*READS_A_VARIABLE, {"declare": ["/World/Drive.graph:variable:size", "double", 9.0]}],
            ("K64", "/World/Drive/drive", "inputs:wheelRadius"),
        ),
        (
            [*READS_A_VARIABLE, {"declare": ["/World/Drive.graph:variable:sise", "double", 0.1]}],
            ("K99", READ, "inputs:variableName"),
        ),
        (
            [
                *SENDS_A_NUMBER,
                {"declare": [f"{VOLTS}.inputs:dta", "double"]},
                {"connect": [f"{VOLTS}.inputs:dta", "/World/Drive/tick.outputs:time"]},
            ],
            ("K21", VOLTS, "inputs:dta"),
        ),
    ],
)
def test_variables_and_fields_of_messages_count_in_scripts_too(
    steps: list[dict[str, Any]], expected: tuple[str, str, str], tmp_path: Path
) -> None:
    in_stage, in_script = found_in_both(broken_robot("rover", steps), tmp_path)
    assert in_script == in_stage
    assert expected in in_stage


@pytest.mark.parametrize("rule", sorted({*CASES} - {*UNLIKE}))
def test_a_fault_of_a_stage_is_found_in_the_script(rule: str, tmp_path: Path) -> None:
    case = quick_yaml.load(CASES[rule].read_text(encoding="utf-8"))
    stage = broken_robot(case.get("robot", "rover"), case["break"])
    in_stage, in_script = found_in_both(stage, tmp_path)
    assert in_script == in_stage
