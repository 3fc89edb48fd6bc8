"""Grading without worker processes, where a test is not about them: all else is as ever.

A right stage of the small lab is judged once, for whoever hands it in, and with `judged_once` a
whole submission, for whoever hands it in again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from threading import Lock
from typing import NamedTuple
from unittest.mock import patch

import other_labs
from msgspec.structs import replace

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.gradebook import Rows
from lab3_usd.grade.intake.staging import StagedSubmission
from lab3_usd.grade.workers import pool, submission_grading, worker_main
from lab3_usd.grade.workers.submission_grading import GradingSetup
from lab3_usd.grade.workers.worker_messages import Json, PoolSettings, Task
from lab3_usd.model.finding import StageResult
from lab3_usd.pipeline import folder as pipeline_folder
from lab3_usd.pipeline.stage import JudgeSettings, judge_stage
from lab3_usd.pipeline.starter_comparison import Starter
from lab3_usd.spec.lab import Lab

GRADE = submission_grading.grade_staged
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
    judging = {"judge_stage": _judge_once}
    with patch.multiple(pool, **parts), patch.multiple(pipeline_folder, **judging):
        yield


@contextmanager
def judged_once() -> Iterator[None]:
    """Judge equal copies of what a student handed in once; nothing else may change judging."""
    with patch.object(submission_grading, "grade_staged", _grade_once):
        yield


_GRADED: dict[bytes, bytes] = {}


def _grade_once(
    setup: GradingSetup, task: Task, staged: StagedSubmission, announce: Callable[[str], None]
) -> Json:
    starter = Path(setup.starter.path) if setup.starter else Path(os.devnull)
    settings = setup.settings
    if (
        settings.supplied_map
        or setup.supplied
        or os.environ.get(LAB_VARIABLE) != str(other_labs.MINI)
    ):
        return GRADE(setup, task, staged, announce)
    asked = replace(task, sources=(), known="", folder="")
    copied = replace(staged, folder=Path())
    given = (
        setup.rubric.digest,
        settings.limits,
        settings.merge,
        settings.with_report,
        settings.named,
        starter.name,
    )
    parts = (repr((asked, copied, given)).encode(), starter.read_bytes())
    key = hashlib.sha256(b"\0".join(parts)).digest()
    if key not in _GRADED:
        _GRADED[key] = pickle.dumps(GRADE(setup, task, staged, announce))
    return pickle.loads(_GRADED[key])  # type: ignore[no-any-return]  # noqa: S301


_SETUPS: dict[tuple[str, bytes], GradingSetup] = {}


def _start(settings: PoolSettings, _stopped: Callable[[], bool]) -> WorkerHere:
    return WorkerHere(_setup(settings), Path(mkdtemp()), {})


def _setup(settings: PoolSettings) -> GradingSetup:
    """Load what is judged with; once for equal settings with the starter of the small lab."""
    is_mini = os.environ.get(LAB_VARIABLE) == str(other_labs.MINI)
    if not is_mini or settings.starter != other_labs.starter() or settings.assets:
        return worker_main.load_setup(settings)
    rubric = settings.rubric.read_bytes() if settings.rubric else b""
    key = repr(replace(settings, readable=(), jobs=1)), rubric
    if key not in _SETUPS:
        _SETUPS[key] = worker_main.load_setup(settings)
    return _SETUPS[key]


def _ask(worker: WorkerHere, task: Task, _stopped: Callable[[], bool], _seconds: float) -> Json:
    with TURN:
        return worker_main.answer(worker.setup, task, worker.scratch, lambda _name: None)


def _end(worker: WorkerHere) -> None:
    shutil.rmtree(worker.scratch)


_JUDGED: dict[tuple[str, Path | None], StageResult] = {}


def _judge_once(path: str, settings: JudgeSettings, at: tuple[Lab, str]) -> StageResult:
    starter = settings.starter.path if isinstance(settings.starter, Starter) else None
    if starter not in {None, other_labs.starter()} or not _is_right(path, at[1]):
        return judge_stage(path, settings, at)
    key = at[1], starter
    if key not in _JUDGED:
        _JUDGED[key] = judge_stage(path, settings, at)
    return replace(_JUDGED[key], path=path)


def _is_right(path: str, number: str) -> bool:
    """Whether a file is the stage of a checkpoint that the small lab builds."""
    if os.environ.get(LAB_VARIABLE) != str(other_labs.MINI):
        return False
    return Path(path).read_bytes() == other_labs.stage(number).read_bytes()
