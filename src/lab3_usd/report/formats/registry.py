"""The output formats of a report: their table, and rendering."""

from __future__ import annotations

import importlib

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Report
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import truncated_report


class Format(Struct, frozen=True):
    """One output format: the module below `report` that renders it, and what it is for.

    `manual` says that the renderer quotes the rules' manuals, so that they are worth importing.
    """

    module: str
    purpose: str
    manual: bool = False
    changes: bool = False


# A module is imported when its format is asked for: checking one file stays fast.
FORMATS: dict[str, Format] = {
    "text": Format("formats.text", "for people, on a terminal or in a file"),
    "concise": Format("formats.concise", "one line for each finding, for editors"),
    "json": Format("formats.json_report", "for programs; schema/report-2.json"),
    "jsonl": Format("formats.jsonl", "one JSON object for each finding"),
    "sarif": Format("formats.sarif", "SARIF 2.1.0, for code scanning", manual=True, changes=True),
    "junit": Format("formats.junit", "JUnit XML, for Jenkins and its kind"),
    "github": Format("formats.github", "annotations of GitHub Actions"),
    "gitlab": Format("formats.gitlab", "GitLab Code Quality"),
    "gradescope": Format("formats.gradescope", "results of a Gradescope autograder"),
    "csv": Format("formats.csv_report", "one row for each finding, for spreadsheets"),
    "markdown": Format("formats.markdown", "tables, for pull requests and wikis"),
    "html": Format("html.report_page", "one self-contained page", manual=True),
}


def format_named(name: str) -> Format:
    """Return the entry of one format.

    Raises:
        UsageError: there is no such format; the message lists those there are.
    """
    entry = FORMATS.get(name)
    if entry is None:
        raise UsageError(f"there is no format '{name}'; the formats are {', '.join(FORMATS)}")
    return entry


def module_of(name: str) -> str:
    """Return the name of the module that renders a format.

    Raises:
        UsageError: there is no such format.
    """
    return f"lab3_usd.report.{format_named(name).module}"


def render(
    name: str, report: Report, rules: Rules | None = None, options: Options | None = None
) -> str:
    """Return the report in one format, ending with a line feed unless it is empty.

    Its texts are truncated (see `safe_text`).

    Raises:
        UsageError: there is no such format, or it cannot do what `options` asks.
    """
    module = importlib.import_module(module_of(name))
    text: str = module.render(truncated_report(report), rules, options or Options())
    return text
