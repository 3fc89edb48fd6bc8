"""What differs between two stages as JSON in the form of `schema/diff-1.json`."""

from __future__ import annotations

import json

from msgspec.structs import asdict

from lab3_usd.model.changes import StageDiff
from lab3_usd.report.safe_text import truncated_values
from lab3_usd.report.tool import NAME, tool_version

VERSION = 1


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
