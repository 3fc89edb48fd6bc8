"""The gradebook as a learning platform takes it: its own export, with the points filled in."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.files import write_whole
from lab3_usd.report.safe_text import FORMULA_STARTS

_LARGEST = 64 << 20
_MOST_NAMED = 5
Notify = Callable[[str], None]
Row = Mapping[str, Any]


class Platform(Struct, frozen=True):
    """How the table of a platform is read and written, by the names of its columns.

    `ids` hold what the names of submissions hold, one of them is enough; `number` is the part of
    it that is the number. `names` make up a student's name. `kept` are the columns that a file of
    grades has beside the points, every column where none is named. `points` is the column of the
    points: a pattern, and what it is called where the export has none (with title and points).
    `comment` is the column for remarks, `top` is what the first column holds in rows that are no
    student's, and `more` are columns that each row must have.
    """

    ids: tuple[str, ...]
    names: tuple[str, ...]
    kept: tuple[str, ...]
    points: str
    new: str
    number: str = r"(.+)"
    comment: str = ""
    top: str = ""
    more: Mapping[str, str] = {}


# By the manuals of the platforms: what a file of grades must have to be imported.
PLATFORMS: Mapping[str, Platform] = {
    "canvas": Platform(
        ids=("ID", "SIS User ID", "SIS Login ID"),
        names=("Student",),
        kept=("Student", "ID", "SIS User ID", "SIS Login ID", "Section"),
        points=r".+ \(\d+\)",
        new="{title}",
        top="Points Possible",
    ),
    "moodle": Platform(
        ids=("Identifier",),
        names=("Full name",),
        kept=(),
        points=r"Grade",
        new="Grade",
        number=r"\D*(\d+)",
        comment="Feedback comments",
    ),
    "gradescope": Platform(
        ids=("SID", "Email"),
        names=("First Name", "Last Name"),
        kept=("First Name", "Last Name", "SID", "Email", "Sections"),
        points=r"(?!.* - )(?!Total).+",
        new="{title}",
    ),
    "brightspace": Platform(
        ids=("OrgDefinedId", "Username"),
        names=("First Name", "Last Name"),
        kept=("OrgDefinedId", "Username", "Last Name", "First Name", "Email"),
        points=r".+ Points Grade( <.*>)?",
        new="{title} Points Grade <Numeric MaxPoints:{points:g}>",
        number=r"#?(.+)",
        more={"End-of-Line Indicator": "#"},
    ),
    "blackboard": Platform(
        ids=("Username", "Student ID"),
        names=("First Name", "Last Name"),
        kept=("Last Name", "First Name", "Username", "Student ID"),
        points=r".+ \[Total Pts: .*\].*",
        new="{title} [Total Pts: {points:g} Score]",
    ),
}


def write_for_platform(
    out: Path, name: str, roster: Path, book: Row, notify: Notify, column: str = ""
) -> Path:
    """Write the points of a class as a platform takes them, and return the file.

    `roster` is the export of the platform, whose order and ids are kept. `column` is the heading of
    the points, where the export has several. `notify` receives the students in one of the two only.

    Raises:
        UsageError: the export is none of this platform, or leaves open which column is meant.
    """
    platform, path = PLATFORMS[name], out / f"{name}.csv"
    if path.exists() and roster.exists() and path.samefile(roster):
        raise UsageError(f"{roster}: would be replaced by the points; keep it elsewhere")
    table = _read(roster)
    heads = [head.strip() for head in table.rows[0]] if table.rows else []
    if not any(head in heads for head in platform.ids):
        columns = ", ".join(platform.ids)
        raise UsageError(f"{roster}: is not an export of {name}: it has no column {columns}")
    points = _points_column(platform, heads, column, book, roster)
    kept = [head for head in heads if not platform.kept or head in platform.kept]
    head = [*dict.fromkeys([*kept, points, *platform.more])]
    graded = {row["student"]: row for row in book["students"]}
    written, found = [head], set()
    for cells in table.rows[1:]:
        values = dict(zip(heads, [*cells, *[""] * len(heads)], strict=False))
        values |= platform.more
        values[points] = ""
        if platform.top and cells and cells[0].strip() == platform.top:
            values[points] = f"{book['points']:g}"
        elif any(cell.strip() for cell in cells):
            keys = [_number(platform, values.get(head, "")) for head in platform.ids]
            called = " ".join(values.get(head, "").strip() for head in platform.names)
            row = _row_of(graded, keys, called)
            if row is None:
                notify(f"{roster}: no submission of {called or ' '.join(keys)}")
            else:
                found.add(row["student"])
                values[points] = _points(row, notify)
                if platform.comment in heads:
                    values[platform.comment] = "; ".join(row["because"])
        written.append([_cell(values.get(name, "")) for name in head])
    missing = [student for student in graded if student not in found]
    if missing:
        more = f" and {len(missing) - _MOST_NAMED} more" if len(missing) > _MOST_NAMED else ""
        named = ", ".join(missing[:_MOST_NAMED])
        notify(f"{roster}: does not have {named}{more}; their points are in no row")
    text = io.StringIO(newline="")
    csv.writer(text, delimiter=table.delimiter).writerows(written)
    write_whole(path, text.getvalue().encode(table.encoding, "replace"), force=True)
    return path


class _Table(Struct, frozen=True):
    rows: list[list[str]]
    delimiter: str
    encoding: str


def _read(roster: Path) -> _Table:
    """Read an export as it was written: with commas, semicolons or tabs, in UTF-8 or UTF-16."""
    try:
        if roster.stat().st_size > _LARGEST:
            raise UsageError(f"{roster}: is larger than {_LARGEST} bytes")
        data = roster.read_bytes()
    except OSError as error:
        raise UsageError(f"{roster}: cannot be read ({error.strerror})") from error
    encoding = "utf-16" if data[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig"
    if encoding != "utf-16" and not data.startswith(b"\xef\xbb\xbf"):
        encoding = "utf-8"
    try:
        text = data.decode(encoding)
        first = text.partition("\n")[0]
        delimiter = max(",;\t", key=first.count)
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=delimiter))
    except (UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{roster}: is not a text table: {error}") from error
    return _Table(rows, delimiter, encoding)


def _points_column(
    platform: Platform, heads: list[str], column: str, book: Row, roster: Path
) -> str:
    """Return the heading of the points: the one named, the only one, or a new one."""
    fitting = [head for head in heads if re.fullmatch(platform.points, head)]
    fitting = [head for head in fitting if head not in {*platform.kept, *platform.more}]
    wanted = (column or book["title"]).casefold()
    exact = [head for head in fitting if head.casefold().startswith(wanted)]
    if column and not exact:
        raise UsageError(f"{roster}: has no column '{column}'; there are {', '.join(fitting)}")
    if len(exact) > 1:
        raise UsageError(f"{roster}: has the columns {', '.join(exact)}; name one with --column")
    if exact:
        return exact[0]
    if len(fitting) == 1 and not platform.kept:
        return fitting[0]
    return platform.new.format(title=book["title"], points=book["points"])


def _points(row: Row, notify: Notify) -> str:
    """Return the points of a student; none where this program failed, which is no grade."""
    if row["status"] == "tool failed" or row.get("crashes"):
        notify(f"{row['student']}: {row['status']}, and so has no points in the file")
        return ""
    return f"{row['earned']:.2f}"


def _number(platform: Platform, cell: str) -> str:
    found = re.fullmatch(platform.number, cell.strip())
    return found[1] if found else ""


def _row_of(graded: Mapping[str, Row], keys: Iterable[str], name: str) -> Row | None:
    """Return the row of a student: by an id, else by a name that only one has."""
    for key in keys:
        if key and key in graded:
            return graded[key]
    called = [row for row in graded.values() if name and _plain(row["name"]) == _plain(name)]
    return called[0] if len(called) == 1 else None


def _plain(name: str) -> str:
    """Return a name without case, order and commas: `Lee, Jo` is `jo lee`."""
    return " ".join(sorted(re.split(r"[\s,]+", name.casefold().strip())))


def _cell(text: str) -> str:
    """Return a cell that no spreadsheet takes for a formula; numbers below zero are none."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text
