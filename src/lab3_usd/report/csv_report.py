"""One row for each finding, as RFC 4180 has it and as spreadsheets read it without harm."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

from lab3_usd.check.finding import Report
from lab3_usd.report.entries import Entry, crashes, entries
from lab3_usd.report.escape import visible
from lab3_usd.report.formats import Options, Rules

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
# A cell that opens with one of these is a formula to a spreadsheet.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n")
CELL_LIMIT = 32_000  # spreadsheets hold 32767 characters a cell


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the table with its heading; lines end in CR LF."""
    del rules, options
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, COLUMNS)
    writer.writeheader()
    for row in _rows(report):
        writer.writerow({column: safe_cell(text) for column, text in row.items()})
    return table.getvalue()


def safe_cell(text: str) -> str:
    """Return the text as a cell that no spreadsheet runs: an apostrophe goes before a formula."""
    guarded = f"'{text}" if text.startswith(FORMULA_STARTS) else text
    return visible(guarded)[:CELL_LIMIT]


def _rows(report: Report) -> Iterator[dict[str, str]]:
    for entry in entries(report):
        yield _row(entry)
    for path, crash in crashes(report):
        yield {"path": path, "rule": crash.rule, "severity": "crash", "message": crash.error}


def _row(entry: Entry) -> dict[str, str]:
    row = {"path": entry.path, "checkpoint": entry.checkpoint or ""}
    for column in COLUMNS[2:-1]:
        value = getattr(entry.finding, column)
        row[column] = "" if value is None else str(value)
    row["related"] = " ".join(entry.finding.related)
    return row
