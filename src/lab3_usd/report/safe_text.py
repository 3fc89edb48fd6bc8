"""Strings from a stage made safe to report: escaped where they do not print, and truncated."""

from __future__ import annotations

from typing import Any, TypeVar

from msgspec.structs import asdict, replace

from lab3_usd.model.finding import ChecklistItem, Crash, Finding, Report, StageResult, Submission

LONGEST = 1000  # characters
# A cell that opens with one of these is a formula to a spreadsheet.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n")
CELL_LIMIT = 32_000  # spreadsheets hold 32767 characters a cell


def visible(text: str) -> str:
    r"""Return `text` with everything that does not print written as an escape (`\x1b`, `\u202e`).

    Covers the control characters that terminals obey, line ends, marks that turn the direction
    of writing, lone surrogates and every character that XML 1.0 forbids. The result is one line.
    """
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")


def safe_cell(text: str) -> str:
    """Return the text as a spreadsheet cell; an apostrophe before it disables a formula."""
    guarded = f"'{text}" if text.startswith(FORMULA_STARTS) else text
    return visible(guarded)[:CELL_LIMIT]


def truncated(text: str) -> str:
    """Return the text; one longer than `LONGEST` is truncated and ends with its length."""
    if len(text) <= LONGEST:
        return text
    return f"{text[:LONGEST]}... ({len(text)} characters)"


def printable(text: str) -> str:
    """Return the text truncated, with escapes for characters that do not print."""
    return visible(truncated(text))


def dot_string(text: str) -> str:
    """Return any text as a string of Graphviz, in which nothing is an escape."""
    return '"' + printable(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def truncated_values(document: Any) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return plain data with every text in it truncated."""
    if isinstance(document, str):
        return truncated(document)
    if isinstance(document, dict):
        return {key: truncated_values(value) for key, value in document.items()}
    return (
        type(document)(map(truncated_values, document))
        if isinstance(document, (list, tuple))
        else document
    )


def truncated_report(report: Report) -> Report:
    """Return a report with every text truncated; paths stay, because files are opened again."""
    return replace(
        report,
        results=tuple(map(_truncated_result, report.results)),
        submissions=tuple(
            replace(_truncated_result(each), checklist=tuple(map(_truncated_texts, each.checklist)))
            for each in report.submissions
        ),
    )


_Result = TypeVar("_Result", StageResult, Submission)
_Texts = TypeVar("_Texts", Finding, Crash, ChecklistItem)


def _truncated_result(result: _Result) -> _Result:
    return replace(
        result,
        findings=tuple(map(_truncated_texts, result.findings)),
        crashes=tuple(map(_truncated_texts, result.crashes)),
    )


def _truncated_texts(texts: _Texts) -> _Texts:
    whole = asdict(texts)
    return replace(
        texts, **{name: truncated_values(whole[name]) for name in whole if name != "layer"}
    )
