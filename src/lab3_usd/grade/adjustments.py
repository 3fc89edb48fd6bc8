"""Reads what a grader decides by hand: points and remarks for items of students, and days late."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, timedelta
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.files import write_whole
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.text_table import csv_line, read_text_table
from lab3_usd.report.entries import plural

ADJUSTMENTS, LATE = "adjustments.csv", "late.csv"  # the copies that the gradebook keeps
# The columns that say what was decided.
_OF_POINTS = ("student", "item", "points", "text")
_OF_DAYS, _OF_TIMES = ("student", "days"), ("student", "submitted", "deadline")
WHOLE = ""  # the item of what is decided about a whole submission
_DAYS = re.compile(r"([1-9][0-9]?)d", re.ASCII)
_DAY = timedelta(days=1)
_POINTS = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]+)?", re.ASCII)


class Adjustment(Struct, frozen=True):
    """What a grader decided about an item: its points, or with `is_change` a change of them.

    Without points it is a remark. `line` is where it stands in the file. A whole submission may be
    so many `days` late, for which a table of days gives no `text`; None where nobody says so.
    """

    text: str
    points: float | None
    line: int
    is_change: bool = False
    days: int | None = None


ByItem = Mapping[str, Adjustment]


class Tables(Struct, frozen=True):
    """The tables that a grader gives: of decisions, and of days late."""

    decisions: Path | None = None
    late: Path | None = None


class Decisions(Struct, frozen=True):
    """What was decided by student and item, and what is told of lines that no longer count."""

    by_student: Mapping[str, ByItem]
    dropped: tuple[str, ...] = ()


class _Line(Struct, frozen=True):
    """A line of a table: where it begins in the file, as a cell may hold several, and its cells."""

    number: int
    cells: Mapping[str, str]


class _Lines(Struct, frozen=True):
    """The lines of a table, and the columns of it that say what was decided, () for none."""

    path: Path
    form: tuple[str, ...]
    lines: tuple[_Line, ...]

    @property
    def counted(self) -> list[_Line]:
        """Those that decide something: each with points or words, and who has a day or time."""
        of_points = self.form == _OF_POINTS
        return [line for line in self.lines if of_points or line.cells[self.form[1]]]

    def place(self, line: _Line) -> str:
        """Return the file and the line in it."""
        return f"{self.path}: line {line.number}"


class Roll:
    """The students of a class, by number and by name."""

    def __init__(self, students: Iterable[tuple[str, str]]) -> None:
        self.people = dict(students)
        self.names: dict[str, list[str]] = {}
        for student, name in self.people.items():
            self.names.setdefault(name.casefold(), []).append(student)

    def called(self, name: str) -> list[str]:
        """Return the numbers of those who may be meant."""
        return [name] if name in self.people else self.names.get(name.casefold(), [])

    def student(self, name: str) -> str:
        """Return the number of the student of this number or name.

        Raises:
            UsageError: there is none, or several are called so.
        """
        called = self.called(name)
        if len(called) != 1:
            what = "several students have the name" if called else "no student is called"
            near = None if called else likely_name(name, {*self.people, *self.people.values()})
            ways = did_you_mean(near) or "; give the number of grades.csv"
            raise UsageError(f"{what} '{name}'{ways}")
        return called[0]

    def student_at(self, place: str, name: str) -> str:
        """Return the number of a student who is named at a place of a file (see `student`)."""
        try:
            return self.student(name)
        except UsageError as error:
            raise UsageError(f"{place}: {error}") from error


def decisions_in(
    out: Path, given: Tables, rubric: Rubric, students: Iterable[tuple[str, str]]
) -> Decisions | None:
    """Return what the grader decided, and keep copies of the tables in the gradebook.

    Without a table that copy counts; None where there is none. `students` are numbers and names.

    Raises:
        UsageError: a file is no such table, or a line names an unknown student or item, has no
            text, wrong points or days, or repeats another one.
    """
    roll = Roll(students)
    kept, decided = (_lines(table, _OF_POINTS) for table in (out / ADJUSTMENTS, given.decisions))
    kept_late, given_late = (
        _lines(table, _OF_DAYS, _OF_TIMES) for table in (out / LATE, given.late)
    )
    counted, late = decided or kept, given_late or kept_late
    if counted is None and late is None:
        return None
    by_student = {} if counted is None else _adjustments(counted, rubric, roll)
    for student, late_line in ({} if late is None else _late(late, rubric, roll)).items():
        own = by_student.setdefault(student, {})
        whole = own.get(WHOLE, late_line)
        own[WHOLE] = whole if whole.days is not None else replace(whole, days=late_line.days)
    replaced = ((kept, decided), (kept_late, given_late))
    dropped = tuple(line for before, now in replaced for line in _dropped(before, now, roll))
    keep_copy(out / ADJUSTMENTS, given.decisions)
    keep_copy(out / LATE, given.late)
    return Decisions(by_student, dropped)


def keep_copy(copy: Path, file: Path | None) -> None:
    """Keep a copy of a file that was given in the gradebook that is made by it.

    Raises:
        UsageError: it cannot be written.
        NoRoomError: the disk is full.
    """
    if file is not None and not (copy.exists() and copy.samefile(file)):
        write_whole(copy, file.read_bytes(), force=True)


def _lines(path: Path | None, *forms: tuple[str, ...]) -> _Lines | None:
    """Read a table of one of these forms; None where none is given, or a copy is not there."""
    if path is None or (path.name in {ADJUSTMENTS, LATE} and not path.is_file()):
        return None
    table = read_text_table(path)
    headings = [heading.casefold() for heading in table.headings] if table.rows else []
    columns = {name: headings.index(name) for name in headings}
    form = next((form for form in forms if columns.keys() >= set(form)), ())
    lines = []
    for row in table.lines:
        before = table.text[: table.rows[row][0].start]
        number = len(re.findall(r"\r\n|\r|\n", before)) + 1
        cells = {name: table.value(row, column).strip() for name, column in columns.items()}
        lines.append(_Line(number, cells))
    return _Lines(path, form, tuple(lines))


def _adjustments(table: _Lines, rubric: Rubric, roll: Roll) -> dict[str, dict[str, Adjustment]]:
    """Return what a table of decisions says, by student and item."""
    if not table.form:
        raise UsageError(f"{table.path}: needs the columns {', '.join(_OF_POINTS)}")
    points = {item.id: item.points for item in rubric.items}
    points[WHOLE] = sum(points.values())
    by_student: dict[str, dict[str, Adjustment]] = {}
    for line in table.lines:
        student, item, amount, text = (line.cells[name] for name in _OF_POINTS)
        place = table.place(line)
        own = by_student.setdefault(roll.student_at(place, student), {})
        if item not in points:
            item_ids = ", ".join(filter(None, points))
            raise UsageError(f"{place}: the rubric has no item '{item}'; it has {item_ids}")
        if not text:
            raise UsageError(f"{place}: has no text; the student reads it as the reason")
        if item in own:
            what = item or "the whole submission"
            raise UsageError(f"{place}: {student} and {what} are in line {own[item].line} too")
        days = _DAYS.fullmatch(amount) if item == WHOLE else None
        if days is not None:
            _need_price(rubric, f"{place}: {amount}")
            own[item] = Adjustment(text, None, line.number, days=int(days[1]))
        else:
            amount_points = _points(amount, points[item], place)
            is_change = amount.startswith(("+", "-"))
            own[item] = Adjustment(text, amount_points, line.number, is_change=is_change)
    return by_student


def _need_price(rubric: Rubric, what: str) -> None:
    if not rubric.late.per_day:
        raise UsageError(f"{what} needs `late: {{per_day: 0.1}}` in the rubric")


def _points(amount: str, most: float, place: str) -> float | None:
    if not amount:
        return None
    if not _POINTS.fullmatch(amount):
        raise UsageError(f"{place}: '{amount}' is not a number of points, such as 8, +2 or -1.5")
    points = float(amount.replace(",", "."))
    if abs(points) > most:
        raise UsageError(f"{place}: {amount} points are more than the item's {most:g}")
    return points


def _late(table: _Lines, rubric: Rubric, roll: Roll) -> dict[str, Adjustment]:
    """Return who is late by a table of days, or of times and deadlines; a day begun counts."""
    if not table.form:
        raise UsageError(
            f"{table.path}: needs the columns {', '.join(_OF_DAYS)} or {', '.join(_OF_TIMES)}"
        )
    _need_price(rubric, f"{table.path}:")
    late_by_student: dict[str, Adjustment] = {}
    for line in table.counted:
        name, place = line.cells["student"], table.place(line)
        if table.form == _OF_DAYS:
            days = _days(line.cells["days"], place)
        else:
            days = _days_after(line.cells["submitted"], line.cells["deadline"], place)
        if not days and not roll.called(name):
            continue  # who did not hand in is in the table too
        student = roll.student_at(place, name)
        if student in late_by_student:
            raise UsageError(f"{place}: {student} is in line {late_by_student[student].line} too")
        late_by_student[student] = Adjustment("", None, line.number, days=days)
    return late_by_student


def _days(written: str, place: str) -> int:
    days = written.removesuffix("d")
    if not re.fullmatch(r"[0-9]{1,3}", days, re.ASCII):
        raise UsageError(f"{place}: '{days}' is not a number of days, such as 0 or 2")
    return int(days)


def _days_after(submitted: str, deadline: str, place: str) -> int:
    """Return how many days after the deadline was submitted."""
    try:
        after = _time(submitted, place) - _time(deadline, place)
    except TypeError as error:
        raise UsageError(
            f"{place}: of '{submitted}' and '{deadline}' one has a time zone, the other none"
        ) from error
    return max(0, -(-after // _DAY))


def _time(text: str, place: str) -> datetime:
    try:
        return datetime.fromisoformat(re.sub(r"[Zz]$", "+00:00", text))
    except ValueError as error:
        raise UsageError(f"{place}: '{text}' is not a time, such as 2026-11-20 23:59") from error


def _dropped(before: _Lines | None, now: _Lines | None, roll: Roll) -> Iterator[str]:
    """Yield what is told of the lines of a table that the new one has not, as they stood there.

    A line with the same student and item takes the place of the earlier one; a student without a
    time or a number of days is in a table of days as if not named.
    """
    if before is None or now is None:
        return

    def key(table: _Lines, line: _Line) -> tuple[str, str]:
        name = line.cells["student"]
        item = line.cells["item"] if table.form == _OF_POINTS else WHOLE
        return (",".join(roll.called(name)) or name, item)

    stays = {key(now, line) for line in now.counted}
    gone = [line for line in before.counted if key(before, line) not in stays]
    if gone:
        lines = plural(len(gone), "line")
        yield f"{lines} of the table before no longer count; to keep them, add to the new one:"
    for line in gone:
        yield f"    {csv_line(line.cells[name] for name in before.form).rstrip()}"
