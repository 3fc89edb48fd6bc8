"""Texts of a length that somebody reads: no value of a stage or a file makes a report large."""

from __future__ import annotations

from typing import Any, TypeVar

from msgspec.structs import asdict, replace

from lab3_usd.check.finding import ChecklistItem, Crash, Finding, Report, StageResult, Submission
from lab3_usd.report.escape import visible

LONGEST = 1000  # characters


def cut(text: str) -> str:
    """Return a text as reports show it: what is longer than `LONGEST` ends with how long it is."""
    if len(text) <= LONGEST:
        return text
    return f"{text[:LONGEST]}... ({len(text)} characters)"


def shown(text: str) -> str:
    """Return a text cut, and what does not print in it written out."""
    return visible(cut(text))


def cut_all(document: Any) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return plain data with every text in it cut."""
    if isinstance(document, str):
        return cut(document)
    if isinstance(document, dict):
        return {key: cut_all(value) for key, value in document.items()}
    return (
        type(document)(map(cut_all, document)) if isinstance(document, (list, tuple)) else document
    )


def cut_report(report: Report) -> Report:
    """Return a report with every text cut; paths of files stay, they are opened again."""
    return replace(
        report,
        results=tuple(map(_cut_judged, report.results)),
        submissions=tuple(
            replace(_cut_judged(each), checklist=tuple(map(_cut_texts, each.checklist)))
            for each in report.submissions
        ),
    )


_Judged = TypeVar("_Judged", StageResult, Submission)
_Said = TypeVar("_Said", Finding, Crash, ChecklistItem)


def _cut_judged(judged: _Judged) -> _Judged:
    return replace(
        judged,
        findings=tuple(map(_cut_texts, judged.findings)),
        crashes=tuple(map(_cut_texts, judged.crashes)),
    )


def _cut_texts(said: _Said) -> _Said:
    whole = asdict(said)
    return replace(said, **{name: cut_all(whole[name]) for name in whole if name != "layer"})
