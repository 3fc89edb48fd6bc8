"""Reasons and reports in the form that platforms take, by the rules of their own importers."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from pathlib import Path
from typing import Any

import pytest

from lab3_usd.errors import UsageError
from lab3_usd.grade.feedback import reasons_by_student, write_feedback
from lab3_usd.grade.filled_export import FilledExport, fill_export
from lab3_usd.model.grade import REMARK

REASON = "wheelRadius is 0.25, expected 0.025"


def book_of(entry: str, platform: str, ids: dict[str, str]) -> dict[str, Any]:
    """A gradebook of one student, who lost points for one reason."""
    items = [
        {"id": "drive", "state": "part", "earned": 12.5, "possible": 15.0},
        {"id": "report", "state": "open", "earned": 0.0, "possible": 0.0},
    ]
    lost = [
        {"item": "drive", "requirement": "x", "title": "radius", "points": 2.5, "found": REASON}
    ]
    student = {
        "student": "77", "name": "Jane Doe", "folder": "77", "status": "graded", "reason": "",
        "earned": 12.5, "because": [], "platform": platform, "entries": [entry], "late": False,
        "people": [{"name": "Jane Doe", "ids": ids}], "may_be": [], "items": items, "lost": lost,
    }  # fmt: skip
    titles = [{"id": "drive", "title": "/cmd_vel drives"}, {"id": "report", "title": "Report"}]
    return {"title": "Lab 3", "points": 15.0, "items": titles, "students": [student]}


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A gradebook with the student's page."""
    page = tmp_path / "book" / "students" / "77" / "report.html"
    page.parent.mkdir(parents=True)
    page.write_text("<p>the page</p>")
    return tmp_path / "book"


def exported(folder: Path, platform: str, text: str, book: dict[str, Any]) -> FilledExport:
    path = folder / "export.csv"
    path.write_text(text)
    return fill_export(platform, path, book, reasons=reasons_by_student(book))


MOODLE = (
    "Identifier,Full name,Grade,Maximum grade,Feedback comments\nParticipant 77,Jane Doe,,15,\n"
)


def test_moodle_gets_a_folder_of_the_participant_and_the_reasons_as_comments(
    out: Path, tmp_path: Path
) -> None:
    book = book_of("Jane Doe_77_assignsubmission_file", "moodle", {"Moodle number": "77"})
    export = exported(tmp_path, "moodle", MOODLE, book)
    (returned,) = write_feedback(out, export, book)
    with zipfile.ZipFile(returned.path) as archive:
        (name,) = archive.namelist()
        assert archive.read(name) == b"<p>the page</p>"
    # importziplib.php: at most five parts, the second is the participant, 3 and 4 a plugin.
    first, number, *plugin = name.partition("/")[0].split("_", 4)
    assert (number, plugin) == ("77", ["assignsubmission", "file"])
    assert not re.search("[_]", first.removeprefix("lab3"))
    (row,) = csv.DictReader(io.StringIO(export.data.decode()))
    assert row["Grade"] == "12.50"
    assert row["Feedback comments"] == f"/cmd_vel drives: -2.50 {REASON}"


CANVAS = 'Student,ID,SIS User ID,Lab 3 (5)\n    Points Possible,,,15\n"Doe, Jane",77,9,\n'


def test_canvas_gets_the_report_in_an_archive_of_the_name_that_was_downloaded(
    out: Path, tmp_path: Path
) -> None:
    entry = "doejane_77_900_Lab3.zip"
    book = book_of(entry, "canvas", {"Canvas user": "77"})
    archive, table = write_feedback(out, exported(tmp_path, "canvas", CANVAS, book), book)
    with zipfile.ZipFile(archive.path) as outer:
        assert outer.namelist() == [entry]
        with zipfile.ZipFile(io.BytesIO(outer.read(entry))) as inner:
            assert inner.read("report.html") == b"<p>the page</p>"
    (row,) = csv.DictReader(io.StringIO(table.path.read_text()))
    assert row["Student Id"] == "77"
    assert row["/cmd_vel drives - Points"] == "12.5"
    assert REASON in row["/cmd_vel drives - Comments"]
    assert (row["Report - Points"], row["Report - Rating"]) == ("", "")


def by_hand(book: dict[str, Any]) -> None:
    """Let the grader write two lines that no spreadsheet may compute, and no page obey."""
    text = f"{REMARK}: =1+1 <b>\n@home, \x1b[2J"
    book["students"][0]["lost"] = [
        {"item": "drive", "requirement": "", "title": text, "points": 0.0, "found": ""}
    ]


def test_words_of_a_grader_keep_their_lines_and_do_nothing(out: Path, tmp_path: Path) -> None:
    book = book_of("doejane_77_900_Lab3.zip", "canvas", {"Canvas user": "77"})
    by_hand(book)
    _, table = write_feedback(out, exported(tmp_path, "canvas", CANVAS, book), book)
    (row,) = csv.DictReader(io.StringIO(table.path.read_text()))
    lines = row["/cmd_vel drives - Comments"].split("\n")
    assert lines == ["Points:", f"{REMARK}: =1+1 <b>", "@home, \\x1b[2J"]
    book = book_of("Jane Doe_77_assignsubmission_file", "moodle", {"Moodle number": "77"})
    by_hand(book)
    export = exported(tmp_path, "moodle", MOODLE, book)
    (row,) = csv.DictReader(io.StringIO(export.data.decode()))
    shown = f"/cmd_vel drives: {REMARK}: =1+1 &lt;b&gt;<br>@home, \\x1b[2J"
    assert row["Feedback comments"] == shown


def test_a_worksheet_without_a_column_of_comments_is_named(out: Path, tmp_path: Path) -> None:
    book = book_of("Jane Doe_77_assignsubmission_file", "moodle", {"Moodle number": "77"})
    text = MOODLE.replace(",Feedback comments", "").replace(",15,", ",15")
    (returned,) = write_feedback(out, exported(tmp_path, "moodle", text, book), book)
    assert "has no column 'Feedback comments'" in returned.left_out[0]


def test_who_handed_in_no_archive_is_named(out: Path, tmp_path: Path) -> None:
    book = book_of("doejane_77_900_Lab3_02_drive.usda", "canvas", {"Canvas user": "77"})
    archive, _ = write_feedback(out, exported(tmp_path, "canvas", CANVAS, book), book)
    assert archive.left_out == ("Doe, Jane (77): handed in no archive",)


BLACKBOARD = (
    '"Last Name","First Name","Username","Lab 3 [Total Pts: 15 Score] |5",'
    '"Feedback to Learner","Feedback Format"\n"Doe","Jane","jdoe","","",""\n'
)


def test_blackboard_gets_the_reasons_in_its_own_column(out: Path, tmp_path: Path) -> None:
    book = book_of(
        "Lab 3_jdoe_attempt_2026-11-20-10-22-33_Lab3.zip", "blackboard", {"Blackboard user": "jdoe"}
    )
    export = exported(tmp_path, "blackboard", BLACKBOARD, book)
    assert write_feedback(out, export, book) == []
    (row,) = csv.DictReader(io.StringIO(export.data.decode()))
    assert REASON in row["Feedback to Learner"]
    assert row["Feedback Format"] == "SMART_TEXT"


def test_a_platform_whose_rules_are_not_known_is_refused(out: Path, tmp_path: Path) -> None:
    text = (
        "OrgDefinedId,Last Name,First Name,Lab 3 Points Grade <Numeric MaxPoints:15>\n9,Doe,Jane,\n"
    )
    book = book_of("1-2 - Jane Doe", "brightspace", {"student id": "9"})
    with pytest.raises(UsageError, match="brightspace takes reports is not known"):
        write_feedback(out, exported(tmp_path, "brightspace", text, book), book)


def test_the_same_gradebook_gives_the_same_bytes(out: Path, tmp_path: Path) -> None:
    book = book_of("Jane Doe_77_assignsubmission_file", "moodle", {"Moodle number": "77"})
    export = exported(tmp_path, "moodle", MOODLE, book)
    made = [write_feedback(out, export, book)[0].path.read_bytes() for _ in range(2)]
    assert made[0] == made[1]
