"""One worker process seen from outside: start it, ask it, and know how it ended."""

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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from msgspec import Struct
from msgspec.structs import asdict

from lab3_usd.data import PACKAGE
from lab3_usd.errors import Lab3Error
from lab3_usd.grade.limits import Limits
from lab3_usd.grade.outcome import CRASHED, OUT_OF_MEMORY, OUT_OF_TIME
from lab3_usd.grade.scratch import make_scratch, remove_scratch

Json = dict[str, Any]
_START_SECONDS = 120.0
_POLL_SECONDS = 0.2
_LONGEST_LINE = 64 << 20
# `-I` keeps the working directory, which holds a stranger's files, off the path of modules.
_MAIN = "import sys; sys.path[:0] = {path!r}; from lab3_usd.grade.worker import main; main()"
_KEPT = ("PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "SYSTEMROOT", "TZ")
_STDERR = "stderr.txt"
STOPPED, NONSENSE = "stopped", "answered nonsense"


class WorkerError(Lab3Error):
    """A worker cannot be started; the line says what it said last."""


class DiedError(Exception):
    """A worker ended or was ended before it answered; `how` says it in a few words."""

    def __init__(self, how: str, file: str) -> None:
        """Keep how it ended, and the file that it was reading, '' before the first."""
        super().__init__(how)
        self.how = how
        self.file = file


class PoolSettings(Struct, frozen=True):
    """How to judge: with which starter and rubric, and what workers may use and read."""

    starter: Path | None
    rubric: Path | None
    limits: Limits
    readable: tuple[Path, ...] = ()
    jobs: int = 1


@dataclass(slots=True)
class Worker:
    """A worker process, the folder it may write to, and the lines that it says."""

    process: subprocess.Popen[bytes]
    scratch: Path
    limits: Limits
    lines: queue.Queue[bytes | None] = field(default_factory=queue.Queue)
    confined: Mapping[str, bool] = field(default_factory=dict)


def start_worker(settings: PoolSettings) -> Worker:
    """Start a worker and wait until it is ready.

    Raises:
        WorkerError: it does not get ready.
    """
    scratch = make_scratch("lab3-grade-")
    command = [sys.executable, "-I", "-c", _MAIN.format(path=_module_path())]
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
    threading.Thread(target=_listen, args=(process.stdout, worker.lines), daemon=True).start()
    try:
        _send(worker, _settings_message(settings, scratch))
        worker.confined = _next(worker, _START_SECONDS, "", lambda: False)["ready"]
    except (DiedError, KeyError) as error:
        said = (scratch / _STDERR).read_text(errors="replace").strip().splitlines()
        end_worker(worker)
        message = f"a worker does not start: {said[-1] if said else error}"
        raise WorkerError(message) from error
    return worker


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


def _listen(stream: IO[bytes], lines: queue.Queue[bytes | None]) -> None:
    """Pass on the lines of a worker; None at the end of them, or when one is absurdly long."""
    with contextlib.suppress(OSError, ValueError):
        while line := stream.readline(_LONGEST_LINE):
            if not line.endswith(b"\n"):
                break
            lines.put(line)
    lines.put(None)


def _send(worker: Worker, message: Json) -> None:
    stream = worker.process.stdin
    if stream is not None:
        with contextlib.suppress(OSError):  # it has died: reading says so
            stream.write(json.dumps(message).encode() + b"\n")
            stream.flush()


def ask(worker: Worker, message: Json, stopped: Callable[[], bool]) -> Json:
    """Give a worker a task and return its answer.

    Raises:
        DiedError: it died, said nothing for too long, or `stopped` became true.
    """
    _send(worker, message)
    file = ""
    while True:
        said = _next(worker, worker.limits.seconds, file, stopped)
        done = said.get("done")
        if isinstance(done, dict):
            if "died" in done:
                raise DiedError(str(done["died"]), file)
            return done
        if "open" not in said:
            raise DiedError(NONSENSE, file)
        file = said["open"]


def _next(worker: Worker, seconds: float, file: str, stopped: Callable[[], bool]) -> Json:
    until = time.monotonic() + seconds
    while True:
        try:
            line = worker.lines.get(timeout=_POLL_SECONDS)
        except queue.Empty:
            if stopped():
                raise DiedError(STOPPED, file) from None
            if time.monotonic() > until:
                how = f"{OUT_OF_TIME} ({seconds:g} s)"
                raise DiedError(how, file) from None
            continue
        if line is None:
            raise DiedError(_how_it_ended(worker), file)
        return _parsed(line, file)


def _parsed(line: bytes, file: str) -> Json:
    try:
        said = json.loads(line)
    except ValueError:
        said = None
    if not isinstance(said, dict):
        raise DiedError(NONSENSE, file)
    return said


def _how_it_ended(worker: Worker) -> str:
    status, peak = _wait(worker)
    if peak > worker.limits.memory // 2 or status == -signal.SIGKILL:
        return OUT_OF_MEMORY
    if status < 0:
        with contextlib.suppress(ValueError):
            return f"{CRASHED} ({signal.Signals(-status).name})"
    return f"ended the worker (status {status})"


def _wait(worker: Worker) -> tuple[int, int]:
    """Return the exit status, and the most memory it had (bytes; 0 where that is not known)."""
    if not hasattr(os, "wait4"):
        return worker.process.wait(), 0
    try:
        _, status, usage = os.wait4(worker.process.pid, 0)
    except ChildProcessError:
        return worker.process.wait(), 0
    worker.process.returncode = os.waitstatus_to_exitcode(status)
    scale = 1 if sys.platform == "darwin" else 1024
    return worker.process.returncode, usage.ru_maxrss * scale


def end_worker(worker: Worker) -> None:
    """End a worker, whatever it is doing, and remove its folder."""
    if worker.process.poll() is None:
        worker.process.kill()
        worker.process.wait()
    for stream in (worker.process.stdin, worker.process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()
    remove_scratch(worker.scratch)
