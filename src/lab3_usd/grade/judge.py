"""Judges one submission inside its fence: from the files that were handed in to points."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import Struct, to_builtins
from msgspec.structs import replace

from lab3_usd.check.checker import ordered
from lab3_usd.check.finding import Crash, Finding, Report, StageResult, Submission, Verdict
from lab3_usd.check.folder import FolderResult, FolderSettings, check_folder
from lab3_usd.check.judged import finding_of
from lab3_usd.check.registry import Rule, all_rules
from lab3_usd.check.unchanged import Starter
from lab3_usd.grade.archives import ArchiveError
from lab3_usd.grade.guard import check_layer
from lab3_usd.grade.intake import Refused, TooLargeError
from lab3_usd.grade.limits import Limits
from lab3_usd.grade.outcome import status_of
from lab3_usd.grade.reports import write_reports
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.scoring import Grade, grade
from lab3_usd.grade.staging import Source, stage_submission
from lab3_usd.spec.spec import Lab
from lab3_usd.stage.fence import fenced
from lab3_usd.stage.fence_layers import Barred, Fence

Json = dict[str, Any]


class Course(Struct, frozen=True):
    """What every submission of a class is judged with.

    `starter` is open already, and `allowed` are the files that it consists of.
    """

    lab: Lab
    rubric: Rubric
    starter: Starter | None
    allowed: frozenset[str]
    limits: Limits


class Task(Struct, frozen=True):
    """One submission to judge: whose it is, what it consists of, and what is known of it.

    `folder` is the student's place in the gradebook, `name` what the platform calls the student.
    `broken` names files that ended a worker, and how; `known` is the digest of what was judged
    before, with which there is nothing to do.
    """

    student: str
    folder: str
    sources: tuple[Source, ...]
    late: bool = False
    name: str = ""
    broken: Mapping[str, str] | None = None
    known: str = ""


def judge_task(course: Course, task: Task, scratch: Path, announce: Callable[[str], None]) -> Json:
    """Copy a submission into `scratch`, judge the copy, and return everything to be recorded.

    Sets the working directory to the copy for as long as it takes.
    """
    try:
        staged = stage_submission(task.sources, scratch, course.limits)
    except TooLargeError as error:
        return not_judged(course.rubric, task.student, "too large", str(error), task.name)
    except ArchiveError as error:
        return not_judged(course.rubric, task.student, "unreadable", str(error), task.name)
    if task.known and task.known == staged.digest:
        return {"status": "known", "digest": staged.digest}
    fence = Fence(
        root=staged.folder.resolve(),
        check=partial(check_layer, limits=course.limits),
        allowed=course.allowed,
        broken=task.broken or {},
        announce=announce,
        graphs=tuple(spec.path for spec in course.lab.graphs.values()),
        nesting=course.limits.nesting,
    )
    with _inside(staged.folder), fenced(fence):
        found = check_folder(Path(), FolderSettings(starter=course.starter))
        found = _with_fence(found, task.student, staged.refused, fence.found.values())
        points = _points(course, found, late=task.late)
        fence.closed = _not_pictured(found.results)
        report = Report(found.results, (found.submission,))
        reports = write_reports(report, course.rubric, points, task.name)
    return {
        **_record(points, _status(found, task.broken or {}, staged.refused)),
        "digest": staged.digest,
        "verdicts": {each.checkpoint: each.verdict for each in found.results},
        "crashes": [crash.rule for crash in _crashes(found)],
        "reports": reports,
    }


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _not_pictured(results: Sequence[StageResult]) -> set[str]:
    """Name the stages without faults, but for the last: its pictures show what they show."""
    return {
        each.path
        for each in results[:-1]
        if all(finding.severity == "note" for finding in each.findings)
    }


def not_judged(rubric: Rubric, student: str, status: str, reason: str, name: str = "") -> Json:
    """Return the record of a submission of which nothing could be judged, with a report of why."""
    points = grade(rubric, ())
    finding = _finding(all_rules()["Z01"], student, reason)
    report = Report((), (Submission(student, (finding,)),))
    return {
        **_record(points, (status, reason)),
        "digest": "",
        "verdicts": {},
        "crashes": [],
        "reports": write_reports(report, rubric, points, name),
    }


def _record(points: Grade, status: tuple[str, str]) -> Json:
    record: Json = to_builtins(points)
    return {"status": status[0], "reason": status[1], **record}


def _points(course: Course, found: FolderResult, *, late: bool) -> Grade:
    return grade(course.rubric, found.results, found.submission.checklist, late=late)


def _status(
    found: FolderResult, broken: Mapping[str, str], refused: Sequence[Refused]
) -> tuple[str, str]:
    for path, how in broken.items():
        return status_of(how), f"{path}: {how}"
    if not found.results:
        because = "; ".join(f"{each.path}: {each.reason}" for each in refused[:1])
        return "empty", because or "holds no stage of a checkpoint"
    if _crashes(found):
        return "tool failed", "a rule of the checker failed; please report it"
    return "graded", ""


def _crashes(found: FolderResult) -> Sequence[Crash]:
    crashes = [crash for each in found.results for crash in each.crashes]
    return [*crashes, *found.submission.crashes]


def _with_fence(
    found: FolderResult, student: str, refused: Iterable[Refused], barred: Iterable[Barred]
) -> FolderResult:
    """Add what was left out to the results, as findings of the rules about it."""
    rules = all_rules()
    files = [_finding(rules["Z01"], each.path, each.reason) for each in refused]
    grave: dict[str, list[Finding]] = {}
    for each in barred:
        if each.grave:
            finding = _finding(rules["Z02"], each.asset, each.reason)
            grave.setdefault(each.stage, []).append(replace(finding, layer=each.stage))
    results = tuple(_with_errors(each, grave.get(each.path, [])) for each in found.results)
    findings = ordered((*found.submission.findings, *files))
    return FolderResult(results, replace(found.submission, path=student, findings=findings))


def _finding(rule: Rule, *arguments: str) -> Finding:
    (problem,) = rule.check(*arguments)
    return finding_of(rule, problem)


def _with_errors(result: StageResult, errors: list[Finding]) -> StageResult:
    if not errors:
        return result
    verdict: Verdict = "unreadable" if result.verdict == "unreadable" else "fail"
    return replace(result, findings=ordered((*result.findings, *errors)), verdict=verdict)
