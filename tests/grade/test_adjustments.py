"""What a grader decides by hand: points and remarks, in a table, shown wherever a grade is."""

from __future__ import annotations

import csv
import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
import quick_yaml
from click.shell_completion import ShellComplete
from html_pages import read
from in_process import invoke
from other_labs import MINI, cut_wire, files_below, stage, starter, submission
from workers_here import graded_here, workers_here

from lab3_usd.errors import UsageError
from lab3_usd.features.grade import grade
from lab3_usd.grade import class_run, gradebook
from lab3_usd.grade.adjustments import Tables
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.feedback import reasons_by_student
from lab3_usd.grade.gradebook import HTML, read_gradebook
from lab3_usd.grade.regrade import student_in

pytestmark = pytest.mark.usefixtures("equal_judged_once")

# Jane's work is whole: 100 points. Joe lost 1.83 of 10 at the clock. The video is 10 points more,
# which nobody but a person can judge.
TABLE = """student,item,points,text
jane,video,8,"clear, but no goal is reached"
jane,drive,-2.5,drove into the wall in the check-off
joe,clock,+1,the wire was there in the check-off
joe,scan,,neat
"""
JANE = (105.5, 110.0)  # 100 + 8 - 2.5
JOE = (99.17, 100.0)  # 98.17 + 1; the video is still open


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class of two with its gradebook, without adjustments, and the files to go on with."""
    folder = tmp_path_factory.mktemp("graded")
    submission(folder / "class" / "jane")
    cut_wire(submission(folder / "class" / "joe") / "work" / stage("01").name)
    rubric = quick_yaml.load((MINI / "rubric.yaml").read_text(encoding="utf-8"))
    video = {"title": "The video", "checklist": "Robot stops at the goal", "points": 10}
    rubric["items"]["video"] = video
    (folder / "rubric.yaml").write_text(quick_yaml.dump(rubric), encoding="utf-8")
    (folder / "hand.csv").write_text(TABLE, encoding="utf-8")
    graded_here(settings(folder))
    return folder


@pytest.fixture
def here(graded: Path, tmp_path: Path) -> Path:
    """A copy of all of it."""
    shutil.copytree(graded, tmp_path, dirs_exist_ok=True)
    return tmp_path


def settings(folder: Path, book: str = "book", **more: object) -> ClassSettings:
    rubric = folder / "rubric.yaml"
    return ClassSettings(folder / "class", starter(), folder / book, rubric, **more)  # type: ignore[arg-type]


def regraded(folder: Path, *options: object) -> str:
    rubric = folder / "rubric.yaml"
    result = invoke("grade", "--regrade", folder / "book", "--rubric", rubric, *options)
    assert result.exit_code == 0
    return result.stdout


def sums(book: Path) -> list[tuple[float, float]]:
    return [(row["earned"], row["possible"]) for row in read_gradebook(book)["students"]]


def test_points_by_hand_are_counted_and_the_change_is_printed(here: Path) -> None:
    shown = regraded(here, "--adjust", here / "hand.csv")
    assert shown.splitlines() == [
        "jane: 100.00 of 100 -> 105.50 of 110 (+5.50), other remarks",
        "joe: 98.17 of 100 -> 99.17 of 100 (+1.00), other remarks",
        f"2 changed (points of 2, remarks of 2): {here / 'book' / 'index.html'}",
    ]
    assert sums(here / "book") == [JANE, JOE]


@pytest.mark.parametrize(("book", "students"), [("book", ["joe"]), ("nowhere", [])])
def test_the_students_of_a_gradebook_are_completed(
    here: Path, book: str, students: list[str]
) -> None:
    words = ["-o", str(here / book), "--explain"]
    offered = ShellComplete(grade.command, {}, "grade", "_X").get_completions(words, "jo")
    assert [item.value for item in offered] == students


def with_price(folder: Path, per_day: float = 0.1) -> None:
    """Let each day late cost a share of all points."""
    rubric = folder / "rubric.yaml"
    content = quick_yaml.load(rubric.read_text(encoding="utf-8")) | {"late": {"per_day": per_day}}
    rubric.write_text(quick_yaml.dump(content), encoding="utf-8")


@pytest.mark.parametrize(
    ("points", "earned", "because"),
    [
        ("", 100.0, ["remark: see me"]),
        ("-7.5", 92.5, ["adjusted by hand: see me (-7.5 points)"]),
        ("60", 60.0, ["adjusted by hand: see me (-40 points)"]),
        ("3d", 70.0, ["late by 3 days, each 10%", "remark: see me"]),
        ("11d", 0.0, ["late by 11 days, each 10%", "remark: see me"]),
    ],
)
def test_a_whole_submission_has_a_remark_points_or_days(
    here: Path, points: str, earned: float, because: list[str]
) -> None:
    with_price(here)
    (here / "hand.csv").write_text(f"student,item,points,text\njane,,{points},see me\n")
    regraded(here, "--adjust", here / "hand.csv")
    row = student_in(read_gradebook(here / "book"), "jane")
    assert (row["earned"], row["because"]) == (earned, because)


LATE_TABLES = {
    "days": "student,days\njane,2\njoe,0\nnobody,\n",
    "times": "student,submitted,deadline\n"
    "jane,2026-11-22 08:00,2026-11-20 23:59\njoe,2026-11-20 23:59,2026-11-20 23:59\n",
    "points": "student,item,points,text,days\njane,clock,,neat,2\n",
    "zones": "student,submitted,deadline\njane,2026-11-22T04:59Z,2026-11-20T23:59-05:00\n",
}


@pytest.mark.parametrize(
    ("table", "days"),
    [("days", 2), ("times", 2), ("points", 2), ("zones", 1)],
    ids=list(LATE_TABLES),
)
def test_days_late_come_from_a_table_of_days_or_of_times(here: Path, table: str, days: int) -> None:
    with_price(here)
    (here / "hand.csv").write_text("student,item,points,text\njane,,-5,rude\n")
    (here / "times.csv").write_text(LATE_TABLES[table])
    shown = regraded(here, "--adjust", here / "hand.csv", "--late", here / "times.csv")
    assert shown.splitlines()[0].startswith("jane: 100.00 of 100 -> ")
    assert f"{days} day{'s' * (days > 1)} late" in shown
    jane, joe = read_gradebook(here / "book")["students"]
    assert (jane["earned"], jane["days_late"]) == (95.0 - 10 * days, days)
    assert joe["earned"] == 98.17
    with (here / "book" / "grades.csv").open(newline="") as file:
        late = [row["late"] for row in csv.DictReader(file)]
    assert late == [f"{days} day{'s' * (days > 1)}", ""]
    assert regraded(here).startswith("0 changed")  # the gradebook keeps the table


def test_a_late_student_without_days_loses_nothing_until_they_are_given(here: Path) -> None:
    with_price(here)
    rubric = here / "rubric.yaml"
    rubric.write_text(
        rubric.read_text().replace("per_day: 0.1", "per_day: 0.1\n  students: [jane]")
    )
    regraded(here)
    row = student_in(read_gradebook(here / "book"), "jane")
    assert (row["earned"], row["because"]) == (100.0, ["late, by how many days is not given"])
    (here / "times.csv").write_text("student,days\njane,0\n")
    regraded(here, "--late", here / "times.csv")
    row = student_in(read_gradebook(here / "book"), "jane")
    assert (row["earned"], row["because"], row["days_late"]) == (100.0, [], 0)


@pytest.mark.parametrize(
    ("table", "why"),
    [
        ("student,when\njane,2\n", "needs the columns student, days or student, submitted, dead"),
        ("student,days\njane,two\n", "line 2: 'two' is not a number of days, such as 0 or 2"),
        ("student,days\njim,2\n", "line 2: no student is called 'jim'"),
        ("student,days\njane,2\njane,3\n", "line 3: jane is in line 2 too"),
        (
            "student,submitted,deadline\njane,Friday,2026-11-20\n",
            "line 2: 'Friday' is not a time, such as 2026-11-20 23:59",
        ),
        (
            "student,submitted,deadline\njane,2026-11-20T08:00Z,2026-11-20\n",
            "line 2: of '2026-11-20T08:00Z' and '2026-11-20' one has a time zone, the other none",
        ),
    ],
)
def test_a_wrong_table_of_days_is_refused(here: Path, table: str, why: str) -> None:
    with_price(here)
    (here / "times.csv").write_text(table)
    with pytest.raises(UsageError, match=re.escape(why)):
        regraded(here, "--late", here / "times.csv")
    assert not (here / "book" / "late.csv").exists()


def test_lines_of_an_earlier_table_that_no_longer_count_are_named(here: Path) -> None:
    regraded(here, "--adjust", here / "hand.csv")
    (here / "next.csv").write_text("student,item,points,text\njoe,clock,+1,again\n")
    rubric = here / "rubric.yaml"
    options = ["--rubric", rubric, "--adjust", here / "next.csv"]
    told = invoke("grade", "--regrade", here / "book", *options).stderr.splitlines()
    assert told == [
        "lab3: 3 lines of the table before no longer count; to keep them, add to the new one:",
        'lab3:     jane,video,8,"clear, but no goal is reached"',
        "lab3:     jane,drive,-2.5,drove into the wall in the check-off",
        "lab3:     joe,scan,,neat",
    ]


def test_who_is_no_longer_in_the_table_of_days_is_named_and_not_called_in_time(here: Path) -> None:
    with_price(here)
    (here / "all.csv").write_text("student,days\njane,2\njoe,1\n")
    (here / "next.csv").write_text("student,days\njane,\njoe,3\n")
    regraded(here, "--late", here / "all.csv")
    options = ["--rubric", here / "rubric.yaml", "--late", here / "next.csv"]
    told = invoke("grade", "--regrade", here / "book", *options)
    assert told.stderr.splitlines() == [
        "lab3: 1 line of the table before no longer count; to keep them, add to the new one:",
        "lab3:     jane,2",
    ]
    assert told.stdout.splitlines()[:2] == [
        "jane: 80.00 of 100 -> 100.00 of 100 (+20.00), days late not given",
        "joe: 88.17 of 100 -> 68.17 of 100 (-20.00), 3 days late",
    ]


def test_what_only_a_person_can_judge_is_no_longer_open(here: Path) -> None:
    before = student_in(read_gradebook(here / "book"), "jane")["items"][-1]
    assert (before["id"], before["state"], before["possible"]) == ("video", "open", 0.0)
    regraded(here, "--adjust", here / "hand.csv")
    jane, joe = read_gradebook(here / "book")["students"]
    assert (jane["items"][-1]["state"], jane["items"][-1]["possible"]) == ("part", 10.0)
    assert joe["items"][-1]["state"] == "open"


def test_grading_and_regrading_with_the_same_table_give_the_same_grades(here: Path) -> None:
    graded_here(settings(here, "other", by_hand=Tables(here / "hand.csv")))
    regraded(here, "--adjust", here / "hand.csv")
    of_joe = ("students/joe/report.html", "students/joe/results.json")
    for name in ("grades.csv", "grades.json", "index.html", *of_joe):
        assert (here / "book" / name).read_bytes() == (here / "other" / name).read_bytes(), name


def test_the_same_table_again_gives_the_same_bytes(here: Path) -> None:
    regraded(here, "--adjust", here / "hand.csv")
    before = files_below(here / "book")
    assert regraded(here, "--adjust", here / "hand.csv").startswith("0 changed")
    assert files_below(here / "book") == before


def test_the_results_for_gradescope_keep_what_was_found(here: Path) -> None:
    path = here / "book" / "students" / "joe" / "results.json"
    before = json.loads(path.read_text())
    regraded(here, "--adjust", here / "hand.csv")
    after = json.loads(path.read_text())
    assert (before["score"], after["score"]) == (98.17, 99.17)
    assert after["output"] == before["output"]
    assert [test["name"] for test in after["tests"]] == [test["name"] for test in before["tests"]]
    clock = after["tests"][1]["output"]
    assert clock.endswith(before["tests"][1]["output"])
    assert "**error W01**" in clock


def test_every_line_of_an_item_adds_up_to_what_it_lost(here: Path) -> None:
    regraded(here, "--adjust", here / "hand.csv")
    for row in read_gradebook(here / "book")["students"]:
        for item in row["items"]:
            lost = sum(line["points"] for line in row["lost"] if line["item"] == item["id"])
            assert lost == pytest.approx(item["possible"] - item["earned"])


WORDS = "adjusted by hand: the wire was there in the check-off"


def test_the_words_stand_wherever_the_grade_is_shown(here: Path) -> None:
    regraded(here, "--adjust", here / "hand.csv")
    book = here / "book"
    page = read((book / "students" / "joe" / HTML).read_text(encoding="utf-8")).text
    assert f"+1.00 {WORDS}" in re.sub(r"\s+", " ", page)
    assert "remark: neat" in page
    of_class = read((book / "index.html").read_text(encoding="utf-8")).text
    assert f"clock: {WORDS}" in of_class
    assert "video: adjusted by hand: clear, but no goal is reached" in of_class
    with (book / "grades.csv").open(newline="") as file:
        jane, joe = csv.DictReader(file)
    assert "drive: -2.50 adjusted by hand: drove into the wall in the check-off" in jane["remarks"]
    assert "video: -2.00 adjusted by hand: clear, but no goal is reached" in jane["remarks"]
    assert (jane["video"], joe["video"]) == ("8.00", "")
    assert f"clock: +1.00 {WORDS}, -1.83" in joe["remarks"]
    explained = invoke("grade", "-o", book, "--explain", "joe").stdout
    assert f"    +1.00 {WORDS}\n" in explained
    assert "    remark: neat\n" in explained
    scored = json.loads((book / "students" / "joe" / "results.json").read_text())
    assert scored["score"] == 99.17
    assert r"\+1\.00 adjusted by hand\: the wire was there" in scored["tests"][1]["output"]
    told = reasons_by_student(read_gradebook(book))["joe"]
    assert f"/clock is publishing: +1.00 {WORDS}" in told
    assert "/scan publishes a LaserScan: remark: neat" in told


def test_without_a_table_what_was_adjusted_stays(here: Path) -> None:
    regraded(here, "--adjust", here / "hand.csv")
    assert regraded(here).startswith("0 changed")
    graded_here(settings(here, resume=True))
    assert sums(here / "book") == [JANE, JOE]


def test_a_new_upload_keeps_what_was_adjusted(here: Path) -> None:
    regraded(here, "--adjust", here / "hand.csv")
    shutil.copyfile(stage("01"), here / "class" / "joe" / "work" / stage("01").name)
    graded_here(settings(here, resume=True))
    assert sums(here / "book") == [JANE, (100.0, 100.0)]  # no more than the item has
    joe = student_in(read_gradebook(here / "book"), "joe")
    assert WORDS in [line["title"] for line in joe["lost"]]


def test_a_table_without_lines_takes_everything_back(here: Path) -> None:
    before = files_below(here / "book")
    regraded(here, "--adjust", here / "hand.csv")
    (here / "none.csv").write_text("student,item,points,text\n")
    regraded(here, "--adjust", here / "none.csv")
    after = files_below(here / "book")
    of_joe = ("students/joe/report.html", "students/joe/results.json")
    for name in ("grades.csv", "grades.json", "index.html", *of_joe):
        assert after[name] == before[name], name


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("jim,clock,1,x", "line 2: no student is called 'jim'"),
        ("janes,clock,1,x", "line 2: no student is called 'janes'; did you mean jane?"),
        ("joe,klock,1,x", "line 2: the rubric has no item 'klock'; it has starter, clock,"),
        ("joe,clock,10.5,x", "line 2: 10.5 points are more than the item's 10"),
        ("joe,clock,+11,x", "line 2: +11 points are more than the item's 10"),
        ("joe,clock,nan,x", "line 2: 'nan' is not a number of points"),
        ("joe,clock,1,", "line 2: has no text"),
        ('joe,clock,1,"a\nb"\njoe,clock,2,c', "line 4: joe and clock are in line 2 too"),
        ("joe,,2d,late", "line 2: 2d needs `late: {per_day: 0.1}` in the rubric"),
    ],
)
def test_a_wrong_line_is_named_and_nothing_is_written(here: Path, line: str, why: str) -> None:
    (here / "wrong.csv").write_text(f"student,item,points,text\n{line}\n")
    before = files_below(here / "book")
    with pytest.raises(UsageError, match=re.escape(f"wrong.csv: {why}")):
        regraded(here, "--adjust", here / "wrong.csv")
    assert files_below(here / "book") == before
    with pytest.raises(UsageError, match=re.escape(f"wrong.csv: {why}")):
        graded_here(settings(here, "new", by_hand=Tables(here / "wrong.csv")))
    assert files_below(here / "new") == {}


def test_a_table_of_a_spreadsheet_in_german_is_read(here: Path) -> None:
    text = "Student;Item;Points;Text\r\njoe;clock;8,5;gut\r\n"
    (here / "hand.csv").write_bytes(text.encode("utf-16"))
    regraded(here, "--adjust", here / "hand.csv")
    assert sums(here / "book")[1] == (98.5, 100.0)  # 90 + 8.5


def test_adjustments_are_refused_where_no_points_are_counted(here: Path) -> None:
    with pytest.raises(UsageError, match="--adjust goes with SUBMISSIONS or --regrade"):
        invoke("grade", "-o", here / "book", "--explain", "joe", "--adjust", here / "hand.csv")


@pytest.mark.parametrize(
    ("module", "part", "after", "far"),
    [
        (class_run, "decisions_in", 0, "nothing is graded yet"),
        (class_run, "write_student", 1, "1 of 2 done"),
        (class_run, "adjust", 0, "2 of 2 done"),
        (gradebook, "write_parts", 1, "2 of 2 done"),
    ],
)
def test_a_run_that_is_ended_says_how_to_continue(
    here: Path, monkeypatch: pytest.MonkeyPatch, module: object, part: str, after: int, far: str
) -> None:
    """Before the first, in the middle, and while the tables are written."""
    whole = getattr(module, part)
    calls: list[None] = []

    def ended_later(*arguments: object, **options: object) -> object:
        if len(calls) == after:
            raise KeyboardInterrupt
        calls.append(None)
        return whole(*arguments, **options)

    book = here / "new book"
    words = [here / "class", "--starter", starter(), "--adjust", here / "hand.csv"]
    words += ["--rubric", here / "rubric.yaml", "--jobs", 1]
    with workers_here(), monkeypatch.context() as patched:
        patched.setattr(module, part, ended_later)
        ended = invoke("grade", *words, "-o", book)
    assert ended.exit_code == 1
    said = ended.stderr.splitlines()[0]
    assert said.startswith(f"lab3: {far}; continue with: lab3 grade ")
    with workers_here():
        again = invoke(*shlex.split(said.partition("with: lab3 ")[2]))
        invoke("grade", *words, "-o", here / "without a pause")
    assert again.stdout == f"2 submissions (2 graded): {book / 'index.html'}\n"
    assert sums(book) == [JANE, JOE]
    assert files_below(book) == files_below(here / "without a pause")


def test_the_command_that_continues_keeps_a_secret_and_says_so(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(class_run, "grade_class", ended)
    address = "https://ana:geheim@course.example/lab3?token=abc"
    shown = invoke("grade", address, "--starter", starter(), "-o", here / "new").stderr
    assert "geheim" not in shown
    assert "abc" not in shown
    command, _, rest = shown.splitlines()[0].partition(" (")
    assert "'https://***@course.example/lab3?***'" in command
    assert rest == "with what stood in place of ***, a secret)"
