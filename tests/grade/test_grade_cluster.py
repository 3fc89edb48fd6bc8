"""Judging on more than one machine: the same grades, also when a machine goes away half-way."""

from __future__ import annotations

import gc
import importlib
import signal
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from clusters import cluster_of, graded_on, machine
from other_labs import cut_wire, files_below, stage, starter, submission

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.workers.cluster import Cluster, cluster_runner
from lab3_usd.grade.workers.pool import run_tasks
from lab3_usd.grade.workers.scheduler import Patience
from lab3_usd.grade.workers.worker_process import WorkerError

pytestmark = [
    pytest.mark.timeout(300),  # machines are started, waited for and lost
    pytest.mark.usefixtures("forked_workers"),
]

STUDENTS = 4


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class of several students, one of them with a fault, one with a file of rubbish."""
    folder = tmp_path_factory.mktemp("class") / "class"
    for number in range(STUDENTS):
        submission(folder / f"s{number}", "00", "01")
    cut_wire(folder / "s1" / "work" / stage("01").name)
    (folder / "s2" / "work" / stage("01").name).write_text("rubbish")
    return folder


@pytest.fixture(scope="module")
def alone(place: Path) -> dict[str, bytes]:
    """The gradebook of a run on this computer alone."""
    out = place.parent / "alone"
    grade_class(ClassSettings(place, starter(), out))
    return files_below(out)


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_machine_gives_the_same_gradebook(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    with cluster_of(2, tmp_path / "temporary") as cluster:
        lost, _ = cluster.machines

        def kill(done: int, total: int) -> None:
            del total
            if done == 2:
                lost.process.kill()

        found = graded_on(cluster, place, tmp_path / "book", progress=kill)
        assert lost.process.wait() == -signal.SIGKILL
    assert found == alone


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_without_workers_is_an_error_that_says_what_to_start(
    place: Path, tmp_path: Path
) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed")
    with (
        cluster_of(0, tmp_path / "temporary") as empty,
        pytest.raises(UsageError, match=r"no worker; start one with `dask worker tcp://"),
    ):
        graded_on(empty, place, tmp_path / "book", patience=Patience(to_find=0.3))


@pytest.mark.filterwarnings("ignore")
def test_a_machine_that_joins_later_goes_on_for_the_first(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    temporary = tmp_path / "temporary"
    with ExitStack() as later, cluster_of(1, temporary) as lone:
        (first,) = lone.machines

        def exchange(done: int, total: int) -> None:
            del total
            if done == 1:
                first.process.send_signal(signal.SIGSTOP)  # with the tasks that it has
                later.enter_context(machine(lone.scheduler_address, temporary))
                with distributed.Client(lone.scheduler_address) as watching:
                    watching.wait_for_workers(2, timeout=60)
                first.process.kill()

        found = graded_on(lone, place, tmp_path / "book", progress=exchange)
        assert first.process.wait() == -signal.SIGKILL
    assert found == alone


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_all_workers_is_an_error_and_what_is_graded_stays(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The machine may have answered once more before it is killed; the others are never sent.
    monkeypatch.setattr("lab3_usd.grade.workers.cluster._PER_THREAD", 1)
    with (
        cluster_of(1, tmp_path / "temporary") as lone,
        pytest.raises(WorkerError, match=r"have gone; start others, .* --resume"),
    ):
        graded_on(
            lone,
            place,
            tmp_path / "book",
            patience=Patience(to_return=0.5),
            progress=lambda done, _total: lone.machines[0].process.kill() if done == 1 else None,
        )
    graded = list((tmp_path / "book" / "students").iterdir())
    assert 1 <= len(graded) < STUDENTS - 1


def test_workers_are_waited_for_anew_each_time_that_they_go(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed")
    now, known = 0.0, dict[str, int]()
    client = SimpleNamespace(
        status="running",
        sync=lambda *_, **__: known,
        scheduler=SimpleNamespace(ncores=None),
    )
    shipment = SimpleNamespace(status="finished")
    monkeypatch.setattr("lab3_usd.grade.workers.cluster.time.monotonic", lambda: now)
    cluster = Cluster(client, "tcp://host:1", lambda: shipment, b"", print)
    cluster.look()
    now = 19.0
    cluster.look()
    known["tcp://host:2"] = 1  # it is back, and goes again
    now = 25.0
    cluster.look()
    known.clear()
    now = 100.0
    cluster.look()
    now = 119.0
    cluster.look()
    now = 121.0
    with pytest.raises(WorkerError, match="have gone; start others"):
        cluster.look()


class ClosedCluster(NamedTuple):
    """A gradebook of submissions by address, what was said of its cluster, and what lay there."""

    book: dict[str, bytes]
    said: list[str]
    while_open: set[str]
    after: set[str]


@pytest.fixture(scope="module")
def closed(place: Path, tmp_path_factory: pytest.TempPathFactory) -> ClosedCluster:
    folder = tmp_path_factory.mktemp("closed")
    temporary = folder / "temporary"
    said: list[str] = []
    with ExitStack() as later:
        with cluster_of(0, temporary) as lone:
            judge = later.enter_context(machine(lone.scheduler_address, temporary))
            book = graded_on(lone, place.as_uri(), folder / "book", said.append)
            while_open = names_in(temporary)
        assert judge.process.wait(timeout=60) == 0
    return ClosedCluster(book, said, while_open, names_in(temporary))


def names_in(temporary: Path) -> set[str]:
    """Return the beginnings of the names of what grading keeps there."""
    found = (*temporary.glob("lab3-*"), *temporary.glob("*/lab3-*"))
    return {path.name.rpartition("-")[0] for path in found}


@pytest.mark.filterwarnings("ignore")
def test_submissions_by_address_give_the_same_gradebook(
    closed: ClosedCluster, alone: dict[str, bytes]
) -> None:
    assert closed.book == alone


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_on_this_computer_alone_needs_no_tls_and_nothing_is_said(
    closed: ClosedCluster,
) -> None:
    assert closed.said == []


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_is_closed_leaves_no_files_of_students(closed: ClosedCluster) -> None:
    assert closed.while_open == {"lab3-scratch", "lab3-grade", "lab3-starter"}
    assert closed.after == set()


def test_submissions_by_address_are_judged_without_a_cluster(
    place: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    pytest.importorskip("fsspec", reason="fsspec is not installed")
    grade_class(ClassSettings(place.as_uri(), starter(), tmp_path / "book"))
    assert files_below(tmp_path / "book") == alone


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_is_not_there_is_an_error(place: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed")
    runner = cluster_runner("tcp://127.0.0.1:1", patience=Patience(to_connect=0.3))
    with pytest.raises(UsageError, match="no Dask scheduler"):
        grade_class(ClassSettings(place, starter(), tmp_path / "book", runner=runner))
    gc.collect()  # what Dask leaves of a client that never was is its own affair


@pytest.mark.parametrize("missing", ["distributed", "fsspec.core"])
def test_without_the_extra_the_error_says_what_to_install(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    really = importlib.import_module

    def without(name: str) -> Any:
        if name == missing:
            raise ImportError(name)
        return really(name)

    monkeypatch.setattr(importlib, "import_module", without)
    settings = ClassSettings(
        place if missing == "distributed" else place.as_uri(),
        starter(),
        tmp_path / "book",
        runner=cluster_runner("tcp://127.0.0.1:1") if missing == "distributed" else run_tasks,
    )
    with pytest.raises(UsageError, match=r"the extra cluster"):
        grade_class(settings)
