"""Options of grading that belong together: the bounds of a worker, the export of a platform."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct

from lab3_usd.commands.shared.options import (
    FiniteRange,
    all_of,
    file_option,
    made_of,
    named_options,
    recorded,
    refuse_options,
)
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.grade.intake.submission_copy import Limits


def _limits(timeout: float, memory: int) -> Limits:
    from lab3_usd.grade.intake.submission_copy import MEGABYTE, Limits

    return Limits(seconds=timeout, memory=memory * MEGABYTE)


bound_options = all_of(
    click.option(
        "--timeout",
        type=FiniteRange(1, 3600),
        default=20,
        show_default=True,
        metavar="S",
        help="Seconds of processor time for one file; a submission may take ten times as long.",
    ),
    click.option(
        "--memory",
        type=click.IntRange(512, 1 << 20),
        default=2048,
        show_default=True,
        metavar="MB",
        help="Memory that a worker may use.",
    ),
    made_of("limits", ("timeout", "memory"), _limits),
)


class ExportOptions(Struct, frozen=True):
    """Into which export of a platform points are filled, and how; `map` says whose they are."""

    gradebook: str | None
    roster: Path | None
    column: str
    scale: bool
    map: Path | None
    feedback: bool
    preview: bool


export_options = all_of(
    click.option(
        "--gradebook",
        metavar="PLATFORM",
        help="Fill the points into the export of canvas, moodle, brightspace or blackboard.",
    ),
    file_option(
        "--roster",
        text="The platform's own export of its gradebook, for --gradebook.",
    ),
    click.option("--column", default="", metavar="NAME", help="Its column for the points."),
    click.option("--scale", is_flag=True, help="Convert the points to the maximum of the column."),
    file_option(
        "--map",
        text="Table of submission and id, or classroom_roster.csv, for --gradebook.",
    ),
    click.option(
        "--feedback",
        is_flag=True,
        help="With --gradebook: also write what returns reasons and reports on the platform.",
    ),
    click.option(
        "--preview",
        "--dry-run",
        "preview",
        is_flag=True,
        help="Only show what --gradebook would fill in.",
    ),
    recorded("export", ExportOptions),
)


def check_export(export: ExportOptions) -> None:
    """Refuse what does not go together of an export.

    Raises:
        UsageError: it does not go together.
    """
    from lab3_usd.grade.rosters import PLATFORMS

    if export.gradebook == "gradescope":
        raise UsageError(
            "--gradebook gradescope: Gradescope imports no points; give it the results.json of "
            "--format gradescope"
        )
    if export.gradebook not in {None, *PLATFORMS}:
        names = ", ".join(PLATFORMS)
        raise UsageError(f"--gradebook {export.gradebook}: is none of {names}")
    if (export.gradebook is None) != (export.roster is None):
        raise UsageError("--gradebook and --roster go together: the export names the students")
    if export.gradebook is None:
        of_exports = named_options(export, "column", "scale", "map", "preview", "feedback")
        refuse_options(of_exports, "is for --gradebook PLATFORM with --roster FILE")
