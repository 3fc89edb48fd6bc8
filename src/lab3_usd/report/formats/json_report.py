"""The report as JSON in the form of `schema/report-2.json`; imports next to nothing, for speed."""

from __future__ import annotations

from typing import Any, Literal

from msgspec import to_builtins
from msgspec.structs import asdict

from lab3_usd.model.finding import Crash, Finding, NodeCoverage, Report, Requirement
from lab3_usd.report.entries import (
    FINDING_FIELDS,
    Summary,
    fault_id,
    severity_counts,
    summarize,
)
from lab3_usd.report.options import NAME, Options, Rules, tool_version
from lab3_usd.report.safe_text import json_text, truncated_values

VERSION = 2
Json = dict[str, Any]


def render(report: Report, _rules: Rules | None, options: Options) -> str:
    """Return the report as indented JSON in ASCII; verbose adds the requirements."""
    return json_text(report_json(report, requirements=options.verbosity == "verbose"), 2)


def report_json(report: Report, *, requirements: bool = False) -> Json:
    """Return the report as plain data, keys in the order of the schema."""
    document = _head()
    document["results"] = []
    for result in report.results:
        score: Json = {"earned": result.score.earned, "possible": result.score.possible}
        if result.score.not_judged:
            score["not_judged"] = result.score.not_judged
        entry: Json = {
            "path": result.path,
            "checkpoint": result.checkpoint,
            "verdict": result.verdict,
            "score": score,
            "findings": [finding_json(finding) for finding in result.findings],
        }
        if requirements:
            entry["requirements"] = [*map(_requirement_json, result.requirements)]
        if result.gaps:
            entry["gaps"] = list(result.gaps)
        _add_hidden(entry, result.hidden)
        if result.coverage is not None:
            entry["nodes"] = _nodes_json(result.coverage)
        if result.not_judged:
            entry["not_judged"] = [asdict(left_open) for left_open in result.not_judged]
        _add_crashes(entry, result.crashes)
        document["results"].append(entry)
    if report.submissions:
        document["submissions"] = []
    for submission in report.submissions:
        entry = {
            "path": submission.path,
            "findings": [finding_json(finding) for finding in submission.findings],
            "checklist": [asdict(item) for item in submission.checklist],
        }
        if not submission.handed_in:
            entry["to_come"] = list(submission.to_come)
        _add_hidden(entry, submission.hidden)
        _add_crashes(entry, submission.crashes)
        document["submissions"].append(entry)
    document["summary"] = _summary_json(summarize(report))
    return document


def _summary_json(summary: Summary) -> Json:
    document = asdict(summary)
    if not summary.hidden:
        del document["hidden"]
    return document


def _add_hidden(document: Json, hidden: tuple[Finding, ...]) -> None:
    if hidden:
        document["hidden"] = severity_counts(hidden)


def _requirement_json(requirement: Requirement) -> Json:
    document = asdict(requirement)
    del document["slight"]  # it is for points alone
    if requirement.judged:
        del document["judged"]
    return document


def _nodes_json(coverage: NodeCoverage) -> Json:
    built = coverage.built
    document: Json = {
        "total": coverage.nodes,
        "judged": coverage.judged,
        "waiting": dict(sorted(coverage.waiting.items())),
        "unknown_types": dict(sorted(coverage.unknown.items())),
        "partly": dict(sorted(coverage.partly.items())),
    }
    if built is not None:
        document |= {"graphs": built.graphs, "wires": built.wires, "values": built.values}
        document["not_known"] = [asdict(each) for each in built.unknown]
    return document


def error_report(message: str, kind: Literal["usage", "crash"]) -> Json:
    """Return the report of a failed run: wrong usage, or a crash of the program."""
    document = _head()
    document["results"] = []
    document["summary"] = _summary_json(Summary(0, 0, 0, 0, 0, 0))
    document["error"] = {"kind": kind, "message": message}
    return document


def finding_json(finding: Finding) -> Json:
    """Return one finding as plain data; what is unknown is null, a repair is there or not."""
    document: Json = {name: getattr(finding, name) for name in FINDING_FIELDS}
    document |= {"related": list(finding.related), "fault": fault_id(finding)}
    if finding.fix is not None:
        document["fix"] = truncated_values(to_builtins(finding.fix))
    return document


def _head() -> Json:
    return {"version": VERSION, "tool": {"name": NAME, "version": tool_version()}}


def _add_crashes(document: Json, crashes: tuple[Crash, ...]) -> None:
    if crashes:
        document["crashes"] = [*map(asdict, crashes)]
