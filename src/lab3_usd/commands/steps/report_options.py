"""The options of every command that judges stages and reports what it found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])

_REPORT_OPTIONS = (
    click.option(
        "--format",
        "form",
        default="text",
        metavar="NAME",
        show_default=True,
        help="How to report: text, json, sarif, ... (a wrong name lists them all).",
    ),
    click.option("--output", "-o", type=click.Path(), help="Write the report to this file."),
    click.option(
        "--select", multiple=True, metavar="RULES", help="Only these rules (W01) or families (W)."
    ),
    click.option("--ignore", multiple=True, metavar="RULES", help="Not these rules or families."),
    click.option(
        "--fail-on",
        type=click.Choice(["error", "warning"]),
        default="error",
        show_default=True,
        help="Exit 1 from this severity on.",
    ),
    click.option("--exit-zero", is_flag=True, help="Exit 0 whatever is found."),
    click.option(
        "--baseline",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Leave out what this file knows.",
    ),
    click.option(
        "--write-baseline",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Write all findings to this file, as known from now on.",
    ),
)


def report_options(command: Command) -> Command:
    """Add the options that say what is reported, where and in which form."""
    for option in reversed(_REPORT_OPTIONS):
        command = option(command)
    return command


native_option = click.option(
    "--native", is_flag=True, help="Also run the validators that come with OpenUSD (rules UV)."
)


_VIEW_OPTIONS = (
    click.option(
        "--jobs",
        "-j",
        type=click.IntRange(1, 256),
        default=1,
        metavar="N",
        show_default=True,
        help="Judge N files or submissions at once, each in a process of its own.",
    ),
    click.option(
        "--watch", is_flag=True, help="Judge again whatever is saved, until Ctrl-C (extra watch)."
    ),
    click.option("--quiet", "-q", is_flag=True, help="Only the summary lines."),
    click.option("--verbose", "-v", is_flag=True, help="Also why each rule matters."),
    click.option("--each", is_flag=True, help="Report a folder file by file, not fault by fault."),
    click.option(
        "--source",
        type=click.Choice(["auto", "always", "never"]),
        default="auto",
        show_default=True,
        help="Show the lines of the file at fault; auto: for a single stage.",
    ),
    click.option("--statistics", is_flag=True, help="Count the faults by rule."),
)


def view_options(command: Command) -> Command:
    """Add the options that say how many judge at once, and how much is shown."""
    for option in reversed(_VIEW_OPTIONS):
        command = option(command)
    return command
