"""`lab3 check --jobs N`: the same answer in less time, whatever becomes of a process."""

from __future__ import annotations

import importlib
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import forking
import pytest
from click.testing import Result
from hostile import INPUTS, Kit
from in_process import invoke
from pxr import Usd
from report_examples import assert_valid
from submissions import STARTER, delete, edit, stage_name, write_submission

from lab3_usd import build_checkpoint, cli
from lab3_usd.check.registry import all_rules
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.model.finding import Report, StageResult
from lab3_usd.pipeline import folder, processes
from lab3_usd.pipeline.entries import crashed_target
from lab3_usd.pipeline.processes import in_processes
from lab3_usd.pipeline.results import Target
from lab3_usd.pipeline.stage import JudgeSettings
from lab3_usd.report.formats.registry import all_formats, render
from lab3_usd.spec.lab import Lab

CLOCK = "Lab3_01_ros_clock.usda"
TOPIC = "/World/ROS_Clock/ros2_publish_clock.inputs:topicName"
forks = pytest.mark.skipif(processes._METHOD != "forkserver", reason="nothing is forked here")


def check(*arguments: object) -> Result:
    return invoke("check", *arguments)


def set_topic(stage: Usd.Stage) -> None:
    stage.GetAttributeAtPath(TOPIC).Set("/other")


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A wrong stage, a right one twice, and one that cannot be read."""
    folder = tmp_path_factory.mktemp("stages")
    right = build_checkpoint(None, "01", folder / CLOCK)
    wrong = Path(shutil.copy(right, folder / "Lab3_01_wrong.usda"))
    stage = Usd.Stage.Open(str(wrong))
    set_topic(stage)
    stage.Save()
    torn = folder / "Lab3_01_torn.usda"
    torn.write_text("#usda 1.0\ndef")
    return [wrong, right, torn, right]


@pytest.fixture(scope="module")
def submissions(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A submission with a wrong stage, and one that lacks a stage, of the first ones."""
    folder = tmp_path_factory.mktemp("class")
    found = [write_submission(folder / name) for name in ("ana", "ben")]
    for work in found:
        for number in ("04", "05", "06", "07", "08"):
            delete(stage_name(number))(work)
    edit("03", set_topic)(found[0])
    delete(stage_name("02"))(found[1])
    return found


def hostile(name: str, folder: Path) -> Path:
    """Write a file at which usd-core ends the process that opens it."""
    folder.mkdir()
    INPUTS[name](folder, Kit(folder, folder))
    (stage,) = folder.iterdir()
    return stage


# A line for each finding, all that a result holds, and what is read of the files once more.
@pytest.mark.parametrize("form", ["text", "json", "html"])
def test_a_report_has_the_same_bytes(stages: list[Path], form: str) -> None:
    one, two = (check("--format", form, "--jobs", n, *stages) for n in (1, 2))
    assert (one.exit_code, two.exit_code) == (1, 1)
    assert one.stdout_bytes == two.stdout_bytes


def test_submissions_have_the_same_bytes(submissions: list[Path], stages: list[Path]) -> None:
    starter = submissions[0] / STARTER
    options = ("--starter", starter, "--require-evidence", "--ignore", "P")
    calls = ("--format", "json", *options, *submissions, *stages)
    one, three = (check("--jobs", n, *calls) for n in (1, 3))
    report = json.loads(one.stdout)
    assert_valid(report)
    assert len(report["submissions"]) == 2
    assert one.stdout_bytes == three.stdout_bytes
    assert one.exit_code == three.exit_code == 1


def test_a_checkpoint_that_does_not_exist_is_refused_for_a_submission_too(
    submissions: list[Path],
) -> None:
    with pytest.raises(UsageError, match="no checkpoint '99'"):
        check("--checkpoint", "99", submissions[0])


def test_the_stages_of_a_folder_have_the_same_bytes(stages: list[Path], tmp_path: Path) -> None:
    for number, stage in enumerate(stages):
        shutil.copy(stage, tmp_path / f"{number}.usda")
    one, two = (check("--jobs", n, "--checkpoint", "01", tmp_path) for n in (1, 2))
    assert one.stdout_bytes == two.stdout_bytes
    assert "4 files: 2 passed, 2 failed" in one.stdout


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("nested_prims", ("--exit-zero",)),
        ("nested_dictionaries", ("--ignore", "F", "--quiet")),
    ],
)
def test_a_file_that_ends_its_process_is_a_crash_and_costs_no_other_its_result(
    stages: list[Path], tmp_path: Path, name: str, options: tuple[str, ...]
) -> None:
    fatal = hostile(name, tmp_path / "fatal")
    paths = [fatal, *stages, fatal]
    done = check("--format", "json", "--jobs", 2, *options, *paths)
    assert done.exit_code == 3
    report = json.loads(done.stdout)
    assert_valid(report)
    assert [each["path"] for each in report["results"]] == [str(path) for path in paths]
    crashed = [each for each in report["results"] if "crashes" in each]
    assert [each["path"] for each in crashed] == [str(fatal)] * 2
    assert {each["verdict"] for each in crashed} == {"unreadable"}
    assert all("SIGSEGV" in each["crashes"][0]["error"] for each in crashed)
    alone = json.loads(check("--format", "json", *options, *stages).stdout)["results"]
    assert report["results"][1 : len(stages) + 1] == alone


@pytest.mark.parametrize("form", all_formats())
def test_every_format_tells_of_a_crash(form: str) -> None:
    entries = (Target(CLOCK, is_submission=False), Target("ana", is_submission=True))
    crashed = [crashed_target(JudgeSettings(), entry, "SIGSEGV") for entry in entries]
    report = Report(crashed[0][0], crashed[1][1])
    assert render(form, report, all_rules()).count("SIGSEGV") >= 2


def test_a_submission_that_ends_its_process_is_a_crash(
    submissions: list[Path], tmp_path: Path
) -> None:
    fatal = Path(shutil.copytree(submissions[0], tmp_path / "dan"))
    shutil.copy(hostile("nested_prims", tmp_path / "fatal"), fatal / stage_name("01"))
    done = check("--format", "json", "--jobs", 2, fatal, submissions[1])
    assert done.exit_code == 3
    report = json.loads(done.stdout)
    assert_valid(report)
    told = {each["path"]: "crashes" in each for each in report["submissions"]}
    assert told == {str(fatal): True, str(submissions[1]): False}


@pytest.mark.parametrize("command", ["check", "lint"])
def test_a_file_over_which_the_program_fails_costs_no_other_its_result(
    stages: list[Path], monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    odd, others = stages[0], stages[1:]
    module, name = "lab3_usd.pipeline.entries", "judge_stage"
    usual = getattr(importlib.import_module(module), name)

    def fail(path: str, *rest: object) -> StageResult:
        if path == str(odd):
            raise KeyError("x")
        result: StageResult = usual(path, *rest)
        return result

    monkeypatch.setattr(f"{module}.{name}", fail)
    done = invoke(command, "--format", "json", odd, *others)
    assert done.exit_code == 3
    report = json.loads(done.stdout)
    assert_valid(report)
    first, *rest = report["results"]
    assert first["verdict"] == "unreadable"
    (crash,) = first["crashes"]
    assert re.fullmatch(r"this program failed \(KeyError: 'x' at \S+:\d+\)", crash["error"])
    assert rest == json.loads(invoke(command, "--format", "json", *others).stdout)["results"]


def test_a_stage_over_which_the_program_fails_costs_a_submission_nothing_else(
    submissions: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = folder.judge_stage

    def fail(path: str, settings: JudgeSettings, at: tuple[Lab, str]) -> StageResult:
        if at[1] == "01":
            raise KeyError("x")
        return usual(path, settings, at)

    monkeypatch.setattr(folder, "judge_stage", fail)
    done = check("--format", "json", submissions[1])
    assert done.exit_code == 3
    report = json.loads(done.stdout)
    crashed = [each["checkpoint"] for each in report["results"] if "crashes" in each]
    assert crashed == ["01"]
    assert len(report["results"]) > 1
    assert "crashes" not in report["submissions"][0]


def test_one_process_judges_without_others(
    stages: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "in_processes", None)
    assert check("--jobs", 1, *stages).exit_code == 1
    assert check(*stages).exit_code == 1
    assert check("--jobs", 8, stages[1]).exit_code == 0
    with pytest.raises(TypeError):
        check("--jobs", 2, *stages)


@pytest.mark.parametrize("number", ["0", "-1", "two", "257"])
def test_a_number_of_processes_that_cannot_be_is_refused(number: str) -> None:
    assert check("--jobs", number, ".").exit_code == 2


def test_the_first_error_in_order_is_the_one_that_is_told(
    stages: list[Path], tmp_path: Path
) -> None:
    starter = tmp_path / "starter.usda"
    starter.write_text("#usda 1.0\ndef")
    errors = []
    for jobs in (1, 2):
        with pytest.raises(Lab3Error) as refused:
            check("--jobs", jobs, "--starter", starter, *stages)
        errors.append((refused.type, str(refused.value)))
    assert errors[0] == errors[1]


def test_progress_is_shown_on_a_terminal(
    stages: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    asked = ["check", "--jobs", "2", "--output", str(tmp_path / "report"), *map(str, stages)]
    with pytest.raises(SystemExit, match="1"):
        cli.lab3(asked)
    assert "100%" in terminal.getvalue()


def run_all(works: Sequence[str], jobs: int = 2) -> list[Any]:
    """Evaluate expressions in processes; one that ends its process is how it ended."""
    return list(in_processes(eval, lambda work, how: (work, how), works, jobs))


def test_answers_come_in_the_order_of_the_work() -> None:
    slow = "__import__('time').sleep(0.3) or 'slow'"
    assert run_all([slow, "1", "2", slow, "3"]) == ["slow", 1, 2, "slow", 3]
    assert run_all([]) == []


def test_how_a_process_ended_is_known() -> None:
    killed = "__import__('os').kill(__import__('os').getpid(), {})"
    ends = {
        "__import__('os')._exit(7)": "exit status 7",
        killed.format(9): "SIGKILL",
        killed.format(40): "signal 40",  # a real-time signal, which has no name
    }
    assert run_all(["0", *ends, "1"]) == [0, *ends.items(), 1]


def test_what_raises_there_raises_here_in_its_turn() -> None:
    slow = "__import__('time').sleep(0.5)"
    answers = in_processes(eval, lambda _work, how: how, [slow, "1 / 0", "2"], 2)
    assert next(answers) is None
    with pytest.raises(ZeroDivisionError):
        next(answers)


def test_nobody_is_left_when_it_is_not_waited_for() -> None:
    endless = "__import__('time').sleep(600)"
    answers = in_processes(eval, lambda _work, how: how, ["__import__('os').getpid()", endless], 2)
    process = next(answers)
    answers.close()  # type: ignore[attr-defined]  # it is a generator
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@forks
def test_what_all_need_is_imported_once() -> None:
    assert run_all(["'pxr.Usd' in __import__('sys').modules"] * 2) == [True, True]


def test_no_environment_is_left_changed() -> None:
    before = dict(os.environ)
    assert run_all(["__import__('os').environ['PXR_WORK_THREAD_LIMIT']"] * 2) == ["1", "1"]
    assert dict(os.environ) == before


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 looks into the folder")
def test_modules_in_the_working_directory_are_not_imported(
    stages: list[Path], tmp_path: Path
) -> None:
    for name in ("socket", "signal", "random", "pickle", "click"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a module of the student')")
    program = Path(sys.executable).with_name("lab3")
    done = subprocess.run(
        [program, "check", "--jobs", "2", *stages],
        check=False, capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "")


def group(leader: int) -> list[int]:
    """Return the processes of a group that are still there."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _parent, leads, *_ = status.read_text().rpartition(")")[2].split()
            if int(leads) == leader and state != "Z":
                found.append(int(status.parent.name))
    return found


def wait_until(is_so: Callable[[], bool], seconds: float = 60) -> bool:
    until = time.monotonic() + seconds
    while not is_so() and time.monotonic() < until:
        time.sleep(0.05)
    return is_so()


@forks
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("count", [3, 5], ids=["while usd-core is imported", "while it judges"])
def test_ctrl_c_is_one_line_and_leaves_nobody(stages: list[Path], count: int) -> None:
    start = forking.Popen if count == 5 else subprocess.Popen  # forked, all is imported
    running = start(
        [sys.executable, "-m", "lab3_usd", "check", "--jobs", "2", *[stages[1]] * 1000],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    # The command, a helper and the server of multiprocessing, then two that judge.
    assert wait_until(lambda: len(group(running.pid)) >= count)
    time.sleep(0.1)
    os.killpg(running.pid, signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert (running.returncode, out, err.strip()) == (130, "", "lab3: interrupted")
    assert wait_until(lambda: not group(running.pid))
