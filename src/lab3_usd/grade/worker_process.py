"""A worker process seen from outside: start, ask and end it. Two threads alone touch its pipes."""

from __future__ import annotations

import contextlib
import json
import queue
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

from lab3_usd.errors import Lab3Error
from lab3_usd.grade.limits import MEGABYTE, Limits
from lab3_usd.grade.outcome import OUT_OF_TIME, TOO_LARGE
from lab3_usd.grade.process_end import END_SECONDS, how_it_ended, kill
from lab3_usd.grade.scratch import make_scratch, remove_scratch
from lab3_usd.grade.surroundings import environment, module_path

Json = dict[str, Any]
_START_SECONDS = 120.0
_POLL_SECONDS = 0.2
_LEAST_COUNTED = 1024  # bytes; millions of short lines take memory too
# `-I` keeps the working directory, which holds a stranger's files, off the path of modules.
# `-B`: a worker writes to its own folder alone, so that no cache is written beside the program.
_MAIN = "import sys; sys.path[:0] = {path!r}; from lab3_usd.grade.worker import main; main()"
_STDERR = "stderr.txt"
STOPPED, NONSENSE = "stopped", "answered nonsense"


class WorkerError(Lab3Error):
    """A worker cannot be started; the line says what it said last."""


class DiedError(Exception):
    """A worker ended or was ended before it answered."""

    def __init__(self, how: str, file: str, *, innocent: bool = False, seconds: float = 0) -> None:
        """Keep how and over which file; `innocent` is what nothing in the task brought about."""
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
    said: int = 0
    turns: int = 0
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
    command = [sys.executable, "-I", "-B", "-c", _MAIN.format(path=module_path())]
    with (scratch / _STDERR).open("wb") as errors:
        process = subprocess.Popen(  # noqa: S603 - our own module
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            cwd=scratch,
            env=environment(scratch),
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
    for hold, pipe in ((_speak, worker.process.stdin), (_listen, worker.process.stdout)):
        thread = threading.Thread(target=hold, args=(worker, pipe), daemon=True)
        thread.start()
        yield thread


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
    turn = _Turn(worker, worker.limits.all_seconds if seconds is None else seconds, stopped)
    if not worker.lines.empty():  # it ended, or speaks without being asked
        turn.next(turn.whole)
        turn.fail(NONSENSE, innocent=True)
    worker.said = 0
    worker.turns += 1
    _send(worker, {**message, "turn": worker.turns})
    while True:
        said = turn.next(worker.limits.seconds)
        if said.get("turn") != worker.turns:  # it still speaks of the task before
            turn.fail(NONSENSE, innocent=True)
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
        innocent = innocent or (not self.begun and how != STOPPED)
        raise DiedError(how, self.file, innocent=innocent, seconds=time.monotonic() - self.started)

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
            memory = max(self.worker.limits.memory // 2, self.worker.peak)
            how, innocent = how_it_ended(self.worker.process, memory)
            self.fail(how, innocent=innocent)
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            said = None
        if not isinstance(said, dict):
            self.fail(NONSENSE)
        return said


def end_worker(worker: Worker) -> None:
    """End a worker, whatever it is doing, and remove its folder."""
    kill(worker.process)
    with contextlib.suppress(subprocess.TimeoutExpired):  # it hangs in the kernel; it may
        worker.process.wait(END_SECONDS)
    worker.tasks.put(None)
    for thread in worker.threads:
        thread.join(END_SECONDS)
    remove_scratch(worker.scratch)
