"""A report as a flat list of findings: what the formats without a hierarchy walk over."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.finding import SEVERITIES, Crash, Finding, Report


class Entry(Struct, frozen=True):
    """A finding and where it was made: the path as given, and the checkpoint of a stage."""

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
    """Yield every rule that failed itself, with the path it was looking at."""
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
    """Return the path of the prim or property at fault, as the Stage panel takes it."""
    return f"{finding.prim}.{finding.property}" if finding.property else finding.prim
