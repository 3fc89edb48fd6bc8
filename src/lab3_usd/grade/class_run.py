"""Grades a whole class: finds what was handed in, has it judged, and writes the gradebook."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.data import data_folder
from lab3_usd.errors import StageError, UsageError
from lab3_usd.grade.archives import ArchiveError, is_archive, unpack
from lab3_usd.grade.gradebook import Rows, check_target, known_digest, write_student, write_tables
from lab3_usd.grade.intake import Intake, TooLargeError
from lab3_usd.grade.judge import Json, Task, not_judged
from lab3_usd.grade.limits import Limits
from lab3_usd.grade.load_rubric import load_rubric
from lab3_usd.grade.outcome import status_of
from lab3_usd.grade.pool import run_tasks
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.submissions import Handed, find_submissions, within_wrapper
from lab3_usd.grade.worker_process import PoolSettings
from lab3_usd.report.tool import tool_version
from lab3_usd.spec.loader import load_lab

Runner = Callable[[Iterable[Task], PoolSettings], Iterator[tuple[Task, Json]]]
# A class in one archive holds many submissions.
_CLASS = Limits(files=200_000, total_size=16 << 30, file_size=1 << 30)


class ClassSettings(Struct, frozen=True):
    """What to grade, with what, and where to write; `runner` has the tasks judged."""

    submissions: Path | str
    starter: Path
    out: Path
    rubric: Path | None = None
    limits: Limits = field(default_factory=Limits)
    jobs: int = 1
    resume: bool = False
    runner: Runner = run_tasks


def grade_class(
    settings: ClassSettings, progress: Callable[[int, int], None] = lambda _done, _total: None
) -> Rows:
    """Grade every submission and return the rows of the gradebook, in the order of the students.

    `progress` is told how many of how many are done. What is finished is on disk at once, so
    that a run which is interrupted can be resumed.

    Raises:
        SpecError: the rubric is wrong. Nothing has been graded then.
        StageError: the starter cannot be opened.
        UsageError: there are no submissions, or the gradebook cannot be written.
    """
    rubric = load_rubric(settings.rubric, load_lab())
    check_starter(settings.starter)
    check_target(settings.out, resume=settings.resume)
    salt = salt_of(rubric, settings.starter)
    with submissions_in(settings.submissions) as place:
        handed = [_with_lateness(each, rubric) for each in find_submissions(place)]
        by_folder = {each.folder: each for each in handed}
        tasks = (_task(each, settings, salt) for each in handed)
        pool = PoolSettings(
            settings.starter,
            settings.rubric,
            settings.limits,
            (place,) if isinstance(place, Path) else (),
            min(settings.jobs, len(handed)),
        )
        progress(0, len(handed))
        for done, (task, answer) in enumerate(settings.runner(tasks, pool), start=1):
            _record(settings.out, by_folder[task.folder], salt, answer, rubric)
            progress(done, len(handed))
    return write_tables(settings.out, handed, rubric)


def check_starter(starter: Path) -> None:
    """Make sure that the starter can be opened, before anything is judged by it.

    Raises:
        StageError: it cannot.
    """
    from lab3_usd.stage.opening import open_stage  # noqa: PLC0415 - pxr

    if not starter.is_file():
        message = f"{starter}: there is no such file"
        raise StageError(message)
    open_stage(starter)


def salt_of(rubric: Rubric, starter: Path) -> str:
    """Return what stands for everything that a grade depends on beside the submission."""
    digest = hashlib.sha256(f"{tool_version()}\0{rubric.digest}\0".encode())
    for path in [starter, *sorted(data_folder("graphs").glob("*.yaml"))]:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _with_lateness(handed: Handed, rubric: Rubric) -> Handed:
    """Return the submission as late where the platform or the rubric says so."""
    return replace(handed, late=handed.late or handed.student in rubric.late.students)


def _task(handed: Handed, settings: ClassSettings, salt: str) -> Task:
    known = known_digest(settings.out, handed, salt) if settings.resume else ""
    return Task(
        handed.student, handed.folder, handed.sources, handed.late, handed.name, known=known
    )


def _record(out: Path, handed: Handed, salt: str, answer: Json, rubric: Rubric) -> None:
    if answer.get("status") == "known":
        return
    if "failed" in answer:
        how = answer["failed"]
        answer = not_judged(rubric, handed.student, status_of(how), how, handed.name)
    write_student(out, handed, salt, answer)


@contextmanager
def submissions_in(place: Path | str) -> Iterator[Path | str]:
    """Yield the folder of submissions; an archive of a whole class is unpacked first.

    Raises:
        UsageError: the archive is damaged or too large.
    """
    if isinstance(place, str) or place.is_dir() or not is_archive(place.name):
        yield place
        return
    if not place.is_file():
        message = f"{place}: there is no such folder or archive of submissions"
        raise UsageError(message)
    with tempfile.TemporaryDirectory(prefix="lab3-class-") as folder:
        try:
            unpack(place, "", Intake(Path(folder), _CLASS, archives=True))
        except (ArchiveError, TooLargeError) as error:
            message = f"{place}: {str(error).removeprefix(f'{place.name}: ')}"
            raise UsageError(message) from error
        yield within_wrapper(Path(folder))
