"""The output formats of a report: their table, and rendering."""

from __future__ import annotations

import importlib

from lab3_usd.errors import UsageError, guess
from lab3_usd.hooks import Format, features
from lab3_usd.model.finding import Report
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import truncated_values

# A module is imported when its format is asked for: checking one file stays fast.
_OF_THE_CORE: dict[str, Format] = {
    "text": Format("lab3_usd.report.formats.text_report", "for people, on a terminal or in a file"),
    "concise": Format("lab3_usd.report.formats.concise", "one line for each finding, for editors"),
    "json": Format("lab3_usd.report.formats.json_report", "for programs; schema/report-2.json"),
    "jsonl": Format("lab3_usd.report.formats.jsonl", "one JSON object for each finding"),
    "sarif": Format(
        "lab3_usd.report.formats.sarif", "SARIF 2.1.0, for code scanning", manual=True, changes=True
    ),
    "junit": Format("lab3_usd.report.formats.junit", "JUnit XML, for Jenkins and its kind"),
    "github": Format("lab3_usd.report.formats.github", "annotations of GitHub Actions"),
    "gitlab": Format("lab3_usd.report.formats.gitlab", "GitLab Code Quality"),
    "csv": Format(
        "lab3_usd.report.formats.csv_report", "one row for each finding, for spreadsheets"
    ),
    "markdown": Format("lab3_usd.report.formats.markdown", "tables, for pull requests and wikis"),
}


def all_formats() -> dict[str, Format]:
    """Return every format by its name: those of the core, then those of features."""
    formats = dict(_OF_THE_CORE)
    for feature in features():
        formats |= feature.formats
    return formats


def format_named(name: str) -> Format:
    """Return the entry of one format.

    Raises:
        UsageError: there is no such format; the message guesses, or lists those there are.
    """
    entry = _OF_THE_CORE.get(name) or all_formats().get(name)
    if entry is None:
        raise UsageError(f"there is no format '{name}'; {guess(name, all_formats())}")
    return entry


def render(
    name: str, report: Report, rules: Rules | None = None, options: Options | None = None
) -> str:
    """Return the report in one format, ending with a line feed unless it is empty.

    Its texts are truncated (see `safe_text`).

    Raises:
        UsageError: there is no such format, or it cannot do what `options` asks.
    """
    module = importlib.import_module(format_named(name).module)
    text: str = module.render(truncated_values(report), rules, options or Options())
    return text
