"""The formats of one line or row for each finding: concise, JSON lines, CSV."""

from __future__ import annotations

import csv
import io
import json
import re

import pytest
from msgspec.structs import replace
from report_examples import DRIVE, FAILED, HOSTILE, LAYER, MISSING_WIRE, REPORT, hostile

from lab3_usd.model.finding import Report
from lab3_usd.report.formats.csv_report import COLUMNS
from lab3_usd.report.formats.json_report import finding_json
from lab3_usd.report.formats.registry import render
from lab3_usd.report.safe_text import CELL_LIMIT, FORMULA_STARTS, safe_cell

# `file:line:column: RULE message`, as editors and problem matchers parse it.
CONCISE = re.compile(
    r"^(?P<file>.+?):(?P<line>\d+):(?P<column>\d+): (?P<rule>[A-Z]\d\d) (?P<rest>.+)$"
)


def rows_of(report: Report) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(render("csv", report), newline="")))


def test_concise_names_file_line_column_and_rule() -> None:
    first = CONCISE.match(render("concise", REPORT).splitlines()[0])
    assert first is not None
    assert first.group("file", "line", "column", "rule") == (LAYER, "9", "26", "W01")
    assert first["rest"].endswith(f"({DRIVE}/make_array.inputs:input0)")


def test_concise_has_one_line_for_each_finding() -> None:
    lines = render("concise", REPORT).splitlines()
    rules = [found["rule"] for line in lines if (found := CONCISE.match(line))]
    assert rules == ["W01", "N07", "F05", "F01", "X01"]


def test_concise_puts_a_finding_without_a_line_at_the_start_of_its_file() -> None:
    report = Report((replace(FAILED, findings=(replace(MISSING_WIRE, line=None, column=None),)),))
    assert render("concise", report).startswith(f"{LAYER}:1:1: W01 ")


def test_json_lines_have_one_finding_each() -> None:
    rows = [json.loads(line) for line in render("jsonl", REPORT).splitlines()]
    assert rows[0] == {"path": LAYER, "checkpoint": "05", **finding_json(MISSING_WIRE)}
    assert [row["rule"] for row in rows] == ["W01", "N07", "F05", "F01", "X01"]


def test_json_lines_leave_the_checkpoint_of_a_submission_open() -> None:
    last = json.loads(render("jsonl", REPORT).splitlines()[-1])
    assert (last["path"], last["checkpoint"]) == ("work", None)


def test_csv_has_a_heading_and_a_row_for_each_finding() -> None:
    rows = rows_of(REPORT)
    assert tuple(rows[0]) == COLUMNS
    assert [row["rule"] for row in rows] == ["W01", "N07", "F05", "F01", "X01"]
    assert rows[0]["line"] == "9"
    assert rows[1]["line"] == ""


def test_csv_lines_end_as_rfc_4180_says() -> None:
    rendered = render("csv", REPORT)
    assert rendered.count("\r\n") == rendered.count("\n") == 6


@pytest.mark.parametrize("text", HOSTILE)
def test_csv_holds_no_formula(text: str) -> None:
    cells = [cell for row in rows_of(hostile(text)) for cell in row.values()]
    assert not [cell for cell in cells if cell.startswith(FORMULA_STARTS)]
    assert {len(row) for row in rows_of(hostile(text))} == {len(COLUMNS)}


@pytest.mark.parametrize("start", FORMULA_STARTS)
def test_a_formula_gets_an_apostrophe(start: str) -> None:
    assert safe_cell(f"{start}1+1").startswith("'")


def test_a_cell_fits_into_a_spreadsheet() -> None:
    assert len(safe_cell("x" * 100_000)) == CELL_LIMIT
