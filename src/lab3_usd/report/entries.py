"""A report as a flat list of findings, for the formats without a hierarchy."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from lab3_usd.model.finding import SEVERITIES, Crash, Finding, Report


class Entry(Struct, frozen=True):
    """A finding with the path that was checked and the checkpoint of a stage."""

    path: str
    checkpoint: str | None
    finding: Finding

    @property
    def file(self) -> str:
        """The file to open: the layer that holds the fault where it is known."""
        return self.finding.layer or self.path


class Summary(Struct, frozen=True):
    """How many files were checked and passed, and how many findings there are."""

    files: int
    passed: int
    errors: int
    warnings: int
    notes: int


def entries(report: Report) -> Iterator[Entry]:
    """Yield every finding in the order of the report: the stages, then the submissions."""
    for result in report.results:
        for finding in result.findings:
            yield Entry(result.path, result.checkpoint, finding)
    for submission in report.submissions:
        for finding in submission.findings:
            yield Entry(submission.path, None, finding)


def crashes(report: Report) -> Iterator[tuple[str, Crash]]:
    """Yield every rule that crashed, with the path that was checked."""
    for result in report.results:
        for crash in result.crashes:
            yield result.path, crash
    for submission in report.submissions:
        for crash in submission.crashes:
            yield submission.path, crash


def summarize(report: Report) -> Summary:
    """Count files, passes and findings."""
    counts = dict.fromkeys(SEVERITIES, 0)
    for entry in entries(report):
        counts[entry.finding.severity] += 1
    return Summary(
        files=len(report.results),
        passed=sum(result.verdict == "pass" for result in report.results),
        errors=counts["error"],
        warnings=counts["warning"],
        notes=counts["note"],
    )


def site(finding: Finding) -> str:
    """Return the path of the faulty prim or property, as the Stage panel accepts it."""
    return f"{finding.prim}.{finding.property}" if finding.property else finding.prim


def relative_path(path: str, root: str | None) -> str:
    """Return `path` with forward slashes, relative to `root` (the current folder) if below it.

    Decided by the text alone: a link stays the file that was given.
    """
    base = os.path.normpath(Path.cwd() / (root or ""))
    whole = os.path.normpath(Path.cwd() / path)
    try:
        return Path(whole).relative_to(base).as_posix()
    except ValueError:
        return Path(whole).as_posix()
