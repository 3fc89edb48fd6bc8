"""Checks one untrusted submission as grading does, and returns the report instead of points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath

import msgspec
from msgspec.structs import replace

from lab3_usd.grade.class_run import grade_alone
from lab3_usd.grade.workers.messages import PoolSettings
from lab3_usd.grade.workers.submission_grading import ungraded_report
from lab3_usd.model.finding import Crash, Finding, Report, StageResult, Submission


class _Sent(Finding, frozen=True):
    """A finding as a worker sends it: without its repair."""

    fix: None = None


class _SentResult(StageResult, frozen=True):
    findings: tuple[_Sent, ...] = ()


class _SentSubmission(Submission, frozen=True):
    findings: tuple[_Sent, ...] = ()


class _SentReport(Report, frozen=True):
    results: tuple[_SentResult, ...]
    submissions: tuple[_SentSubmission, ...] = ()


def check_untrusted(
    submission: Path, settings: PoolSettings, notify: Callable[[str], None]
) -> Report:
    """Judge a folder or an archive in a worker, as a copy within the fence.

    Files go by where they lie from here, and a failure of the program is a crash in the report.

    Raises:
        SpecError: the rubric of the lab is wrong.
        StageError: the starter cannot be opened.
        UsageError: there is no such submission, or no starter to judge it with.
    """
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
