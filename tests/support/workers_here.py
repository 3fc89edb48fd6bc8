"""Grading without worker processes, where a test is not about them: all else is as ever."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from threading import Lock
from typing import NamedTuple
from unittest.mock import patch

from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.gradebook import Rows
from lab3_usd.grade.workers import pool, worker_main
from lab3_usd.grade.workers.messages import Json, PoolSettings, Task
from lab3_usd.grade.workers.submission_grading import GradingSetup

TURN = Lock()  # judging changes the working directory


class WorkerHere(NamedTuple):
    """What stands for a worker process."""

    setup: GradingSetup
    scratch: Path
    confined: dict[str, bool]


def graded_here(settings: ClassSettings) -> Rows:
    with workers_here():
        return grade_class(settings)


@contextmanager
def workers_here() -> Iterator[None]:
    """Let this process do what workers do."""
    parts = {"start_worker": _start, "ask": _ask, "end_worker": _end}
    with patch.multiple(pool, **parts):
        yield


def _start(settings: PoolSettings, _stopped: Callable[[], bool]) -> WorkerHere:
    return WorkerHere(worker_main.load_setup(settings), Path(mkdtemp()), {})


def _ask(worker: WorkerHere, task: Task, _stopped: Callable[[], bool], _seconds: float) -> Json:
    with TURN:
        return worker_main.answer(worker.setup, task, worker.scratch, lambda _name: None)


def _end(worker: WorkerHere) -> None:
    shutil.rmtree(worker.scratch)
