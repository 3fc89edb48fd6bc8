"""What is done with a gradebook that is there: sums, another rubric, files for platforms."""

from __future__ import annotations

import csv
import json
import os
import shutil
from pathlib import Path

import pytest
import quick_yaml
from html_pages import read
from mini_lab import LAB, LAST, MINI, cut_wire, stage, starter, submission
from pxr import Gf, Usd
from workers_here import graded_here

from lab3_usd.errors import UsageError
from lab3_usd.grade.afterwards import class_of, regrade, student_in, sum_of
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.gradebook import HTML
from lab3_usd.grade.rosters import PLATFORMS, write_for_platform
from lab3_usd.grade.rubric import Rubric, load_rubric


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class of two with its gradebook: one whole, one with a wire cut in the clock."""
    folder = tmp_path_factory.mktemp("graded")
    submission(folder / "class" / "jane")
    cut_wire(submission(folder / "class" / "joe") / "work" / stage("01").name)
    graded_here(ClassSettings(folder / "class", starter(), folder / "book"))
    return folder


@pytest.fixture
def book(graded: Path, tmp_path: Path) -> Path:
    """A copy of the gradebook, beside a copy of the class."""
    shutil.copytree(graded, tmp_path, dirs_exist_ok=True)
    return tmp_path / "book"


def another(tmp_path: Path) -> Rubric:
    """The rubric with twice the points for the clock."""
    data = quick_yaml.load((MINI / "rubric.yaml").read_text(encoding="utf-8"))
    data["items"]["clock"]["points"] = 20
    path = tmp_path / "new.yaml"
    path.write_text(quick_yaml.dump(data), encoding="utf-8")
    return load_rubric(path, LAB)


def test_the_sum_of_a_student_names_every_item_and_deduction(book: Path) -> None:
    of_class = class_of(book)
    lines = list(sum_of(of_class, student_in(of_class, "joe")))
    assert lines[0] == "joe: graded, 98.17 of 100.00 points, 98.17 %"
    row = student_in(of_class, "joe")
    shown = [line for line in lines if line.startswith("    -")]
    assert len(shown) == len(row["lost"]) == 1
    assert "-1.83" in shown[0]
    assert f"(W01 work/{stage('01').name}:" in shown[0]
    assert lines[-1].split() == ["total", "98.17", "of", "100.00"]


def test_a_student_who_is_not_there_is_named(book: Path) -> None:
    with pytest.raises(UsageError, match="nobody: no such student"):
        student_in(class_of(book), "nobody")


def test_another_rubric_needs_no_submission_and_says_who_changed(
    book: Path, tmp_path: Path
) -> None:
    (tmp_path / "class").rename(tmp_path / "gone")
    changed = regrade(book, another(tmp_path))
    assert [(each.student, each.before, each.after) for each in changed] == [
        ("jane", (100.0, 100.0), (110.0, 110.0)),
        ("joe", (98.17, 100.0), (106.33, 110.0)),
    ]
    row = student_in(class_of(book), "joe")
    assert (row["earned"], row["possible"]) == (106.33, 110.0)
    with (book / "grades.csv").open(newline="") as file:
        assert [line["earned"] for line in csv.DictReader(file)] == ["110.00", "106.33"]
    page = read((book / "students" / "joe" / HTML).read_text(encoding="utf-8"))
    assert "106.33 of 110" in page.one("header", "hero").text
    assert page.one("title").text == "joe: 106.33 of 110 points"
    assert "execIn" in page.text
    scored = json.loads((book / "students" / "joe" / "results.json").read_text())
    assert scored["score"] == 106.33


def test_the_same_rubric_changes_nobody_and_nothing(book: Path) -> None:
    page = (book / "students" / "joe" / HTML).read_bytes()
    assert regrade(book, load_rubric(MINI / "rubric.yaml", LAB)) == []
    assert (book / "students" / "joe" / HTML).read_bytes() == page


def test_after_another_rubric_the_class_is_judged_again(book: Path, tmp_path: Path) -> None:
    regrade(book, another(tmp_path))
    rows = graded_here(ClassSettings(tmp_path / "class", starter(), book, resume=True))
    assert [row["earned"] for row in rows] == [100.0, 98.17]


def test_a_result_without_what_was_found_is_refused(book: Path, tmp_path: Path) -> None:
    path = book / "students" / "joe" / "result.json"
    row = json.loads(path.read_text())
    del row["facts"]
    path.write_text(json.dumps(row))
    with pytest.raises(UsageError, match="joe does not say what was found"):
        regrade(book, another(tmp_path))


EXPORTS = {
    "canvas": (
        ('Student,ID,SIS User ID,SIS Login ID,Section,Mini (77),Other (78)\n'
        "    Points Possible,,,,,100,10\n"
        '"Roe, Joe",joe,9,jroe,A,,5\n"Doe, Jane",jane,8,jdoe,A,,6\n'),
        [
            ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Mini (77)"],
            ["    Points Possible", "", "", "", "", "100"],
            ["Roe, Joe", "joe", "9", "jroe", "A", "98.17"],
            ["Doe, Jane", "jane", "8", "jdoe", "A", "100.00"],
        ],
    ),
    "moodle": (
        ("Identifier,Full name,Status,Grade,Maximum Grade,Feedback comments\n"
        "Participant 7,Joe,Submitted,,100.00,\nParticipant 8,Ann,,,100.00,\n"),
        [
            ["Identifier", "Full name", "Status", "Grade", "Maximum Grade", "Feedback comments"],
            ["Participant 7", "Joe", "Submitted", "98.17", "100.00", ""],
            ["Participant 8", "Ann", "", "", "100.00", ""],
        ],
    ),
    "gradescope": (
        "First Name,Last Name,SID,Email,Sections,Mini,Mini - Max Points\nJo,Roe,joe,j@x,A,,100\n",
        [["First Name", "Last Name", "SID", "Email", "Sections", "Mini"],
         ["Jo", "Roe", "joe", "j@x", "A", "98.17"]],
    ),
    "brightspace": (
        ("OrgDefinedId,Username,Last Name,First Name,Email,"
        "Mini Points Grade <Numeric MaxPoints:100>,End-of-Line Indicator\n"
        "#12,#joe,Roe,=Jo,j@x,,#\n"),
        [["OrgDefinedId", "Username", "Last Name", "First Name", "Email",
          "Mini Points Grade <Numeric MaxPoints:100>", "End-of-Line Indicator"],
         ["#12", "#joe", "Roe", "'=Jo", "j@x", "98.17", "#"]],
    ),
    "blackboard": (
        ("Last Name\tFirst Name\tUsername\tStudent ID\tMini [Total Pts: 100 Score] |5\n"
        "Roe\tJo\tjoe\t007\t\n"),
        [["Last Name", "First Name", "Username", "Student ID",
          "Mini [Total Pts: 100 Score] |5"],
         ["Roe", "Jo", "joe", "007", "98.17"]],
    ),
}  # fmt: skip


def test_every_platform_has_an_example() -> None:
    assert set(EXPORTS) == set(PLATFORMS)


@pytest.mark.parametrize("name", EXPORTS)
def test_a_platform_gets_its_own_columns_in_its_own_order(
    name: str, book: Path, tmp_path: Path
) -> None:
    text, expected = EXPORTS[name]
    roster = tmp_path / "export.csv"
    encoding = "utf-16" if name == "blackboard" else "utf-8"
    roster.write_text(text, encoding=encoding)
    path = write_for_platform(book, name, roster, class_of(book), lambda _line: None)
    delimiter = "\t" if "\t" in text else ","
    with path.open(newline="", encoding=encoding) as file:
        assert list(csv.reader(file, delimiter=delimiter)) == expected


def test_who_is_in_one_of_the_two_only_is_said(book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(EXPORTS["moodle"][0])
    told: list[str] = []
    write_for_platform(book, "moodle", roster, class_of(book), told.append)
    assert told == [
        f"{roster}: no submission of Ann",
        f"{roster}: does not have jane; their points are in no row",
    ]


@pytest.mark.parametrize(
    ("status", "crashes"), [("tool failed", ["Z01"]), ("tool failed", []), ("crashed", ["N01"])]
)
def test_a_failure_of_the_tool_is_no_grade_of_nothing(
    book: Path, tmp_path: Path, status: str, crashes: list[str]
) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(EXPORTS["canvas"][0])
    of_class = class_of(book)
    for row in of_class["students"]:
        if row["student"] == "joe":
            row |= {"status": status, "crashes": crashes}
    told: list[str] = []
    path = write_for_platform(book, "canvas", roster, of_class, told.append)
    with path.open(newline="") as file:
        assert [row[-1] for row in csv.reader(file)][2:] == ["", "100.00"]
    assert told == [f"joe: {status}, and so has no points in the file"]


def test_a_column_that_is_left_open_is_asked_for(book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text("Student,ID,Mini a (1),Mini b (2)\nJoe,joe,,\n")
    with pytest.raises(UsageError, match=r"Mini a .*--column"):
        write_for_platform(book, "canvas", roster, class_of(book), lambda _line: None)
    path = write_for_platform(book, "canvas", roster, class_of(book), lambda _line: None, "Mini b")
    assert path.read_text().splitlines()[1] == "Joe,joe,98.17"


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n"])
def test_the_export_of_another_platform_is_refused(text: str, book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.write_text(text)
    with pytest.raises(UsageError, match="not an export of canvas"):
        write_for_platform(book, "canvas", roster, class_of(book), lambda _line: None)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"Student,ID,Mini (1)\n\xff", "is not a text table"),
        (None, "cannot be read"),
        (b"Student,ID,Mini (1)\nJoe,joe,\n", "has no column 'Other'; there are Mini"),
    ],
)
def test_an_export_that_cannot_be_read_is_refused(
    data: bytes | None, fault: str, book: Path, tmp_path: Path
) -> None:
    roster = tmp_path / "export.csv"
    if data is not None:
        roster.write_bytes(data)
    with pytest.raises(UsageError, match=fault):
        write_for_platform(book, "canvas", roster, class_of(book), lambda _line: None, "Other")


def test_an_export_of_more_than_64_megabytes_is_refused(book: Path, tmp_path: Path) -> None:
    roster = tmp_path / "export.csv"
    roster.touch()
    os.truncate(roster, (64 << 20) + 1)
    with pytest.raises(UsageError, match="is larger than"):
        write_for_platform(book, "canvas", roster, class_of(book), lambda _line: None)


def test_a_folder_without_a_gradebook_is_refused(tmp_path: Path) -> None:
    (tmp_path / "grades.json").write_text('{"students": [1], "items": []}')
    with pytest.raises(UsageError, match="contains no readable gradebook"):
        class_of(tmp_path)


def renamed(path: Path) -> None:
    """Name a node otherwise, move it in the editor, and write a comment."""
    stage = Usd.Stage.Open(str(path))
    clock = LAB.graphs["ROS_Clock"].path
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(f"{clock}/ros2_context", f"{clock}/mine")
    editor.ApplyEdits()
    node = stage.GetPrimAtPath(f"{clock}/mine")
    node.GetAttribute("ui:nodegraph:node:pos").Set(Gf.Vec2f(7, 8))
    stage.GetRootLayer().comment = "my own work"
    stage.Save()


def test_the_same_work_is_listed_and_not_judged(tmp_path: Path) -> None:
    place = tmp_path / "class"
    for student in ("ann", "bob", "cem"):
        submission(place / student)
    other = cut_wire(submission(place / "dan") / "work" / stage(LAST).name)
    assert other.is_file()
    for path in (place / "cem" / "work").iterdir():
        if path.name != stage("00").name:
            renamed(path)
    rows = list(graded_here(ClassSettings(place, starter(), tmp_path / "book")))
    assert {row["earned"] for row in rows[:3]} == {100.0}
    stages = [number for number in LAB.checkpoints if number != "00"]
    assert class_of(tmp_path / "book")["alike"] == [
        {"students": ["ann", "bob"], "what": "the same files", "checkpoints": [LAST]},
        {
            "students": ["ann", "bob", "cem"],
            "what": "the same graphs but for names",
            "checkpoints": [],
        },
        {"students": ["ann", "bob", "dan"], "what": "the same files", "checkpoints": stages[:-1]},
    ]
    page = read((tmp_path / "book" / "index.html").read_text(encoding="utf-8"))
    assert "ann, bob, cem: the same graphs but for names" in page.text


def test_an_export_in_the_gradebook_is_not_written_over(tmp_path: Path) -> None:
    roster = tmp_path / "canvas.csv"
    roster.write_text("Student,ID,SIS Login ID,Section,Lab 3 (1)")
    with pytest.raises(UsageError, match="would be replaced"):
        write_for_platform(tmp_path, "canvas", roster, {}, lambda _line: None)
    assert roster.read_text().startswith("Student")
