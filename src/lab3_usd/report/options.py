"""What a renderer is asked for, whatever the format."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from msgspec import Struct

from lab3_usd.check.registry import Rule
from lab3_usd.model.finding import Site
from lab3_usd.model.repair import TextChange

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
