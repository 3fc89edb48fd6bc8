"""Does work with several workers at once, each of which a thread asks, and ends them at the end.

A worker is a process, or a place on a cluster. What is tried again is for the one who asks it. The
executor of `concurrent.futures` for processes gives up all work when one process ends, does not say
which piece of it was the reason, and cannot end a process that is busy.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager, nullcontext, suppress
from itertools import islice
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import FrameType
from typing import Any, TypeVar

from lab3_usd.errors import EndedBySignalError, exit_text
from lab3_usd.errors import interrupt as default_interrupt

_Worker = TypeVar("_Worker")
_Work = TypeVar("_Work")
_Answer = TypeVar("_Answer")
Stopped = Callable[[], bool]  # whether nobody waits for an answer any more
_POLL_INTERVAL = 0.2  # seconds until an interrupt is looked at


def answers_of(
    works: Iterable[_Work],
    workers: Sequence[_Worker],
    ask: Callable[[_Worker, _Work, Stopped], _Answer],
    end: Callable[[_Worker], object],
) -> Generator[_Answer]:
    """Yield what `ask` returns of a worker for each piece of work, as soon as it is there.

    It is to return soon when it is stopped. Then all workers are ended, also by a signal.
    """
    executor = ThreadPoolExecutor(len(workers) or 1)
    free: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
    for worker in workers:
        free.put(worker)
    is_over = is_waiting = False  # signals set them, which must not wait for a lock
    signals: list[int] = []

    def answer(work: _Work) -> _Answer:
        worker = free.get()
        try:
            return ask(worker, work, lambda: is_over)
        finally:
            free.put(worker)

    def interrupt(number: int) -> None:
        nonlocal is_over
        is_over = True
        signals.append(number)
        # The waiting for futures holds their locks: an exception in the middle of it would keep
        # them for ever, and the threads that want to give their answers with them.
        if not is_waiting:
            raise EndedBySignalError(number)

    def end_all() -> None:
        nonlocal is_over
        is_over = True
        executor.shutdown(cancel_futures=True)
        for worker in workers:
            end(worker)

    waiting, pending = iter(works), set[Future[_Answer]]()
    # An interrupt in the caller's code does not close this generator before the program ends.
    atexit.register(end_all)
    try:
        with _signals_handled(interrupt):
            while True:
                is_waiting = True
                # As many again wait, so that no worker is idle while the caller uses an answer.
                further = islice(waiting, 2 * len(workers) - len(pending))
                pending.update(executor.submit(answer, work) for work in further)
                done, pending = wait(pending, _POLL_INTERVAL, FIRST_COMPLETED)
                is_waiting = False
                if signals:
                    raise EndedBySignalError(signals[0])
                if not done and not pending:
                    return
                for future in done:
                    yield future.result()
    finally:
        end_all()
        atexit.unregister(end_all)


@contextmanager
def _signals_handled(interrupt: Callable[[int], None]) -> Iterator[None]:
    """Call `interrupt` once at SIGINT, SIGTERM or SIGHUP.

    Signals that are ignored (`nohup`) or handled stay as they are. Only the main thread may handle
    signals; in others nothing changes.
    """
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        numbers = {getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP")}
        present = {number: signal.getsignal(number) for number in numbers if number is not None}
        ours = (signal.SIG_DFL, signal.default_int_handler, default_interrupt)
        handlers = {number: handler for number, handler in present.items() if handler in ours}

    def handle(number: int, _frame: FrameType | None) -> None:
        for each in handlers:  # cleaning up is not to be interrupted again
            signal.signal(each, signal.SIG_IGN)
        interrupt(number)

    for number in handlers:
        signal.signal(number, handle)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            with suppress(ValueError):  # a generator may be closed by another thread
                signal.signal(number, handler)


# macOS has threads of its own in a process, which a fork breaks; Windows cannot fork.
_METHOD = "spawn" if sys.platform in {"darwin", "win32"} else "forkserver"
# Imported once, by the server that all processes are forked from.
_PRELOADED = "lab3_usd.pipeline.preloaded"
_ENVIRONMENT = {
    # One thread each: others would not live through a fork, and the processors are shared already.
    "PXR_WORK_THREAD_LIMIT": "1",
    "TF_ENV_SETTING_ALERTS_ENABLED": "0",  # usd-core would announce the setting
    "PYTHONSAFEPATH": "1",  # modules in the working directory are none of ours
}
_IS_SAFE_PATH_KNOWN = sys.version_info >= (3, 11)
_SECONDS_TO_END = 5.0
_starting = threading.Lock()  # whoever starts a process also asks which of the others have ended


def in_processes(
    do: Callable[[_Work], _Answer],
    ended: Callable[[_Work, str], _Answer],
    works: Sequence[_Work],
    jobs: int,
) -> Iterator[_Answer]:
    """Yield what `do` returns for each piece of work, in order.

    Where a process ends at its work, the answer is what `ended` returns for it and the reason.
    """
    if _METHOD == "forkserver":
        with _inherited():
            forkserver.set_forkserver_preload([_PRELOADED])
            forkserver.ensure_running()
    workers = [_Process(do) for _ in range(jobs)]
    early: dict[int, tuple[Any, ...] | str] = {}
    number = 0
    with closing(
        answers_of(enumerate(works), workers, _Process.ask, _Process.end)
    ) as numbered_answers:
        for place, answer in numbered_answers:
            early[place] = answer
            while number in early:
                work, own = works[number], early.pop(number)
                number += 1
                if isinstance(own, str):
                    yield ended(work, own)
                else:  # what raised there raises here as well, with its place in the code
                    yield own[0] if own else do(work)


class _Process:
    """A process that does what it is sent, started when it is needed; another one after its end."""

    def __init__(self, do: Callable[[Any], Any]) -> None:
        self._do = do
        self._process: BaseProcess | None = None
        self._pipe: Any = None

    def ask(self, work: tuple[int, Any], stopped: Stopped) -> tuple[int, tuple[Any, ...] | str]:
        """Return the number of a piece of work and its answer, or how the process ended."""
        if self._process is None:
            self._start()
        try:
            with suppress(OSError):  # an ended process is noticed at its answer
                self._pipe.send(work[1])
            while not self._pipe.poll(_POLL_INTERVAL):
                if stopped():
                    return work[0], ()
            return work[0], self._pipe.recv()
        except (EOFError, OSError):
            return work[0], exit_text(self.end(_SECONDS_TO_END))

    def _start(self) -> None:
        context: Any = multiprocessing.get_context(_METHOD)
        with _starting:
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_serve, args=(theirs, self._do), daemon=True)
            with nullcontext() if _METHOD == "forkserver" else _inherited():
                self._process.start()
            theirs.close()

    def end(self, seconds: float = 0.0) -> int:
        """End the process, unless it ends by itself in so many seconds, and return its status."""
        process, self._process = self._process, None
        if process is None:
            return 0
        with _starting:
            process.join(seconds)
            process.kill()
            process.join()
        self._pipe.close()
        return process.exitcode or 0


@contextmanager
def _inherited() -> Iterator[None]:
    """Set what programs that start here find: the environment, and that Ctrl-C is not for them.

    Python 3.10 knows no safe path: it starts where only its own modules are, and then goes back.
    """
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    is_main = threading.current_thread() is threading.main_thread()  # others handle no signals
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if is_main else None
    os.environ.update(_ENVIRONMENT)
    here = "" if _IS_SAFE_PATH_KNOWN else os.getcwd()  # noqa: PTH109 - as the system has it
    if here:
        os.chdir(os.path.dirname(os.__file__))  # noqa: PTH120
    try:
        yield
    finally:
        if here:
            os.chdir(here)
        if is_main:
            signal.signal(signal.SIGINT, handler)
        for name, value in before.items():
            os.environ.pop(name)
            os.environ.update({} if value is None else {name: value})


def _serve(pipe: Connection, do: Callable[[Any], Any]) -> None:
    """Do what comes, until nothing more can come; an empty answer means that it raised."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # not every system lets it be inherited
    with suppress(EOFError, OSError):
        while True:
            work = pipe.recv()
            try:
                answer: tuple[Any, ...] = (do(work),)
            except Exception:  # noqa: BLE001 - the one who asked does it again, and raises
                answer = ()
            pipe.send(answer)
