"""Where this program fails over a file: that is the result of that file, no grade, and no pass."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from in_process import invoke
from linting import add_failing_rule
from msgspec.structs import replace
from other_labs import cut_wire, stage, starter, submission
from workers_here import workers_here

from lab3_usd.grade import dry_runs
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers import worker_main
from lab3_usd.grade.workers.submission_grading import GradingSetup, grade_submission
from lab3_usd.grade.workers.worker_messages import Answer, PoolSettings, Task

CLOCK = f"work/{stage('01').name}"
SETTINGS = PoolSettings(None, None, Limits())


pytestmark = pytest.mark.usefixtures("own_rules")


def rule_fails(_: pytest.MonkeyPatch) -> None:
    """Let a rule about graphs fail: there are some in 01 and none in 00."""
    add_failing_rule("W99", "graph", KeyError, "odd")


def fail(*_arguments: object) -> None:
    raise KeyError("odd")


def search_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let fail what is no rule: findings of 01 are looked for in its text."""
    monkeypatch.setattr("lab3_usd.pipeline.stage.located_findings", fail)


def dry_run_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the dry run fail, which is there for stages with errors."""
    monkeypatch.setattr(dry_runs, "faults_in_dry_run", fail)


FAILURES = pytest.mark.parametrize("fails", [rule_fails, search_fails, dry_run_fails])


def clock_of(folder: Path) -> Path:
    """Hand in 00, which is right, and 01 with an error."""
    cut_wire(submission(folder, "00", "01") / CLOCK)
    return folder


def judged(folder: Path, scratch: Path, **changes: Any) -> dict[str, Any]:
    (scratch / "copy").mkdir(parents=True)
    course: GradingSetup = worker_main.load_setup(replace(SETTINGS, starter=starter()))
    task = Task("ana", "ana", (Source(folder),), **changes)
    return grade_submission(course, task, scratch / "copy", lambda _name: None)


@FAILURES
def test_the_class_is_graded_and_the_student_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[[pytest.MonkeyPatch], None]
) -> None:
    clock_of(tmp_path / "class" / "ana")
    submission(tmp_path / "class" / "ben", "00")
    fails(monkeypatch)
    with workers_here():
        done = invoke(
            "grade", tmp_path / "class", "--starter", starter(), "-o", tmp_path / "book"
        )  # fmt: skip
    assert done.exit_code == 0
    assert done.stdout.startswith("2 submissions (1 crashed, 1 graded)")
    assert f"lab3: ana has no grade: {CLOCK}: " in done.stderr
    assert "please report it" in done.stderr
    ana, ben = json.loads((tmp_path / "book" / "grades.json").read_text())["students"]
    assert (ana["status"], ben["status"]) == ("crashed", "graded")
    assert (bool(ana["crashes"]), ben["crashes"]) == (True, [])
    assert ana["earned"] == ben["earned"]  # what 00 is worth: 01 earns nothing
    assert ana["verdicts"]["00"] == "pass"
    assert ana["verdicts"]["01"] in {"fail", "unreadable"}


def test_of_two_stages_over_which_the_program_fails_the_first_is_named(tmp_path: Path) -> None:
    add_failing_rule("W99", "graph", KeyError, "odd")
    found = judged(submission(tmp_path / "ana", "01", "02"), tmp_path)
    assert len(found["crashes"]) > 1
    assert found["reason"].startswith(f"{CLOCK}: ")


def test_of_two_archives_that_cannot_be_read_the_first_is_named(tmp_path: Path) -> None:
    for name in ("b.zip", "a.zip"):
        (tmp_path / "ana" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "ana" / name).write_bytes(b"PK\x03\x04 not an archive")
    found = judged(tmp_path / "ana", tmp_path)
    assert found["reason"].startswith("a.zip: ")


@FAILURES
def test_the_report_says_that_it_was_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[[pytest.MonkeyPatch], None]
) -> None:
    fails(monkeypatch)
    found = judged(clock_of(tmp_path / "ana"), tmp_path)
    start, clock = json.loads(found["reports"]["report.json"])["results"]
    assert "crashes" not in start
    assert "KeyError" in clock["crashes"][0]["error"]
    lost = [line["title"] for line in found["lost"] if line["points"] and line["place"] == CLOCK]
    assert set(lost) == {"checkpoint 01 is not judged: this program failed"}


@FAILURES
def test_there_is_no_result_for_gradescope(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[[pytest.MonkeyPatch], None]
) -> None:
    out = tmp_path / "results.json"
    clock_of(tmp_path / "ana")
    fails(monkeypatch)
    with workers_here():
        done = invoke(
            "grade", "--format", "gradescope", "--starter", starter(), tmp_path / "ana", "-o", out
        )  # fmt: skip
        checked = invoke("check", "--untrusted", "--starter", starter(), tmp_path / "ana")
    assert (done.exit_code, out.exists(), checked.exit_code) == (3, False, 3)
    assert CLOCK in done.stderr


def test_a_file_over_which_a_worker_failed_before_is_told_from_one_that_ended_it(
    tmp_path: Path,
) -> None:
    ana = clock_of(tmp_path / "ana")
    for how, crashes in (("this program failed: KeyError at a.py:1: 'x'", ["F01"]), ("x", [])):
        found = judged(ana, tmp_path / how[:1], broken={CLOCK: how})
        assert (found["status"], found["crashes"]) == ("crashed", crashes)
        assert found["verdicts"] == {"00": "pass", "01": "unreadable"}


def test_a_recording_over_which_a_worker_failed_is_a_crash_of_the_submission(
    tmp_path: Path,
) -> None:
    broken = {"results/run": "this program failed: KeyError at a.py:1: 'x'"}
    found = judged(submission(tmp_path / "ana", "00"), tmp_path, broken=broken)
    assert (found["status"], found["crashes"]) == ("crashed", ["Z01"])


def test_a_submission_over_which_this_program_fails_as_a_whole_has_no_grade(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def all_fail(tasks: Iterable[Task], _settings: PoolSettings) -> Iterator[Answer]:
        yield from ((task, {"failed": "this program failed: KeyError at a.py:1"}) for task in tasks)

    for student in ("ana", "ben", "cyd", "dan", "eve", "fay", "gil"):
        submission(tmp_path / "class" / student, "00")
    monkeypatch.setattr("lab3_usd.grade.workers.pool.run_tasks", all_fail)
    done = invoke("grade", tmp_path / "class", "--starter", starter(), "-o", tmp_path / "book")
    assert (done.exit_code, "7 crashed" in done.stdout) == (0, True)
    assert done.stderr.splitlines()[-2:] == [
        "lab3: eve has no grade: this program failed: KeyError at a.py:1",
        "lab3: 2 more have no grade, see crashes in grades.json",
    ]
    rows = json.loads((tmp_path / "book" / "grades.json").read_text())["students"]
    assert {(row["status"], *row["crashes"]) for row in rows} == {("crashed", "Z01")}
