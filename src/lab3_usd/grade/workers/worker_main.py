"""The process that judges: reads one task a line, writes one answer a line, trusts no submission.

It is started by `worker_process` with an environment of its own, and gives up what it does not
need before it reads the first file. Tasks and answers are JSON, so that nothing in them can be
executed.
"""

from __future__ import annotations

import gc
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import BinaryIO, NamedTuple

from lab3_usd.data import data_folder, lab_folder
from lab3_usd.errors import failure_text, is_no_room
from lab3_usd.grade.intake.submission_copy import UnreachedError
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.grade.workers.sandbox import (
    fence_files,
    give_up_privileges,
    limit_resources,
    limit_time,
)
from lab3_usd.grade.workers.submission_grading import GradingSetup, grade_submission
from lab3_usd.grade.workers.worker_messages import (
    CRASHED,
    FAILED_OVER_IT,
    FAULT,
    OUT_OF_MEMORY,
    TOO_LARGE,
    TOOL_FAILED,
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
from lab3_usd.pipeline.starter_comparison import open_starter
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.server_assets import assets_at

_NEEDED = ("/usr", "/lib", "/lib64", "/etc/localtime", "/proc/self", "/dev/urandom")
_TOO_LONG = f"{TOO_LARGE}: its reports would be longer than is sane"
_NO_TIME = 1e-6  # seconds; none at all would be no limit
_NO_ROOM = "no room for a copy of the submission"
_OURS = ("graphs", "maps", "schema")
_UNTIL_COLLECTED = 20_000  # new objects; a submission leaves some hundreds that refer to each other


def serve() -> None:
    """Serve tasks until there are no more: the settings first, then a task on each line."""
    gc.set_threshold(_UNTIL_COLLECTED)
    tasks, answers = _channels()
    with tasks, answers:
        start = decoded_message(tasks.readline(), Start)
        sys.argv = [start.settings.typed]
        with assets_at(start.settings.assets):
            _serve(start, _confined(start), tasks, answers)


def _channels() -> tuple[BinaryIO, BinaryIO]:
    """Keep standard input and output for tasks and answers; what else is printed is lost."""
    tasks = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    discarded = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(discarded, stream)
    os.close(discarded)
    return tasks, answers


class Prepared(NamedTuple):
    """What every submission is judged with, the folders that it may read and write, and the walls.

    `walls` says of each whether it is there.
    """

    setup: GradingSetup
    readable: list[Path]
    writable: list[Path]
    walls: dict[str, bool]


def _confined(start: Start) -> Prepared:
    """Load what is judged with, and put up the walls around this process."""
    settings = start.settings
    walls = give_up_privileges()
    setup = load_setup(settings)
    walls["limits"] = limit_resources(settings.limits)
    # The folders of modules and data are still read while submissions are judged.
    ours = [lab_folder(), *map(data_folder, _OURS)]
    python = [sys.prefix, sys.base_prefix, sys.exec_prefix, *filter(None, sys.path)]
    given = (*setup.allowed, *setup.supplied, *python, *_NEEDED)
    readable, writable = [*ours, *map(Path, given)], [start.scratch.resolve(), Path(os.devnull)]
    walls["files"] = fence_files([*settings.readable, *readable], writable)
    return Prepared(setup, readable, writable, walls)


def _serve(start: Start, prepared: Prepared, tasks: BinaryIO, answers: BinaryIO) -> None:
    def send(line: bytes) -> None:
        answers.write(line)
        answers.flush()

    settings, scratch = start.settings, start.scratch.resolve()
    setup, readable, writable, walls = prepared
    send(encode(Ready(walls, _most_memory())))
    for line in tasks:
        assignment = decoded_message(line, Assignment)
        judge = partial(_judge, assignment, setup, scratch, send)
        if walls["files"]:
            paths = [source.path for source in assignment.task.sources]
            own = [path for path in paths if not path.is_symlink()]  # which are not followed
            done = _fenced(judge, [*own, *readable], writable)
        else:
            done = judge()
        reply = encode(Reply(assignment.turn, done=done))
        if len(reply) > settings.limits.answer_size // 2:  # lines about progress count too
            reply = encode(Reply(assignment.turn, done={"failed": _TOO_LONG}))
        send(reply)


def _fenced(judge: Callable[[], Json], readable: list[Path], writable: list[Path]) -> Json:
    """Judge in a thread, as which no file of another student is opened: a sandbox is a thread's."""

    def confined() -> Json:
        if not fence_files(readable, writable):
            return {"died": f"{TOOL_FAILED}: a submission cannot be confined"}
        return judge()

    with ThreadPoolExecutor(1) as thread:
        return thread.submit(confined).result()


def _judge(
    assignment: Assignment, setup: GradingSetup, scratch: Path, send: Callable[[bytes], None]
) -> Json:
    """Judge a task within its processor time, and say which file is at work."""
    begun = time.process_time()

    def announce(name: str) -> None:
        limit_time(0)  # of the file before
        now = time.process_time()
        send(encode(Reply(assignment.turn, open=name, processor=now)))
        left = begun + assignment.seconds - now
        limit_time(min(setup.settings.limits.seconds, max(left, _NO_TIME)))

    announce("")  # from here on, what ends this process is caused by the task
    done = answer(setup, assignment.task, scratch, announce)
    limit_time(0)
    return done


def _most_memory() -> int:
    """Return the most memory that this process had, in bytes; 0 where that is not known."""
    try:
        import resource
    except ImportError:
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


def load_setup(settings: PoolSettings) -> GradingSetup:
    """Load what every submission is judged with."""
    # Imported here so that importing it is over before the files are confined.
    from lab3_usd.stage.sandboxed_open import files_of

    lab, starter = load_lab(), settings.starter
    return GradingSetup(
        lab=lab,
        rubric=load_rubric(settings.rubric, lab),
        starter=None if starter is None else open_starter(starter, lab),
        allowed=frozenset() if starter is None else files_of(starter),
        supplied=tuple(map(os.path.realpath, settings.assets.values())),
        settings=settings,
    )


def answer(setup: GradingSetup, task: Task, scratch: Path, announce: Callable[[str], None]) -> Json:
    """Judge one task in a folder of its own, which is removed afterwards."""
    folder = Path(tempfile.mkdtemp(dir=scratch))
    try:
        return grade_submission(setup, task, folder, announce)
    except MemoryError:
        return {"died": OUT_OF_MEMORY}
    except UnreachedError as error:
        return {FAULT: str(error)}
    except Exception as error:  # noqa: BLE001 - our own failure is recorded, and never a grade
        if is_no_room(error):
            return {FAULT: f"{_NO_ROOM} ({getattr(error, 'strerror', '')})"}
        return {"died": _failure_text(error, folder)}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _failure_text(error: Exception, folder: Path) -> str:
    """Tell what usd-core raises over a damaged file from a failure of our own.

    Files are named by their place in the submission, not by where the copy of it lies.
    """
    kind = type(error)
    if kind.__module__.startswith("pxr."):
        return f"{CRASHED} ({kind.__name__})"
    message = failure_text(error).replace(f"{folder}{os.sep}", "")
    return f"{FAILED_OVER_IT}: {' '.join(message.split())}"
