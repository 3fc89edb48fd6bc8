"""The formats of one line or row for each finding: concise, JSON lines, CSV."""

from __future__ import annotations

import csv
import io

import pytest
from msgspec.structs import replace
from report_examples import FAILED, HOSTILE, LAYER, MISSING_WIRE, REPORT, hostile

from lab3_usd.model.finding import Report
from lab3_usd.report.formats.csv_report import COLUMNS
from lab3_usd.report.formats.registry import render
from lab3_usd.report.safe_text import CELL_LIMIT, FORMULA_STARTS, safe_cell


def rows_of(report: Report) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(render("csv", report), newline="")))


def test_concise_puts_a_finding_without_a_line_at_the_start_of_its_file() -> None:
    report = Report((replace(FAILED, findings=(replace(MISSING_WIRE, line=None, column=None),)),))
    assert render("concise", report).startswith(f"{LAYER}:1:1: W01 ")


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
