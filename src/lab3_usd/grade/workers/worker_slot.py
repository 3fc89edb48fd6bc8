"""Judges tasks in one worker after the other: one that dies, hangs or grows is replaced."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass

from msgspec.structs import replace

from lab3_usd.grade.intake.limits import TooLargeError
from lab3_usd.grade.intake.remote import fetched
from lab3_usd.grade.workers.messages import (
    CRASHED,
    OUT_OF_TIME,
    TOO_LARGE,
    TOOL_FAILED,
    Answer,
    Json,
    PoolSettings,
    Task,
)
from lab3_usd.grade.workers.worker_pipes import Worker, WorkerDiedError
from lab3_usd.grade.workers.worker_process import (
    WorkerError,
    ask,
    end_worker,
    never_stopped,
    start_worker,
)

_MOST_BROKEN = 12  # files that end a worker, after which the rest is not tried
_TASKS_OF_A_WORKER = 250  # usd-core keeps some memory until its process ends


@dataclass(slots=True)
class WorkerSlot:
    """The place of one worker, which is replaced when it dies or has judged many submissions."""

    settings: PoolSettings
    worker: Worker | None = None
    judged: int = 0

    def ask(self, task: Task, stopped: Callable[[], bool], seconds: float) -> Json:
        """Have a task judged by the worker of this slot, which is started where there is none.

        Raises:
            WorkerDiedError: the worker died, and was removed.
        """
        self.worker = worker = self.worker or self._new(stopped)
        folder = worker.scratch / "fetched"
        try:
            sources = fetched(task.sources, folder, self.settings.limits, stopped)
            here = replace(task, sources=sources)
            found = ask(worker, here, stopped, seconds) | _unconfined(worker)
        except TooLargeError as error:
            found = {"failed": f"{TOO_LARGE}: {error}"}
        except WorkerDiedError:
            self.stop()
            raise
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        self.judged += 1
        if self.judged % _TASKS_OF_A_WORKER == 0:
            self.stop()
        return found

    def _new(self, stopped: Callable[[], bool]) -> Worker:
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


def _unconfined(worker: Worker) -> Json:
    """Return what a worker could not give up, for the record; nothing where it gave up all."""
    missing = sorted(name for name, held in worker.confined.items() if not held)
    return {"unconfined": missing} if missing else {}


def judge_in(slot: WorkerSlot, task: Task, stopped: Callable[[], bool] = never_stopped) -> Answer:
    """Judge a task, again without the file that ended a worker, until there is an answer.

    A worker that ended for a reason outside of the task is replaced once. A file at which a worker
    crashed is read once more: usd-core itself crashes now and then.
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
            whole = slot.settings.limits.all_seconds
            return task, {"failed": f"{OUT_OF_TIME} ({whole:g} s for all files)"}
        if died.external and spare:
            spare -= 1
            continue
        if died.file and died.how.startswith(CRASHED) and died.file not in crashed:
            crashed.add(died.file)
            continue
        task, answer = _after(task, died)
        if answer is not None:
            return task, answer
    return task, {}


def _after(task: Task, died: WorkerDiedError) -> tuple[Task, Json | None]:
    """Return the task without the file that ended the worker, or what to record where none did."""
    if died.external and not died.file:
        return task, {"failed": f"{TOOL_FAILED}: two workers ended before they read it: {died.how}"}
    if not died.file or died.file in task.broken or len(task.broken) >= _MOST_BROKEN:
        return task, {"failed": died.how}
    return replace(task, broken={**task.broken, died.file: died.how}), None
