"""The messages between a class run and its workers: typed records, each a line of JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from lab3_usd.data import program as program_name
from lab3_usd.deliverables.maps import SuppliedMap
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits

Json = dict[str, Any]
OUT_OF_TIME, OUT_OF_MEMORY = "ran out of time", "ran out of memory"
TOO_LARGE = "too large"
# Of this program itself: apart from any submission, and over one.
TOOL_FAILED, FAILED_OVER_IT = "tool failed", "this program failed"
CRASHED = "crashed usd-core"
KILLED = "ended by"  # a signal that nothing in a file sends
# What did not reach the judge, by a fault of the computer it was on, or of all that it does there.
FAULT, FAULT_OF_ALL = "fault", "fault of all"
_STATUSES = {
    OUT_OF_TIME: "timeout",
    OUT_OF_MEMORY: "too large",
    TOO_LARGE: "too large",
    TOOL_FAILED: "tool failed",
}
_Message = TypeVar("_Message", bound=Struct)
# What a worker process runs: its arguments are where it finds the modules of the one that asks.
PROGRAM = """
import sys
sys.path[:0] = sys.argv[1:]
from lab3_usd.grade.workers import worker_main
worker_main.serve()
"""


class PoolSettings(Struct, frozen=True):
    """How to judge: with which starter and rubric, and what workers may use and read.

    Maps are compared with the `supplied_map`. `lab` is the folder of another lab than the bundled
    one, `assets` the folders in which the grader has what lies at these addresses. With `merge`,
    what the last upload of a student lacks comes from the ones before. With `with_report`, an
    answer holds the report as data alone. Without `named`, reports do not name the student. `typed`
    is the name by which the program was started, `program` what a worker runs.
    """

    starter: Path | None
    rubric: Path | None
    limits: Limits
    readable: tuple[Path, ...] = ()
    jobs: int = 1
    lab: Path | None = None
    assets: dict[str, Path] = {}
    merge: bool = False
    with_report: bool = False
    named: bool = True
    supplied_map: SuppliedMap | None = None
    typed: str = msgspec.field(default_factory=program_name)
    program: str = PROGRAM


class Task(Struct, frozen=True):
    """One submission to judge: whose it is, what it consists of, and what is known of it.

    `folder` is the student's folder in the gradebook, `name` what the platform calls the student.
    `broken` names files that ended a worker, and how; `known` is the digest of what was judged
    before: a submission with the same digest is not judged again.
    """

    student: str
    folder: str
    sources: tuple[Source, ...]
    late: bool = False
    name: str = ""
    broken: dict[str, str] = {}
    known: str = ""


class Start(Struct, frozen=True):
    """The first message to a worker: its settings, and the one folder that it may write to."""

    scratch: Path
    settings: PoolSettings


class Ready(Struct, frozen=True):
    """The first message of a worker: what it gave up, and the memory in bytes that it had then."""

    confined: dict[str, bool]
    peak: int = 0


class Assignment(Struct, frozen=True):
    """A task for a worker, its number, and the processor time in seconds that it may take."""

    turn: int
    task: Task
    seconds: float


class Reply(Struct, frozen=True, omit_defaults=True):
    """What a worker says about the task of a turn: the file that it opens, or the answer.

    `processor` is the processor time in seconds that the worker has taken since it started.
    """

    turn: int
    open: str | None = None
    done: Json | None = None
    processor: float = 0.0


Answer = tuple[Task, Json]  # a task as it was judged in the end, and what to record


def encode(message: Struct) -> bytes:
    """Return a message as a line of JSON; paths become absolute.

    The standard library writes it: names of files may hold lone surrogates, which msgspec refuses.
    """
    plain = msgspec.to_builtins(message, enc_hook=lambda path: str(path.absolute()))
    return json.dumps(plain).encode() + b"\n"


def decoded_message(line: bytes, kind: type[_Message]) -> _Message:
    """Return the message of a line.

    Raises:
        ValueError: it is not JSON, or not such a message.
    """
    try:
        return msgspec.convert(json.loads(line), kind, dec_hook=lambda path, text: path(text))
    except RecursionError as error:
        raise ValueError("nested too deep") from error


def status_of(how: str) -> str:
    """Return the status to record for a submission, from how its worker ended."""
    for beginning, status in _STATUSES.items():
        if how.startswith(beginning):
            return status
    return "crashed"
