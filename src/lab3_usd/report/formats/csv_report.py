"""One row for each finding as CSV (RFC 4180), safe to open in a spreadsheet."""

from __future__ import annotations

import csv
import io

from lab3_usd.model.finding import Report
from lab3_usd.report.entries import FINDING_FIELDS, entries, remarks
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import safe_cell

COLUMNS = ("path", "checkpoint", *FINDING_FIELDS)
_SEVERITIES = {"baseline": "hidden", "not judged": "not judged"}


def render(report: Report, _rules: Rules | None, _options: Options) -> str:
    """Return the table with its heading; lines end in CR LF."""
    rows: list[dict[str, object]] = []
    for entry in entries(report):
        values = {name: getattr(entry.finding, name) for name in FINDING_FIELDS}
        values["related"] = " ".join(entry.finding.related)
        rows.append({"path": entry.path, "checkpoint": entry.checkpoint, **values})
    for remark in remarks(report):
        severity = _SEVERITIES.get(remark.title, "crash")
        rows.append(
            {
                "path": remark.path,
                "rule": remark.rule,
                "severity": severity,
                "message": remark.text,
            }
        )
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, COLUMNS)
    writer.writeheader()
    for row in rows:
        shown = {name: "" if value is None else str(value) for name, value in row.items()}
        writer.writerow({name: safe_cell(text) for name, text in shown.items()})
    return table.getvalue()
