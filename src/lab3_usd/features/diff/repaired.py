"""The differences that a repair makes in a stage that is no text: `lab3 fix --diff`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.commands.shared.options import terminal_width
from lab3_usd.diff import compare_stages
from lab3_usd.files import copy_beside
from lab3_usd.report import diff_report
from lab3_usd.spec.load.loader import load_lab


def changes_to(path: Path, content: bytes) -> Iterator[str]:
    """Yield the differences between a stage and what it would hold, as `lab3 diff` prints them.

    Raises:
        StageError: one of them cannot be opened.
        UsageError: nothing can be written beside the stage, whose references the copy needs.
    """
    with copy_beside(path, content) as copy:
        compared = compare_stages(path, copy, load_lab()).diff
    yield from diff_report.lines(replace(compared, after="repaired"), terminal_width())
