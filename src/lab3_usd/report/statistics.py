"""Faults counted by rule, and the summary line of a run."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.model.finding import SEVERITIES, Report, Severity
from lab3_usd.report.entries import Summary, entries
from lab3_usd.report.safe_text import visible


class RuleCount(Struct, frozen=True):
    """The number of findings of one rule and severity, and of files that have them."""

    rule: str
    name: str
    severity: Severity
    findings: int
    files: int


def count_by_rule(report: Report) -> tuple[RuleCount, ...]:
    """Count the findings of each rule, the most frequent first."""
    paths: dict[tuple[str, str, Severity], list[str]] = {}
    for entry in entries(report):
        finding = entry.finding
        key = (finding.rule, finding.name, finding.severity)
        paths.setdefault(key, []).append(entry.path)
    counts = (
        RuleCount(*key, findings=len(found), files=len(set(found))) for key, found in paths.items()
    )
    return tuple(
        sorted(
            counts,
            key=lambda count: (-count.findings, count.rule, SEVERITIES.index(count.severity)),
        )
    )


def statistics_table(report: Report) -> list[str]:
    """Return the table of faults by rule as lines, aligned; empty where nothing was found."""
    counts = count_by_rule(report)
    if not counts:
        return []
    rows = [("findings", "files", "severity", "rule")]
    rows += [
        (
            str(count.findings),
            str(count.files),
            count.severity,
            visible(f"{count.rule} {count.name}"),
        )
        for count in counts
    ]
    return [f"{row[0]:>8}  {row[1]:>5}  {row[2]:<8}  {row[3]}" for row in rows]


def summary_line(summary: Summary) -> str:
    """Return the line that ends a report: files, verdicts and findings."""
    failed = summary.files - summary.passed
    found = [
        plural(summary.errors, "error"),
        plural(summary.warnings, "warning"),
        plural(summary.notes, "note"),
    ]
    files = f"{plural(summary.files, 'file')}: {summary.passed} passed, {failed} failed"
    return f"{files}; {', '.join(found)}"


def plural(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
