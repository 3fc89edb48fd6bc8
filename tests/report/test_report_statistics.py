"""Counting: faults by rule, files and verdicts."""

from __future__ import annotations

from msgspec.structs import replace
from report_examples import EMPTY, FAILED, MISSING_WIRE, REPORT

from lab3_usd.model.finding import Report
from lab3_usd.report.entries import Summary, statistics_table, summarize


def test_the_summary_counts_files_and_findings() -> None:
    assert summarize(REPORT) == Summary(
        files=3, passed=1, not_judged=0, errors=3, warnings=1, notes=1
    )


def test_the_most_frequent_fault_comes_first() -> None:
    again = replace(FAILED, path="other.usda", findings=(MISSING_WIRE, MISSING_WIRE))
    heading, *rows = statistics_table(Report((FAILED, again)))
    assert heading.split() == ["findings", "files", "severity", "rule"]
    assert rows[0].split() == ["3", "2", "error", "W01", "missing-wire"]
    assert [row.split()[3] for row in rows] == ["W01", "F05", "N07"]


def test_one_rule_of_two_severities_is_counted_apart() -> None:
    softer = replace(MISSING_WIRE, severity="warning")
    _, *rows = statistics_table(Report((replace(FAILED, findings=(softer, MISSING_WIRE)),)))
    assert [row.split()[2] for row in rows] == ["error", "warning"]


def test_nothing_found_gives_no_table() -> None:
    assert statistics_table(EMPTY) == []
