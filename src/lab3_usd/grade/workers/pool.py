"""Runs tasks with worker processes of this computer, and tries again what may have been chance."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from dataclasses import dataclass

from msgspec.structs import replace

from lab3_usd.grade.intake.remote import fetched
from lab3_usd.grade.intake.submission_copy import TooLargeError, UnreachedError
from lab3_usd.grade.workers.worker_messages import (
    CRASHED,
    FAULT,
    TOO_LARGE,
    TOOL_FAILED,
    Answer,
    Json,
    PoolSettings,
    Task,
)
from lab3_usd.grade.workers.worker_process import (
    Worker,
    WorkerDiedError,
    WorkerError,
    ask,
    end_worker,
    never_stopped,
    out_of_all_time,
    start_worker,
)
from lab3_usd.pipeline.processes import Stopped, answers_of

_MOST_BROKEN = 12  # files that end a worker, after which the rest is not tried
TASKS_OF_A_WORKER = 250  # usd-core keeps some memory until its process ends


@dataclass(slots=True)
class WorkerSlot:
    """The place of one worker, which is replaced when it dies or has judged many submissions."""

    settings: PoolSettings
    worker: Worker | None = None
    judged: int = 0

    def ask(self, task: Task, stopped: Stopped, seconds: float) -> Json:
        """Have a task judged by the worker of this slot, which is started where there is none.

        Raises:
            WorkerDiedError: the worker died, and was removed.
            UnreachedError: what was handed in did not reach it.
        """
        self.worker = worker = self.worker or self._new(stopped)
        folder = worker.scratch / "fetched"
        try:
            sources = fetched(task.sources, folder, self.settings.limits, stopped)
            answer = ask(worker, replace(task, sources=sources), stopped, seconds)
            if FAULT in answer:
                raise UnreachedError(str(answer[FAULT]))
            missing = sorted(name for name, held in worker.confined.items() if not held)
            if missing:  # what the worker could not give up, for the record
                answer |= {"unconfined": missing}
        except TooLargeError as error:
            answer = {"failed": f"{TOO_LARGE}: {error}"}
        except WorkerDiedError:
            self.stop()
            raise
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        self.judged += 1
        if self.judged % TASKS_OF_A_WORKER == 0:
            self.stop()
        return answer

    def _new(self, stopped: Stopped) -> Worker:
        """Start a worker, again where it ends before it is ready."""
        try:
            return start_worker(self.settings, stopped)
        except WorkerError:
            if stopped():
                raise
            return start_worker(self.settings, stopped)

    def stop(self) -> None:
        """End the worker of this slot, if there is one."""
        if self.worker is not None:
            end_worker(self.worker)
            self.worker = None


def judge_with_retries(slot: WorkerSlot, task: Task, stopped: Stopped = never_stopped) -> Answer:
    """Judge a task, again without the file that ended a worker, until there is an answer.

    A worker that ended for a reason outside of the task, or stood still, is replaced once. A file
    at which a worker crashed is read once more: usd-core itself crashes now and then.

    Raises:
        UnreachedError: it did not reach the judge, by no fault of its own.
    """
    left, spare = slot.settings.limits.all_seconds, 1
    crashed: set[str] = set()
    while not stopped():
        try:
            return task, slot.ask(task, stopped, left)
        except WorkerDiedError as error:
            died = error
        left -= died.seconds
        if left <= 0:
            return task, {"failed": out_of_all_time(slot.settings.limits)}
        if died.external and spare:
            spare -= 1
        elif died.file and died.how.startswith(CRASHED) and died.file not in crashed:
            crashed.add(died.file)
        elif died.external and not died.file:
            raise UnreachedError(f"two workers ended before they read it: {died.how}")
        elif not died.file or died.file in task.broken or len(task.broken) >= _MOST_BROKEN:
            return task, {"failed": died.how}
        else:
            task = replace(task, broken={**task.broken, died.file: died.how})
    return task, {}


Runner = Callable[[Iterable[Task], PoolSettings], Generator[Answer]]


def run_tasks(tasks: Iterable[Task], settings: PoolSettings) -> Generator[Answer]:
    """Yield each task with its answer, as soon as it is there, whatever became of the worker.

    Raises:
        WorkerError: workers cannot be started.
    """
    slots = [WorkerSlot(settings) for _ in range(settings.jobs)]
    return answers_of(tasks, slots, _judge, WorkerSlot.stop)


def _judge(slot: WorkerSlot, task: Task, stopped: Stopped) -> Answer:
    """Judge a task, once more where it does not reach the judge."""
    try:
        with suppress(UnreachedError):
            return judge_with_retries(slot, task, stopped)
        return judge_with_retries(slot, task, stopped)
    except UnreachedError as error:
        return task, {"failed": f"{TOOL_FAILED}: {error}"}
