"""How the judging of a submission can end, in the words that workers, pool and gradebook share."""

from __future__ import annotations

OUT_OF_TIME, OUT_OF_MEMORY = "ran out of time", "ran out of memory"
TOO_LARGE, TOOL_FAILED = "too large", "tool failed"
CRASHED = "crashed usd-core"
_STATUSES = {
    OUT_OF_TIME: "timeout",
    OUT_OF_MEMORY: "too large",
    TOO_LARGE: "too large",
    TOOL_FAILED: "tool failed",
}


def status_of(how: str) -> str:
    """Return the status to record for a submission, from how its worker ended."""
    for beginning, status in _STATUSES.items():
        if how.startswith(beginning):
            return status
    return "crashed"
