"""Machines of a cluster that cannot judge: others do, and no student loses a point."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from threading import Thread

import forking
import pytest
from clusters import WITHOUT_LAB3, cluster_of, graded_on, machine, scheduler
from fork_server import FORKED_WORKERS
from machine import eventually
from other_labs import cut_wire, files_below, stage, starter, submission
from web_server import WebServer, served

from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.workers.cluster import cluster_runner
from lab3_usd.grade.workers.scheduler import Patience
from lab3_usd.grade.workers.worker_process import WorkerError

pytestmark = [
    pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed"),
    pytest.mark.timeout(300),  # machines are started and waited for
    pytest.mark.usefixtures("forked_workers"),
    pytest.mark.filterwarnings("ignore"),
]
ANOTHER_RELEASE = """
from lab3_usd.grade.workers import machine
machine.tool_version = lambda: "0.0.1"
"""
FIRST_RELEASE = """
import sys
import lab3_usd.grade.workers
sys.modules["lab3_usd.grade.workers.machine"] = None
"""
# The machine reaches nothing at an address, and says each time that it did not.
WITHOUT_CREDENTIALS = """
from pathlib import Path
from fsspec.implementations.http import HTTPFileSystem
failed = Path({folder!r})
def refuse(*_arguments, **_options):
    (failed / str(len(list(failed.iterdir())))).touch()
    raise PermissionError(13, "Permission denied")
HTTPFileSystem.info = refuse
"""
# It fetches nothing before the other one has failed so many times.
PATIENT = """
import time
from pathlib import Path
from fsspec.implementations.http import HTTPFileSystem
failed, info = Path({folder!r}), HTTPFileSystem.info
def late(*arguments, **options):
    until = time.monotonic() + 100
    while len(list(failed.iterdir())) < 3 and time.monotonic() < until:
        time.sleep(0.05)
    return info(*arguments, **options)
HTTPFileSystem.info = late
"""
WITHOUT_ROOM = """
from lab3_usd.grade.workers import machine
def full(_prefix):
    raise OSError(28, "No space left on device", "/tmp")
machine.make_scratch = full
"""
# What judges there is killed at each stage that it opens, as by a system without memory.
WITHOUT_MEMORY = """
from msgspec.structs import replace
from lab3_usd.grade.workers import pool
start_worker = pool.start_worker
program = '''
import os, signal, sys
sys.path[:0] = sys.argv[1:]
from lab3_usd.grade.workers import worker_main
from lab3_usd.grade.workers import submission_grading
def killed(_folder, _settings, *, may_open, **_options):
    may_open.args[0].announce("work/stage.usda")
    os.kill(os.getpid(), signal.SIGKILL)
submission_grading.check_folder = killed
worker_main.serve()
'''
pool.start_worker = lambda settings, stopped: start_worker(
    replace(settings, program=program), stopped
)
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("class") / "class"
    for number in range(6):
        submission(folder / f"s{number}", "00")
    cut_wire(submission(folder / "s1", "00", "01") / "work" / stage("01").name)
    return folder


@pytest.fixture(scope="module")
def alone(place: Path) -> dict[str, bytes]:
    """The gradebook of a run on this computer alone."""
    out = place.parent / "alone"
    grade_class(ClassSettings(place, starter(), out))
    return files_below(out)


@pytest.fixture
def server(place: Path) -> Iterator[WebServer]:
    forking.preload("fsspec.implementations.http")
    with served(place.parent) as running:
        yield running


def test_machines_with_no_or_another_lab3_are_taken_out_and_named(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    """The scheduler has no lab3 at all, and needs none."""
    said: list[str] = []
    faults = {
        WITHOUT_LAB3: "lab3-usd is not installed there; install lab3-usd ",
        ANOTHER_RELEASE: "lab3-usd 0.0.1 is installed there, not ",
        FIRST_RELEASE: "another release of lab3-usd is installed there, not ",
        WITHOUT_ROOM: "No space left on device: /tmp",
    }
    with scheduler(tmp_path / "s", WITHOUT_LAB3) as running:
        address = running.address
        with (
            machine(address, tmp_path / "m"),
            machine(address, tmp_path / "0", WITHOUT_LAB3) as bare,
            machine(address, tmp_path / "1", ANOTHER_RELEASE) as other,
            machine(address, tmp_path / "2", FIRST_RELEASE) as first,
            machine(address, tmp_path / "3", WITHOUT_ROOM) as full,
        ):
            runner = cluster_runner(address, said.append)
            grade_class(ClassSettings(place, starter(), tmp_path / "book", runner=runner))
            machines = (bare.address, other.address, first.address, full.address)
    assert files_below(tmp_path / "book") == alone
    assert len(said) == len(machines)
    for named, reason in zip(machines, faults.values(), strict=True):
        (line,) = [line for line in said if line.startswith(f"{named}: ")]
        assert line.startswith(f"{named}: judges nothing more in this run: {reason}")


def test_a_cluster_in_which_nobody_can_judge_is_one_error_that_says_why(
    place: Path, tmp_path: Path
) -> None:
    with (
        cluster_of(0, tmp_path / "temporary") as cluster,
        machine(cluster.scheduler_address, tmp_path / "0", WITHOUT_LAB3) as bare,
        pytest.raises(WorkerError) as raised,
    ):
        graded_on(cluster, place, tmp_path / "book", patience=Patience(to_return=0.5))
    assert f"no worker of the cluster can judge ({bare.address}: lab3-usd is" in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1
    assert not list((tmp_path / "book").glob("students/*"))


def test_a_machine_that_reaches_no_submission_takes_no_points_and_is_taken_out(
    server: WebServer, alone: dict[str, bytes], tmp_path: Path
) -> None:
    said: list[str] = []
    failed = tmp_path / "failed"
    failed.mkdir()
    with cluster_of(0, tmp_path / "temporary") as cluster:
        address = cluster.scheduler_address
        with (
            machine(address, tmp_path / "0", WITHOUT_CREDENTIALS.format(folder=str(failed))) as bad,
            machine(address, tmp_path / "1", PATIENT.format(folder=str(failed))),
        ):
            found = graded_on(cluster, f"{server.address}/class", tmp_path / "book", said.append)
    assert found == alone
    (line,) = said
    assert line.startswith(f"{bad.address}: judges nothing more in this run: s")
    assert line.endswith(": cannot be fetched (Permission denied)")


def test_a_machine_that_is_short_of_memory_takes_no_points(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    with (
        cluster_of(1, tmp_path / "temporary") as cluster,
        machine(cluster.scheduler_address, tmp_path / "0", WITHOUT_MEMORY),
    ):
        found = graded_on(cluster, place, tmp_path / "book")
    assert found == alone


def test_what_no_machine_reaches_is_the_tools_failure_named_and_not_exported(
    server: WebServer, alone: dict[str, bytes], tmp_path: Path
) -> None:
    server.fault = lambda path: "gone" if "/s2/work/" in path or "/s4/" in path else None
    book, roster = tmp_path / "book", tmp_path / "roster.csv"
    points = book / "canvas.csv"
    students = [f"s{number}" for number in range(6)]
    with cluster_of(2, tmp_path / "temporary") as cluster:
        command = [
            *[sys.executable, "-m", "lab3_usd", "grade", f"{server.address}/class"],
            *["--starter", str(starter()), "--output", str(book)],
            *["--cluster", cluster.scheduler_address],
        ]
        first = forking.run(command, capture_output=True, text=True, check=False)
        rows = {
            row["student"]: row
            for row in json.loads((book / "grades.json").read_text())["students"]
        }
        possible = rows["s0"]["possible"]
        roster.write_text(
            "Student,ID,SIS User ID,SIS Login ID,Section,Mini (7)\n"
            f"    Points Possible,,,,,{possible:g}\n"
            + "".join(f"{name},{number},{name},{name},A,\n" for number, name in enumerate(students))
        )
        export = [*command[:4], "--output", str(book), "--gradebook", "canvas", "--roster"]
        exported = forking.run([*export, str(roster)], capture_output=True, check=False)
        machines = [machine.address for machine in cluster.machines]
        server.fault = lambda _path: None
        again = forking.run([*command, "--resume"], capture_output=True, text=True, check=False)
    assert first.returncode == 3, first.stderr
    assert {name for name, row in rows.items() if row["status"] != "graded"} == {"s2", "s4"}
    for name in ("s2", "s4"):
        assert rows[name]["status"] == "tool failed"
        assert rows[name]["reason"].startswith(f"tool failed: {name}: ")
        assert all(address in rows[name]["reason"] for address in machines)
    assert exported.returncode == 0
    lines = points.read_text().splitlines()[2:]
    assert [line.partition(",")[0] for line in lines if not line.endswith(",")] == [
        "s0",
        "s1",
        "s3",
        "s5",
    ]
    assert again.returncode == 0
    points.unlink()
    assert files_below(book) == alone


def test_two_graders_use_one_cluster_and_each_has_workers_of_its_own(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    other = tmp_path / "starter.usda"
    other.write_bytes(starter().read_bytes() + b"\n")
    temporary = tmp_path / "temporary"
    with cluster_of(1, temporary) as cluster:

        def grade(started_with: Path, out: Path) -> None:
            runner = cluster_runner(cluster.scheduler_address)
            grade_class(ClassSettings(place, started_with, out, runner=runner))

        second = Thread(target=grade, args=(other, tmp_path / "second"))
        second.start()
        grade(starter(), tmp_path / "first")
        second.join()
        kept = sorted(path.name.rpartition("-")[0] for path in temporary.glob("*/lab3-*"))
    assert files_below(tmp_path / "first") == alone
    assert len(files_below(tmp_path / "second")) == len(alone)
    assert kept == ["lab3-grade"] * 2 + ["lab3-starter"] * 2


def test_a_scheduler_that_is_lost_is_one_line_and_what_is_graded_stays(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    book = tmp_path / "book"
    command = [
        *[sys.executable, "-m", "lab3_usd", "grade", str(place)],
        *["--starter", str(starter()), "--output", str(book)],
    ]
    hold = f"""
import time
from pathlib import Path
from lab3_usd.grade.workers import machine
judge = machine.judge_here
def held(*arguments):
    while list(Path({str(book)!r}).glob("students/*/result.json")):
        time.sleep(0.05)
    return judge(*arguments)
machine.judge_here = held
"""
    environment = {**os.environ, **FORKED_WORKERS}
    with (
        scheduler(tmp_path / "s") as running,
        machine(running.address, tmp_path / "m", hold),
        forking.Popen(
            [*command, "--cluster", running.address],
            stdout=forking.PIPE,
            stderr=forking.PIPE,
            env=environment,
            text=True,
        ) as grading,
    ):
        assert eventually(lambda: list(book.glob("students/*/result.json")))
        running.process.kill()
        _, said = grading.communicate(timeout=120)
    assert grading.returncode == 2
    assert said == (
        f"lab3: {running.address}: the scheduler of the cluster has gone; start it and its workers "
        "again, and continue with --resume, which keeps what is graded\n"
    )
    assert list(book.glob("students/*/result.json"))
    forking.run([*command, "--resume"], check=True, stdout=forking.DEVNULL, env=environment)
    assert files_below(book) == alone
