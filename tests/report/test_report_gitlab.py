"""The Code Quality report: every property that GitLab requires, with a value it knows."""

from __future__ import annotations

import json
from typing import Any

from jsonschema import Draft202012Validator
from msgspec.structs import replace
from report_examples import FAILED, MISSING_WIRE, REPORT

from lab3_usd.model.finding import Report
from lab3_usd.report.formats.registry import render

# As GitLab documents the format for custom tools.
SPECIFICATION = {
    "type": "array",
    "items": {
        "type": "object",
        "required": ["description", "check_name", "fingerprint", "severity", "location"],
        "properties": {
            "description": {"type": "string", "minLength": 1},
            "check_name": {"type": "string", "minLength": 1},
            "fingerprint": {"type": "string", "pattern": "^[0-9a-f]{32}$"},
            "severity": {"enum": ["info", "minor", "major", "critical", "blocker"]},
            "location": {
                "type": "object",
                "required": ["path", "lines"],
                "properties": {
                    "path": {"type": "string", "pattern": "^[^/.]"},
                    "lines": {
                        "type": "object",
                        "required": ["begin"],
                        "properties": {"begin": {"type": "integer", "minimum": 1}},
                    },
                },
            },
        },
    },
}


def issues_of(*results: Any) -> list[Any]:
    issues: list[Any] = json.loads(render("gitlab", Report(results)))
    return issues


def test_every_issue_is_as_gitlab_asks() -> None:
    issues = json.loads(render("gitlab", REPORT))
    Draft202012Validator(SPECIFICATION).validate(issues)
    assert [issue["severity"] for issue in issues] == ["major", "minor", "info", "major", "major"]


def test_a_moved_line_keeps_the_fingerprint() -> None:
    moved = replace(FAILED, findings=(replace(MISSING_WIRE, line=77, column=1),))
    assert issues_of(moved)[0]["fingerprint"] == issues_of(FAILED)[0]["fingerprint"]


def test_fingerprints_are_unique() -> None:
    again = replace(FAILED, path="other/Lab3_05_ODOM_TF.usda")
    twice = replace(FAILED, findings=(MISSING_WIRE, replace(MISSING_WIRE, message="another")))
    issues = issues_of(twice, again)
    assert len({issue["fingerprint"] for issue in issues}) == len(issues) == 5
