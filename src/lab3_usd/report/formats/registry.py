"""The output formats of a report: their table, their options, and rendering."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from msgspec import Struct

from lab3_usd.check.registry import Rule
from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Report, Site
from lab3_usd.model.repair import TextChange
from lab3_usd.report.safe_text import truncated_report

if TYPE_CHECKING:
    from lab3_usd.report.behaviour.summary import DryRunSummary
    from lab3_usd.report.html.grade_summary import GradeSummary

Verbosity = Literal["quiet", "normal", "verbose"]
Source = Literal["auto", "always", "never"]
Rules = Mapping[str, Rule]


class Options(Struct, frozen=True):
    """The options of a renderer.

    Only text heeds the first of these. `color` and `width` (columns) describe the terminal;
    `statistics` adds the table of faults by rule; `source` says whether lines of the files are
    shown (auto: for a single stage); `each` asks for every file by itself where the stages of a
    folder would be reported together; `points` are what each checkpoint is worth. `verbosity` is
    heeded by text and json. `root` is the folder that paths in SARIF, GitHub and GitLab are
    relative to (None: the current one). `visibility` says when Gradescope shows the results to the
    student. `grade` is the grade of the one submission that is reported, `dry_runs` what stages do
    in a dry run, by their paths; only HTML shows these two.
    `changes` are the lines that the repairs of a stage's findings would change, for SARIF.
    """

    color: bool = False
    width: int = 80
    verbosity: Verbosity = "normal"
    statistics: bool = False
    source: Source = "auto"
    each: bool = False
    points: Mapping[str, float] = {}
    root: str | None = None
    visibility: str = "visible"
    grade: GradeSummary | None = None
    dry_runs: Mapping[str, DryRunSummary] = {}
    changes: Mapping[tuple[str, Site], tuple[TextChange, ...]] = {}


class Format(Struct, frozen=True):
    """One output format: the module that renders it, and what it is for.

    `manual` says that the renderer quotes the rules' manuals, so that they are worth importing.
    """

    module: str
    purpose: str
    manual: bool = False
    changes: bool = False


# A module is imported when its format is asked for: checking one file stays fast.
FORMATS: dict[str, Format] = {
    "text": Format("text", "for people, on a terminal or in a file"),
    "concise": Format("concise", "one line for each finding, for editors"),
    "json": Format("json_report", "for programs; schema/report-1.json"),
    "jsonl": Format("jsonl", "one JSON object for each finding"),
    "sarif": Format("sarif", "SARIF 2.1.0, for code scanning", manual=True, changes=True),
    "junit": Format("junit", "JUnit XML, for Jenkins and its kind"),
    "github": Format("github", "annotations of GitHub Actions"),
    "gitlab": Format("gitlab", "GitLab Code Quality"),
    "gradescope": Format("gradescope", "results of a Gradescope autograder"),
    "csv": Format("csv_report", "one row for each finding, for spreadsheets"),
    "markdown": Format("markdown", "tables, for pull requests and wikis"),
    "html": Format("html", "one self-contained page", manual=True),
}


def format_named(name: str) -> Format:
    """Return the entry of one format.

    Raises:
        UsageError: there is no such format; the message lists those there are.
    """
    found = FORMATS.get(name)
    if found is None:
        message = f"there is no format '{name}'; the formats are {', '.join(FORMATS)}"
        raise UsageError(message)
    return found


def render(
    name: str, report: Report, rules: Rules | None = None, options: Options | None = None
) -> str:
    """Return the report in one format, ending with a line feed unless it is empty.

    Its texts are truncated (see `safe_text`).

    Raises:
        UsageError: there is no such format, or it cannot do what `options` asks.
    """
    module = importlib.import_module(f"lab3_usd.report.formats.{format_named(name).module}")
    text: str = module.render(truncated_report(report), rules, options or Options())
    return text
