"""Hands tasks to workers, and starts a new worker whenever one dies, hangs or grows."""

from __future__ import annotations

import atexit
import contextlib
import queue
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from msgspec.structs import replace

from lab3_usd.grade.intake import TooLargeError
from lab3_usd.grade.interrupt import interrupted_by_signals
from lab3_usd.grade.judge import Json, Task
from lab3_usd.grade.outcome import OUT_OF_TIME, TOO_LARGE, TOOL_FAILED
from lab3_usd.grade.remote import fetched
from lab3_usd.grade.staging import source_message
from lab3_usd.grade.worker_process import (
    DiedError,
    PoolSettings,
    Worker,
    WorkerError,
    ask,
    end_worker,
    start_worker,
)

_MOST_BROKEN = 12  # files that end a worker, after which the rest is not tried
_TASKS_OF_A_WORKER = 250  # what usd-core keeps for itself goes with the worker
_Answer = tuple[Task, Json]
_Answers = queue.Queue["_Answer | Exception | None"]


def run_tasks(tasks: Iterable[Task], settings: PoolSettings) -> Iterator[_Answer]:
    """Yield each task with its answer, as soon as it is there, whatever became of the worker.

    Raises:
        WorkerError: workers cannot be started.
    """
    waiting = iter(tasks)
    lock, stopped = threading.Lock(), threading.Event()
    answers: _Answers = queue.Queue(64)

    def next_task() -> Task | None:
        with lock:
            return None if stopped.is_set() else next(waiting, None)

    def serve() -> None:
        try:
            for pair in serve_tasks(next_task, settings, stopped.is_set):
                answers.put(pair)
        except Exception as error:  # noqa: BLE001 - raised again in the caller's thread
            answers.put(error)
        answers.put(None)

    threads = [threading.Thread(target=serve, daemon=True) for _ in range(settings.jobs)]

    def end() -> None:
        stopped.set()
        _drain(answers, threads)

    # What interrupts the caller does not close this generator before everything ends.
    atexit.register(end)
    try:
        with interrupted_by_signals():
            for thread in threads:
                thread.start()
            yield from _collect(answers, len(threads))
    finally:
        end()
        atexit.unregister(end)


def _collect(answers: _Answers, running: int) -> Iterator[_Answer]:
    while running:
        found = answers.get()
        if found is None:
            running -= 1
        elif isinstance(found, Exception):
            raise found
        else:
            yield found


def _drain(answers: _Answers, threads: list[threading.Thread]) -> None:
    """Let the threads end, also those that wait for room in the queue."""
    while any(thread.is_alive() for thread in threads):
        with contextlib.suppress(queue.Empty):
            answers.get(timeout=0.05)


@dataclass(slots=True)
class Seat:
    """Where one worker sits after the other; each thread has its own."""

    settings: PoolSettings
    worker: Worker | None = None
    judged: int = 0

    def ask(self, task: Task, stopped: Callable[[], bool], seconds: float) -> Json:
        """Ask the worker that sits here, or a new one; one that died leaves."""
        self.worker = worker = self.worker or self._new(stopped)
        folder = worker.scratch / "fetched"
        try:
            with fetched(task, folder, self.settings.limits, stopped) as here:
                found = ask(worker, message_of(here), stopped, seconds) | _unconfined(worker)
        except TooLargeError as error:
            found = {"failed": f"{TOO_LARGE}: {error}"}
        except DiedError:
            self.leave()
            raise
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        self.judged += 1
        if self.judged % _TASKS_OF_A_WORKER == 0:
            self.leave()
        return found

    def _new(self, stopped: Callable[[], bool]) -> Worker:
        """Start a worker, again where it ends before it is ready."""
        try:
            return start_worker(self.settings, stopped)
        except WorkerError:
            if stopped():
                raise
            return start_worker(self.settings, stopped)

    def leave(self) -> None:
        """End the worker that sits here, if any."""
        if self.worker is not None:
            end_worker(self.worker)
            self.worker = None


def _unconfined(worker: Worker) -> Json:
    """Return what a worker could not give up, for the record; nothing where it gave up all."""
    missing = sorted(name for name, held in worker.confined.items() if not held)
    return {"unconfined": missing} if missing else {}


def serve_tasks(
    next_task: Callable[[], Task | None], settings: PoolSettings, stopped: Callable[[], bool]
) -> Iterator[_Answer]:
    """Judge tasks in one worker after the other until there are no more."""
    seat = Seat(settings)
    try:
        while (task := next_task()) is not None:
            found = judge_in(seat, task, stopped)
            if not stopped():
                yield found
    finally:
        seat.leave()


def judge_in(seat: Seat, task: Task, stopped: Callable[[], bool]) -> _Answer:
    """Judge a task, again without the file that ended a worker, until there is an answer.

    A worker that ended for no reason in the task is replaced once.
    """
    left, spare = seat.settings.limits.all_seconds, 1
    while not stopped():
        found = _try(seat, task, stopped, left)
        if not isinstance(found, DiedError):
            return task, found
        left -= found.seconds
        if left <= 0:
            whole = seat.settings.limits.all_seconds
            return task, {"failed": f"{OUT_OF_TIME} ({whole:g} s for all files)"}
        if found.innocent and spare:
            spare -= 1
            continue
        task, answer = _after(task, found)
        if answer is not None:
            return task, answer
    return task, {}


def _try(seat: Seat, task: Task, stopped: Callable[[], bool], seconds: float) -> Json | DiedError:
    try:
        return seat.ask(task, stopped, seconds)
    except DiedError as died:
        return died


def _after(task: Task, died: DiedError) -> tuple[Task, Json | None]:
    """Return the task without the file that ended the worker, or what to record where none did."""
    broken = dict(task.broken or {})
    if died.innocent and not died.file:
        return task, {"failed": f"{TOOL_FAILED}: two workers ended before they read it: {died.how}"}
    if not died.file or died.file in broken or len(broken) >= _MOST_BROKEN:
        return task, {"failed": died.how}
    broken[died.file] = died.how
    return replace(task, broken=broken), None


def message_of(task: Task) -> Json:
    """Return a task as plain data, to be read by `worker.task_of`."""
    return {
        "student": task.student,
        "folder": task.folder,
        "sources": [source_message(source) for source in task.sources],
        "late": task.late,
        "name": task.name,
        "broken": dict(task.broken or {}),
        "known": task.known,
    }
