"""Starts, asks and ends one worker process."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from lab3_usd.data import LAB_VARIABLE, PACKAGE
from lab3_usd.errors import Lab3Error
from lab3_usd.grade.intake.scratch import make_scratch, remove_scratch
from lab3_usd.grade.workers.messages import (
    Assignment,
    Json,
    PoolSettings,
    Ready,
    Reply,
    Start,
    Task,
    encode,
)
from lab3_usd.grade.workers.process_end import END_SECONDS, kill
from lab3_usd.grade.workers.worker_pipes import NONSENSE, Turn, Worker, WorkerDiedError, hold_pipes

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
    """A worker cannot be started; the line says what it said last."""


def never_stopped() -> bool:
    """Nobody stops this."""
    return False


def start_worker(settings: PoolSettings, stopped: Callable[[], bool] = never_stopped) -> Worker:
    """Start a worker and wait until it is ready.

    Raises:
        WorkerError: it does not get ready, or `stopped` became true.
    """
    scratch = make_scratch("lab3-grade-")
    command = [sys.executable, "-I", "-B", "-c", _MAIN.format(path=_module_path())]
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
        said = Turn(worker, _START_SECONDS, stopped).next(Ready, _START_SECONDS)
        worker.confined, worker.peak = said.confined, said.peak
    except WorkerDiedError as error:
        last = log.read_text(errors="replace").strip().splitlines()
        end_worker(worker)
        message = f"a worker does not start: {last[-1] if last else error}"
        raise WorkerError(message) from error
    return worker


def _module_path() -> list[str]:
    """Return where a worker finds this package, and what this process finds beside it."""
    ours = str(PACKAGE.parent)
    return [ours, *(path for path in sys.path if path and path != ours and Path(path).is_dir())]


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
        WorkerDiedError: it died, said nothing for too long, took too long altogether, said too
            much, or `stopped` became true.
    """
    turn = Turn(worker, seconds or worker.limits.all_seconds, stopped)
    if not worker.lines.empty():  # it ended, or speaks without being asked
        turn.next(Reply, turn.whole)
        turn.fail(NONSENSE)
    worker.said, worker.turns = 0, worker.turns + 1
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
