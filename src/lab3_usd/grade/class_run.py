"""Grades a whole class: finds what was handed in, has it judged, and writes the gradebook."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path

import msgspec
from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.data import lab_folder, own_lab
from lab3_usd.deliverables.maps import MapError, SuppliedMap, supplied_map
from lab3_usd.errors import StageError, UsageError
from lab3_usd.files import write_whole
from lab3_usd.grade.adjustments import Tables, decisions_in, keep_copy
from lab3_usd.grade.gradebook import (
    MAP,
    Rows,
    check_target,
    clear_halves,
    known_digest,
    write_student,
    write_tables,
)
from lab3_usd.grade.intake.remote import local_path
from lab3_usd.grade.intake.scratch import remove_abandoned
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.intake.submissions import StudentSubmission, find_submissions, submissions_in
from lab3_usd.grade.lock import locked
from lab3_usd.grade.regrade import adjust, rubric_of
from lab3_usd.grade.rubric import Rubric, load_rubric
from lab3_usd.grade.shared_reports import MOST_NAMED
from lab3_usd.grade.workers.pool import Runner, run_tasks
from lab3_usd.grade.workers.sandbox import WALLS
from lab3_usd.grade.workers.submission_grading import ungraded_record
from lab3_usd.grade.workers.worker_messages import Json, PoolSettings, Task, status_of
from lab3_usd.report.options import tool_version
from lab3_usd.spec.lab import RUBRIC
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.server_assets import assets_at


class ClassSettings(Struct, frozen=True):
    """What to grade, with what, and where to write.

    `runner` grades the tasks; `notify` receives a line for each part of a class that is left out.
    `resume` without a rubric uses the gradebook's, else the lab's. `assets` maps addresses of
    servers to folders. With `merge_uploads`, earlier uploads of a student complete the last one.
    `force` removes the lock of a run that was killed. `by_hand` are the grader's tables of manual
    decisions, by default those of the gradebook. `maps` is the supplied map, or its folder, with
    which submitted maps are compared; `resume` without it uses the gradebook's.
    """

    submissions: Path | str
    starter: Path
    out: Path
    rubric: Path | None = None
    by_hand: Tables = Tables()
    maps: Path | None = None
    limits: Limits = field(default_factory=Limits)
    jobs: int = 1
    resume: bool = False
    assets: Mapping[str, Path] = {}
    merge_uploads: bool = False
    force: bool = False
    most_named: int = MOST_NAMED
    runner: Runner = run_tasks
    notify: Callable[[str], None] = lambda _line: None


def grade_class(
    settings: ClassSettings, progress: Callable[[int, int], None] = lambda _done, _total: None
) -> Rows:
    """Grade every submission and return the rows of the gradebook, in the order of the students.

    `progress` receives the numbers of finished and of all tasks. Finished work is on disk at once,
    so that an interrupted run can be resumed.

    Raises:
        MapError: the supplied map cannot be read.
        SpecError: the rubric is wrong. Nothing has been graded then.
        StageError: the starter cannot be opened.
        UsageError: there are no submissions, a line of a table is wrong, or the gradebook
            cannot be written.
    """
    place = local_path(settings.submissions)
    check_apart(place, settings.out)
    if settings.resume:
        settings = replace(settings, rubric=rubric_of(settings.out, settings.rubric))
    rubric = load_rubric(settings.rubric, load_lab())
    with assets_at(settings.assets):
        check_starter(settings.starter)
        supplied = _map_of(settings)
        salt = salt_of(rubric, settings.starter, settings.assets, supplied)
    check_target(settings.out, resume=settings.resume)
    with locked(settings.out, force=settings.force):
        check_target(settings.out, resume=settings.resume)  # another run may just have ended
        return _graded(place, rubric, salt, settings, progress)


def _graded(
    place: Path | str,
    rubric: Rubric,
    salt: str,
    settings: ClassSettings,
    progress: Callable[[int, int], None],
) -> Rows:
    """Grade every submission into a gradebook that no other run writes to."""
    clear_halves(settings.out)
    given = [place, settings.starter, settings.out, settings.rubric, *settings.assets.values()]
    remove_abandoned(path for path in (*given, own_lab()) if isinstance(path, Path))
    late = set(rubric.late.students)
    with submissions_in(place) as location:
        submissions = [
            replace(
                submission,
                late=submission.late or bool({submission.student, submission.number} & late),
            )
            for submission in find_submissions(location, settings.notify)
        ]
        people = [(submission.student, submission.name) for submission in submissions]
        decisions = decisions_in(settings.out, settings.by_hand, rubric, people)
        keep_copy(settings.out / RUBRIC, settings.rubric)
        supplied = _map_of(settings)
        if supplied is not None:
            write_whole(settings.out / MAP, msgspec.json.encode(supplied), force=True)
        by_folder = {submission.folder: submission for submission in submissions}
        items = [item.id for item in rubric.items]

        def task_of(submission: StudentSubmission) -> Task:
            known = ""
            if settings.resume:
                known = known_digest(settings.out, submission, salt, items)
            student, folder, sources = submission.student, submission.folder, submission.sources
            return Task(student, folder, sources, submission.late, submission.name, known=known)

        places = (location.where, *([location.empty_folder] if location.left_out else []))
        readable = tuple(path for path in places if isinstance(path, Path))  # by the workers
        pool = PoolSettings(
            settings.starter,
            settings.rubric,
            settings.limits,
            readable,
            min(settings.jobs, len(submissions)),
            own_lab(),
            dict(settings.assets),
            settings.merge_uploads,
            named=len(submissions) <= settings.most_named,
            supplied_map=supplied,
        )
        progress(0, len(submissions))
        notified: set[str] = set()
        with closing(settings.runner(map(task_of, submissions), pool)) as answers:
            for done, (task, answer) in enumerate(answers, start=1):
                _notify_unconfined(answer, notified, settings.notify)
                if answer.get("status") != "known":
                    own = by_folder[task.folder]
                    whole = _whole(answer, rubric, own.student, own.name)
                    write_student(settings.out, own, salt, whole)
                progress(done, len(submissions))
    if decisions is not None:
        adjust(settings.out, submissions, rubric, decisions.by_student)
        for line in decisions.dropped:
            settings.notify(line)
    return write_tables(settings.out, submissions, rubric)


def _map_of(settings: ClassSettings) -> SuppliedMap | None:
    """Return the map that is supplied to a run, else the one that the gradebook keeps, if any.

    Raises:
        MapError: it cannot be read.
    """
    copy = settings.out / MAP
    if settings.maps is not None:
        return supplied_map(settings.maps)
    if not (settings.resume and copy.is_file()):
        return None
    try:
        return msgspec.json.decode(copy.read_bytes(), type=SuppliedMap)
    except msgspec.DecodeError as error:
        raise MapError(f"{copy}: is no map that a gradebook keeps; give --maps again") from error


def grade_alone(
    submission: Path, settings: PoolSettings, notify: Callable[[str], None] = lambda _line: None
) -> Json:
    """Grade one submission, a folder or an archive, and return what is recorded of it.

    Raises:
        SpecError: the rubric is wrong.
        StageError: the starter cannot be opened.
        UsageError: there is no such submission, or no starter to judge it with.
    """
    if not submission.exists():
        raise UsageError(f"{submission}: there is no such file or folder")
    if settings.starter is None:
        raise UsageError("untrusted files are judged with the instructor's starter: give --starter")
    rubric = load_rubric(settings.rubric, load_lab())
    with assets_at(settings.assets):
        check_starter(settings.starter)
    path = submission.resolve()
    given = (path, settings.starter, settings.rubric, own_lab(), *settings.assets.values())
    remove_abandoned(place for place in given if place is not None)
    name = path.name or "submission"
    pool = replace(settings, readable=(path,), jobs=1, lab=own_lab())
    with closing(run_tasks([Task(name, "", (Source(path),))], pool)) as answers:
        answer = next(given for _, given in answers)
    _notify_unconfined(answer, set(), notify)
    return _whole(answer, rubric, name)


def check_apart(submissions: Path | str, out: Path) -> None:
    """Make sure that the gradebook does not become a submission.

    Raises:
        UsageError: it would lie among them.
    """
    inside = os.path.isdir(submissions)  # noqa: PTH112 - pathlib raises without permission
    if inside and out.resolve().is_relative_to(Path(submissions).resolve()):
        raise UsageError(f"{out}: lies in {submissions}, which is graded; choose another -o")


def check_starter(starter: Path) -> None:
    """Make sure that the starter can be opened, before anything is judged by it.

    Raises:
        StageError: it cannot.
    """
    from lab3_usd.stage.read.opening import open_stage

    if starter.is_dir():
        raise StageError(f"{starter}: is a folder; name the stage in it")
    if not starter.is_file():
        raise StageError(f"{starter}: there is no such file")
    open_stage(starter)


def salt_of(
    rubric: Rubric,
    starter: Path,
    assets: Mapping[str, Path],
    supplied: SuppliedMap | None = None,
) -> str:
    """Return a digest of everything that a grade depends on beside the submission.

    Of assets that are not the starter's it holds where they lie.
    """
    from lab3_usd.stage.sandboxed_open import files_of

    digest = hashlib.sha256(f"{tool_version()}\0{rubric.digest}\0".encode())
    for path in [starter, *sorted(lab_folder().glob("*.yaml"))]:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    if supplied is not None:
        digest.update(repr(supplied.facts).encode() + supplied.grid.cells)
    for address, folder in sorted(assets.items()):
        digest.update(f"{address}\0{folder.resolve()}\0".encode("utf-8", "backslashreplace"))
    # The files that the starter consists of; one in a package is read with the package.
    paths = (Path(file.partition("[")[0]) for file in files_of(starter))
    contents = [
        (path.name, hashlib.sha256(path.read_bytes()).digest()) for path in paths if path.is_file()
    ]
    for name, content in sorted(contents):
        digest.update(name.encode("utf-8", "backslashreplace") + b"\0" + content)
    return digest.hexdigest()


def _notify_unconfined(answer: Json, notified: set[str], notify: Callable[[str], None]) -> None:
    """Say once, in one line, which sandbox layers this system does not give workers."""
    missing = answer.get("unconfined", [])
    if not notified.issuperset(missing):
        notified.update(missing)
        layers = ", ".join(f"{name} ({WALLS[name]})" for name in missing)
        notify(f"workers lack sandbox layers, see SECURITY.md: {layers}")


def _whole(answer: Json, rubric: Rubric, student: str, name: str = "") -> Json:
    """Return an answer with all that is recorded, also where a submission was not judged."""
    if "failed" not in answer:
        return answer
    reason = answer["failed"]
    record = ungraded_record(rubric, student, status_of(reason), reason, name)
    return {key: answer[key] for key in answer if key != "failed"} | record
