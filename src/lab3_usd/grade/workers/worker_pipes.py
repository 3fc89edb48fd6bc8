"""Messages to and from a worker process: two threads write to and read from its pipes."""

from __future__ import annotations

import contextlib
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NoReturn, TypeVar

from msgspec import Struct

from lab3_usd.grade.intake.limits import MEGABYTE, Limits
from lab3_usd.grade.workers.messages import OUT_OF_TIME, TOO_LARGE, decode
from lab3_usd.grade.workers.process_end import how_it_ended

_POLL_SECONDS = 0.2
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
    said: int = 0
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
                return self._decoded(kind, self.worker.lines.get(timeout=_POLL_SECONDS))

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
