"""Runs tasks on threads with a worker process each, or on a cluster."""

from __future__ import annotations

import atexit
import queue
import shutil
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from types import FrameType

from msgspec.structs import replace

from lab3_usd.errors import EndedBySignalError
from lab3_usd.errors import interrupt as default_interrupt
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

_MOST_BROKEN = 12  # files that end a worker, after which the rest is not tried
TASKS_OF_A_WORKER = 250  # usd-core keeps some memory until its process ends


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


def judge_with_retries(
    slot: WorkerSlot, task: Task, stopped: Callable[[], bool] = never_stopped
) -> Answer:
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
            continue
        if died.file and died.how.startswith(CRASHED) and died.file not in crashed:
            crashed.add(died.file)
            continue
        task, answer = _after(task, died)
        if answer is not None:
            return task, answer
    return task, {}


def _after(task: Task, died: WorkerDiedError) -> tuple[Task, Json | None]:
    """Return the task without the file that ended the worker, or what to record where none did.

    Raises:
        UnreachedError: the worker did not begin to read it.
    """
    if died.external and not died.file:
        raise UnreachedError(f"two workers ended before they read it: {died.how}")
    if not died.file or died.file in task.broken or len(task.broken) >= _MOST_BROKEN:
        return task, {"failed": died.how}
    return replace(task, broken={**task.broken, died.file: died.how}), None


_POLL_INTERVAL = 0.2  # seconds until an interrupt is looked at
Runner = Callable[[Iterable[Task], PoolSettings], Generator[Answer]]


def run_tasks(tasks: Iterable[Task], settings: PoolSettings) -> Generator[Answer]:
    """Yield each task with its answer, as soon as it is there, whatever became of the worker.

    Raises:
        WorkerError: workers cannot be started.
    """
    pool, waiting = _ThreadPool(settings), iter(tasks)
    # An interrupt in the caller's code does not close this generator before the program ends.
    atexit.register(pool.end)
    try:
        with interrupted_by_signals(pool.stop) as interrupt:
            with interrupt.put_off():
                # As many again wait, so that no worker is idle while the caller writes an answer.
                pending = {pool.submit(task) for task in islice(waiting, 2 * settings.jobs)}
            while pending:
                with interrupt.put_off():
                    done, pending = wait(pending, _POLL_INTERVAL, FIRST_COMPLETED)
                    pending.update(pool.submit(task) for task in islice(waiting, len(done)))
                for future in done:
                    yield future.result()
    finally:
        pool.end()
        atexit.unregister(pool.end)


class _ThreadPool:
    """Threads of this process that judge, with a worker for each."""

    def __init__(self, settings: PoolSettings) -> None:
        self._executor = ThreadPoolExecutor(settings.jobs)
        self._slots = [WorkerSlot(settings) for _ in range(settings.jobs)]
        self._free: queue.SimpleQueue[WorkerSlot] = queue.SimpleQueue()
        self._is_stopped = False  # a signal sets it, which must not wait for a lock
        for slot in self._slots:
            self._free.put(slot)

    def submit(self, task: Task) -> Future[Answer]:
        return self._executor.submit(self._judge, task)

    def _judge(self, task: Task) -> Answer:
        """Judge a task, once more where it does not reach the judge."""
        slot = self._free.get()
        try:
            with suppress(UnreachedError):
                return judge_with_retries(slot, task, lambda: self._is_stopped)
            return judge_with_retries(slot, task, lambda: self._is_stopped)
        except UnreachedError as error:
            return task, {"failed": f"{TOOL_FAILED}: {error}"}
        finally:
            self._free.put(slot)

    def stop(self) -> None:
        """Have the threads leave what they are at; they look several times a second."""
        self._is_stopped = True

    def end(self) -> None:
        self.stop()
        self._executor.shutdown(cancel_futures=True)
        for slot in self._slots:
            slot.stop()


class _Interrupt:
    """Raises EndedBySignalError at a signal, or after a part that must not be cut short.

    The waiting for futures holds their locks: an exception in the middle of it would keep them
    for ever, and the threads that want to give their answers with them.
    """

    def __init__(self) -> None:
        self._is_put_off = False
        self._has_come: EndedBySignalError | None = None

    def come(self, number: int) -> None:
        """Raise that this signal came, now or later."""
        self._has_come = EndedBySignalError(number)
        if not self._is_put_off:
            raise self._has_come

    @contextmanager
    def put_off(self) -> Iterator[None]:
        """Raise pending errors on exit."""
        self._is_put_off = True
        try:
            yield
        finally:
            self._is_put_off = False
        if self._has_come is not None:
            raise self._has_come


@contextmanager
def interrupted_by_signals(stop: Callable[[], None]) -> Iterator[_Interrupt]:
    """Call `stop` and raise EndedBySignalError once at SIGINT, SIGTERM or SIGHUP.

    Signals that are ignored (`nohup`) or handled stay as they are. Only the main thread may handle
    signals; in others nothing changes.
    """
    interrupt = _Interrupt()
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        numbers = {getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP")}
        present = {number: signal.getsignal(number) for number in numbers if number is not None}
        ours = (signal.SIG_DFL, signal.default_int_handler, default_interrupt)
        handlers = {number: handler for number, handler in present.items() if handler in ours}

    def handle(number: int, _frame: FrameType | None) -> None:
        stop()
        for each in handlers:  # cleaning up is not to be interrupted again
            signal.signal(each, signal.SIG_IGN)
        interrupt.come(number)

    for number in handlers:
        signal.signal(number, handle)
    try:
        yield interrupt
    finally:
        for number, handler in handlers.items():
            with suppress(ValueError):  # a generator may be closed by another thread
                signal.signal(number, handler)
