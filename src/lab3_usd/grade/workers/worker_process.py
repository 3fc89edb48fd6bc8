"""Starts, asks and ends one worker process, and tells how it ended."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NamedTuple, NoReturn, TypeVar

from msgspec import Struct

from lab3_usd.data import LAB_VARIABLE, PACKAGE
from lab3_usd.errors import Lab3Error, exit_text
from lab3_usd.grade.awake import AwakeClock
from lab3_usd.grade.intake.scratch import make_scratch, remove_scratch
from lab3_usd.grade.intake.submission_copy import MEGABYTE, Limits
from lab3_usd.grade.workers.worker_messages import (
    CRASHED,
    KILLED,
    OUT_OF_MEMORY,
    OUT_OF_TIME,
    TOO_LARGE,
    Assignment,
    Json,
    PoolSettings,
    Ready,
    Reply,
    Start,
    Task,
    decoded_message,
    encode,
)

END_SECONDS = 2.0  # for a process that closed its pipe to end, and for a killed one to be gone
CLOSED = "stopped answering"
_POLL_SECONDS = 0.02
# Nothing in a file sends these: somebody outside does, or a system that is short of memory.
_FROM_OUTSIDE = {"SIGKILL", "SIGTERM", "SIGINT", "SIGHUP"}
_OUT_OF_TIME = "SIGPROF"  # by `sandbox.limit_time`


class ProcessEnd(NamedTuple):
    """How a process ended, whether that came from outside, and its processor time in seconds."""

    how: str
    external: bool = False
    processor: float = 0.0  # 0 where it is not known


def how_it_ended(process: subprocess.Popen[bytes], memory: int, seconds: float) -> ProcessEnd:
    """Say how a process ended that closed its pipe.

    More than `memory` bytes say that it ran out of it. A process that goes on after so many
    seconds is killed.
    """
    clock = AwakeClock()
    while not (ended := _has_ended(process)) and clock.seconds() < seconds:
        time.sleep(_POLL_SECONDS)
    kill(process)
    if not ended:
        return ProcessEnd(CLOSED)
    status, peak, processor = _figures(process)
    name = exit_text(status)
    if name == _OUT_OF_TIME:
        return ProcessEnd(OUT_OF_TIME, processor=processor)
    if peak > memory:
        return ProcessEnd(OUT_OF_MEMORY, processor=processor)
    if status >= 0:
        return ProcessEnd(f"ended the worker ({name})", processor=processor)
    external = name in _FROM_OUTSIDE
    return ProcessEnd(
        f"{KILLED} {name}" if external else f"{CRASHED} ({name})", external, processor
    )


def _has_ended(process: subprocess.Popen[bytes]) -> bool:
    """Whether a process has ended; its figures stay where they are, as long as that is possible."""
    if not hasattr(os, "waitid") or process.returncode is not None:
        return process.poll() is not None
    try:
        flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
        return os.waitid(os.P_PID, process.pid, flags) is not None
    except ChildProcessError:
        return True


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and everything it started; a process that was waited for has no group."""
    if process.returncode is None:
        with contextlib.suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()


class _Figures(NamedTuple):
    """The exit status of a process, its most memory in bytes and its processor time in seconds."""

    status: int
    memory: int = 0  # 0 where it is not known
    processor: float = 0.0


def _figures(process: subprocess.Popen[bytes]) -> _Figures:
    """Return what is known of a process that has ended."""
    if not hasattr(os, "wait4") or process.returncode is not None:
        return _Figures(process.wait())
    try:
        _, status, usage = os.wait4(process.pid, 0)
    except ChildProcessError:
        return _Figures(process.wait())
    process.returncode = os.waitstatus_to_exitcode(status)
    scale = 1 if sys.platform == "darwin" else 1024
    processor = usage.ru_utime + usage.ru_stime
    return _Figures(process.returncode, usage.ru_maxrss * scale, processor)


_PIPE_POLL_SECONDS = 0.2
_LEAST_COUNTED = 1024  # bytes; millions of short lines take memory too
STOPPED, NONSENSE = "stopped", "answered nonsense"
_Message = TypeVar("_Message", bound=Struct)


class WorkerDiedError(Exception):
    """A worker ended or was ended before it answered.

    `how` and `file` say how and over which file. `external` is what the machine may have brought
    about and not the task: somebody killed the worker, it stood still, or it ended before it began.
    `seconds` is the processor time that the task has taken of its own.
    """

    def __init__(self, how: str, file: str, *, external: bool = False, seconds: float = 0) -> None:
        """Keep what is known of the end."""
        super().__init__(how)
        self.how = how
        self.file = file
        self.external = external
        self.seconds = seconds


@dataclass(slots=True)
class Worker:
    """A worker process, the folder it may write to, and the lines that it says.

    After the last comes None, or why the rest is not read. `said` counts bytes since it was asked,
    `turns` its tasks: it numbers what it says by them. `peak` is the memory in bytes that it had
    when it was ready, as inherited from the process that started it.
    """

    process: subprocess.Popen[bytes]
    scratch: Path
    limits: Limits
    lines: queue.Queue[bytes | str | None] = field(default_factory=queue.Queue)
    tasks: queue.Queue[bytes | None] = field(default_factory=queue.Queue)
    threads: tuple[threading.Thread, ...] = ()
    bytes_read: int = 0
    turns: int = 0
    peak: int = 0
    confined: Mapping[str, bool] = field(default_factory=dict)


def hold_pipes(worker: Worker) -> Iterator[threading.Thread]:
    """Start the two threads that write to and read from a worker, and yield them."""
    for hold, pipe in ((_speak, worker.process.stdin), (_listen, worker.process.stdout)):
        thread = threading.Thread(target=hold, args=(worker, pipe), daemon=True)
        thread.start()
        yield thread


def _listen(worker: Worker, stream: IO[bytes]) -> None:
    """Pass on the lines of a worker, as many bytes as an answer may have."""
    most, end = worker.limits.answer_size, None
    with stream, contextlib.suppress(OSError, ValueError):
        while line := stream.readline(most + 1):
            worker.bytes_read += max(len(line), _LEAST_COUNTED)
            if worker.bytes_read > most:
                end = f"{TOO_LARGE}: answers more than {most / MEGABYTE:.7g} MB"
                break
            if not line.endswith(b"\n"):
                break
            worker.lines.put(line)
    worker.lines.put(end)


def _speak(worker: Worker, stream: IO[bytes]) -> None:
    """Write a request to a worker; the death of one shows where it is read."""
    with contextlib.suppress(OSError, ValueError), stream:
        while (line := worker.tasks.get()) is not None:
            stream.write(line)
            stream.flush()


@dataclass(slots=True)
class Turn:
    """What a worker says about one task, which may take `whole` seconds of processor time.

    The worker's own limit ends it then. What it says is heard before the clock is looked at, by
    which it has much longer.
    """

    worker: Worker
    whole: float
    stopped: Callable[[], bool]
    file: str = ""
    begun: float | None = None
    spent: float = 0.0
    clock: AwakeClock = field(default_factory=AwakeClock)

    def fail(self, how: str, *, external: bool = False) -> NoReturn:
        """Raise how the worker ended; a failure before the task began is external."""
        external = external or (self.begun is None and how != STOPPED)
        raise WorkerDiedError(how, self.file, external=external, seconds=self.spent)

    def spend(self, processor: float) -> None:
        """Note the processor time of the worker, which counts from when the task began."""
        if self.begun is None:
            self.begun = processor
        self.spent = max(self.spent, processor - self.begun)

    def next(self, kind: type[_Message], seconds: float) -> _Message:
        """Return what the worker says next, within `seconds` by the clock."""
        silent = self.clock.seconds() + seconds
        while True:
            if self.stopped():
                self.fail(STOPPED)
            with contextlib.suppress(queue.Empty):
                return self._decoded(kind, self.worker.lines.get(timeout=_PIPE_POLL_SECONDS))
            if self.clock.seconds() > silent:
                self._stand_still(f"{seconds:g} s by the clock", seconds)

    def go_on(self) -> None:
        """End a worker that goes on for too long by the clock, whatever progress it makes."""
        most = self.worker.limits.by_clock(self.whole)
        if self.clock.seconds() > most:
            self._stand_still(f"{most:g} s by the clock for all files", most)

    def _stand_still(self, what: str, seconds: float) -> NoReturn:
        self.spent = max(self.spent, seconds / self.worker.limits.clock_times)
        self.fail(f"{OUT_OF_TIME} ({what})", external=True)

    def _decoded(self, kind: type[_Message], line: bytes | str | None) -> _Message:
        if isinstance(line, str):
            self.fail(line)
        if line is None:
            limits = self.worker.limits
            memory = max(limits.memory // 2, self.worker.peak)
            patience = min(END_SECONDS, limits.by_clock(limits.seconds))
            end, spent = how_it_ended(self.worker.process, memory, patience), self.spent
            if self.begun is not None:
                self.spend(end.processor)
            if end.how == OUT_OF_TIME:
                self._be_out_of_time(self.whole - spent)
            self.fail(end.how, external=end.external)
        try:
            return decoded_message(line, kind)
        except ValueError:
            self.fail(NONSENSE)

    def _be_out_of_time(self, left: float) -> NoReturn:
        """Raise which limit of processor time it was: that of the file or that of all files."""
        limits = self.worker.limits
        if left <= limits.seconds:
            self.spent = self.whole
            self.fail(out_of_all_time(limits))
        self.fail(f"{OUT_OF_TIME} ({limits.seconds:g} s of processor time)")


def out_of_all_time(limits: Limits) -> str:
    """Say that a submission has taken all the processor time that it has."""
    return f"{OUT_OF_TIME} ({limits.all_seconds:g} s of processor time for all files)"


_START_SECONDS = 120.0
# `-I` keeps the working directory, which holds untrusted files, off the path of modules.
# `-B`: a worker writes to its own folder alone, so that no cache is written beside the program.
_KEPT_VARIABLES = ("PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "SYSTEMROOT", "TZ")


class WorkerError(Lab3Error):
    """A worker cannot be started; the line is its last output."""


def never_stopped() -> bool:
    """Nobody stops this."""
    return False


def start_worker(settings: PoolSettings, stopped: Callable[[], bool] = never_stopped) -> Worker:
    """Start a worker and wait until it is ready.

    Raises:
        WorkerError: it does not get ready, or `stopped` became true.
    """
    scratch = make_scratch("lab3-grade-")
    # Where the worker finds this package, and what this process finds beside it.
    package = str(PACKAGE.parent)
    path = [
        package,
        *(name for name in sys.path if name and name != package and Path(name).is_dir()),
    ]
    command = [sys.executable, "-I", "-B", "-c", settings.program, *path]
    log = scratch / "stderr.txt"
    try:
        with log.open("wb") as errors:
            process = subprocess.Popen(  # noqa: S603 - our own module
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                cwd=scratch,
                env=environment(scratch, settings.lab),
                start_new_session=True,
            )
    except OSError as error:
        remove_scratch(scratch)
        raise WorkerError(f"a worker does not start: {error.strerror}") from error
    worker = Worker(process, scratch, settings.limits)
    try:
        worker.threads = tuple(hold_pipes(worker))
        worker.tasks.put(encode(Start(scratch, settings)))
        ready = Turn(worker, _START_SECONDS, stopped).next(Ready, _START_SECONDS)
        worker.confined, worker.peak = ready.confined, ready.peak
    except BaseException as error:  # also an interrupt, which may come at any time
        last = log.read_text(errors="replace").strip().splitlines()
        end_worker(worker)
        if isinstance(error, (WorkerDiedError, RuntimeError)):  # the system starts no more threads
            why = last[-1] if last else error
            raise WorkerError(f"a worker does not start: {why}") from error
        raise
    return worker


def environment(scratch: Path, lab: Path | None = None) -> dict[str, str]:
    """Return the environment of a worker: no plugin path, no search path, no proxy, no secret."""
    kept = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
    if lab is not None:
        kept[LAB_VARIABLE] = str(lab)
    # Each submission is judged in a thread; memory that one gave back is for the next.
    one = {"PXR_WORK_THREAD_LIMIT": "1", "MALLOC_ARENA_MAX": "1"}
    return kept | {"HOME": str(scratch), "TMPDIR": str(scratch)} | one


def ask(
    worker: Worker,
    task: Task,
    stopped: Callable[[], bool] = never_stopped,
    seconds: float | None = None,
) -> Json:
    """Give a worker a task and return its answer, which may take `seconds` of processor time.

    Raises:
        WorkerDiedError: it died, took too long over a file or altogether, wrote too much, or
            `stopped` became true.
    """
    limits = worker.limits
    turn = Turn(worker, limits.all_seconds if seconds is None else seconds, stopped)
    if not worker.lines.empty():  # it ended, or speaks without being asked
        turn.next(Reply, limits.seconds)
        turn.fail(NONSENSE)
    worker.bytes_read, worker.turns = 0, worker.turns + 1
    worker.tasks.put(encode(Assignment(worker.turns, task, turn.whole)))
    while True:
        reply = turn.next(Reply, limits.by_clock(limits.seconds))
        if reply.turn != worker.turns:  # it still speaks of the task before
            turn.fail(NONSENSE, external=True)
        turn.spend(reply.processor)
        if reply.done is not None:
            if "died" in reply.done:
                turn.fail(str(reply.done["died"]))
            return reply.done
        if reply.open is None:
            turn.fail(NONSENSE)
        turn.file = reply.open
        turn.go_on()


def end_worker(worker: Worker) -> None:
    """End a worker, whatever it is doing, and remove its folder."""
    kill(worker.process)
    with contextlib.suppress(subprocess.TimeoutExpired):  # it hangs in the kernel; it may
        worker.process.wait(END_SECONDS)
    worker.tasks.put(None)
    for thread in worker.threads:
        thread.join(END_SECONDS)
    remove_scratch(worker.scratch)
