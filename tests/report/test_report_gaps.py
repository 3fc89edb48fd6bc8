"""What could not be judged, in every format."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import pytest
from msgspec.structs import replace
from report_examples import GAP, NOT_JUDGED, PASSED, assert_valid

from lab3_usd.model.finding import BuiltParts, NodeCoverage, Report
from lab3_usd.report.entries import coverage_line
from lab3_usd.report.formats.registry import all_formats, render
from lab3_usd.report.options import Options

REPORT = Report((NOT_JUDGED,))


@pytest.mark.parametrize("form", all_formats())
def test_every_format_names_what_could_not_be_judged(form: str) -> None:
    shown = render(form, REPORT).replace("\\", "")
    assert GAP in shown


@pytest.mark.parametrize("form", all_formats())
def test_no_format_speaks_of_gaps_where_everything_was_judged(form: str) -> None:
    assert "not judged: " not in render(form, Report((PASSED,))).lower()


def test_a_stage_that_was_not_judged_neither_passed_nor_failed() -> None:
    last = render("text", REPORT).splitlines()[-1]
    assert last.startswith("1 file: 0 passed, 0 failed, 1 not judged;")


def test_json_counts_nodes_by_what_they_wait_for() -> None:
    (result,) = assert_valid(render("json", REPORT))["results"]
    assert (result["verdict"], result["gaps"]) == ("not judged", [GAP])
    assert result["nodes"] == {
        "total": 9,
        "judged": 5,
        "waiting": {"./robot.usd": 3},
        "unknown_types": {"a.B": 1},
        "partly": {"./robot.usd": 2},
    }
    assert [entry["rule"] for entry in result["not_judged"]] == ["K14"]


def test_a_test_of_junit_is_skipped() -> None:
    suite = ET.fromstring(render("junit", REPORT))[0]  # noqa: S314 - our own output
    assert [case.find("skipped") is not None for case in suite] == [True]
    assert [suite.get(name) for name in ("tests", "failures", "skipped")] == ["1", "0", "1"]


def test_the_page_of_a_stage_that_was_not_judged_is_no_pass() -> None:
    page = render("html", REPORT)
    assert '<b class="verdict not judged">not judged</b>' in page
    assert "<h2>Not judged</h2>" in page
    assert 'class="clear"' not in page


def test_a_stage_that_passes_is_not_listed_as_not_judged() -> None:
    built = NodeCoverage(nodes=3, built=BuiltParts(graphs=1, wires=2))
    page = render("html", Report((replace(PASSED, checkpoint=None, coverage=built),)))
    assert "Not judged" not in page
    assert "Judged in part" not in page


def test_a_stage_that_passes_with_gaps_is_judged_in_part() -> None:
    partly = NodeCoverage(nodes=3, partly={"./robot.usd": 2})
    page = render("html", Report((replace(PASSED, checkpoint=None, coverage=partly),)))
    assert "<h2>Judged in part</h2>" in page
    assert "Not judged" not in page


def test_a_line_of_jsonl_has_the_gap() -> None:
    assert json.loads(render("jsonl", REPORT)) == {"path": NOT_JUDGED.path, "not_judged": GAP}


@pytest.mark.parametrize(
    ("coverage", "line"),
    [
        (NodeCoverage(nodes=4), ""),
        (NodeCoverage(), "there are no graph nodes to judge"),
        (
            NodeCoverage(nodes=4, waiting={"a.usd": 1}),
            "1 of 4 nodes not judged (1 needs a.usd)",
        ),
        (
            NodeCoverage(nodes=9, waiting={"a": 1, "b": 4}, unknown={"x.Y": 1}),
            "6 of 9 nodes not judged (4 need b, 1 needs a; 1 has the unknown type x.Y)",
        ),
        (
            NodeCoverage(nodes=2, partly={"a.usd": 2}),
            "2 nodes only partly checked (2 need a.usd)",
        ),
        (
            NodeCoverage(nodes=9, waiting={"a": 5, "b": 1, "c": 1, "d": 1, "e": 1}),
            "9 of 9 nodes not judged (5 need a, 1 needs b, 1 needs c, 2 more)",
        ),
    ],
)
def test_one_line_counts_the_nodes(coverage: NodeCoverage, line: str) -> None:
    assert coverage_line(coverage) == line


def test_the_text_has_that_line_unless_it_is_quiet() -> None:
    line = coverage_line(NOT_JUDGED.coverage or NodeCoverage())
    text = " ".join(render("text", REPORT).split())
    assert line in text
    assert line not in " ".join(render("text", REPORT, None, Options(verbosity="quiet")).split())
