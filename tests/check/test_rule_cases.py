"""Each rule about graphs against its case file: what breaks it, what is said, what clears it.

A case that names no checkpoint is judged at the first that has the graphs of its lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import pytest
import quick_yaml
from breaking import broken, judged, place, the_lab
from golden import assert_golden, findings_text
from places import TESTS

from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.model.finding import Finding, ordered

FOLDER = TESTS / "cases"
LAST = "05"  # which has all graphs


@dataclass(frozen=True, eq=False)
class Case:
    """One fault: the steps that make it, and every error and warning that it gives."""

    rule: str
    name: str
    checkpoint: str
    steps: list[dict[str, Any]]
    expect: list[str]
    notes: list[str]


def _cases() -> tuple[list[Case], list[Case]]:
    triggers, clearing = [], []
    for path in sorted(FOLDER.glob("*.yaml")):
        content = quick_yaml.load(path.read_text())
        entries = {"": content, **content.get("more", {})}
        for name, entry in entries.items():
            steps, lines = entry["break"], [*entry["expect"], *entry.get("notes", [])]
            checkpoint = entry.get("checkpoint", content.get("checkpoint", ""))
            found = (checkpoint or _first_with(steps, lines), steps, entry["expect"])
            triggers.append(Case(path.stem, name, *found, entry.get("notes", [])))
        checkpoint = content.get("checkpoint", "") or _first_with(content)
        clearing.append(Case(path.stem, "", checkpoint, content["clear"], [], []))
    return triggers, clearing


def _first_with(*parts: object) -> str:
    """Return the first checkpoint that has the graphs which these parts of a case name."""
    text, lab = str(parts), the_lab()
    named = {name for name in lab.graphs if name in text}
    fitting = (each.id for each in lab.checkpoints.values() if named <= {*each.graphs})
    return next(fitting) if named else LAST


TRIGGERS, CLEARING = _cases()


def _id(case: Case) -> str:
    return f"{case.rule} {case.name}".strip()


@cache
def _judged(case: Case) -> RuleResults:
    return judged(broken(case.checkpoint, case.steps), case.checkpoint)


def _said(judgement: RuleResults, *severities: str) -> list[str]:
    findings = ordered(finding for finding in judgement.findings if finding.severity in severities)
    return sorted(
        f"{finding.rule} {finding.prim} {finding.property or ''}".strip() for finding in findings
    )


def _placed(lines: list[str]) -> list[str]:
    return sorted(" ".join(map(place, line.split())) for line in lines)


@pytest.mark.parametrize("rule", [case.rule for case in CLEARING])
def test_a_fault_is_said_once_at_its_place(rule: str) -> None:
    for case in (case for case in TRIGGERS if case.rule == rule):
        judgement = _judged(case)
        assert not judgement.crashes, case.name
        assert _said(judgement, "error", "warning") == _placed(case.expect), case.name
        notes = _said(judgement, "note")
        assert [note for note in _placed(case.notes) if note not in notes] == [], case.name


@pytest.mark.parametrize("case", CLEARING, ids=_id)
def test_what_is_only_alike_does_not_trigger_the_rule(case: Case) -> None:
    judgement = judged(broken(case.checkpoint, case.steps), case.checkpoint)
    assert not judgement.crashes
    assert case.rule not in {finding.rule for finding in judgement.findings}


def _own_findings(case: Case) -> list[Finding]:
    """Return the findings without the notes that every stage has."""
    noted = {line.split()[0] for line in case.notes}
    return ordered(
        finding
        for finding in _judged(case).findings
        if finding.severity != "note" or finding.rule in noted
    )


def test_what_is_said_of_each_fault_is_as_it_was() -> None:
    shown = {_id(case): findings_text(_own_findings(case)) for case in TRIGGERS}
    assert_golden("rule-cases", shown)


def is_of_its_rule(case: Case) -> bool:
    return case.rule in {line.split()[0] for line in [*case.expect, *case.notes]}


def test_what_a_case_file_expects_is_of_its_own_rule() -> None:
    assert [_id(case) for case in TRIGGERS if not is_of_its_rule(case)] == []
