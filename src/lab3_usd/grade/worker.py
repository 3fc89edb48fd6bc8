"""The process that judges: reads one task a line, writes one answer a line, trusts no submission.

It is started by `pool` with an environment of its own, and gives up what it does not need before
it reads the first file. Tasks and answers are JSON, so that nothing in them can be executed.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from lab3_usd.check.unchanged import open_starter
from lab3_usd.data import data_folder
from lab3_usd.grade.confine import fence_files, give_up_privileges, limit_resources
from lab3_usd.grade.judge import Course, Json, Task, judge_task
from lab3_usd.grade.limits import Limits
from lab3_usd.grade.load_rubric import load_rubric
from lab3_usd.grade.outcome import CRASHED, OUT_OF_MEMORY, TOO_LARGE, TOOL_FAILED
from lab3_usd.grade.staging import source_of
from lab3_usd.spec.loader import load_lab

_NEEDED = ("/usr", "/lib", "/lib64", "/etc/localtime", "/proc/self", "/dev/urandom")
_TOO_LONG = f"{TOO_LARGE}: its reports would be longer than is sane"
_OURS = ("graphs", "maps", "schema")


def main() -> None:
    """Serve tasks until there are no more: the settings first, then a task on each line."""
    tasks, answers = _channels()
    with tasks, answers:
        settings = json.loads(tasks.readline())
        _serve(settings, tasks, answers)


def _channels() -> tuple[BinaryIO, BinaryIO]:
    """Keep standard input and output for tasks and answers; what else is printed goes nowhere."""
    tasks = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    os.close(nowhere)
    return tasks, answers


def _serve(settings: Json, tasks: BinaryIO, answers: BinaryIO) -> None:
    def say(message: Json) -> None:
        line = json.dumps(message).encode() + b"\n"
        if len(line) > limits.answer_size // 2:  # what was said of progress counts too
            short = {"turn": message.get("turn"), "done": {"failed": _TOO_LONG}}
            line = json.dumps(short).encode() + b"\n"
        answers.write(line)
        answers.flush()

    scratch = Path(settings["scratch"]).resolve()
    limits = Limits(**settings["limits"])
    given_up = give_up_privileges()
    course = make_course(settings, limits)
    given_up["limits"] = limit_resources(limits)
    readable = [*settings["readable"], *course.allowed, *_python(), *_NEEDED]
    given_up["files"] = fence_files([Path(each) for each in readable], [scratch, Path(os.devnull)])
    say({"ready": given_up, "peak": _most_memory()})
    for line in tasks:
        message = json.loads(line)
        turn = {"turn": message["turn"]}

        def announce(name: str, turn: Json = turn) -> None:
            say({**turn, "open": name})

        announce("")  # from here on, what ends this process is the task's doing
        say({**turn, "done": answer(course, message, scratch, announce)})


def _most_memory() -> int:
    """Return the most memory that this process had, in bytes; 0 where that is not known."""
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


def _python() -> list[str]:
    """Name the folders of modules and data, which are still read while submissions are judged."""
    ours = [str(data_folder(name)) for name in _OURS]
    return [*ours, sys.prefix, sys.base_prefix, sys.exec_prefix, *filter(None, sys.path)]


def make_course(settings: Json, limits: Limits) -> Course:
    """Load what every submission is judged with, as `worker_process` tells it."""
    # Imported here so that importing it is over before the files are fenced.
    from lab3_usd.stage.fence import files_of  # noqa: PLC0415

    lab = load_lab()
    starter = None if settings["starter"] is None else Path(settings["starter"])
    return Course(
        lab=lab,
        rubric=load_rubric(None if settings["rubric"] is None else Path(settings["rubric"]), lab),
        starter=None if starter is None else open_starter(starter, lab),
        allowed=frozenset() if starter is None else files_of(starter),
        limits=limits,
    )


def answer(
    course: Course, message: Json, scratch: Path, announce: Callable[[str], None]
) -> dict[str, Any]:
    """Judge one task in a folder of its own, which is removed afterwards."""
    task = task_of(message)
    folder = Path(tempfile.mkdtemp(dir=scratch))
    try:
        return judge_task(course, task, folder, announce)
    except MemoryError:
        return {"died": OUT_OF_MEMORY}
    except Exception as error:  # noqa: BLE001 - our own failure is recorded, and never a grade
        return {"died": _how(error, folder)}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _how(error: Exception, folder: Path) -> str:
    """Tell what usd-core raises over a damaged file from a failure of our own.

    Files are named by their place in the submission, not by where the copy of it lies.
    """
    kind = type(error)
    if kind.__module__.startswith("pxr."):
        return f"{CRASHED} ({kind.__name__})"
    frame = traceback.extract_tb(error.__traceback__)[-1]
    said = " ".join(str(error).replace(f"{folder}{os.sep}", "").split())
    return f"{TOOL_FAILED}: {kind.__name__} at {Path(frame.filename).name}:{frame.lineno}: {said}"


def task_of(message: Json) -> Task:
    """Return the task that a message describes (see `pool.message_of`)."""
    return Task(
        student=message["student"],
        folder=message["folder"],
        sources=tuple(source_of(each) for each in message["sources"]),
        late=message["late"],
        name=message["name"],
        broken=message["broken"],
        known=message["known"],
    )
