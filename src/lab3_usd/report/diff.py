"""What differs between two stages, as text and as JSON in the form of `schema/diff-1.json`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby

from msgspec.structs import asdict

from lab3_usd.model.changes import ChangeKind, Part, StageChange, StageDiff
from lab3_usd.report.options import NAME, tool_version
from lab3_usd.report.safe_text import printable, truncated_values

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
_OF_WHOLES = ("node", "topic")  # whose properties are facts about them


def lines(diff: StageDiff) -> Iterator[str]:
    """Yield the lines of the report: a heading, then each part with its changes."""
    count = len(diff.changes)
    counted = "no differences" if not count else f"{count} change{'s' * (count > 1)}"
    yield printable(f"{diff.before} -> {diff.after}: {counted}")
    for part, changes in groupby(diff.changes, key=lambda change: change.part):
        yield ""
        yield TITLES[part]
        for change in changes:
            yield printable(f"  {SIGNS[change.edit]} {_change_text(change)}")


def _change_text(change: StageChange) -> str:
    if change.part == "wire":
        return f"{change.was or change.now} -> {change.path}.{change.property}"
    if change.part == "frame":
        return change.was or change.now
    separator = " " if change.part in _OF_WHOLES or change.property == "schema" else "."
    place = f"{change.path}{separator}{change.property}" if change.property else change.path
    if change.edit == "changed":
        return f"{place}: {change.was} -> {change.now}"
    if change.edit == "removed" and change.now:
        return f"{place}: {change.was} is {change.now}"
    return f"{place}: {change.was or change.now}"


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
    return json.dumps(truncated_values(data), indent=1) + "\n"
