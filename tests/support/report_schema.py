"""Holds JSON reports against the published schema, and against what a schema cannot say."""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator

from lab3_usd.data import data_folder

ORDER = ["version", "tool", "results", "submissions", "summary", "error"]
RESULT_ORDER = [
    "path",
    "checkpoint",
    "verdict",
    "score",
    "findings",
    "requirements",
    "gaps",
    "hidden",
    "nodes",
    "not_judged",
    "crashes",
]


@cache
def validator(name: str = "report-2") -> Draft202012Validator:
    text = (data_folder("schema") / f"{name}.json").read_text(encoding="utf-8")
    return Draft202012Validator(json.loads(text))


def dry_run_of(text: str) -> dict[str, Any]:
    """Return what is said of a dry run or a recording, which is as `schema/sim-2.json` says."""
    document: dict[str, Any] = json.loads(text)
    assert [error.message for error in validator("sim-2").iter_errors(document)] == []
    return document


def problems_of(report: Any) -> list[str]:
    """Name what the schema finds wrong, each with its place."""
    errors = sorted(validator().iter_errors(report), key=lambda error: list(map(str, error.path)))
    return [f"{error.json_path}: {error.message}" for error in errors]


def assert_valid(report_json: str | bytes | dict[str, Any]) -> dict[str, Any]:
    """Assert that a report is as `schema/report-2.json` says, and return it parsed.

    Also: keys in their order, the summary counts what is there, no more points than possible, a
    column only with its line.
    """
    report: dict[str, Any] = (
        report_json if isinstance(report_json, dict) else json.loads(report_json)
    )
    assert problems_of(report) == []
    assert list(report) == [key for key in ORDER if key in report]
    for result in report["results"]:
        assert list(result) == [key for key in RESULT_ORDER if key in result]
        score = result["score"]
        assert score["earned"] + score.get("not_judged", 0) <= score["possible"]
    parts = [*report["results"], *report.get("submissions", [])]
    findings = [finding for part in parts for finding in part["findings"]]
    assert all(finding["line"] or not finding["column"] for finding in findings)
    hidden: Counter[str] = sum((Counter(part.get("hidden", {})) for part in parts), Counter())
    assert report["summary"] == ({"hidden": hidden} if hidden else {}) | {
        "files": len(report["results"]),
        "passed": sum(result["verdict"] == "pass" for result in report["results"]),
        "not_judged": sum(result["verdict"] == "not judged" for result in report["results"]),
        "errors": sum(finding["severity"] == "error" for finding in findings),
        "warnings": sum(finding["severity"] == "warning" for finding in findings),
        "notes": sum(finding["severity"] == "note" for finding in findings),
    }
    return report
