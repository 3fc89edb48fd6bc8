"""Reads what a grader decides by hand: points and remarks for items of students."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.files import write_whole
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.text_table import TextTable, read_text_table

ADJUSTMENTS = "adjustments.csv"  # the copy that the gradebook keeps
_COLUMNS = ("student", "item", "points", "text")
WHOLE = ""  # the item of what is decided about a whole submission
_DAYS = re.compile(r"([1-9][0-9]?)d", re.ASCII)
_POINTS = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]+)?", re.ASCII)


class Adjustment(Struct, frozen=True):
    """What a grader decided about an item: its points, or with `is_change` a change of them.

    Without points it is a remark. `line` is where it stands in the file. A whole submission may be
    so many `days` late.
    """

    text: str
    points: float | None
    is_change: bool
    line: int
    days: int = 0


ByItem = Mapping[str, Adjustment]


def adjustments_in(
    out: Path, given: Path | None, rubric: Rubric, students: Iterable[tuple[str, str]]
) -> dict[str, dict[str, Adjustment]] | None:
    """Return the adjustments by student and item, and keep a copy of the file in the gradebook.

    Without a file `given` that copy counts; None where there is none. `students` are numbers and
    names.

    Raises:
        UsageError: the file is no such table, or a line names an unknown student or item, has no
            text or wrong points, or repeats another one.
    """
    copy = out / ADJUSTMENTS
    path = given or copy
    if given is None and not copy.is_file():
        return None
    table = read_text_table(path)
    headings = [heading.casefold() for heading in table.headings] if table.rows else []
    if not set(_COLUMNS) <= set(headings):
        raise UsageError(f"{path}: needs the columns {', '.join(_COLUMNS)}")
    columns = [headings.index(name) for name in _COLUMNS]
    points = {item.id: item.points for item in rubric.items}
    points[WHOLE] = sum(points.values())
    numbers, names = _by_name(students)
    found: dict[str, dict[str, Adjustment]] = {}
    for row in table.lines:
        student, item, amount, text = (table.value(row, place).strip() for place in columns)
        line = _line_of(table, row)
        place = f"{path}: line {line}"
        called = [student] if student in numbers else names.get(student.casefold(), [])
        if len(called) != 1:
            what = "several students have the name" if called else "no student is called"
            near = None if called else likely_name(student, {*numbers, *names})
            ways = did_you_mean(near) or "; give the number of grades.csv"
            raise UsageError(f"{place}: {what} '{student}'{ways}")
        if item not in points:
            known = ", ".join(filter(None, points))
            raise UsageError(f"{place}: the rubric has no item '{item}'; it has {known}")
        if not text:
            raise UsageError(f"{place}: has no text; the student reads it as the reason")
        own = found.setdefault(called[0], {})
        if item in own:
            what = item or "the whole submission"
            raise UsageError(f"{place}: {student} and {what} are in line {own[item].line} too")
        days = _DAYS.fullmatch(amount) if item == WHOLE else None
        if days is not None and not rubric.late.per_day:
            raise UsageError(f"{place}: {amount} needs `late: {{per_day: 0.1}}` in the rubric")
        if days is not None:
            own[item] = Adjustment(text, None, is_change=False, line=line, days=int(days[1]))
            continue
        own[item] = Adjustment(
            text, _points(amount, points[item], place), amount.startswith(("+", "-")), line
        )
    if given is not None and not (copy.exists() and copy.samefile(given)):
        write_whole(copy, given.read_bytes(), force=True)
    return found


def _by_name(students: Iterable[tuple[str, str]]) -> tuple[set[str], dict[str, list[str]]]:
    numbers: set[str] = set()
    names: dict[str, list[str]] = {}
    for student, name in students:
        numbers.add(student)
        names.setdefault(name.casefold(), []).append(student)
    return numbers, names


def _line_of(table: TextTable, row: int) -> int:
    """Return the line of the file in which a row begins: a cell may hold several lines."""
    before = table.text[: table.rows[row][0].start]
    return len(re.findall(r"\r\n|\r|\n", before)) + 1


def _points(amount: str, most: float, place: str) -> float | None:
    if not amount:
        return None
    if not _POINTS.fullmatch(amount):
        raise UsageError(f"{place}: '{amount}' is not a number of points, such as 8, +2 or -1.5")
    points = float(amount.replace(",", "."))
    if abs(points) > most:
        raise UsageError(f"{place}: {amount} points are more than the item's {most:g}")
    return points
