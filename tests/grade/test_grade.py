"""`lab3 grade` from end to end: what is written, in which order it does not matter, and again."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from golden import assert_golden_text
from html_pages import in_lines
from in_process import invoke
from msgspec.structs import replace
from other_labs import MINI, cut_wire, files_below, stage, starter, submission
from pxr import Sdf
from workers_here import graded_here, workers_here

from lab3_usd import cli
from lab3_usd.errors import Lab3Error, StageError, UsageError
from lab3_usd.features.grade import grade as grade_command
from lab3_usd.grade.class_run import ClassSettings, grade_class, salt_of
from lab3_usd.grade.gradebook import Rows
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.grade.workers.pool import run_tasks
from lab3_usd.grade.workers.worker_messages import Answer, PoolSettings, Task
from lab3_usd.report.options import tool_version
from lab3_usd.spec.load.loader import load_lab

pytestmark = pytest.mark.usefixtures("forked_workers", "equal_judged_once")
REPORTS = {"report.html", "report.json", "result.json", "results.json"}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class: one complete, one with a fault, one late and zipped, one with a file of rubbish."""
    folder = tmp_path_factory.mktemp("class") / "class"
    submission(folder / "whole")
    cut_wire(submission(folder / "fault", "00", "01") / "work" / stage("01").name)
    submission(folder / "rubbish", "00", "01")
    (folder / "rubbish" / "work" / stage("01").name).write_text("=cmd()")
    with zipfile.ZipFile(folder / "doe_LATE_77_1_all.zip", "w") as packed:
        packed.write(stage("00"), f"Lab3/work/{stage('00').name}")
    return folder


@pytest.fixture(scope="module")
def book(place: Path) -> Path:
    """The gradebook of the class."""
    out = place.parent / "book"
    grade_class(ClassSettings(place, starter(), out))
    return out


def rows(out: Path) -> dict[str, dict[str, Any]]:
    students = json.loads((out / "grades.json").read_text())["students"]
    return {row["student"]: row for row in students}


def result(out: Path, student: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "students" / student / "result.json").read_text())
    return found


@pytest.fixture
def copied(book: Path, tmp_path: Path) -> Path:
    """The gradebook of the class once more, to be gone on with."""
    return shutil.copytree(book, tmp_path / "book")


def graded(folder: Path, **changes: Any) -> dict[str, dict[str, Any]]:
    """Grade the class in a folder into a gradebook beside it, and return its rows."""
    graded_here(ClassSettings(folder / "class", starter(), folder / "book", **changes))
    return rows(folder / "book")


def rubric_with_late(folder: Path, late: str) -> Path:
    """Write a rubric that is the lab's but for who was late."""
    text = (MINI / "rubric.yaml").read_text(encoding="utf-8")
    rubric = folder / "mine.yaml"
    rubric.write_text(text.replace("late: {at_most: 1.0}", f"late: {late}"), encoding="utf-8")
    return rubric


def test_every_student_has_a_row_and_a_report_folder(book: Path) -> None:
    assert sorted(rows(book)) == ["77", "fault", "rubbish", "whole"]
    assert sorted(path.name for path in book.iterdir()) == [
        "grades.csv",
        "grades.json",
        "index.html",
        "students",
    ]
    for student in rows(book):
        assert {path.name for path in (book / "students" / student).iterdir()} == REPORTS


def test_points_follow_what_is_right(book: Path) -> None:
    found = rows(book)
    assert found["whole"]["percent"] == 100.0
    assert found["fault"]["earned"] == round(5 + 10 * (0.9 - 1 / 12), 2)
    assert [each["requirement"] for each in found["fault"]["lost"][:2]] == [
        "ROS_Clock/wire/ros2_publish_clock.execIn",
        "checkpoint 02",
    ]
    assert found["rubbish"]["verdicts"] == {"00": "pass", "01": "unreadable"}
    assert (found["77"]["late"], found["77"]["name"]) == (True, "doe")


WRITTEN = (
    "grades.csv",
    "grades.json",
    "index.html",
    "students/rubbish/report.json",
    "students/rubbish/result.json",
    "students/rubbish/results.json",
)


@pytest.mark.parametrize("name", WRITTEN)
def test_what_is_written_is_the_golden_text(book: Path, name: str) -> None:
    text = (book / name).read_text(encoding="utf-8").replace(tool_version(), "VERSION")
    shown = re.sub(r"\b[0-9a-f]{64}\b", "DIGEST", text)
    assert_golden_text(f"grade/{Path(name).name}", in_lines(shown) if "html" in name else shown)


def test_the_table_can_be_read_by_a_spreadsheet(book: Path) -> None:
    with (book / "grades.csv").open(newline="", encoding="utf-8") as file:
        table = {row["student"]: row for row in csv.DictReader(file)}
    assert table["whole"]["percent"] == "100.00"
    assert table["fault"]["clock"] == "8.17"
    assert table["77"]["late"] == "yes"
    assert "clock: unreadable" in table["rubbish"]["remarks"]


def test_no_cell_is_a_formula(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "=1+1", "00")
    submission(tmp_path / "class" / "jane", "00")
    graded(tmp_path)
    assert "'=1+1" in (tmp_path / "book" / "grades.csv").read_text()


def test_paths_in_reports_are_those_of_the_submission(book: Path, place: Path) -> None:
    for path in sorted((book / "students").rglob("*")):
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            assert str(place) not in text, path
            assert "lab3-grade-" not in text, path
    report = json.loads((book / "students" / "fault" / "report.json").read_text())
    assert [each["path"] for each in report["results"]] == [
        f"work/{stage(number).name}" for number in ("00", "01")
    ]
    finding = report["results"][1]["findings"][0]
    assert finding["layer"].endswith(f"work/{stage('01').name}")
    assert report["submissions"][0]["path"] == "fault"


def test_gradescope_gets_the_points_of_the_rubric(book: Path) -> None:
    document = json.loads((book / "students" / "fault" / "results.json").read_text())
    tests = {each["name"]: each for each in document["tests"]}
    clock = tests["/clock is publishing"]
    assert document["score"] == rows(book)["fault"]["earned"]
    assert (clock["score"], clock["max_score"], clock["status"]) == (8.17, 10.0, "failed")
    assert "execIn" in clock["output"]
    assert {
        each["status"] for each in tests.values() if each.get("score") == each.get("max_score", 0)
    } == {"passed"}
    assert "checkpoint 02 is missing" in tests["/cmd_vel controls the robot"]["output"]


def test_neither_place_nor_hash_seed_change_a_byte(place: Path, book: Path, tmp_path: Path) -> None:
    code = (
        "import json, sys\nfrom pathlib import Path\n"
        "from lab3_usd.grade.class_run import ClassSettings, grade_class\n"
        "from lab3_usd.grade.workers.worker_main import answer, load_setup\n"
        "place, start, out = map(Path, sys.argv[1:4])\n"
        "def judged(tasks, pool):\n"
        "    setup = load_setup(pool)\n"
        "    for task in tasks:\n"
        "        found = answer(setup, task, out.parent, lambda _name: None)\n"
        "        yield task, found | json.loads(sys.argv[4])\n"
        "grade_class(ClassSettings(place, start, out, runner=judged))\n"
    )
    moved = shutil.copytree(place, tmp_path / "elsewhere")
    missing = result(book, "whole").get("unconfined", [])  # walls of this system
    walls = json.dumps({"unconfined": missing} if missing else {})
    subprocess.run(
        [sys.executable, "-c", code, str(moved), str(starter()), str(tmp_path / "again"), walls],
        check=True,
        env={**os.environ, "PYTHONHASHSEED": "4711", "PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=120,
    )
    assert files_below(tmp_path / "again") == files_below(book)


class StoppedError(Exception):
    """Stands for Ctrl-C."""


def interrupted(settings: ClassSettings, after: int) -> None:
    def stop(done: int, total: int) -> None:
        del total
        if done == after:
            raise StoppedError

    with pytest.raises(StoppedError):
        grade_class(settings, stop)


def judged(
    place: Path, out: Path, grade: Callable[[ClassSettings], Rows] = graded_here, **changes: Any
) -> list[str]:
    """Resume a gradebook, and return whose submission was really judged."""
    done: list[str] = []

    def runner(tasks: Any, pool: Any) -> Any:
        for task, answer in run_tasks(tasks, pool):
            if answer.get("status") != "known":
                done.append(task.student)
            yield task, answer

    settings = {"starter": starter(), **changes}
    grade(ClassSettings(place, out=out, resume=True, runner=runner, **settings))
    return done


def test_an_interrupted_run_goes_on_where_it_was(place: Path, book: Path, tmp_path: Path) -> None:
    out = tmp_path / "book"
    interrupted(ClassSettings(place, starter(), out), after=2)
    assert not (out / "grades.csv").exists()
    assert len(list((out / "students").iterdir())) == 2
    assert len(judged(place, out, grade_class)) == 2
    assert files_below(out) == files_below(book)


def test_a_finished_run_repeats_nothing(place: Path, copied: Path) -> None:
    before = files_below(copied)
    assert judged(place, copied) == []
    assert files_below(copied) == before


def test_what_changed_is_judged_again(place: Path, copied: Path, tmp_path: Path) -> None:
    shutil.copytree(place, tmp_path / "class")
    shutil.copyfile(stage("01"), tmp_path / "class" / "fault" / "work" / stage("01").name)
    assert judged(tmp_path / "class", copied) == ["fault"]
    assert rows(copied)["fault"]["earned"] == 15.0


def test_another_starter_or_rubric_judges_everybody_again(
    place: Path, copied: Path, tmp_path: Path
) -> None:
    other = tmp_path / "starter.usda"
    other.write_text(starter().read_text() + "\n")
    assert len(judged(place, copied, starter=other)) == 4
    rubric = tmp_path / "mine.yaml"
    rubric.write_text(
        'title: T\nitems:\n  all: {title: All, checkpoint: "00", points: 1}\n', encoding="utf-8"
    )
    assert len(judged(place, copied, starter=other, rubric=rubric)) == 4


def test_a_result_that_was_cut_short_is_judged_again(place: Path, copied: Path) -> None:
    (copied / "students" / "fault" / "result.json").write_text('{"version": 1')
    assert judged(place, copied) == ["fault"]


@pytest.mark.parametrize("change", [{"status": "timeout"}, {"late": True}])
def test_what_ended_a_worker_and_who_is_late_otherwise_now_is_judged_again(
    place: Path, copied: Path, change: dict[str, object]
) -> None:
    path = copied / "students" / "fault" / "result.json"
    path.write_text(json.dumps({**result(copied, "fault"), **change}))
    assert judged(place, copied) == ["fault"]


def test_the_rubric_may_say_who_was_late(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "whole")
    rubric = rubric_with_late(tmp_path, "{at_most: 0.5, students: [whole]}")
    whole = graded(tmp_path, rubric=rubric)["whole"]
    assert (whole["late"], whole["percent"], whole["because"]) == (
        True,
        50.0,
        ["late: at most 50%"],
    )


def answered(answer: dict[str, Any]) -> Any:
    def runner(tasks: Any, pool: Any) -> Any:
        del pool
        for task in tasks:
            assert isinstance(task, Task)
            yield task, answer

    return runner


@pytest.mark.parametrize(
    ("answer", "status"),
    [
        ({"failed": "ran out of time (20 s)"}, "timeout"),
        ({"failed": "ran out of memory"}, "too large"),
        ({"failed": "crashed usd-core (SIGSEGV)"}, "crashed"),
        ({"failed": "tool failed: two workers ended before they read it"}, "tool failed"),
        ({"failed": "this program failed: KeyError at rules.py:1: 'x'"}, "crashed"),
    ],
)
def test_a_submission_that_could_not_be_judged_has_a_status_and_a_report(
    tmp_path: Path, answer: dict[str, str], status: str
) -> None:
    submission(tmp_path / "class" / "jane", "00")
    submission(tmp_path / "class" / "ali", "00")
    settings = ClassSettings(
        tmp_path / "class", starter(), tmp_path / "book", runner=answered(answer)
    )
    first, _ = grade_class(settings)
    (reason,) = answer.values()
    assert (first["status"], first["reason"], first["earned"]) == (status, reason, 0.0)
    assert set(first["reports"]) == REPORTS - {"result.json"}


def test_what_fails_apart_from_any_submission_is_the_tools_fault_and_no_grade(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "lab3_usd.grade.workers.pool.run_tasks",
        answered({"failed": "tool failed: two workers ended before they read it: stopped"}),
    )
    done = invoke("grade", place, "--starter", starter(), "-o", tmp_path / "book")
    assert done.exit_code == 3
    assert "4 tool failed" in done.output


def test_the_command_says_where_the_gradebook_is(tmp_path: Path) -> None:
    out = tmp_path / "book"
    for student in ("ana", "ben"):
        submission(tmp_path / "class" / student, "00")
    done = invoke("grade", tmp_path / "class", "--starter", starter(), "-o", out, "--jobs", "1")
    assert done.exit_code == 0
    assert done.output == f"2 submissions (2 graded): {out / 'index.html'}\n"
    assert set(rows(out)) == {"ana", "ben"}


def refused(settings: ClassSettings, error: type[Lab3Error]) -> str:
    with pytest.raises(error) as raised:
        grade_class(settings)
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_a_wrong_rubric_is_an_error_before_anything_is_written(place: Path, tmp_path: Path) -> None:
    rubric = tmp_path / "mine.yaml"
    rubric.write_text("title: T\nitems: {}\n")
    out = tmp_path / "book"
    assert "mine.yaml" in refused(ClassSettings(place, starter(), out, rubric=rubric), Lab3Error)
    assert not out.exists()


@pytest.mark.parametrize("content", [None, b"", b"#usda 1.0\ndef {{{"])
def test_a_starter_that_cannot_be_opened_is_an_error(
    place: Path, tmp_path: Path, content: bytes | None
) -> None:
    path = tmp_path / "starter.usda"
    if content is not None:
        path.write_bytes(content)
    assert "starter.usda" in refused(ClassSettings(place, path, tmp_path / "book"), StageError)


def test_a_folder_in_use_is_not_written_to(place: Path, tmp_path: Path) -> None:
    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "thesis.tex").write_text("years of work")
    settings = ClassSettings(place, starter(), tmp_path / "book")
    assert "not empty" in refused(settings, UsageError)
    again = ClassSettings(place, starter(), tmp_path / "book", resume=True)
    assert "thesis.tex" in refused(again, UsageError)
    file = ClassSettings(place, starter(), tmp_path / "book" / "thesis.tex")
    assert "not a folder" in refused(file, UsageError)
    assert files_below(tmp_path / "book") == {"thesis.tex": b"years of work"}


def test_submissions_are_only_read(place: Path, book: Path) -> None:
    before = files_below(place)
    assert result(book, "whole")["percent"] == 100.0
    assert files_below(place) == before
    assert all(not path.name.startswith("lab3-") for path in place.parent.iterdir())


def test_the_salt_stands_for_rubric_and_starter(tmp_path: Path) -> None:
    rubric = load_rubric(None, load_lab())
    other = tmp_path / "other.usda"
    other.write_bytes(starter().read_bytes() + b"\n")
    assert salt_of(rubric, starter(), {}) != salt_of(rubric, other, {})


def starter_of_parts(folder: Path) -> Path:
    """A starter that stands on a layer and an asset of its own."""
    folder.mkdir(parents=True)
    shutil.copyfile(starter(), folder / "base.usda")
    (folder / "part.usda").write_text('#usda 1.0\ndef Xform "Part"\n{\n}\n')
    path = folder / "starter.usda"
    path.write_text(
        '#usda 1.0\n(\n    defaultPrim = "World"\n    subLayers = [@./base.usda@]\n)\n'
        'over "World"\n{\n    def "More" (references = @./part.usda@</Part>)\n    {\n    }\n}\n'
    )
    return path


@pytest.mark.parametrize("name", ["base.usda", "part.usda"])
def test_the_salt_stands_for_every_file_of_the_starter(tmp_path: Path, name: str) -> None:
    rubric = load_rubric(None, load_lab())
    path = starter_of_parts(tmp_path / "one")
    before = salt_of(rubric, path, {})
    assert salt_of(rubric, starter_of_parts(tmp_path / "two"), {}) == before
    with (path.parent / name).open("a") as file:
        file.write("\n")
    assert salt_of(rubric, path, {}) != before


def test_assets_of_a_server_are_read_only_where_the_grader_has_them(tmp_path: Path) -> None:
    path = submission(tmp_path / "class" / "jane", "00") / "work" / stage("00").name
    layer = Sdf.Layer.FindOrOpen(str(path))
    chair = Sdf.CreatePrimInLayer(layer, "/World/chair")
    chair.specifier = Sdf.SpecifierDef
    chair.referenceList.Prepend(Sdf.Reference("https://server.example/Assets/chair.usda"))
    layer.Save()
    folder = tmp_path / "assets"
    folder.mkdir()
    (folder / "chair.usda").write_text('#usda 1.0\n(\n    defaultPrim = "C"\n)\ndef "C" {}\n')
    rules = {}
    for name, assets in (("without", {}), ("with", {"https://server.example/Assets": folder})):
        out = tmp_path / name
        settings = ClassSettings(tmp_path / "class", starter(), out, assets=assets)
        assert [row["status"] for row in grade_class(settings)] == ["graded"]
        report = json.loads((out / "students" / "jane" / "report.json").read_text())
        found = [finding["rule"] for each in report["results"] for finding in each["findings"]]
        rules[name] = found.count("F02")
    assert rules == {"without": 1, "with": 0}


ADDRESSES = ("https://a", "https://b", "https://\udcff")  # the last is no text


def test_the_salt_stands_for_where_assets_lie(tmp_path: Path) -> None:
    rubric = load_rubric(None, load_lab())
    salts = {
        salt_of(rubric, starter(), assets)
        for assets in ({}, *({address: tmp_path} for address in ADDRESSES))
    }
    assert len(salts) == 1 + len(ADDRESSES)


def test_a_gradebook_among_the_submissions_is_refused(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "jane", "00")
    (tmp_path / "link").symlink_to(tmp_path / "class")
    for out in (tmp_path / "class" / "book", tmp_path / "link" / "book", tmp_path / "class"):
        settings = ClassSettings(tmp_path / "class", starter(), out, resume=True)
        assert "which is graded" in refused(settings, UsageError)
    address = ClassSettings((tmp_path / "class").as_uri(), starter(), tmp_path / "class" / "book")
    assert "which is graded" in refused(address, UsageError)
    assert [path.name for path in (tmp_path / "class").iterdir()] == ["jane"]


@pytest.mark.parametrize("seconds", ["nan", "inf", "-inf", "0", "x"])
def test_seconds_are_a_number_within_bounds(place: Path, tmp_path: Path, seconds: str) -> None:
    options = ["--starter", starter(), "-o", tmp_path / "book", "--timeout", seconds]
    done = invoke("grade", place, *options)
    assert done.exit_code == 2
    assert not (tmp_path / "book").exists()


@pytest.mark.parametrize("name", ["", " "])
def test_no_name_is_not_the_current_folder(tmp_path: Path, name: str) -> None:
    options = ["--starter", str(starter()), "-o", str(tmp_path / "book")]
    done = invoke("grade", name, *options)
    assert done.exit_code == 2
    assert "current folder" in done.output


def test_what_is_passed_over_is_said_on_stderr(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "jane", "00")
    (tmp_path / "class" / "bob.pdf").touch()
    with workers_here():
        done = invoke("grade", tmp_path / "class", "--starter", starter(), "-o", tmp_path / "book")
    assert done.exit_code == 0
    assert done.stderr.startswith("lab3: ")
    assert done.stderr.endswith(": bob.pdf\n")


def test_the_newer_of_two_uploads_is_graded(tmp_path: Path) -> None:
    (tmp_path / "class").mkdir()
    name = stage("00").name
    (tmp_path / "class" / f"bob_7_998_{name}").write_text("rubbish")
    shutil.copyfile(stage("00"), tmp_path / "class" / f"bob_7_1002_{name.replace('.', '-1.')}")
    assert graded(tmp_path)["7"]["verdicts"] == {"00": "pass"}


def test_two_who_claim_one_number_each_have_their_own_grade(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "submission_1")
    submission(tmp_path / "class" / "submission_2", "00")
    who = "submission_{0}:\n  :submitters:\n  - :name: N{0}\n    :sid: '7'\n"
    metadata = who.format(1) + who.format(2)
    (tmp_path / "class" / "submission_metadata.yml").write_text(metadata)
    found = graded(tmp_path)
    assert {student: row["name"] for student, row in found.items()} == {
        "7 (submission_1)": "N1",
        "7 (submission_2)": "N2",
    }
    assert found["7 (submission_1)"]["percent"] == 100.0
    assert list(found["7 (submission_2)"]["verdicts"]) == ["00"]


def test_who_is_late_by_a_number_that_two_claim_is_late(tmp_path: Path) -> None:
    who = "submission_{0}:\n  :submitters:\n  - :name: N{0}\n    :sid: '{1}'\n"
    for number in (1, 2, 3):
        submission(tmp_path / "class" / f"submission_{number}", "00")
    metadata = who.format(1, 7) + who.format(2, 7) + who.format(3, 8)
    (tmp_path / "class" / "submission_metadata.yml").write_text(metadata)
    rubric = rubric_with_late(tmp_path, '{at_most: 0.5, students: ["7"]}')
    found = graded(tmp_path, rubric=rubric)
    assert {student: row["late"] for student, row in found.items()} == {
        "7 (submission_1)": True,
        "7 (submission_2)": True,
        "8": False,
    }


def test_progress_is_shown_on_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    (tmp_path / "class" / "nobody").mkdir(parents=True)
    asked = [str(tmp_path / "class"), "--starter", str(starter()), "-o", str(tmp_path / "book")]
    with pytest.raises(SystemExit, match="0"):
        cli.lab3(["grade", *asked])
    assert "1/1" in terminal.getvalue()


def test_there_are_as_many_workers_as_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _process: {0, 3}, raising=False)
    assert grade_command._processors() == 2
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert grade_command._processors() == 1


def test_a_cluster_is_asked_where_one_is_named(place: Path, tmp_path: Path) -> None:
    options = ["--cluster", "nonsense", "--starter", str(starter()), "-o", str(tmp_path / "book")]
    with pytest.raises(UsageError):
        invoke("grade", place, *options)
    assert not (tmp_path / "book").exists()


# A worker of a system that has no Landlock and refuses namespaces.
OPEN = """
import sys
sys.path[:0] = sys.argv[1:]
from lab3_usd.grade.workers import worker_main as worker
worker.fence_files = lambda *arguments: False
give_up = worker.give_up_privileges
worker.give_up_privileges = lambda: give_up() | {"network": False}
worker.serve()
"""


def test_a_system_without_walls_is_said_once_and_in_the_gradebook(
    tmp_path: Path,
) -> None:
    def run_open(tasks: Iterable[Task], pool: PoolSettings) -> Iterator[Answer]:
        return run_tasks(tasks, replace(pool, program=OPEN))

    for name in ("jane", "john"):
        submission(tmp_path / "class" / name, "00")
    said: list[str] = []
    out = tmp_path / "book"
    settings = ClassSettings(tmp_path / "class", starter(), out, notify=said.append)
    grade_class(replace(settings, runner=run_open))
    (line_,) = [line for line in said if "sandbox layers" in line]
    assert "files (Landlock" in line_
    assert "network (" in line_
    missing = set(json.loads((out / "grades.json").read_text())["unconfined"])
    assert missing >= {"files", "network"}
    assert all(missing == set(row["unconfined"]) for row in rows(out).values())


def test_where_every_wall_holds_nothing_is_said_of_them(book: Path) -> None:
    document = json.loads((book / "grades.json").read_text())
    missing = {name for row in document["students"] for name in row.get("unconfined", [])}
    assert set(document["unconfined"]) == missing
