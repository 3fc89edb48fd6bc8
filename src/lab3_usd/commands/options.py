"""What several commands' options have in common."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable

from lab3_usd.check.finding import Finding


def split_rules(values: Iterable[str]) -> tuple[str, ...]:
    """Return rule ids and families out of repeated, comma-separated options, in capitals."""
    return tuple(
        part.strip().upper() for value in values for part in value.split(",") if part.strip()
    )


def chosen(finding: Finding, select: tuple[str, ...], ignore: tuple[str, ...]) -> bool:
    """Whether a finding is wanted; a family letter means all of its rules."""
    if select and not finding.rule.startswith(select):
        return False
    return not (ignore and finding.rule.startswith(ignore))


def wants_color() -> bool:
    """Whether standard output is a terminal that shows colour (see no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


def width() -> int:
    """Return the columns of the terminal, 100 when there is none."""
    return shutil.get_terminal_size((100, 24)).columns
