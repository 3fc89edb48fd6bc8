"""Gradebooks and pages of a class, without any judging."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from lab3_usd.grade.gradebook import owner_record
from lab3_usd.grade.intake.submissions import StudentSubmission, find_submissions
from lab3_usd.report.html.class_page import class_page


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


ITEMS = [
    {"id": "clock", "title": "/clock is publishing", "points": 10.0, "optional": False},
    {"id": "tree", "title": "The TF tree is connected", "points": 5.0, "optional": False},
]


EVIL = "<script>alert(1)</script>\x1b[2J{{ 7 * 7 }}\" onmouseover='x'"


def page_of(
    title: str,
    items: list[dict[str, Any]],
    rows: list[dict[str, Any]],
    alike: list[dict[str, Any]] | None = None,
) -> str:
    return "".join(class_page(title, items, rows, alike or ()))


def row(student: str, percent: float | None = 100.0, **changes: Any) -> dict[str, Any]:
    states = {"clock": ("full", 10.0, 10.0), "tree": ("blocked", 0.0, 0.0)}
    items = [
        {"id": name, "state": state, "earned": earned, "possible": possible, "because": ""}
        for name, (state, earned, possible) in states.items()
    ]
    return {
        "student": student,
        "name": f"Name of {student}",
        "folder": student,
        "status": "graded",
        "reason": "",
        "remarks": [],
        "because": [],
        "late": False,
        "percent": percent,
        "earned": 10.0,
        "possible": 10.0,
        "items": items,
        "lost": [],
        "reports": ["report.html"],
        **changes,
    }
