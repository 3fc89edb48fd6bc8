"""Reads what a grader decides by hand: points and remarks for items of students, and days late."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.files import write_whole
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.text_table import TextTable, csv_line, read_text_table
from lab3_usd.report.entries import plural

ADJUSTMENTS, LATE = "adjustments.csv", "late.csv"  # the copies that the gradebook keeps
_COLUMNS = ("student", "item", "points", "text")
_STUDENT, _LATE_DAYS, _TIMES = "student", "days", ("submitted", "deadline")
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
    is_change: bool
    line: int
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


class _Lines(Struct, frozen=True):
    """The lines of a table, by the columns that it must have and those that it may have."""

    path: Path
    table: TextTable
    columns: Mapping[str, int]

    def value(self, row: int, column: str) -> str:
        """Return what a line says in a column."""
        return self.table.value(row, self.columns[column]).strip()

    @property
    def form(self) -> tuple[str, ...]:
        """The columns that say what was decided; of times, or of days, or of points."""
        forms = (_COLUMNS, (_STUDENT, _LATE_DAYS), (_STUDENT, *_TIMES))
        return next((form for form in forms if self.columns.keys() >= set(form)), (_STUDENT,))

    @property
    def counted(self) -> list[int]:
        """The rows that decide something: each with points or words, and who has a day or time."""
        form = self.form
        return [row for row in self.table.lines if form == _COLUMNS or self.value(row, form[1])]

    def place(self, row: int) -> str:
        """Return the file and the line in which a row begins: a cell may hold several lines."""
        return f"{self.path}: line {self.line(row)}"

    def line(self, row: int) -> int:
        """Return the line of the file in which a row begins."""
        before = self.table.text[: self.table.rows[row][0].start]
        return len(re.findall(r"\r\n|\r|\n", before)) + 1


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
    kept, decided = _lines(out / ADJUSTMENTS), _lines(given.decisions)
    kept_late, given_late = _lines(out / LATE), _lines(given.late)
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


def _lines(path: Path | None) -> _Lines | None:
    """Read a table of a grader; None where none is given, or where a copy is not there."""
    if path is None or (path.name in {ADJUSTMENTS, LATE} and not path.is_file()):
        return None
    table = read_text_table(path)
    headings = [heading.casefold() for heading in table.headings] if table.rows else []
    return _Lines(path, table, {name: headings.index(name) for name in headings})


def _need(lines: _Lines, columns: Sequence[str]) -> None:
    if not lines.columns.keys() >= set(columns):
        raise UsageError(f"{lines.path}: needs the columns {', '.join(columns)}")


def _adjustments(lines: _Lines, rubric: Rubric, roll: Roll) -> dict[str, dict[str, Adjustment]]:
    """Return what a table of decisions says, by student and item."""
    _need(lines, _COLUMNS)
    points = {item.id: item.points for item in rubric.items}
    points[WHOLE] = sum(points.values())
    by_student: dict[str, dict[str, Adjustment]] = {}
    for row in lines.table.lines:
        student, item, amount, text = (lines.value(row, name) for name in _COLUMNS)
        line, place = lines.line(row), lines.place(row)
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
            own[item] = Adjustment(text, None, is_change=False, line=line, days=int(days[1]))
            continue
        own[item] = Adjustment(
            text, _points(amount, points[item], place), amount.startswith(("+", "-")), line
        )
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


def _late(lines: _Lines, rubric: Rubric, roll: Roll) -> dict[str, Adjustment]:
    """Return who is late by a table of days, or of times and deadlines; a day begun counts."""
    is_counted = _LATE_DAYS in lines.columns
    if not is_counted and not lines.columns.keys() >= {_STUDENT, *_TIMES}:
        raise UsageError(
            f"{lines.path}: needs the columns student, days or student, submitted, deadline"
        )
    _need(lines, (_STUDENT,))
    _need_price(rubric, f"{lines.path}:")
    late_by_student: dict[str, Adjustment] = {}
    for row in lines.table.lines:
        place = lines.place(row)
        name = lines.value(row, _STUDENT)
        days = _days(lines, row, place) if is_counted else _days_after(lines, row, place)
        if days is None or (not days and not roll.called(name)):
            continue  # who did not hand in is in the table too
        student = roll.student_at(place, name)
        if student in late_by_student:
            raise UsageError(f"{place}: {student} is in line {late_by_student[student].line} too")
        late_by_student[student] = Adjustment(
            "", None, is_change=False, line=lines.line(row), days=days
        )
    return late_by_student


def _days(lines: _Lines, row: int, place: str) -> int | None:
    days = lines.value(row, _LATE_DAYS).removesuffix("d")
    if not days:
        return None
    if not re.fullmatch(r"[0-9]{1,3}", days, re.ASCII):
        raise UsageError(f"{place}: '{days}' is not a number of days, such as 0 or 2")
    return int(days)


def _days_after(lines: _Lines, row: int, place: str) -> int | None:
    """Return how many days after the deadline was submitted, None where no time is given."""
    submitted, deadline = (lines.value(row, name) for name in _TIMES)
    if not submitted:
        return None
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

    def key(lines: _Lines, row: int) -> tuple[str, str]:
        name = lines.value(row, _STUDENT)
        item = lines.value(row, "item") if lines.form == _COLUMNS else WHOLE
        return (",".join(roll.called(name)) or name, item)

    stays = {key(now, row) for row in now.counted}
    gone = [row for row in before.counted if key(before, row) not in stays]
    if gone:
        lines = plural(len(gone), "line")
        yield f"{lines} of the table before no longer count; to keep them, add to the new one:"
    for row in gone:
        yield f"    {csv_line(before.value(row, name) for name in before.form).rstrip()}"
