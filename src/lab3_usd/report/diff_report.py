"""The differences between two stages, as text and as JSON in the form of `schema/diff-1.json`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import groupby

from msgspec.structs import asdict

from lab3_usd.model.changes import ChangeKind, Part, StageChange, StageDiff
from lab3_usd.report.options import NAME, tool_version
from lab3_usd.report.safe_text import json_text, printable, truncated_values

VERSION = 1
TITLES: dict[Part, str] = {
    "graph": "graphs",
    "node": "nodes",
    "value": "values",
    "wire": "wires",
    "target": "targets",
    "robot": "robot",
    "scene": "scene",
    "topic": "topics",
    "frame": "frames",
}
SIGNS: dict[ChangeKind, str] = {"added": "+", "removed": "-", "changed": "~"}
_BELOW = " " * 6
_OF_WHOLES = ("node", "topic")  # whose properties are facts about them


def lines(diff: StageDiff, width: int = sys.maxsize) -> Iterator[str]:
    """Yield the lines of the report: a heading, then each part with its changes.

    Where a line is wider, the place and what changed there stand below each other.
    """
    count = len(diff.changes)
    counted = "no differences" if not count else f"{count} change{'s' * (count > 1)}"
    yield printable(f"{diff.before} -> {diff.after}: {counted}")
    for part, changes in groupby(diff.changes, key=lambda change: change.part):
        yield ""
        yield TITLES[part]
        for change in changes:
            sign, parts = SIGNS[change.edit], [*map(printable, _change_parts(change))]
            line = f"  {sign} {' '.join(parts)}"
            if len(line) <= width:
                yield line
            else:
                yield f"  {sign} {parts[0]}"
                rest = " ".join(parts[1:])
                below = [rest] if len(rest) + len(_BELOW) <= width else parts[1:]
                yield from (_BELOW + part for part in below)


def _change_parts(change: StageChange) -> Iterator[str]:
    """Yield the parts of a line: where, and what was and is there."""
    if change.part == "wire":
        yield f"{change.was or change.now}"
        yield f"-> {change.path}.{change.property}"
        return
    if change.part == "frame":
        yield change.was or change.now
        return
    separator = " " if change.part in _OF_WHOLES or change.property == "schema" else "."
    yield f"{change.path}{separator}{change.property}:" if change.property else f"{change.path}:"
    if change.edit == "changed":
        yield change.was
        yield f"-> {change.now}"
    elif change.edit == "removed" and change.now:
        yield f"{change.was} is {change.now}"
    else:
        yield change.was or change.now


def render(diff: StageDiff) -> str:
    """Return the differences as JSON text in ASCII."""
    data = {
        "version": VERSION,
        "tool": {"name": NAME, "version": tool_version()},
        "before": diff.before,
        "after": diff.after,
        "equal": not diff.changes,
        "changes": [asdict(change) for change in diff.changes],
    }
    return json_text(truncated_values(data), 1)
