"""In a large class equal reports are stored once, and name nobody."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from other_labs import LAB, MINI, cut_wire, files_below, stage, starter, submission
from workers_here import graded_here

from lab3_usd.grade import shared_reports
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.gradebook import Rows
from lab3_usd.grade.regrade import regrade

pytestmark = pytest.mark.usefixtures("equal_judged_once")

REPORTS = {"report.html", "report.json", "results.json"}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Three students with the same right work, one with a fault, one without a stage."""
    folder = tmp_path / "class"
    for name in ("ana", "ben", "cleo"):
        submission(folder / name, "00", "01")
    cut_wire(submission(folder / "dora", "00", "01") / "work" / stage("01").name)
    (folder / "eve").mkdir()
    return folder


def graded(place: Path, out: Path, most_named: int = 4, **changes: Any) -> Rows:
    """Grade a class of five, of whom four at most would have reports of their own."""
    return graded_here(ClassSettings(place, starter(), out, most_named=most_named, **changes))


def folders(out: Path) -> dict[str, set[str]]:
    """The names of the files in each folder of reports."""
    return {
        path.name: {file.name for file in path.iterdir()} for path in (out / "reports").iterdir()
    }


def test_equal_reports_of_a_large_class_are_stored_once(place: Path, tmp_path: Path) -> None:
    rows = {row["student"]: row for row in graded(place, tmp_path / "book")}
    kept = folders(tmp_path / "book")
    assert rows["ana"]["shared"] == rows["ben"]["shared"] == rows["cleo"]["shared"]
    assert len({row["shared"] for row in rows.values()}) == 3
    assert kept == {row["shared"]: REPORTS for row in rows.values()}
    assert set(files_below(tmp_path / "book" / "students")) == {
        f"{name}/result.json" for name in rows
    }


def test_shared_reports_name_nobody_and_the_page_leads_to_them(place: Path, tmp_path: Path) -> None:
    rows = {row["student"]: row for row in graded(place, tmp_path / "book")}
    for folder in (tmp_path / "book" / "reports").iterdir():
        for file in folder.iterdir():
            assert not [name for name in rows if f">{name}<" in file.read_text()]
            assert not [name for name in rows if f'"{name}"' in file.read_text()]
    page = (tmp_path / "book" / "index.html").read_text()
    for row in rows.values():
        assert f'<a href="reports/{row["shared"]}/report.html">{row["student"]}</a>' in page


def test_a_large_class_has_the_grades_of_a_small_one(place: Path, tmp_path: Path) -> None:
    large = [{**row, "shared": ""} for row in graded(place, tmp_path / "large")]
    small = [{**row, "shared": ""} for row in graded(place, tmp_path / "small", most_named=5)]
    assert large == small
    assert (
        files_below(tmp_path / "large")["grades.csv"]
        == files_below(tmp_path / "small")["grades.csv"]
    )


def test_a_large_class_goes_on_and_reports_that_nobody_has_are_removed(
    place: Path, tmp_path: Path
) -> None:
    graded(place, tmp_path / "book")
    before = files_below(tmp_path / "book")
    graded(place, tmp_path / "book", resume=True)
    assert files_below(tmp_path / "book") == before
    shutil.rmtree(place / "dora")
    submission(place / "dora", "00", "01")
    graded(place, tmp_path / "book", resume=True)
    assert len(folders(tmp_path / "book")) == 2


def test_a_class_that_grows_leaves_no_reports_behind(place: Path, tmp_path: Path) -> None:
    graded(place, tmp_path / "book", most_named=5)
    cut_wire(place / "ana" / "work" / stage("01").name)
    graded(place, tmp_path / "book", resume=True)
    assert set(files_below(tmp_path / "book" / "students" / "ana")) == {"result.json"}
    assert set(files_below(tmp_path / "book" / "students" / "ben")) == {*REPORTS, "result.json"}


def test_other_points_are_written_into_shared_reports(place: Path, tmp_path: Path) -> None:
    graded(place, tmp_path / "book")
    rubric = tmp_path / "rubric.yaml"
    rubric.write_text((MINI / "rubric.yaml").read_text().replace("points: 10", "points: 20", 1))
    changed = regrade(tmp_path / "book", rubric, LAB)
    assert {"ana", "ben", "cleo"} <= {grade.student for grade in changed.changed}
    rows = json.loads((tmp_path / "book" / "grades.json").read_text())["students"]
    assert folders(tmp_path / "book") == {row["shared"]: REPORTS for row in rows}
    scores = {
        json.loads((folder / "results.json").read_text())["score"]
        for folder in (tmp_path / "book" / "reports").iterdir()
    }
    assert scores == {row["earned"] for row in rows}


def test_a_result_that_names_a_place_elsewhere_is_not_followed(
    place: Path, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    graded(place, tmp_path / "book")
    for name in ("../../class", "x" * 32, 7):
        with subtests.test(name=name):
            row = {"shared": name}
            assert shared_reports.shared_folder(tmp_path / "book", row) is None


@pytest.mark.parametrize("names", [(), ("notes.txt",), ("report.html", "report.json")])
def test_a_folder_that_no_run_made_stays_whatever_it_is_called(
    names: tuple[str, ...], tmp_path: Path
) -> None:
    mine = tmp_path / "reports" / ("0" * 32)
    mine.mkdir(parents=True)
    for name in names:
        (mine / name).write_text("mine")
    ours = tmp_path / "reports" / shared_reports.write_shared(tmp_path, {"report.html": "ours"})
    shared_reports.remove_unshared(tmp_path, [])
    assert {path.name for path in mine.iterdir()} == {*names}
    assert not ours.exists()


def test_a_report_that_somebody_changed_stays(tmp_path: Path) -> None:
    folder = tmp_path / "reports" / shared_reports.write_shared(tmp_path, {"report.html": "ours"})
    (folder / "report.html").write_text("with a remark")
    shared_reports.remove_unshared(tmp_path, [])
    assert (folder / "report.html").read_text() == "with a remark"
