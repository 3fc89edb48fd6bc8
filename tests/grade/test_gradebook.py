"""The gradebook as a folder: what it may be written into, what is known of it, what is in it."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from other_labs import files_below

from lab3_usd.errors import UsageError
from lab3_usd.files import leftover_files
from lab3_usd.grade.gradebook import (
    alike,
    check_target,
    clear_halves,
    known_digest,
    read_result,
    write_student,
    write_tables,
)
from lab3_usd.grade.intake.submissions import StudentSubmission
from lab3_usd.grade.rubric import COLUMNS, load_rubric
from lab3_usd.grade.workers.submission_grading import ungraded_record
from lab3_usd.spec.load.loader import load_lab

RUBRIC = load_rubric(None, load_lab())
SALT = "salt"
ITEMS = [item.id for item in RUBRIC.items]


def handed(student: str) -> StudentSubmission:
    return StudentSubmission(student, "", student, ())


def answer(student: str) -> dict[str, Any]:
    return {**ungraded_record(RUBRIC, student, "graded", ""), "digest": "d1"}


def written(out: Path, *students: str) -> list[StudentSubmission]:
    """Write a gradebook of these students."""
    class_ = [handed(student) for student in students]
    for each in class_:
        write_student(out, each, SALT, answer(each.student))
    write_tables(out, class_, RUBRIC)
    return class_


def test_a_half_written_table_is_removed_when_a_run_goes_on(tmp_path: Path) -> None:
    written(tmp_path, "jane")
    before = files_below(tmp_path)
    for name in ("grades.csv", "grades.json", "index.html"):
        (tmp_path / f".{name}.4e28_qqi.lab3-half").write_text("half")
    with pytest.raises(UsageError, match="--resume"):
        check_target(tmp_path, resume=False)
    assert (tmp_path / ".grades.csv.4e28_qqi.lab3-half").exists()
    check_target(tmp_path, resume=True)
    clear_halves(tmp_path)
    assert files_below(tmp_path) == before


@pytest.mark.parametrize(
    "name",
    [
        ".thesis.tex.4e28oqqi.lab3-half",
        ".grades.csv.original",
        ".grades.csv.bak_2026",
        ".grades.csv.swp",
        ".grades.csv",
    ],
)
def test_what_only_looks_like_a_half_is_neither_removed_nor_written_over(
    tmp_path: Path, name: str
) -> None:
    written(tmp_path, "jane")
    (tmp_path / name).write_text("mine")
    with pytest.raises(UsageError, match="not part of a gradebook"):
        check_target(tmp_path, resume=True)
    assert (tmp_path / name).read_text() == "mine"


def test_a_folder_of_that_name_is_no_half(tmp_path: Path) -> None:
    (tmp_path / ".grades.csv.4e28oqqi.lab3-half").mkdir()
    assert leftover_files(tmp_path, ["grades.csv"]) == ()


@pytest.mark.parametrize(
    "name",
    [".DS_Store", "Thumbs.db", "desktop.ini", "._grades.csv", ".~lock.grades.csv#", "~$grades.csv"],
)
@pytest.mark.parametrize("resume", [True, False])
def test_what_a_desktop_leaves_makes_no_folder_foreign(
    tmp_path: Path, name: str, *, resume: bool
) -> None:
    (tmp_path / name).write_text("litter")
    check_target(tmp_path, resume=resume)
    assert (tmp_path / name).read_text() == "litter"


@pytest.mark.parametrize("student", ["jane", "who left"])
def test_halves_of_reports_are_removed_when_a_run_goes_on(tmp_path: Path, student: str) -> None:
    written(tmp_path, "jane", "who left")
    before = files_below(tmp_path)
    folder = tmp_path / "students" / student
    for name in ("report.html", "report.json", "results.json", "result.json"):
        (folder / f".{name}.0123_abc.lab3-half").write_text("half")
    check_target(tmp_path, resume=True)
    clear_halves(tmp_path)
    assert files_below(tmp_path) == before


@pytest.mark.parametrize(
    "name", ["jane/work", "jane/notes.txt", "jane/.result.json.original", "a.txt"]
)
def test_a_gradebook_with_files_of_somebody_is_not_written_to(tmp_path: Path, name: str) -> None:
    written(tmp_path, "jane")
    (tmp_path / "students" / name).write_text("mine")
    with pytest.raises(UsageError, match=f"holds students/{name}, which is not part"):
        check_target(tmp_path, resume=True)


@pytest.mark.parametrize("name", ["0123456789abcdef0123456789abcdef/notes.txt", "solutions/a.usda"])
def test_a_gradebook_with_files_of_somebody_in_its_reports_is_not_written_to(
    tmp_path: Path, name: str
) -> None:
    written(tmp_path, "jane")
    (tmp_path / "reports" / name).parent.mkdir(parents=True)
    (tmp_path / "reports" / name).write_text("mine")
    with pytest.raises(UsageError, match=f"holds reports/{name}, which is not part"):
        check_target(tmp_path, resume=True)


def test_what_is_finished_is_known(tmp_path: Path) -> None:
    (jane,) = written(tmp_path, "jane")
    assert known_digest(tmp_path, jane, SALT, ITEMS) == "d1"
    assert known_digest(tmp_path, jane, "pepper", ITEMS) == ""


@pytest.mark.parametrize("name", ["report.html", "report.json", "results.json"])
def test_a_student_whose_report_was_deleted_is_not_known(tmp_path: Path, name: str) -> None:
    (jane,) = written(tmp_path, "jane")
    (tmp_path / "students" / "jane" / name).unlink()
    assert known_digest(tmp_path, jane, SALT, ITEMS) == ""


def test_a_result_that_names_no_reports_is_not_known(tmp_path: Path) -> None:
    (jane,) = written(tmp_path, "jane")
    path = tmp_path / "students" / "jane" / "result.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "reports": None}))
    assert known_digest(tmp_path, jane, SALT, ITEMS) == ""


@pytest.mark.parametrize(
    "changes",
    [
        *({name: ...} for name in ("items", "earned", "possible", "percent", "lost", "reason")),
        *({name: ...} for name in ("digest", "verdicts", "crashes", "remarks")),
        {"earned": "many"},
        {"items": []},
        {"items": [{"id": "starter"}]},
        {"because": 3},
        {"unconfined": [1]},
    ],
)
def test_a_result_that_somebody_edited_is_judged_anew(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    (jane,) = written(tmp_path, "jane")
    path = tmp_path / "students" / "jane" / "result.json"
    row = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in row.items() if value is not ...}))
    assert known_digest(tmp_path, jane, SALT, ITEMS) == ""


def test_points_that_somebody_gave_by_hand_stay(tmp_path: Path) -> None:
    (jane,) = written(tmp_path, "jane")
    path = tmp_path / "students" / "jane" / "result.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "earned": 7, "note": "by hand"}))
    assert known_digest(tmp_path, jane, SALT, ITEMS) == "d1"


def test_a_student_whose_name_changed_has_a_report_of_that_name(tmp_path: Path) -> None:
    (jane,) = written(tmp_path, "jane")
    assert known_digest(tmp_path, replace(jane, name="Jane Roe"), SALT, ITEMS) == ""


def test_a_result_never_stands_beside_reports_of_another_time(tmp_path: Path) -> None:
    (jane,) = written(tmp_path, "jane")
    (tmp_path / "students" / "jane" / "report.json").unlink()
    (tmp_path / "students" / "jane" / "report.json").mkdir()
    with pytest.raises(UsageError):
        write_student(tmp_path, jane, SALT, answer("jane"))
    assert read_result(tmp_path, jane) is None


def test_who_left_the_class_keeps_a_folder_and_is_in_no_table(tmp_path: Path) -> None:
    written(tmp_path, "jane", "nobodyelse")
    written(tmp_path, "jane")
    assert (tmp_path / "students" / "nobodyelse" / "report.html").is_file()
    for name in ("grades.csv", "grades.json", "index.html"):
        assert "nobodyelse" not in (tmp_path / name).read_text()
    with (tmp_path / "grades.csv").open(newline="") as file:
        assert [row["student"] for row in csv.DictReader(file)] == ["jane"]


def test_the_columns_that_no_item_may_be_called_are_those_of_the_table(tmp_path: Path) -> None:
    written(tmp_path, "jane")
    with (tmp_path / "grades.csv").open(newline="") as file:
        head = next(csv.reader(file))
    items = [item.id for item in RUBRIC.items]
    assert head == [*COLUMNS[:-1], *items, COLUMNS[-1]]


def test_no_item_of_a_rubric_is_a_formula(tmp_path: Path) -> None:
    rubric = tmp_path / "mine.yaml"
    rubric.write_text('title: T\nitems:\n  =1+1: {title: A, checkpoint: "01", points: 1}\n')
    write_tables(tmp_path, [], load_rubric(rubric, load_lab()))
    assert ",'=1+1," in (tmp_path / "grades.csv").read_text()


def test_the_table_says_why_an_item_was_limited(tmp_path: Path) -> None:
    jane = handed("jane")
    found = answer("jane")
    head, *others = found["items"]
    limited = {**head, "state": "none", "because": "the robot was changed"}
    found["items"] = [limited, *others]
    found["lost"] = [line for line in found["lost"] if line["item"] != head["id"]]
    write_student(tmp_path, jane, SALT, found)
    write_tables(tmp_path, [jane], RUBRIC)
    with (tmp_path / "grades.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    first, second, *_ = (item.id for item in RUBRIC.items)
    assert row["remarks"].startswith(f"{first}: the robot was changed; {second}: missing")


def test_the_table_says_of_each_item_what_it_lost_and_where(tmp_path: Path) -> None:
    jane = handed("jane")
    found = answer("jane")
    head, *others = found["items"]
    lost = {"item": head["id"], "requirement": "Scene/axis", "title": "it turns forward"}
    lines = [{**lost, "points": 0.25, "rule": "S09", "place": f"a.usda:{n}"} for n in range(5)]
    found["items"] = [{**head, "state": "part"}, *({**item, "state": "full"} for item in others)]
    write_student(tmp_path, jane, SALT, {**found, "lost": lines})
    write_tables(tmp_path, [jane], RUBRIC)
    with (tmp_path / "grades.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    told = ", ".join(f"-0.25 it turns forward (S09 a.usda:{n})" for n in range(3))
    assert row["remarks"] == f"{head['id']}: {told}, 2 more"


def test_two_who_handed_in_the_same_files_are_listed_once() -> None:
    work = {"files": {"01": "digest"}, "likeness": "signature"}
    rows = [{"student": student, "work": work} for student in ("ana", "ben")]
    assert alike(rows) == [
        {"students": ["ana", "ben"], "what": "the same files", "checkpoints": ["01"]}
    ]
