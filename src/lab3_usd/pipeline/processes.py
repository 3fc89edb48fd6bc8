"""Does work in several processes at once, and answers in the order of the work.

The executor of `concurrent.futures` gives up all work when one process ends, does not say which
piece of it was the reason, and cannot end a process that is busy.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple, TypeVar

from lab3_usd.errors import signal_name

_Work = TypeVar("_Work")
_Answer = TypeVar("_Answer")
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


class _Process(NamedTuple):
    """A process, and our end of the pipe over which it gets work and answers."""

    process: BaseProcess
    pipe: Connection


def in_processes(
    do: Callable[[_Work], _Answer],
    ended: Callable[[_Work, str], _Answer],
    works: Sequence[_Work],
    jobs: int,
) -> Iterator[_Answer]:
    """Yield what `do` returns for each piece of work, in order.

    Where a process ends at its work, the answer is what `ended` returns for it and the reason.
    """
    waiting = deque(enumerate(works))
    answers: dict[int, tuple[_Answer, ...]] = {}
    idle: list[_Process] = []
    busy: dict[Any, tuple[_Process, int, _Work]] = {}
    try:
        for number in range(len(works)):
            while number not in answers:
                while waiting and len(busy) < jobs:
                    process = idle.pop() if idle else _start(do)
                    busy[process.pipe] = (process, *waiting.popleft())
                    with suppress(OSError):  # an ended process is noticed at its answer
                        process.pipe.send(busy[process.pipe][2])
                for pipe in wait(busy):
                    process, done, work = busy.pop(pipe)
                    answers[done] = _answer(process, ended, work)
                    if not process.pipe.closed:
                        idle.append(process)
            answer = answers.pop(number)
            # What raised there raises here as well, with its place in the code.
            yield answer[0] if answer else do(works[number])
    finally:
        for process in (*idle, *(process for process, _, _ in busy.values())):
            process.process.kill()
            process.process.join()


def _start(do: Callable[[_Work], _Answer]) -> _Process:
    context: Any = multiprocessing.get_context(_METHOD)
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, do), daemon=True)
    if _METHOD == "forkserver":
        with _inherited():
            forkserver.set_forkserver_preload([_PRELOADED])
            forkserver.ensure_running()
        with _later():
            process.start()
    else:
        with _inherited():
            process.start()
    theirs.close()
    return _Process(process, ours)


@contextmanager
def _later() -> Iterator[None]:
    """Delay Ctrl-C until this is done: an interrupted fork server prints an error."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _inherited() -> Iterator[None]:
    """Set what programs that start here find: the environment, and that Ctrl-C is not for them.

    Python 3.10 knows no safe path: it starts where only its own modules are, and then goes back.
    """
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(_ENVIRONMENT)
    here = "" if _IS_SAFE_PATH_KNOWN else os.getcwd()  # noqa: PTH109 - as the system has it
    if here:
        os.chdir(os.path.dirname(os.__file__))  # noqa: PTH120
    try:
        yield
    finally:
        if here:
            os.chdir(here)
        signal.signal(signal.SIGINT, handler)
        for name, value in before.items():
            os.environ.pop(name)
            os.environ.update({} if value is None else {name: value})


def _answer(
    process: _Process, ended: Callable[[_Work, str], _Answer], work: _Work
) -> tuple[_Answer, ...]:
    try:
        answer: tuple[_Answer, ...] = process.pipe.recv()
    except (EOFError, OSError):
        process.pipe.close()
        process.process.join(_SECONDS_TO_END)
        process.process.kill()
        process.process.join()
        code = process.process.exitcode or 0
        reason = signal_name(-code) if code < 0 else f"exit status {code}"
        return (ended(work, reason),)
    return answer


def _serve(pipe: Connection, do: Callable[[_Work], _Answer]) -> None:
    """Do what comes, until nothing more can come; an empty answer means that it raised."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # not every system lets it be inherited
    with suppress(EOFError, OSError):
        while True:
            work = pipe.recv()
            try:
                answer: tuple[_Answer, ...] = (do(work),)
            except Exception:  # noqa: BLE001 - the one who asked does it again, and raises
                answer = ()
            pipe.send(answer)
