"""Worker processes: what is done about one that dies, hangs, grows or talks nonsense."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tarfile
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import forking
import pytest
from machine import eventually, has_ended
from msgspec.structs import replace
from other_labs import starter, submission
from pxr import Sdf, Tf

from lab3_usd.grade.awake import AwakeClock
from lab3_usd.grade.intake import scratch
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import MEGABYTE, Limits
from lab3_usd.grade.workers import pool, worker_process
from lab3_usd.grade.workers.pool import WorkerSlot, judge_with_retries, run_tasks
from lab3_usd.grade.workers.worker_main import _failure_text
from lab3_usd.grade.workers.worker_messages import (
    PoolSettings,
    Reply,
    Task,
    decoded_message,
    encode,
    status_of,
)
from lab3_usd.grade.workers.worker_process import (
    Turn,
    Worker,
    WorkerDiedError,
    WorkerError,
    ask,
    end_worker,
    never_stopped,
    start_worker,
)
from lab3_usd.pipeline import processes

pytestmark = pytest.mark.usefixtures("forked_workers")

# A worker that does what the student's name says; it is ready at once.
ODD = """
import json, os, resource, signal, sys, time
limit = json.loads(sys.stdin.readline())["settings"]["limits"]["seconds"]
turn, parent = 0, os.getppid()
say = lambda message: print(json.dumps({"turn": turn, **message}), flush=True)
hurry = lambda: open("late", "w").close()  # from now on the clock of whoever asks goes fast
most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
peak = most if sys.platform == "darwin" else most * 1024
print(json.dumps({"confined": {}, "peak": peak}), flush=True)
for line in sys.stdin:
    message = json.loads(line)
    turn, task = message["turn"], message["task"]
    student, broken = task["student"], task["broken"]
    say({"open": "first.usda"})
    if student.startswith("well") or "second.usda" in broken:
        say({"done": {"status": "graded", "by": os.getpid(), "broken": broken}})
        if student == "well, then dies":
            os.kill(os.getpid(), signal.SIGKILL)
        if student == "well, then talks":
            say({"done": {"status": "graded", "by": 0}})
        if student == "well, then closes":
            os.close(1)
        if student == "well, then hangs":
            hurry()
            time.sleep(600)
        continue
    if student == "early":
        signal.setitimer(signal.ITIMER_PROF, limit / 10)
    else:
        say({"open": "second.usda"})
    if student == "crashes":
        os.kill(os.getpid(), signal.SIGSEGV)
    if student == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if student == "leaves":
        os._exit(7)
    if student == "nonsense":
        print("nonsense", flush=True)
    if student == "list":
        print("[1]", flush=True)
    if student == "grows":
        say({"done": {"died": "ran out of memory"}})
    if student == "endless":
        sys.stdout.write("x" * 5000)
        sys.stdout.flush()
        os._exit(0)
    while student == "writes":
        os.write(1, b"x" * 65536)
    while student == "lines":
        os.write(1, b'{"turn": %d, "open": "second.usda"}\\n' % turn * 1000)
    if student == "computes":
        signal.setitimer(signal.ITIMER_PROF, limit)
    if student == "computes on":  # and has computed for most of its time before
        say({"open": "second.usda", "processor": 2.5 * limit})
        signal.setitimer(signal.ITIMER_PROF, limit / 2)
    while student == "early" or student.startswith("computes"):
        pass
    while student == "busy":
        say({"open": "second.usda"})
        time.sleep(0.1)
    if student.startswith("waits in "):
        place = student.removeprefix("waits in ")
        open(f"{place}/new", "w").write(str(os.getpid()))
        os.rename(f"{place}/new", f"{place}/waiting")
        while not os.path.exists(f"{place}/go"):
            time.sleep(0.02)
        say({"done": {"status": "graded", "broken": broken}})
        open(f"{place}/answered", "w").close()
        continue
    if student == "hangs":
        hurry()
    while student == "hangs":  # until whoever started it is gone
        time.sleep(0.1)
        os.getppid() == parent or os._exit(0)
    if student == "deaf":
        for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
            signal.signal(number, signal.SIG_IGN)
    if student == "closes":
        os.close(1)
    if student == "parts" and os.fork():
        os._exit(0)
    if student == "parts":
        open("part", "w").write(str(os.getpid()))
    if student.endswith("once") and not os.path.exists("../../../once"):
        open("../../../once", "w").close()
        hurry()
        while student == "hangs once":
            time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGSEGV if "crashes" in student else signal.SIGKILL)
    if student.endswith("once"):
        say({"done": {"status": "graded", "by": os.getpid(), "broken": broken}})
        continue
    student == "closes" or hurry()
    time.sleep(600)
"""
STUDENT = Limits(seconds=0.2, answer_size=MEGABYTE)
# For workers that hang: by the clock only fifteen times as long as they may compute.
IMPATIENT = replace(STUDENT, all_times=3.0, clock_times=15.0, clock_least=0.0)
CLOSING = replace(IMPATIENT, clock_times=0.5)  # what closes its pipe is not waited for longer
TIMED = replace(IMPATIENT, seconds=100, all_times=0.0004, clock_times=5.0)  # by a real clock


@dataclass
class WorkersClock:
    """A clock that stands until the worker lets it go, and goes fast then."""

    worker: Worker
    looks: int = 0

    def seconds(self) -> float:
        self.looks += (self.worker.scratch / "late").exists()
        return 2.0 * self.looks


@pytest.fixture(scope="module", autouse=True)
def _time_passes_as_workers_wish() -> Iterator[None]:
    def turn(worker: Worker, whole: float, stopped: Callable[[], bool]) -> Turn:
        clock: Any = AwakeClock() if worker.limits == TIMED else WorkersClock(worker)
        return Turn(worker, whole, stopped, clock=clock)

    with patch.object(worker_process, "Turn", turn):
        yield


@pytest.fixture
def odd() -> PoolSettings:
    """Settings whose workers are odd."""
    return PoolSettings(None, None, STUDENT, program=ODD)


@pytest.fixture
def impatient(odd: PoolSettings) -> PoolSettings:
    return replace(odd, limits=IMPATIENT)


@pytest.fixture
def worker(odd: PoolSettings) -> Iterator[Worker]:
    made = start_worker(odd)
    yield made
    end_worker(made)


@pytest.fixture
def temporary(tmp_path: Path) -> Path:
    """The temporary folder of the runs that are started here."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    return folder


def task(student: str) -> Task:
    return Task(student, student, ())


def judged_in_turn(settings: PoolSettings, *students: str) -> list[tuple[Task, dict[str, Any]]]:
    """Have tasks judged in one slot, each as it is judged last, with its answer."""
    slot = WorkerSlot(settings)
    try:
        return [judge_with_retries(slot, task(student), never_stopped) for student in students]
    finally:
        slot.stop()


# What a worker does over the second file, and what is known of its end.
ENDS = {
    "closes": "stopped answering",
    "hangs": "ran out of time (3 s by the clock)",
    "deaf": "ran out of time (3 s by the clock)",
    "parts": "ran out of time (3 s by the clock)",
    "crashes": "crashed usd-core (SIGSEGV)",
    "killed": "ended by SIGKILL",
    "leaves": "ended the worker (exit status 7)",
    "nonsense": "answered nonsense",
    "list": "answered nonsense",
    "grows": "ran out of memory",
    "endless": "ended the worker (exit status 0)",
    "writes": "too large: answers more than 1 MB",
    "lines": "too large: answers more than 1 MB",
}


@pytest.fixture(scope="module")
def ends() -> dict[str, Future[WorkerDiedError]]:
    """The ends of workers that are waited for side by side."""
    with ThreadPoolExecutor(5) as threads:
        return {student: threads.submit(end_of, student) for student in ENDS}


def end_of(student: str) -> WorkerDiedError:
    limits = CLOSING if student == "closes" else IMPATIENT
    worker = start_worker(PoolSettings(None, None, limits, program=ODD))
    try:
        with pytest.raises(WorkerDiedError) as died:
            ask(worker, task(student), never_stopped)
    finally:
        end_worker(worker)
    return died.value


@pytest.mark.parametrize("student", ENDS)
def test_how_a_worker_ended_and_over_which_file_is_known(
    ends: dict[str, Future[WorkerDiedError]], student: str
) -> None:
    died = ends[student].result()
    assert (died.how, died.file) == (ENDS[student], "second.usda")
    assert died.external == (student in {"killed", "hangs", "deaf", "parts"})


@pytest.mark.parametrize(
    ("student", "how"),
    [
        ("computes", "ran out of time (0.2 s of processor time)"),
        ("computes on", "ran out of time (0.6 s of processor time for all files)"),
    ],
)
def test_processor_time_is_counted_for_a_file_and_for_all(student: str, how: str) -> None:
    died = end_of(student)
    assert (died.how, died.file, died.external) == (how, "second.usda", False)


def test_progress_without_end_is_ended_by_the_clock(odd: PoolSettings) -> None:
    worker = start_worker(replace(odd, limits=TIMED))
    try:
        with pytest.raises(WorkerDiedError) as died:
            ask(worker, task("busy"), never_stopped)
    finally:
        end_worker(worker)
    assert died.value.how == "ran out of time (0.2 s by the clock for all files)"


def test_what_a_worker_left_running_goes_with_it(impatient: PoolSettings) -> None:
    worker = start_worker(impatient)
    with pytest.raises(WorkerDiedError):
        ask(worker, task("parts"), never_stopped)
    part = int((worker.scratch / "part").read_text())
    end_worker(worker)
    assert eventually(lambda: has_ended(part))


@pytest.mark.parametrize(
    "before", ["well, then dies", "well, then talks", "well, then closes", "well, then hangs"]
)
def test_the_next_submission_is_judged_by_another_worker(
    impatient: PoolSettings, before: str
) -> None:
    if before == "well, then closes":
        impatient = replace(impatient, limits=CLOSING)
    answers = [answer for _, answer in run_tasks(map(task, ["well", before, "well"]), impatient)]
    assert [answer["status"] for answer in answers] == ["graded"] * 3
    assert answers[2]["by"] not in {0, answers[1]["by"]}
    assert answers[2]["broken"] == {}


def test_an_idle_worker_that_is_killed_costs_nobody_a_point(odd: PoolSettings) -> None:
    slot = WorkerSlot(odd)
    try:
        _, first = judge_with_retries(slot, task("well"), never_stopped)
        os.kill(first["by"], signal.SIGKILL)
        _, second = judge_with_retries(slot, task("well"), never_stopped)
    finally:
        slot.stop()
    assert (second["status"], second["broken"]) == ("graded", {})


@pytest.mark.parametrize(
    ("once", "always", "end"),
    [
        ("once", "killed", "ended by SIGKILL"),
        ("crashes once", "crashes", "crashed usd-core (SIGSEGV)"),
    ],
)
def test_a_file_at_which_a_worker_ended_is_read_once_more(
    odd: PoolSettings,
    temporary: Path,
    monkeypatch: pytest.MonkeyPatch,
    once: str,
    always: str,
    end: str,
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    (_, well), (_, ended) = judged_in_turn(odd, once, always)
    assert (well["status"], well["broken"]) == ("graded", {})
    assert ended["broken"] == {"second.usda": end}


def test_workers_that_never_begin_are_the_tools_fault(odd: PoolSettings) -> None:
    silent = ODD.replace("for line in sys.stdin:", "for line in []:")
    ((_, answer),) = run_tasks([task("well")], replace(odd, program=silent))
    assert status_of(answer["failed"]) == "tool failed"


def test_a_worker_that_does_not_read_is_not_waited_for(impatient: PoolSettings) -> None:
    broken = {"x" * 1000 + str(number): "y" for number in range(300)}  # more than a pipe holds
    sent = Task("well", "well", (), broken=broken)
    answers = [answer for _, answer in run_tasks([task("well, then hangs"), sent], impatient)]
    assert [answer["status"] for answer in answers] == ["graded"] * 2


LARGE_PARENT = """
import sys
from pathlib import Path
from lab3_usd.grade.workers import worker_process
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.worker_process import WorkerDiedError
large = bytearray(b"x") * (60 << 20)
program = Path(sys.argv[1]).read_text()
settings = PoolSettings(None, None, Limits(seconds=20, memory=80 << 20), program=program)
worker = worker_process.start_worker(settings)
try:
    worker_process.ask(worker, Task(sys.argv[2], "", ()), worker_process.never_stopped)
except WorkerDiedError as died:
    print(died.how)
worker_process.end_worker(worker)
"""


@pytest.mark.parametrize(
    ("student", "how"),
    [("crashes", "crashed usd-core (SIGSEGV)"), ("eats", "ran out of memory")],
)
def test_the_memory_of_whoever_started_a_worker_is_not_its_own(
    temporary: Path, student: str, how: str
) -> None:
    odd = temporary / "odd.py"
    eats = (
        '    if student == "eats":\n        x = bytearray(b"x") * (200 << 20)\n        os.abort()\n'
    )
    code = ODD.replace('    if student == "crashes":', eats + '    if student == "crashes":')
    odd.write_text(code)
    done = forking.run(
        [sys.executable, "-c", LARGE_PARENT, str(odd), student],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stdout.strip() == how


def test_a_worker_that_is_stopped_is_left_at_once(worker: Worker) -> None:
    with pytest.raises(WorkerDiedError, match="stopped"):
        ask(worker, task("hangs"), lambda: True)


@pytest.mark.parametrize(
    ("how", "status"),
    [
        ("ran out of time (5 s)", "timeout"),
        ("ran out of memory", "too large"),
        ("too large: holds more than 9 files", "too large"),
        ("tool failed: two workers ended before they read it: stopped", "tool failed"),
        ("this program failed: KeyError at rules.py:1: 'x'", "crashed"),
        ("crashed usd-core (SIGSEGV)", "crashed"),
        ("answered nonsense", "crashed"),
        ("stopped answering", "crashed"),
        ("ended by SIGKILL", "crashed"),
    ],
)
def test_how_a_worker_ended_gives_the_status(how: str, status: str) -> None:
    assert status_of(how) == status


def test_a_submission_is_judged_again_without_the_file_that_ended_the_worker(
    odd: PoolSettings,
) -> None:
    ((judged, answer),) = judged_in_turn(odd, "crashes")
    assert answer["broken"] == {"second.usda": "crashed usd-core (SIGSEGV)"}
    assert judged.broken == answer["broken"]


def test_a_submission_that_ends_every_worker_is_given_up(odd: PoolSettings) -> None:
    ((_, answer),) = judged_in_turn(odd, "early")
    assert answer == {"failed": "ran out of time (0.2 s of processor time)"}


@pytest.mark.parametrize("jobs", [1, 3])
def test_all_others_are_judged_while_some_end_their_workers(odd: PoolSettings, jobs: int) -> None:
    students = ["well"] * 4 + ["crashes", "early"] + ["well"] * 4
    answers = list(run_tasks(map(task, students), replace(odd, jobs=jobs)))
    assert sorted(found.student for found, _ in answers) == sorted(students)
    assert sum(answer.get("status") == "graded" for _, answer in answers) == 9


def test_one_worker_judges_many_submissions(odd: PoolSettings) -> None:
    answers = [answer for _, answer in run_tasks(map(task, ["well"] * 5), odd)]
    assert len({answer["by"] for answer in answers}) == 1


def test_a_worker_is_replaced_after_many_submissions(odd: PoolSettings) -> None:
    slot = WorkerSlot(odd, judged=pool.TASKS_OF_A_WORKER - 2)
    try:
        answers = [judge_with_retries(slot, task("well"))[1] for _ in range(4)]
    finally:
        slot.stop()
    first, second, third, fourth = (answer["by"] for answer in answers)
    assert first == second != third == fourth


def test_a_run_that_is_given_up_ends_its_workers(odd: PoolSettings) -> None:
    answers = run_tasks(map(task, ["well", *["hangs"] * 20]), odd)
    _, answer = next(answers)
    answers.close()  # type: ignore[attr-defined]  # it is a generator
    with pytest.raises(ProcessLookupError):
        os.kill(answer["by"], 0)


# Asks one odd worker after the other, and waits where it is told to.
RUN = """
import signal, sys, time
from pathlib import Path
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.pool import run_tasks
# Whoever started the tests may ignore signals, which is inherited.
signal.signal(signal.SIGHUP, signal.SIG_IGN if sys.argv[1] == "ignored" else signal.SIG_DFL)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
tasks = [Task(name, name, ()) for name in ("well", sys.argv[3])]
settings = PoolSettings(None, None, Limits(), program=Path(sys.argv[2]).read_text())
for task, _ in run_tasks(tasks, settings):
    print(task.student, flush=True)
    # A signal that comes just before a long sleep is handled only after it.
    for _ in range(600 if sys.argv[1] == "outside" else 0):
        time.sleep(0.1)
"""


def running(temporary: Path, where: str, student: str = "hangs") -> subprocess.Popen[bytes]:
    """Start a run in a process of its own, and wait for its first answer."""
    odd = temporary.parent / "odd.py"
    odd.write_text(ODD)
    process = forking.Popen(
        [sys.executable, "-c", RUN, where, str(odd), student],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"well\n"
    return process


# Has one submission judged, alone or as a machine of a cluster, for a fifth of a second at most.
JUDGED = """
import pickle
import sys
from pathlib import Path
from lab3_usd.grade.workers.machine import judge_here
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task, encode
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.pool import run_tasks
from lab3_usd.grade.workers.shipment import Shipment
from lab3_usd.report.options import tool_version
task, program = Task(sys.argv[3], "", ()), Path(sys.argv[2]).read_text()
settings = PoolSettings(None, None, Limits(seconds=0.2), program=program)
if sys.argv[1] == "cluster":
    shipment = pickle.dumps(Shipment((), settings))
    print(judge_here(tool_version(), b"", shipment, encode(task)))
else:
    for _, answer in run_tasks([task], settings):
        print(answer)
"""


@pytest.mark.parametrize("how", ["alone", "cluster"])
@pytest.mark.parametrize("stopped", ["the run", "the run and its worker"])
def test_a_pause_of_the_run_takes_no_points(
    tmp_path: Path, temporary: Path, stopped: str, how: str
) -> None:
    odd = tmp_path / "odd.py"
    odd.write_text(ODD)
    command = [sys.executable, "-c", JUDGED, how, str(odd), f"waits in {tmp_path}"]
    process = forking.Popen(
        command, stdout=subprocess.PIPE, env={**os.environ, "TMPDIR": str(temporary)}
    )
    assert eventually((tmp_path / "waiting").exists)
    worker = int((tmp_path / "waiting").read_text())
    paused = [process.pid, *([worker] if stopped.endswith("worker") else [])]
    for number in paused:
        os.kill(number, signal.SIGSTOP)
    (tmp_path / "go").touch()
    assert stopped != "the run" or eventually((tmp_path / "answered").exists)
    time.sleep(0.3)  # longer than a file may take
    for number in paused:
        os.kill(number, signal.SIGCONT)
    assert process.communicate(timeout=60)[0] == b"{'status': 'graded', 'broken': {}}\n"


def test_time_that_nobody_was_awake_for_does_not_count() -> None:
    clock = AwakeClock(iter((0.0, 0.5, 1.25, 4000.0, 4000.5)).__next__)
    assert [clock.seconds() for _ in range(4)] == [0.5, 1.25, 2.25, 2.75]


def test_a_file_at_which_a_worker_stood_still_is_read_once_more(
    impatient: PoolSettings, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    ((_, well),) = judged_in_turn(impatient, "hangs once")
    assert (well["status"], well["broken"]) == ("graded", {})


@pytest.mark.parametrize("where", ["inside", "outside"])
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_run_that_is_told_to_end_leaves_nothing_behind(
    temporary: Path, name: str, where: str
) -> None:
    process = running(temporary, where)
    assert list(temporary.glob("*/lab3-grade-*"))
    process.send_signal(getattr(signal, name))
    _, errors = process.communicate(timeout=60)
    assert process.returncode != 0
    number = getattr(signal, name).value
    assert errors.splitlines()[-1] == f"lab3_usd.errors.EndedBySignalError: {number}".encode()
    assert list(temporary.iterdir()) == []


GRADED = """
import signal, sys
from pathlib import Path
from msgspec.structs import replace
from lab3_usd.__main__ import start
from lab3_usd.grade.workers import pool
from lab3_usd.grade.workers.worker_process import start_worker
for name in ("SIGHUP", "SIGTERM"):
    signal.signal(getattr(signal, name), signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
program = Path(sys.argv[1]).read_text()
pool.start_worker = lambda settings, stopped: start_worker(
    replace(settings, program=program), stopped
)
sys.argv = ["lab3", "grade", *sys.argv[2:]]
start()
"""


@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_that_ends_grading_gives_the_status_that_shells_show(
    tmp_path: Path, temporary: Path, name: str, status: int
) -> None:
    submission(tmp_path / "class" / "hangs", "00")
    odd = tmp_path / "odd.py"
    says = f'    if student == "hangs":\n        open("{tmp_path}/hanging", "w").close()\n'
    code = ODD.replace('    while student == "hangs":', says + '    while student == "hangs":')
    odd.write_text(code)
    given = [tmp_path / "class", "--starter", starter(), "--output", tmp_path / "out"]
    process = forking.Popen(
        [sys.executable, "-c", GRADED, str(odd), *map(str, given)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    assert eventually((tmp_path / "hanging").exists)
    process.send_signal(getattr(signal, name))
    _, errors = process.communicate(timeout=60)
    said = errors.split(b"\n")
    assert said[0].startswith(b"lab3: 0 of 1 done; continue with: lab3 grade ")
    assert (process.returncode, errors.strip().split(b"\n")[-1]) == (status, b"lab3: interrupted")


def test_an_interrupt_waits_until_the_locks_of_the_answers_are_free_again(
    odd: PoolSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    came_back = []

    def interrupted_wait(*args: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        came_back.append(True)
        return wait(*args)

    monkeypatch.setattr(processes, "wait", interrupted_wait)
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        list(run_tasks([task("well")], odd))
    signal.signal(signal.SIGINT, inherited)
    assert came_back == [True]


def test_a_signal_that_is_ignored_stays_ignored(tmp_path: Path, temporary: Path) -> None:
    process = running(temporary, "ignored", f"waits in {tmp_path}")
    assert eventually((tmp_path / "waiting").exists)
    process.send_signal(signal.SIGHUP)
    (tmp_path / "go").touch()
    said, _ = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, f"waits in {tmp_path}\n".encode())


def test_after_a_run_signals_are_handled_as_before(odd: PoolSettings) -> None:
    assert len(list(run_tasks([task("well")], odd))) == 1
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_thread_may_run_tasks(odd: PoolSettings) -> None:
    found: list[object] = []
    thread = threading.Thread(target=lambda: found.extend(run_tasks([task("well")], odd)))
    thread.start()
    thread.join()
    assert len(found) == 1


def test_what_a_killed_run_left_is_removed_by_the_next(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    ours = scratch.make_scratch("lab3-grade-")
    killed = running(temporary, "inside")
    (left,) = set(temporary.glob("*/lab3-grade-*")) - {ours.parent}
    scratch.remove_abandoned([])
    assert left.exists()  # it is in use
    killed.kill()
    killed.communicate(timeout=60)
    assert left.exists()
    scratch.remove_abandoned([])
    assert sorted(ours.parent.parent.glob("lab3-*")) == [ours.parent]
    scratch.remove_scratch(ours)
    assert list(temporary.iterdir()) == []


def test_a_worker_that_does_not_start_is_an_error_that_says_why(odd: PoolSettings) -> None:
    settings = replace(odd, program="raise SystemExit('no such module')")
    with pytest.raises(WorkerError, match="no such module"):
        list(run_tasks(map(task, ["well"]), settings))


@pytest.mark.parametrize(
    ("said", "heard"),
    [
        (
            b"short\n" + b"x" * 5000 + b"\n",
            [b"short\n", "too large: answers more than 0.00390625 MB"],
        ),
        (
            b"1\n2\n3\n4\n5\n",
            [b"1\n", b"2\n", b"3\n", b"4\n", "too large: answers more than 0.00390625 MB"],
        ),
        (b"short\ncut off", [b"short\n", None]),
    ],
)
def test_an_answer_without_end_is_not_read_for_ever(
    worker: Worker, said: bytes, heard: list[object]
) -> None:
    inlet, outlet = os.pipe()
    os.write(outlet, said)
    os.close(outlet)
    listener = Worker(worker.process, worker.scratch, Limits(answer_size=4096))
    worker_process._listen(listener, os.fdopen(inlet, "rb"))
    assert [listener.lines.get_nowait() for _ in heard] == heard
    assert listener.lines.empty()


def test_a_task_survives_the_way_to_a_worker() -> None:
    sent = Task(
        "jané", "jane-1", (Source(Path("/a b"), "c.usda"),), late=True, broken={"a": "b"}, known="k"
    )
    assert decoded_message(encode(sent), Task) == sent


def test_names_that_are_no_text_survive_the_way_to_a_worker() -> None:
    sent = Task("jane", "jane", (Source(Path("/class/\udcff"), "\udcff.usda"),))
    assert decoded_message(encode(sent), Task) == sent


@pytest.mark.parametrize("line", [b"[" * 100_000, b'"\xff"', b'{"turn": "first"}', b"[1]", b""])
def test_a_line_that_is_no_message_is_refused(line: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - of several kinds
        decoded_message(line, Reply)


def test_the_environment_of_a_worker_holds_no_plugin_path_and_no_secret(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PXR_PLUGINPATH_NAME", "PYTHONPATH", "AWS_SECRET_ACCESS_KEY", "https_proxy"):
        monkeypatch.setenv(name, str(tmp_path))
    known = worker_process.environment(tmp_path)
    assert set(known) <= {
        *worker_process._KEPT_VARIABLES,
        "HOME",
        "TMPDIR",
        "PXR_WORK_THREAD_LIMIT",
        "MALLOC_ARENA_MAX",
    }


def test_a_worker_finds_the_programs_that_its_grader_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert worker_process.environment(tmp_path)["PATH"] == str(tmp_path)


WRITES = """
import json, sys
sys.stdin.readline()
print(json.dumps({"confined": {"caches": sys.dont_write_bytecode}}), flush=True)
sys.stdin.readline()
"""


def test_a_worker_writes_no_cache_beside_the_program(odd: PoolSettings) -> None:
    made = start_worker(replace(odd, program=WRITES))
    end_worker(made)
    assert made.confined == {"caches": True}


# -- real workers


def settings_for(place: Path, **limits: float) -> PoolSettings:
    return PoolSettings(starter(), None, Limits(**limits), (place,))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("function", "error"),
    [
        ("subprocess.Popen", BlockingIOError(11, "Resource temporarily unavailable")),
        ("threading.Thread.start", RuntimeError("can't start new thread")),
    ],
)
def test_a_worker_that_cannot_start_leaves_no_folder(
    odd: PoolSettings, monkeypatch: pytest.MonkeyPatch, function: str, error: Exception
) -> None:
    def fail(*_arguments: object, **_options: object) -> None:
        raise error

    made: list[Path] = []
    make = worker_process.make_scratch
    monkeypatch.setattr(
        worker_process, "make_scratch", lambda prefix: made.append(make(prefix)) or made[-1]
    )
    monkeypatch.setattr(f"lab3_usd.grade.workers.worker_process.{function}", fail)
    with pytest.raises(WorkerError, match=r"a worker does not start: (Resource|can't start)"):
        start_worker(odd)
    assert [folder.exists() for folder in made] == [False]


def test_a_real_worker_judges_and_leaves_nothing_behind(tmp_path: Path) -> None:
    submission(tmp_path / "jane", "00", "01")
    made = start_worker(settings_for(tmp_path))
    try:
        sent = Task("jane", "jane", (Source(tmp_path / "jane"),))
        answer = ask(made, sent, never_stopped)
        left = sorted(path.name for path in made.scratch.iterdir())
    finally:
        end_worker(made)
    assert answer["verdicts"] == {"00": "pass", "01": "pass"}
    assert left == ["stderr.txt"]
    assert not made.scratch.exists()


# Prints, and reads, instead of judging, a file of the student at work and that of another one.
CURIOUS = """
import sys
sys.path[:0] = sys.argv[1:]
from lab3_usd.grade.workers import worker_main
def read(path):
    try:
        return path.read_text()
    except PermissionError:
        return "refused"
def look(setup, task, scratch, announce):
    print("x", file=sys.__stdout__, flush=True)
    own = task.sources[0].path
    return {name: read(own.parent / name / "file") for name in ("ann", "ben")}
worker_main.grade_submission = look
worker_main.serve()
"""


def test_a_worker_reads_its_own_submission_alone_and_what_it_prints_is_no_answer(
    tmp_path: Path,
) -> None:
    for student in ("ann", "ben"):
        (tmp_path / "class" / student).mkdir(parents=True)
        (tmp_path / "class" / student / "file").write_text("read")
    made = start_worker(replace(settings_for(tmp_path / "class"), program=CURIOUS))
    try:
        if not made.confined["files"]:
            pytest.skip("this kernel has no Landlock")
        sources = {name: (Source(tmp_path / "class" / name),) for name in ("ann", "ben")}
        seen = {name: ask(made, Task(name, name, sources[name])) for name in sources}
    finally:
        end_worker(made)
    assert seen == {
        "ann": {"ann": "read", "ben": "refused"},
        "ben": {"ann": "refused", "ben": "read"},
    }


def test_a_real_worker_unpacks_the_archive_of_a_student(tmp_path: Path) -> None:
    submission(tmp_path / "Lab3", "00", "01")
    (tmp_path / "jane").mkdir()
    with tarfile.open(tmp_path / "jane" / "Lab3.tar.gz", "w:gz") as tar:
        tar.add(tmp_path / "Lab3", "Lab3")
    sent = Task("jane", "jane", (Source(tmp_path / "jane"),))
    ((_, answer),) = run_tasks([sent], settings_for(tmp_path))
    assert answer["verdicts"] == {"00": "pass", "01": "pass"}


def test_a_worker_without_enough_memory_says_so(tmp_path: Path) -> None:
    (tmp_path / "jane").mkdir()
    numbers = ", ".join(["1"] * 2_500_000)
    text = f'#usda 1.0\ndef "World" {{\n int[] x = [{numbers}]\n}}\n'
    (tmp_path / "jane" / "Lab3_01_ros_clock.usda").write_text(text)
    settings = settings_for(tmp_path, memory=100 * MEGABYTE, seconds=60)
    ((_, answer),) = run_tasks([Task("jane", "jane", (Source(tmp_path / "jane"),))], settings)
    assert answer["status"] == "too large"
    assert "ran out of memory" in answer["reason"]


def test_what_usd_core_raises_over_a_file_is_no_failure_of_ours() -> None:
    layer = Sdf.Layer.CreateAnonymous()
    with pytest.raises(Tf.ErrorException) as raised:
        layer.ImportFromString("no layer")
    assert _failure_text(raised.value, Path()) == "crashed usd-core (ErrorException)"


def test_a_failure_of_ours_says_what_and_where() -> None:
    with pytest.raises(KeyError) as raised:
        {}["x"]
    how = _failure_text(raised.value, Path())
    assert re.fullmatch(r"this program failed: KeyError: 'x' at test_grade_workers\.py:\d+", how)
    assert status_of(how) == "crashed"


def test_a_failure_of_ours_names_files_by_their_place_in_the_submission(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="gone") as raised:
        (tmp_path / "work" / "gone.usda").read_bytes()
    how = _failure_text(raised.value, tmp_path)
    assert "No such file or directory: 'work/gone.usda' at " in how


class Dying(WorkerSlot):
    """A worker that ends at one file."""

    def ask(self, task: Task, *_how: object) -> dict[str, str]:
        if "next.usda" in task.broken:
            return {"status": "graded"}
        raise WorkerDiedError("ran out of memory", "next.usda")


@pytest.mark.parametrize(("broken", "goes_on"), [(11, True), (12, False)])
def test_after_twelve_files_that_end_a_worker_the_rest_is_not_tried(
    odd: PoolSettings, broken: int, *, goes_on: bool
) -> None:
    files = {f"{number}.usda": "x" for number in range(broken)}
    judged, answer = judge_with_retries(Dying(odd), Task("jane", "jane", (), broken=files))
    assert ("status" in answer, "next.usda" in judged.broken) == (goes_on, goes_on)


def test_the_memory_of_a_process_that_was_waited_for_is_not_known() -> None:
    process = subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])
    process.wait()
    assert worker_process._figures(process) == (3, 0, 0.0)
