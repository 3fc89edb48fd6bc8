"""Gradebooks of classes whose submissions have names of a platform, without any judging."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from lab3_usd.grade.gradebook import owner_record
from lab3_usd.grade.intake.submissions import StudentSubmission, find_submissions


def laid_out(place: Path, names: Iterable[str]) -> Path:
    """Make files and, where a name ends in a slash, folders."""
    place.mkdir(parents=True, exist_ok=True)
    for name in names:
        if name.endswith("/"):
            (place / name).mkdir()
        else:
            (place / name).touch()
    return place


def book_of(
    place: Path,
    earned: Callable[[StudentSubmission], float],
    *,
    title: str = "Lab 3",
    points: float = 100.0,
) -> dict[str, Any]:
    """What grades.json says of the class in a folder."""
    rows = [
        {
            **owner_record(submission),
            "status": "graded",
            "reason": "",
            "earned": earned(submission),
            "because": [],
        }
        for submission in find_submissions(place)
    ]
    return {"title": title, "points": points, "students": rows, "items": []}
