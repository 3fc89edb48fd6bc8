"""The differences that a repair makes in a stage that is no text: `lab3 fix --diff`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec.structs import replace

from lab3_usd.commands.shared.options import terminal_width
from lab3_usd.diff import compare_stages
from lab3_usd.errors import UsageError
from lab3_usd.files import copy_beside
from lab3_usd.report import diff_report
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.session import anchored


def changes_to(path: Path, content: bytes) -> Iterator[str]:
    """Yield the differences between a stage and what it would hold, as `lab3 diff` prints them.

    In a folder where nothing can be written copies of both stand elsewhere.

    Raises:
        StageError: one of them cannot be opened.
    """
    with TemporaryDirectory(prefix="lab3-diff-") as folder, ExitStack() as stack:
        before = path
        try:
            after = stack.enter_context(copy_beside(path, content))
        except UsageError:
            before, after = (Path(folder, f"{name}{path.suffix}") for name in ("before", "after"))
            anchored(path.read_bytes(), path, before)
            anchored(content, path, after)
        compared = compare_stages(before, after, load_lab()).diff
    named = replace(compared, before=str(path), after="repaired")
    yield from diff_report.lines(named, terminal_width())
