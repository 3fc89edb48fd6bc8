"""The report for people: held against golden files, and what those cannot show."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from golden import UPDATE
from msgspec.structs import replace
from report_examples import (
    CRASHED,
    FAILED,
    LAYER,
    MISSING_WIRE,
    PASSED,
    REPORT,
    RULES,
    hostile,
    write_stage,
)

from lab3_usd.model.finding import ChecklistItem, Report, Submission
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options

GOLDEN = Path(__file__).parent / "golden"
ANSI = re.compile(r"\x1b\[[0-9;]*m")
EVERYTHING = Report((*REPORT.results, CRASHED), REPORT.submissions)
EACH = Options(each=True, source="always")
CASES = {
    "quiet": replace(EACH, verbosity="quiet"),
    "normal": EACH,
    "verbose": replace(EACH, verbosity="verbose"),
    "statistics": replace(EACH, verbosity="quiet", statistics=True),
    "narrow": replace(EACH, width=48),
    "color": replace(EACH, color=True),
    "folder": Options(),
}


@pytest.fixture(autouse=True)
def _beside_the_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_stage(tmp_path)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", CASES)
def test_the_text_is_the_golden_one(name: str) -> None:
    """`LAB3_UPDATE_GOLDEN=1 pytest` writes the files anew, to be read before they are kept."""
    shown = render("text", EVERYTHING, RULES, CASES[name])
    golden = GOLDEN / f"text-{name}.txt"
    if UPDATE:
        golden.write_text(shown, encoding="utf-8", newline="\n")
    assert shown == golden.read_text(encoding="utf-8")


def test_what_is_not_refuted_is_counted_and_listed_when_verbose() -> None:
    def shown(count: int, options: Options) -> str:
        items = [ChecklistItem("7", f"line {n}", "not shown", "none") for n in range(count)]
        items.insert(1, ChecklistItem("7", "a wall", "not met", "gone"))
        items.insert(2, ChecklistItem("7", "a door", "person", "the video"))
        return render("text", Report((), (Submission("ana", (), tuple(items)),)), RULES, options)

    few, many = shown(2, Options()), shown(3, Options())
    assert [each in few for each in ("line 0", "line 1", "a door")] == [True] * 3
    said = "3 not shown, 1 for a person to judge; --verbose lists them"
    assert f"    not met    a wall: gone\n    {said}\n" in many
    assert "line 0" not in many
    assert "line 0" in shown(3, Options(verbosity="verbose"))


def test_notes_stand_together_unless_all_is_told() -> None:
    note = replace(MISSING_WIRE, severity="note")
    report = Report((replace(FAILED, findings=(MISSING_WIRE, note, note)),))
    lines = render("text", report, RULES, Options(each=True)).splitlines()
    (first, second) = (n for n, line in enumerate(lines) if line.startswith("note "))
    assert lines[first - 1] == ""
    assert "" not in lines[first:second]
    told = render("text", report, RULES, Options(each=True, verbosity="verbose"))
    assert told.count("\n\nnote ") == 2


def test_colours_change_nothing_but_colour() -> None:
    colored = render("text", EVERYTHING, RULES, Options(color=True))
    assert colored != ANSI.sub("", colored) == render("text", EVERYTHING, RULES, Options())


@pytest.mark.parametrize("width", [40, 60, 100])
def test_only_unbreakable_words_exceed_the_width(width: int) -> None:
    lines = render("text", EVERYTHING, RULES, Options(width=width)).splitlines()
    too_wide = [line for line in lines if line.startswith(" ") and len(line) > width]
    assert [line for line in too_wide if not re.fullmatch(r"(  [a-z ]{8}  | +)\S+", line)] == []


def test_a_frame_is_left_out_where_the_layer_cannot_be_read() -> None:
    lost = replace(MISSING_WIRE, layer="gone.usda")
    shown = render("text", Report((replace(FAILED, findings=(lost,)),)))
    assert "gone.usda:9:26" in shown
    assert " | " not in shown


def test_a_column_may_be_unknown() -> None:
    found = replace(MISSING_WIRE, column=None)
    lines = render("text", Report((replace(FAILED, findings=(found,)),))).splitlines()
    assert f"  {LAYER}:9" in lines
    assert "^" not in "".join(lines)


def test_nothing_asked_gives_no_score() -> None:
    result = replace(PASSED, requirements=())
    heading = render("text", Report((result,))).splitlines()[0]
    assert heading == "work/Lab3_00_INITIAL.usda: checkpoint 00, pass"


def test_a_submission_may_have_nothing_to_say() -> None:
    shown = render("text", Report((), (Submission("work"),)))
    assert shown.splitlines()[0] == "work: submission"


def test_what_the_message_says_is_not_said_again() -> None:
    said = replace(MISSING_WIRE, message="is 'scan1', expected 'scan'", expected="'scan'")
    shown = render("text", Report((replace(FAILED, findings=(said,)),)))
    assert "actual" in shown
    assert "  expected  " not in shown


def test_files_without_findings_stand_close_together() -> None:
    assert render("text", Report((PASSED, PASSED))).splitlines() == [
        "work/Lab3_00_INITIAL.usda: checkpoint 00, pass, 2 of 2 met",
        "work/Lab3_00_INITIAL.usda: checkpoint 00, pass, 2 of 2 met",
        "2 files: 2 passed, 0 failed; 0 errors, 0 warnings, 0 notes",
    ]


def test_no_escape_sequence_but_our_own_is_coloured_in() -> None:
    shown = render("text", hostile("\x1b[31m"), RULES, Options(color=True))
    assert "\x1b" not in ANSI.sub("", shown)
    assert shown.count(r"\x1b[31m") == render("text", hostile("\x1b[31m")).count(r"\x1b[31m")
