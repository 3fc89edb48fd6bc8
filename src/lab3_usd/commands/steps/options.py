"""Options that several commands share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any

import click

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import is_among

_Decorated = Callable[..., Any]

text_or_json: Callable[[_Decorated], _Decorated] = click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="How to report.",
)


def script_options(command: _Decorated) -> _Decorated:
    """Let a command that writes a script be told where to, and whether to replace a file."""
    force = click.option("--force", is_flag=True, help="Replace a file that exists.")
    where = click.option(
        "-o",
        "--out",
        "script",
        required=True,
        type=click.Path(path_type=Path, dir_okay=False),
        help="Where to write the script.",
    )
    return where(force(command))


def split_rules(values: Iterable[str]) -> tuple[str, ...]:
    """Return rule ids and families out of repeated, comma-separated options, in capitals.

    Raises:
        UsageError: there is no such rule or family; left out, it would hide every fault.
    """
    parts = [part for value in values for part in value.split(",") if part.strip()]
    if not parts:
        return ()
    from lab3_usd.check.registry import check_rule_names  # noqa: PLC0415 - only when named

    return check_rule_names(parts)


def checkpoint_number(given: str, known: Collection[str]) -> str:
    """Return the number of a checkpoint as the lab writes it: `2` is `02`.

    Raises:
        UsageError: there is no such checkpoint; the line lists those there are.
    """
    alike = (each for each in known if _is_same_number(each, given))
    number = given if given in known else next(alike, given)
    if number not in known:
        message = f"there is no checkpoint '{given}'; known are {', '.join(known)}"
        raise UsageError(message)
    return number


def _is_same_number(one: str, other: str) -> bool:
    return one.isdecimal() and other.isdecimal() and int(one) == int(other)


def chosen(rule: str, select: tuple[str, ...], ignore: tuple[str, ...]) -> bool:
    """Whether the findings of a rule are wanted; a family means all of its rules."""
    return (not select or is_among(rule, select)) and not is_among(rule, ignore)


def wants_color() -> bool:
    """Whether standard output is a terminal that shows colour (see no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


def width() -> int:
    """Return the columns of the terminal, 100 when there is none."""
    import shutil  # noqa: PLC0415 - only where a terminal is written to

    return shutil.get_terminal_size((100, 24)).columns
