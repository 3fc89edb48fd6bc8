"""One worker process seen from outside: start it, ask it, end it, and know how it ended.

Two threads hold the ends of its pipes, and nobody else touches them: whatever a worker does with
its side, time runs out over it, and it is killed before anybody waits for its end.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NoReturn

from msgspec import Struct
from msgspec.structs import asdict

from lab3_usd.data import PACKAGE
from lab3_usd.errors import Lab3Error
from lab3_usd.grade.limits import MEGABYTE, Limits
from lab3_usd.grade.outcome import CRASHED, OUT_OF_MEMORY, OUT_OF_TIME, TOO_LARGE
from lab3_usd.grade.scratch import make_scratch, remove_scratch

Json = dict[str, Any]
_START_SECONDS = 120.0
_POLL_SECONDS = 0.2
_END_SECONDS = 2.0  # for a worker that closed its pipe to end, and for a killed one to be gone
_LEAST_COUNTED = 1024  # bytes; millions of short lines take memory too
# `-I` keeps the working directory, which holds a stranger's files, off the path of modules.
# `-B`: a worker writes to its own folder alone, so that no cache is written beside the program.
_MAIN = "import sys; sys.path[:0] = {path!r}; from lab3_usd.grade.worker import main; main()"
_KEPT = ("PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "SYSTEMROOT", "TZ")
_STDERR = "stderr.txt"
STOPPED, NONSENSE = "stopped", "answered nonsense"
CLOSED = "stopped answering"
# Nothing in a file sends these: somebody outside does, or a system that is short of memory.
_FROM_OUTSIDE = {"SIGKILL", "SIGTERM", "SIGINT", "SIGHUP"}


class WorkerError(Lab3Error):
    """A worker cannot be started; the line says what it said last."""


class DiedError(Exception):
    """A worker ended or was ended before it answered; `how` says it in a few words."""

    def __init__(self, how: str, file: str, *, innocent: bool = False, seconds: float = 0) -> None:
        """Keep how it ended, and the file that it was reading, '' before the first.

        `innocent` is what nothing in the task can have brought about; `seconds` is how long the
        worker had the task.
        """
        super().__init__(how)
        self.how = how
        self.file = file
        self.innocent = innocent
        self.seconds = seconds


class PoolSettings(Struct, frozen=True):
    """How to judge: with which starter and rubric, and what workers may use and read."""

    starter: Path | None
    rubric: Path | None
    limits: Limits
    readable: tuple[Path, ...] = ()
    jobs: int = 1


@dataclass(slots=True)
class Worker:
    """A worker process, the folder it may write to, and the lines that it says.

    After its last line comes None, or why the rest is not read. `said` counts its bytes since it
    was asked; `peak` is the memory that it had when it was ready, which is inherited from the
    process that started it.
    """

    process: subprocess.Popen[bytes]
    scratch: Path
    limits: Limits
    lines: queue.Queue[bytes | str | None] = field(default_factory=queue.Queue)
    tasks: queue.Queue[bytes | None] = field(default_factory=queue.Queue)
    threads: tuple[threading.Thread, ...] = ()
    said: int = 0
    peak: int = 0
    confined: Mapping[str, bool] = field(default_factory=dict)


def never() -> bool:
    """Nobody stops this."""
    return False


def start_worker(settings: PoolSettings, stopped: Callable[[], bool] = never) -> Worker:
    """Start a worker and wait until it is ready.

    Raises:
        WorkerError: it does not get ready, or `stopped` became true.
    """
    scratch = make_scratch("lab3-grade-")
    command = [sys.executable, "-I", "-B", "-c", _MAIN.format(path=_module_path())]
    with (scratch / _STDERR).open("wb") as errors:
        process = subprocess.Popen(  # noqa: S603 - our own module
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            cwd=scratch,
            env=_environment(scratch),
            start_new_session=True,
        )
    worker = Worker(process, scratch, settings.limits)
    worker.threads = tuple(_threads(worker))
    try:
        _send(worker, _settings_message(settings, scratch))
        said = _Turn(worker, _START_SECONDS, stopped).next(_START_SECONDS)
        worker.confined, worker.peak = said["ready"], int(said.get("peak", 0))
    except (DiedError, KeyError) as error:
        last = (scratch / _STDERR).read_text(errors="replace").strip().splitlines()
        end_worker(worker)
        message = f"a worker does not start: {last[-1] if last else error}"
        raise WorkerError(message) from error
    return worker


def _threads(worker: Worker) -> Iterable[threading.Thread]:
    pipes = ((_speak, worker.process.stdin), (_listen, worker.process.stdout))
    for hold, pipe in pipes:
        thread = threading.Thread(target=hold, args=(worker, pipe), daemon=True)
        thread.start()
        yield thread


def _module_path() -> list[str]:
    """Return where a worker finds this package, and what this process finds beside it."""
    ours = str(PACKAGE.parent)
    return [ours, *(path for path in sys.path if path and path != ours and Path(path).is_dir())]


def _environment(scratch: Path) -> dict[str, str]:
    """Return next to nothing: no plugin path, no search path, no proxy, no secret."""
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    return kept | {"HOME": str(scratch), "TMPDIR": str(scratch), "PXR_WORK_THREAD_LIMIT": "1"}


def _settings_message(settings: PoolSettings, scratch: Path) -> Json:
    return {
        "scratch": str(scratch),
        "starter": None if settings.starter is None else str(settings.starter.resolve()),
        "rubric": None if settings.rubric is None else str(settings.rubric.resolve()),
        "limits": asdict(settings.limits),
        "readable": [str(path.resolve()) for path in settings.readable],
    }


def _listen(worker: Worker, stream: IO[bytes]) -> None:
    """Pass on the lines of a worker, as many bytes as an answer may have."""
    most, end = worker.limits.answer_size, None
    with stream, contextlib.suppress(OSError, ValueError):
        while line := stream.readline(most + 1):
            worker.said += max(len(line), _LEAST_COUNTED)
            if worker.said > most:
                end = f"{TOO_LARGE}: answers more than {most / MEGABYTE:.7g} MB"
                break
            if not line.endswith(b"\n"):
                break
            worker.lines.put(line)
    worker.lines.put(end)


def _speak(worker: Worker, stream: IO[bytes]) -> None:
    """Write what a worker is told; one that has died says so where it is listened to."""
    with contextlib.suppress(OSError, ValueError), stream:
        while (line := worker.tasks.get()) is not None:
            stream.write(line)
            stream.flush()


def _send(worker: Worker, message: Json) -> None:
    worker.tasks.put(json.dumps(message).encode() + b"\n")


def ask(
    worker: Worker, message: Json, stopped: Callable[[], bool], seconds: float | None = None
) -> Json:
    """Give a worker a task and return its answer, at the latest after `seconds`.

    Raises:
        DiedError: it died, said nothing for too long, took too long altogether, said too much, or
            `stopped` became true.
    """
    whole = worker.limits.all_seconds if seconds is None else seconds
    turn = _Turn(worker, whole, stopped)
    if not worker.lines.empty():  # it ended, or speaks without being asked
        turn.next(whole)
        turn.fail(NONSENSE, innocent=True)
    worker.said = 0
    _send(worker, message)
    while True:
        said = turn.next(worker.limits.seconds)
        turn.begun = True
        done = said.get("done")
        if isinstance(done, dict):
            if "died" in done:
                turn.fail(str(done["died"]))
            return done
        if not isinstance(said.get("open"), str):
            turn.fail(NONSENSE)
        turn.file = said["open"]


@dataclass(slots=True)
class _Turn:
    """What a worker says about one task, for at most so many seconds."""

    worker: Worker
    whole: float
    stopped: Callable[[], bool]
    file: str = ""
    begun: bool = False
    started: float = field(default_factory=time.monotonic)

    def fail(self, how: str, *, innocent: bool = False) -> NoReturn:
        """Raise what became of the worker; what is wrong before it began is nobody's fault."""
        seconds = time.monotonic() - self.started
        innocent = innocent or (not self.begun and how != STOPPED)
        raise DiedError(how, self.file, innocent=innocent, seconds=seconds)

    def next(self, seconds: float) -> Json:
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
                return self._understood(self.worker.lines.get(timeout=_POLL_SECONDS))

    def _understood(self, line: bytes | str | None) -> Json:
        if isinstance(line, str):
            self.fail(line)
        if line is None:
            how, innocent = _how_it_ended(self.worker)
            self.fail(how, innocent=innocent)
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            said = None
        if not isinstance(said, dict):
            self.fail(NONSENSE)
        return said


def _how_it_ended(worker: Worker) -> tuple[str, bool]:
    """Say how a worker ended that closed its pipe, and whether that came from outside."""
    until = time.monotonic() + _END_SECONDS
    while not (ended := _has_ended(worker.process)) and time.monotonic() < until:
        time.sleep(_POLL_SECONDS / 10)
    _kill(worker.process)
    if not ended:
        return CLOSED, False
    status, peak = _figures(worker.process)
    if peak > max(worker.limits.memory // 2, worker.peak):
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


def _kill(process: subprocess.Popen[bytes]) -> None:
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


def end_worker(worker: Worker) -> None:
    """End a worker, whatever it is doing, and remove its folder."""
    _kill(worker.process)
    with contextlib.suppress(subprocess.TimeoutExpired):  # it hangs in the kernel; it may
        worker.process.wait(_END_SECONDS)
    worker.tasks.put(None)
    for thread in worker.threads:
        thread.join(_END_SECONDS)
    remove_scratch(worker.scratch)
