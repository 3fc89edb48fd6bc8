"""Markdown: tables that stay tables, strings that stay text."""

from __future__ import annotations

import json

import pytest
from msgspec.structs import replace
from report_examples import HOSTILE, hostile

from lab3_usd.model.changes import ClearValue, Repair
from lab3_usd.model.finding import Finding, Report, StageResult, Submission
from lab3_usd.report.formats.markdown import HEADING, code, escaped
from lab3_usd.report.formats.registry import render
from lab3_usd.report.safe_text import visible

markdown_it = pytest.importorskip("markdown_it", reason="markdown-it-py is not installed")
FINDING = Finding("K01", "never-executes", "error", "/World/Graph/node", "never executes")
HARMLESS = {"text", "code_inline", "softbreak", "strong_open", "strong_close"}


def inline_types(source: str) -> set[str]:
    """Name the kinds of inline markup that a GitHub-flavoured reader finds."""
    tokens = markdown_it.MarkdownIt("gfm-like", {"linkify": False}).parse(source)
    return {child.type for token in tokens for child in token.children or ()}


def block_types(source: str) -> set[str]:
    return {
        token.type for token in markdown_it.MarkdownIt("gfm-like", {"linkify": False}).parse(source)
    }


def cells(source: str) -> list[str]:
    """Return what a reader shows in each inline block."""
    tokens = markdown_it.MarkdownIt("gfm-like", {"linkify": False}).parse(source)
    return [
        "".join(child.content for child in token.children or ())
        for token in tokens
        if token.type == "inline"
    ]


def test_a_row_has_a_cell_for_each_column() -> None:
    tokens = markdown_it.MarkdownIt("gfm-like", {"linkify": False}).parse(
        render("markdown", hostile("a|b"))
    )
    kinds = [token.type for token in tokens]
    assert kinds.count("td_open") == 2 * len(HEADING) + 4


@pytest.mark.parametrize("hostile_text", HOSTILE)
def test_markup_stays_text(hostile_text: str) -> None:
    source = render("markdown", hostile(hostile_text))
    assert inline_types(source) <= HARMLESS
    assert "html_block" not in block_types(source)
    assert visible(f"found {hostile_text}").strip() in cells(source)


@pytest.mark.parametrize("hostile_text", HOSTILE)
def test_markup_stays_text_in_gradescope(hostile_text: str) -> None:
    results = json.loads(render("gradescope", hostile(hostile_text)))
    for source in (results["output"], *(test["output"] for test in results["tests"])):
        assert inline_types(source) <= HARMLESS
        assert "html_block" not in block_types(source)


@pytest.mark.parametrize("value", ["a`b", "`a`", "``", "a | b", "/World/x_y*z*", "a\\|b"])
def test_a_code_span_shows_what_it_was_given(value: str) -> None:
    assert value in cells(f"| x |\n| --- |\n| {code(value)} |\n")


@pytest.mark.parametrize(
    "value", ["# x", "- x", "1. x", "> x", "a_b_c", "&lt;", "~~x~~", "![a](b)", "a\\b"]
)
def test_text_shows_what_it_was_given(value: str) -> None:
    assert cells(escaped(value)) == [value]


def test_a_submission_may_have_nothing_to_say() -> None:
    source = render("markdown", Report((), (Submission("work"),)))
    assert "table_open" not in block_types(source)


@pytest.mark.parametrize("value", ["`a", "a`"])
def test_a_backtick_at_either_end_is_apart_from_those_around(value: str) -> None:
    assert code(value) == f"`` {value} ``"


def test_a_stage_of_no_lab_is_no_check_of_a_lab_and_has_no_handout() -> None:
    result = StageResult("robot.usd", None, (FINDING,))
    linted = render("markdown", Report((result,)), None)
    assert (linted.splitlines()[0], HEADING[-1] in linted) == ("# Isaac Sim lint", False)
    checked = render("markdown", Report((replace(result, checkpoint="02"),)), None)
    assert (checked.splitlines()[0], HEADING[-1] in checked) == ("# Lab 3 check", True)


@pytest.mark.parametrize("form", ["markdown", "github"])
def test_what_can_be_repaired_names_the_command(form: str) -> None:
    edit = ClearValue("/World/Graph/node", "inputs:queueSize")
    hinted = replace(FINDING, hint="clear it.")
    findings = (
        replace(hinted, fix=Repair("clear it", (edit,))),
        replace(hinted, rule="K02", fix=Repair("clear it", (edit,), safe=False)),
        replace(FINDING, rule="K03", hint="think."),
    )
    result = StageResult("robot.usd", None, findings)
    shown = render(form, Report((result,)), None).replace("\\", "").splitlines()
    repairs = [next(line for line in shown if rule in line) for rule in ("K01", "K02", "K03")]
    assert "clear it; or lab3 fix --lint" in repairs[0]
    assert "clear it; or lab3 fix --lint --unsafe" in repairs[1]
    assert "think." in repairs[2]
