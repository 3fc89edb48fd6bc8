"""Reads the gradebook that a learning platform exports: its people, and the column to fill in.

Canvas: `lib/gradebook_exporter.rb` and `lib/gradebook_importer.rb` of instructure/canvas-lms.
Moodle: `gradingtable.php` of `mod/assign` in moodle/moodle. Blackboard and Brightspace publish
manuals only; their headings are those of public exports.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.people import (
    ADDRESS,
    BLACKBOARD_USER,
    CANVAS_USER,
    LOGIN,
    MOODLE_NUMBER,
    STUDENT_ID,
    id_key,
    name_key,
    name_keys,
)
from lab3_usd.grade.text_table import TextTable, read_text_table


class ExportFormat(Struct, frozen=True):
    """The columns of a platform's export by their headings.

    `ids` hold ids of a kind, `names` make up a name: the first of these sets of columns that the
    export has. `points` is the pattern of headings of points, with `title` and `maximum`; `group`
    holds a team, `comment` what is told to the student, and `comment_format` is the column for the
    format of that, with the format of plain text.
    """

    ids: Mapping[str, str]
    names: tuple[tuple[str, ...], ...]
    points: str
    group: str = ""
    comment: str = ""
    comment_format: tuple[str, str] | None = None
    pending: tuple[str, ...] = ()


PLATFORMS: Mapping[str, ExportFormat] = {
    "canvas": ExportFormat(
        ids={"ID": CANVAS_USER, "SIS User ID": STUDENT_ID, "SIS Login ID": LOGIN},
        names=(("Student",), ("FirstName", "LastName")),
        points=r"(?P<title>.+) \(\d+\)",
    ),
    "moodle": ExportFormat(
        ids={
            "Identifier": MOODLE_NUMBER,
            "ID number": STUDENT_ID,
            "Email address": ADDRESS,
            "Username": LOGIN,
        },
        names=(("Full name",),),
        points=r"(?P<title>Grade)",
        group="Group",
        comment="Feedback comments",
    ),
    "brightspace": ExportFormat(
        ids={"OrgDefinedId": STUDENT_ID, "Username": LOGIN, "Email": ADDRESS},
        names=(("First Name", "Last Name"),),
        points=r"(?P<title>.+) Points Grade(?: <(?:.*?MaxPoints:(?P<maximum>[\d.,]+))?.*>)?",
    ),
    "blackboard": ExportFormat(
        ids={"Username": BLACKBOARD_USER, "Student ID": STUDENT_ID},
        names=(("First Name", "Last Name"),),
        points=r"(?P<title>.+?) *\[Total Pts: (?P<maximum>[\d.,]+) Score\](?: ?\|(?P<number>\d+))?",
        comment="Feedback to Learner",
        comment_format=("Feedback Format", "SMART_TEXT"),
        pending=("needs grading", "in progress"),
    ),
}
_MAXIMUM = "Maximum grade"  # the column of Moodle
_POINTS_POSSIBLE = "Points Possible"  # the row of Canvas, in every language
_NUMBER = re.compile(r"-?\d+(?:[.,]\d+)?")
_IDENTIFIER = re.compile(r"(\D*?)\s*(\d+)")


class RosterRow(Struct, frozen=True):
    """A person in an export: the row of the table, ids and names as they are compared, the points.

    `label` shows the person. `word` is what a worksheet of Moodle has before the number.
    """

    line: int
    label: str
    ids: Mapping[str, str]
    names: frozenset[str]
    group: str
    points: str
    word: str = ""


class Roster(Struct, frozen=True):
    """An export: its people, and the column of the points with its heading and maximum.

    `comment` is the column of comments, -1 for none. With `decimal_comma`, numbers have a comma.
    """

    platform: str
    path: Path
    table: TextTable
    rows: tuple[RosterRow, ...]
    column: int
    heading: str
    maximum: float
    comment: int
    decimal_comma: bool


def number_in(cell: str) -> float | None:
    """Return the number in a cell, None for none."""
    text = cell.strip()
    return float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else None


def read_roster(
    name: str, path: Path, title: str, column: str = "", teams: Collection[str] = ()
) -> Roster:
    """Read an export of a platform, in which the assignment `title` or `column` is filled in.

    `teams` are what groups may be called, for worksheets of Moodle in other languages.

    Raises:
        UsageError: it is no export of the platform, leaves open which column is meant, or does not
            say how many points that has.
    """
    platform, table = PLATFORMS[name], read_text_table(path)
    headings = table.headings if table.rows else ()
    places: dict[str, int] = {}
    for index, heading in enumerate(headings):
        places.setdefault(heading.casefold(), index)
    if name == "moodle" and "identifier" not in places:
        places = _translated_worksheet(table, teams)
    if next(iter(platform.ids)).casefold() not in places and not (
        name == "brightspace" and "username" in places
    ):
        expected = next(iter(platform.ids))
        raise UsageError(f"{path}: is not an export of {name}: it has no column {expected}")
    if name == "moodle":
        points, maximum = _worksheet_points(table, places, path)
        if column and column != headings[points]:
            raise UsageError(f"{path}: has no column '{column}'; there is {headings[points]}")
    else:
        points, maximum = _points_column(platform, table, path, column or title)
    people = _people(platform, table, places, points)
    cells = [cell.value.strip() for row in table.rows for cell in row]
    decimal_signs = {re.sub(r"\d", "", cell) for cell in cells if re.fullmatch(r"\d+[.,]\d+", cell)}
    return Roster(
        name,
        path,
        table,
        tuple(row for row in people if row.ids or row.names),
        points,
        headings[points],
        maximum,
        places.get(platform.comment.casefold(), -1) if platform.comment else -1,
        decimal_signs == {","},
    )


def _points_column(
    platform: ExportFormat, table: TextTable, path: Path, wanted: str
) -> tuple[int, float]:
    """Return the column of the assignment of a title or heading, and its maximum."""
    own_headings = {heading.casefold() for heading in (*platform.ids, *sum(platform.names, ()))}
    fitting = {
        index: match
        for index, heading in enumerate(table.headings)
        if heading.casefold() not in own_headings
        and (match := re.fullmatch(platform.points, heading))
    }
    exact = [index for index in fitting if table.headings[index] == wanted]
    exact = exact or [
        index
        for index, match in fitting.items()
        if match["title"].strip().casefold() == wanted.strip().casefold()
    ]
    if not exact:
        there = ", ".join(table.headings[index] for index in fitting) or "none for points"
        raise UsageError(
            f"{path}: has no column '{wanted}'; there are {there}: name one with --column, or "
            "create the assignment on the platform and export again"
        )
    if len(exact) > 1:
        named = ", ".join(table.headings[index] for index in exact)
        raise UsageError(f"{path}: has the columns {named}; name one with --column")
    (column,) = exact
    about = fitting[column].groupdict()
    if about.get("number", "") is None:
        raise UsageError(
            f"{path}: '{table.headings[column]}' lacks the |number at its end, without which "
            "Blackboard makes a new column of text; export it again"
        )
    above = (
        table.value(row, column)
        for row in table.lines
        if table.value(row, 0).strip() == _POINTS_POSSIBLE
    )
    maximum = number_in(about.get("maximum") or next(above, ""))
    return column, _known_maximum(maximum, path, table.headings[column])


def _known_maximum(maximum: float | None, path: Path, heading: str) -> float:
    if not maximum:
        raise UsageError(
            f"{path}: does not say how many points '{heading}' has; export it again with them"
        )
    return maximum


def _worksheet_points(table: TextTable, places: Mapping[str, int], path: Path) -> tuple[int, float]:
    """Return the column of the grades of a worksheet of Moodle, and the maximum in its rows."""
    if "grade" not in places or _MAXIMUM.casefold() not in places:
        raise UsageError(
            f"{path}: has no grade with one maximum in every row: a scale has no points; for "
            "points, download the worksheet again with Moodle in English"
        )
    column = places[_MAXIMUM.casefold()]
    maxima = {number_in(table.value(row, column)) for row in table.lines}
    maximum = maxima.pop() if len(maxima) == 1 else None
    return places["grade"], _known_maximum(maximum, path, table.headings[places["grade"]])


def _translated_worksheet(table: TextTable, teams: Collection[str]) -> dict[str, int]:
    """Return the columns of a worksheet of Moodle in another language, by order and shape.

    The first column holds a word and the participant's number, the second the name, and that of the
    grades stands before one that holds the same number in every row. A column between them is that
    of the groups where it holds what a submission is called.
    """
    lines = table.lines
    if len({_identifier(table.value(row, 0))[0] for row in lines}) != 1:
        return {}
    if not all(_identifier(table.value(row, 0))[1] for row in lines):
        return {}
    maxima = [
        column
        for column in range(2, len(table.headings))
        if len({number_in(table.value(row, column)) for row in lines}) == 1
        and number_in(table.value(lines[0], column))
        and all(
            cell.strip() in {"", "-"} or number_in(cell) is not None
            for cell in (table.value(row, column - 1) for row in lines)
        )
    ]
    if len(maxima) != 1:
        return {"identifier": 0}
    (maximum,) = maxima
    team_names = {name_key(team) for team in teams}
    groups = [
        column
        for column in range(2, maximum - 1)
        if any(name_key(table.value(row, column)) in team_names for row in lines)
    ]
    group = {"group": groups[0]} if len(groups) == 1 else {}
    named = {"full name": 1} if maximum > 2 else {}  # noqa: PLR2004 - number, name, grade
    return {"identifier": 0, "grade": maximum - 1, _MAXIMUM.casefold(): maximum, **named, **group}


def _identifier(cell: str) -> tuple[str, str]:
    """Return word and number of an identifier of Moodle: `Participant 7`."""
    match = _IDENTIFIER.fullmatch(cell.strip())
    return (match[1], match[2]) if match else (cell, "")


def _people(
    platform: ExportFormat, table: TextTable, places: Mapping[str, int], points: int
) -> Iterator[RosterRow]:
    """Yield the people of an export; rows about the assignments name nobody."""
    columns = {kind: places.get(heading.casefold()) for heading, kind in platform.ids.items()}
    named = next(
        (
            [places[heading.casefold()] for heading in headings]
            for headings in platform.names
            if all(heading.casefold() in places for heading in headings)
        ),
        [],
    )
    group = places.get(platform.group.casefold()) if platform.group else None
    for line in table.lines:
        if table.value(line, 0).strip() == _POINTS_POSSIBLE:
            continue
        cells = [table.value(line, column).strip() for column in named]
        ids: dict[str, str] = {}
        word = ""
        for kind, column in columns.items():
            cell = "" if column is None else table.value(line, column)
            if kind == MOODLE_NUMBER:
                word, cell = _identifier(cell)
            elif kind == LOGIN and "@" in cell:
                kind = ADDRESS  # noqa: PLW2901 - many institutions log in by address
            if id_key(cell):
                ids.setdefault(kind, id_key(cell))
        first = next((table.value(line, column).strip() for column in columns.values()
                      if column is not None), "")  # fmt: skip
        whole = " ".join(filter(None, cells))
        both = {name_key("".join(order)) for order in (cells, cells[::-1])} - {""}
        yield RosterRow(
            line,
            f"{whole} ({first})" if whole and first else whole or first,
            ids,
            name_keys(cells[0]) if len(cells) == 1 else frozenset(both),
            "" if group is None else table.value(line, group).strip(),
            table.value(line, points),
            word,
        )
