"""One JSON object a line: the findings with their file, for streams and `jq`."""

from __future__ import annotations

import json

from lab3_usd.model.finding import Report
from lab3_usd.report.entries import crashes, entries, gaps, hidden_findings, severity_counts
from lab3_usd.report.formats.json_report import finding_json
from lab3_usd.report.options import Options, Rules


def render(report: Report, _rules: Rules | None, _options: Options) -> str:
    """Return a line for each finding, then one for each gap and for each rule that failed.

    They have the keys `not_judged` and `crash`. One with the key `hidden` counts what the baseline
    hides of a file, by severity.
    """
    rows: list[dict[str, object]] = [
        {"path": entry.path, "checkpoint": entry.checkpoint, **finding_json(entry.finding)}
        for entry in entries(report)
    ]
    rows += [{"path": path, "not_judged": gap} for path, gap in gaps(report)]
    rows += [
        {"path": path, "rule": crash.rule, "crash": crash.error} for path, crash in crashes(report)
    ]
    rows += [
        {"path": path, "hidden": severity_counts(findings)}
        for path, findings in hidden_findings(report)
    ]
    return "".join(json.dumps(row) + "\n" for row in rows)
