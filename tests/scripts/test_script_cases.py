"""What is found in scripts, line by line: each case says it at the ends of its lines."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lab3_usd.check.registry import all_rules
from lab3_usd.model.finding import StageResult
from lab3_usd.pipeline.stage import JudgeSettings, lint_stage

CASES = sorted((Path(__file__).parent.parent / "script_cases").glob("*.txt"))
EXPECTED = re.compile(r"# expect: ([A-Z]\d\d)")


def expected(text: str) -> list[tuple[str, int]]:
    lines = enumerate(text.splitlines(), 1)
    return sorted((found[1], number) for number, line in lines for found in EXPECTED.finditer(line))


def lint(text: str, folder: Path) -> StageResult:
    script = folder / "script.py"
    script.write_text(text, encoding="utf-8")
    return lint_stage(script, JudgeSettings(heeds_ignores=True))


@pytest.mark.parametrize("case", CASES, ids=[case.stem for case in CASES])
def test_what_is_wrong_is_found_at_its_line(case: Path, tmp_path: Path) -> None:
    text = case.read_text(encoding="utf-8")
    result = lint(text, tmp_path)
    found = [(f.rule, f.line) for f in result.findings if f.severity != "note"]
    assert sorted(found, key=str) == sorted(expected(text), key=str)
    assert result.crashes == ()


def test_each_rule_about_scripts_has_a_case() -> None:
    about_scripts = {rule.id for rule in all_rules().values() if rule.scope == "script"}
    assert about_scripts == {"B01", "B02", "B03", "B04", "B05", "B06", "B07", "B08"}
    told = {rule for case in CASES for rule, _ in expected(case.read_text(encoding="utf-8"))}
    assert about_scripts <= told


def test_a_port_that_a_node_lacks_is_named_with_the_one_that_is_meant(tmp_path: Path) -> None:
    (case,) = (case for case in CASES if case.stem == "clock_right")
    result = lint(case.read_text(encoding="utf-8").replace("topicName", "topicNames"), tmp_path)
    told = {(f.rule, f.expected, f.actual) for f in result.findings if f.severity == "error"}
    assert told == {("B01", "inputs:topicName", "inputs:topicNames")}


def test_a_graph_tells_each_of_its_variables_once(tmp_path: Path) -> None:
    (case,) = (case for case in CASES if case.stem == "variable_that_is_not_created")
    result = lint(case.read_text(encoding="utf-8"), tmp_path)
    assert [f.expected for f in result.findings if f.rule == "K99"] == ["volts"]
