"""The table of formats, and what holds for all of them."""

from __future__ import annotations

import subprocess
import sys

import pytest
from golden import assert_golden_text
from html_pages import in_lines
from msgspec.structs import replace
from report_examples import (
    CRASHED,
    EMPTY,
    HOSTILE,
    MISSING_FILE,
    MISSING_WIRE,
    OLD_NAME,
    REPORT,
    RULES,
    hostile,
)

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Report, StageResult, Submission
from lab3_usd.report.formats.registry import all_formats, format_named, render
from lab3_usd.report.options import Options, tool_version

OURS = list(all_formats())


def test_an_unknown_format_names_those_there_are() -> None:
    with pytest.raises(UsageError) as caught:
        render("xml", REPORT)
    assert all(name in str(caught.value) for name in all_formats())


def test_a_known_format_is_found() -> None:
    assert format_named("sarif").manual


def test_a_format_is_imported_when_it_is_asked_for() -> None:
    code = (
        "import sys; from lab3_usd.report.formats.registry import all_formats, render;"
        "from lab3_usd.model.finding import Report; render('csv', Report(()));"
        "print(*[n for n, f in all_formats().items() if f.module in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["csv"]


@pytest.mark.parametrize("name", [name for name in OURS if name != "text"])
def test_a_format_is_the_golden_one(name: str) -> None:
    report = Report((*REPORT.results, CRASHED), REPORT.submissions)
    rules = None if name == "html" else RULES  # whose manuals it quotes
    shown = render(name, report, rules, Options(verbosity="verbose", statistics=True))
    shown = shown.replace(tool_version(), "VERSION") if "html" not in name else in_lines(shown)
    assert_golden_text(f"report/{name}.txt", shown)


@pytest.mark.parametrize("name", OURS)
def test_a_format_does_without_the_rules(name: str) -> None:
    assert render(name, REPORT, None, Options(verbosity="verbose"))


@pytest.mark.parametrize("name", OURS)
def test_a_format_renders_a_report_without_results(name: str) -> None:
    assert isinstance(render(name, EMPTY), str)


@pytest.mark.parametrize("name", OURS)
@pytest.mark.parametrize("text", HOSTILE)
def test_no_format_lets_control_characters_through(name: str, text: str) -> None:
    rendered = render(name, hostile(text), RULES, Options(verbosity="verbose"))
    line_ends = "\r\n" if name == "csv" else "\n"
    assert [letter for letter in rendered if not letter.isprintable()] == [
        letter for letter in rendered if letter in line_ends
    ]
    rendered.encode("utf-8")


@pytest.mark.parametrize("name", OURS)
def test_a_crash_is_in_every_format(name: str) -> None:
    assert "T03" in render(name, hostile("x"))


@pytest.mark.parametrize("name", [name for name in OURS if name != "gradescope"])
def test_every_format_says_how_many_findings_a_baseline_hides(name: str) -> None:
    known = StageResult("work/Lab3_02.usda", "02", hidden=(MISSING_WIRE, OLD_NAME))
    report = Report((known,), (Submission("work", hidden=(MISSING_FILE,)),))
    shown = render(name, report).replace("\\", "")
    expected = HIDDEN.get(name, ("hides 1 error, 1 warning", "hides 1 error"))
    assert [text for text in expected if text not in shown] == []
    clean = render(name, Report((replace(known, hidden=()),), (Submission("work"),)))
    assert [text for text in expected if text in clean] == []


HIDDEN = {
    "html": ("the baseline hides 2 errors, 1 warning", "Nothing new found"),
    "json": ('"hidden": {\n        "error": 1,', '"hidden": {\n      "error": 2,'),
    "jsonl": ('"hidden": {"error": 1, "warning": 1}', '"hidden": {"error": 1}'),
}
