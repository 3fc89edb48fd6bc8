"""One row for each finding as CSV (RFC 4180), safe to open in a spreadsheet."""

from __future__ import annotations

import csv
import io

from lab3_usd.model.finding import Report
from lab3_usd.report.entries import crashes, entries, gaps, hidden
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import safe_cell

COLUMNS = (
    "path",
    "checkpoint",
    "rule",
    "name",
    "severity",
    "prim",
    "property",
    "message",
    "expected",
    "actual",
    "layer",
    "line",
    "column",
    "handout",
    "hint",
    "related",
)


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the table with its heading; lines end in CR LF."""
    del rules, options
    rows: list[dict[str, str]] = []
    for entry in entries(report):
        row = {"path": entry.path, "checkpoint": entry.checkpoint or ""}
        for column in COLUMNS[2:-1]:
            value = getattr(entry.finding, column)
            row[column] = "" if value is None else str(value)
        rows.append(row | {"related": " ".join(entry.finding.related)})
    rows += [{"path": path, "severity": "not judged", "message": gap} for path, gap in gaps(report)]
    rows += [{"path": path, "severity": "hidden", "message": text} for path, text in hidden(report)]
    rows += [
        {"path": path, "rule": crash.rule, "severity": "crash", "message": crash.error}
        for path, crash in crashes(report)
    ]
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, COLUMNS)
    writer.writeheader()
    writer.writerows({name: safe_cell(text) for name, text in row.items()} for row in rows)
    return table.getvalue()
