"""Checks untrusted submissions as grading does, and returns their reports instead of points."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from pathlib import Path, PurePosixPath

import msgspec
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import grade_alone
from lab3_usd.grade.intake.archives import is_archive
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.submission_grading import ungraded_report
from lab3_usd.grade.workers.worker_messages import PoolSettings
from lab3_usd.model.finding import Crash, Finding, Report, StageResult, Submission
from lab3_usd.pipeline.results import Results, Target


class _Sent(Finding, frozen=True):
    """A finding as a worker sends it: without its repair."""

    fix: None = None


class _SentResult(StageResult, frozen=True):
    findings: tuple[_Sent, ...] = ()
    hidden: tuple[_Sent, ...] = ()


class _SentSubmission(Submission, frozen=True):
    findings: tuple[_Sent, ...] = ()
    hidden: tuple[_Sent, ...] = ()


class _SentReport(Report, frozen=True):
    results: tuple[_SentResult, ...]
    submissions: tuple[_SentSubmission, ...] = ()


def find_untrusted(path: str) -> list[Target]:
    """Return the submission at a path.

    Raises:
        UsageError: it is neither a folder nor an archive.
    """
    if not Path(path).is_dir() and not is_archive(path):
        raise UsageError(f"{path}: --untrusted judges submissions: give a folder or an archive")
    return [Target(path, is_submission=True)]


def judge_untrusted(
    entries: Iterable[Target],
    starter: Path,
    assets: dict[str, Path],
    notify: Callable[[str], None],
) -> Generator[Results]:
    """Judge submissions one after the other, each in a worker and as a copy in a sandbox.

    Files go by where they lie from here, and a failure of the program is a crash in the report.

    Raises:
        SpecError: the rubric of the lab is wrong.
        StageError: the starter cannot be opened.
        UsageError: there is no such submission, or no starter to judge it with.
    """
    settings = PoolSettings(starter, None, Limits(), assets=assets)
    for entry in entries:
        report = _check_untrusted(Path(entry.path), settings, notify)
        yield report.results, report.submissions


def _check_untrusted(
    submission: Path, settings: PoolSettings, notify: Callable[[str], None]
) -> Report:
    answer = grade_alone(submission, replace(settings, with_report=True), notify)
    if "report" in answer:
        report: Report = msgspec.convert(answer["report"], _SentReport)
    else:
        report = ungraded_report(str(submission), answer["reason"])
    place = PurePosixPath(submission.as_posix()) / answer.get("place", "")
    is_said = "report" in answer  # which has its crashes
    crash = () if is_said else tuple(Crash(rule, answer["reason"]) for rule in answer["crashes"])
    return Report(
        tuple(
            replace(
                result,
                path=str(place / result.path),
                findings=tuple(_placed(result.findings, place)),
            )
            for result in report.results
        ),
        tuple(
            replace(
                about,
                path=str(submission),
                findings=tuple(_placed(about.findings, place)),
                crashes=(*about.crashes, *crash),
            )
            for about in report.submissions
        ),
    )


def _placed(findings: Iterable[Finding], place: PurePosixPath) -> Iterable[Finding]:
    """Yield findings with the files that they name as seen from here."""
    for finding in findings:
        yield replace(finding, layer=str(place / finding.layer)) if finding.layer else finding
