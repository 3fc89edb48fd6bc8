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
from typing import IO, NoReturn, TypeVar

from msgspec import Struct

from lab3_usd.data import LAB_VARIABLE, PACKAGE
from lab3_usd.errors import Lab3Error
from lab3_usd.grade.intake.scratch import make_scratch, remove_scratch
from lab3_usd.grade.intake.submission_copy import MEGABYTE, Limits
from lab3_usd.grade.workers.messages import (
    CRASHED,
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
    decode,
    encode,
)

END_SECONDS = 2.0  # for a process that closed its pipe to end, and for a killed one to be gone
CLOSED = "stopped answering"
_POLL_SECONDS = 0.02
# Nothing in a file sends these: somebody outside does, or a system that is short of memory.
_FROM_OUTSIDE = {"SIGKILL", "SIGTERM", "SIGINT", "SIGHUP"}


def how_it_ended(process: subprocess.Popen[bytes], memory: int) -> tuple[str, bool]:
    """Say how a process ended that closed its pipe, and whether that came from outside.

    More than `memory` bytes say that it ran out of it. A process that goes on is killed.
    """
    until = time.monotonic() + END_SECONDS
    while not (ended := _has_ended(process)) and time.monotonic() < until:
        time.sleep(_POLL_SECONDS)
    kill(process)
    if not ended:
        return CLOSED, False
    status, peak = _figures(process)
    if peak > memory:
        return OUT_OF_MEMORY, False
    if status >= 0:
        return f"ended the worker (status {status})", False
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    return (f"ended by {name}", True) if name in _FROM_OUTSIDE else (f"{CRASHED} ({name})", False)


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


def _figures(process: subprocess.Popen[bytes]) -> tuple[int, int]:
    """Return the exit status of a process that has ended, and the most memory that it had.

    The memory is in bytes, 0 where it is not known.
    """
    if not hasattr(os, "wait4") or process.returncode is not None:
        return process.wait(), 0
    try:
        _, status, usage = os.wait4(process.pid, 0)
    except ChildProcessError:
        return process.wait(), 0
    process.returncode = os.waitstatus_to_exitcode(status)
    scale = 1 if sys.platform == "darwin" else 1024
    return process.returncode, usage.ru_maxrss * scale


_PIPE_POLL_SECONDS = 0.2
_LEAST_COUNTED = 1024  # bytes; millions of short lines take memory too
STOPPED, NONSENSE = "stopped", "answered nonsense"
_Message = TypeVar("_Message", bound=Struct)


class WorkerDiedError(Exception):
    """A worker ended or was ended before it answered."""

    def __init__(self, how: str, file: str, *, external: bool = False, seconds: float = 0) -> None:
        """Keep how and over which file; `external` is what nothing in the task brought about."""
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
    """What a worker says about one task, for at most so many seconds."""

    worker: Worker
    whole: float
    stopped: Callable[[], bool]
    file: str = ""
    begun: bool = False
    started: float = field(default_factory=time.monotonic)

    def fail(self, how: str, *, external: bool = False) -> NoReturn:
        """Raise how the worker ended; a failure before the task began is external."""
        external = external or (not self.begun and how != STOPPED)
        raise WorkerDiedError(
            how, self.file, external=external, seconds=time.monotonic() - self.started
        )

    def next(self, kind: type[_Message], seconds: float) -> _Message:
        """Return what the worker says next, within `seconds` and before time is up."""
        silent, over = time.monotonic() + seconds, self.started + self.whole
        while True:
            if self.stopped():
                self.fail(STOPPED)
            if time.monotonic() > over:
                self.fail(f"{OUT_OF_TIME} ({self.worker.limits.all_seconds:g} s for all files)")
            if time.monotonic() > silent:
                self.fail(f"{OUT_OF_TIME} ({seconds:g} s)")
            with contextlib.suppress(queue.Empty):
                return self._decoded(kind, self.worker.lines.get(timeout=_PIPE_POLL_SECONDS))

    def _decoded(self, kind: type[_Message], line: bytes | str | None) -> _Message:
        if isinstance(line, str):
            self.fail(line)
        if line is None:
            memory = max(self.worker.limits.memory // 2, self.worker.peak)
            how, from_outside = how_it_ended(self.worker.process, memory)
            self.fail(how, external=from_outside)
        try:
            return decode(line, kind)
        except ValueError:
            self.fail(NONSENSE)


_START_SECONDS = 120.0
# `-I` keeps the working directory, which holds untrusted files, off the path of modules.
# `-B`: a worker writes to its own folder alone, so that no cache is written beside the program.
_MAIN = """
import sys
sys.path[:0] = {path!r}
from lab3_usd.grade.workers import worker_main
worker_main.main()
"""
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
    command = [sys.executable, "-I", "-B", "-c", _MAIN.format(path=path)]
    log = scratch / "stderr.txt"
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
    worker = Worker(process, scratch, settings.limits)
    worker.threads = tuple(hold_pipes(worker))
    try:
        worker.tasks.put(encode(Start(scratch, settings)))
        ready = Turn(worker, _START_SECONDS, stopped).next(Ready, _START_SECONDS)
        worker.confined, worker.peak = ready.confined, ready.peak
    except WorkerDiedError as error:
        last = log.read_text(errors="replace").strip().splitlines()
        end_worker(worker)
        raise WorkerError(f"a worker does not start: {last[-1] if last else error}") from error
    return worker


def environment(scratch: Path, lab: Path | None = None) -> dict[str, str]:
    """Return the environment of a worker: no plugin path, no search path, no proxy, no secret."""
    kept = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
    if lab is not None:
        kept[LAB_VARIABLE] = str(lab)
    return kept | {"HOME": str(scratch), "TMPDIR": str(scratch), "PXR_WORK_THREAD_LIMIT": "1"}


def ask(
    worker: Worker,
    task: Task,
    stopped: Callable[[], bool] = never_stopped,
    seconds: float | None = None,
) -> Json:
    """Give a worker a task and return its answer, at the latest after `seconds`.

    Raises:
        WorkerDiedError: it died, was silent for too long, took too long altogether, wrote too
            much, or `stopped` became true.
    """
    turn = Turn(worker, seconds or worker.limits.all_seconds, stopped)
    if not worker.lines.empty():  # it ended, or speaks without being asked
        turn.next(Reply, turn.whole)
        turn.fail(NONSENSE)
    worker.bytes_read, worker.turns = 0, worker.turns + 1
    worker.tasks.put(encode(Assignment(worker.turns, task)))
    while True:
        reply = turn.next(Reply, worker.limits.seconds)
        if reply.turn != worker.turns:  # it still speaks of the task before
            turn.fail(NONSENSE, external=True)
        turn.begun = True
        if reply.done is not None:
            if "died" in reply.done:
                turn.fail(str(reply.done["died"]))
            return reply.done
        if reply.open is None:
            turn.fail(NONSENSE)
        turn.file = reply.open


def end_worker(worker: Worker) -> None:
    """End a worker, whatever it is doing, and remove its folder."""
    kill(worker.process)
    with contextlib.suppress(subprocess.TimeoutExpired):  # it hangs in the kernel; it may
        worker.process.wait(END_SECONDS)
    worker.tasks.put(None)
    for thread in worker.threads:
        thread.join(END_SECONDS)
    remove_scratch(worker.scratch)
