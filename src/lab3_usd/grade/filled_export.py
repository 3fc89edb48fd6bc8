"""Fills the points of a class into a platform's export, and says what becomes of every row."""

from __future__ import annotations

import html
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Struct, to_builtins

from lab3_usd.errors import UsageError
from lab3_usd.files import write_whole
from lab3_usd.grade.gradebook import record_decisions
from lab3_usd.grade.intake.people import MOODLE_NUMBER, id_key, name_keys
from lab3_usd.grade.lock import locked
from lab3_usd.grade.matching import GradedSubmission, Match, Matching, matched
from lab3_usd.grade.rosters import PLATFORMS, Roster, RosterRow, number_in, read_roster
from lab3_usd.grade.text_table import TextTable, filled_bytes, read_text_table
from lab3_usd.report.safe_text import FORMULA_STARTS, printable, visible

Outcome = Literal[
    "filled", "changed", "unchanged", "kept", "for a person", "ambiguous", "without a submission",
    "without a row",
]  # fmt: skip
# What a person reads before uploading, in this order.
_TITLES: Mapping[Outcome, str] = {
    "filled": "filled in",
    "changed": "changed",
    "unchanged": "left, with these points already",
    "kept": "left, since the cell holds a decision",
    "for a person": "left for you to grade",
    "ambiguous": "left, since it is not clear whose they are",
    "without a submission": "left, without a submission",
    "without a row": "submissions without a row",
}
_EMPTY = ("", "-")
_GITHUB = ("identifier", "github_username")


class Decision(Struct, frozen=True):
    """What becomes of a row, or of a submission without one, and why.

    `row` and `submission` are '' where there is none; `before` and `after` are the cell.
    """

    outcome: Outcome
    row: str
    submission: str = ""
    before: str = ""
    after: str = ""
    why: str = ""


class FilledExport(Struct, frozen=True):
    """An export with the points of a class: what was decided, and the bytes of the file.

    `returned` are the rows that have a submission's points now, with its student.
    """

    roster: Roster
    points: float
    decisions: tuple[Decision, ...]
    data: bytes
    returned: tuple[tuple[RosterRow, str], ...] = ()

    @property
    def name(self) -> str:
        """The name of the file: a table with tabs is an `.xls` at Blackboard."""
        ending = "xls" if self.roster.table.delimiter == "\t" else "csv"
        return f"{self.roster.platform}.{ending}"


def fill_export(
    name: str,
    path: Path,
    book: Mapping[str, Any],
    column: str = "",
    given: Path | None = None,
    reasons: Mapping[str, tuple[str, ...]] | None = None,
    *,
    scale: bool = False,
) -> FilledExport:
    """Fill the points of a gradebook into the export of a platform; every other byte stays.

    `given` is a table of submissions and ids, or the roster of GitHub Classroom. `reasons` are
    lines for each student, for an empty cell of comments. With `scale`, points are converted to the
    maximum of the platform.

    Raises:
        UsageError: the export is none of this platform, leaves open which column is meant, or has
            another maximum; a submission in the map does not exist; the gradebook is too old.
    """
    try:
        submissions = msgspec.convert(book["students"], tuple[GradedSubmission, ...])
        points = float(book["points"])
    except (msgspec.ValidationError, KeyError, TypeError, ValueError) as error:
        raise UsageError(
            "the gradebook does not say whose the submissions are; grade again with --resume"
        ) from error
    teams = [
        person.name for submission in submissions for person in submission.people if person.name
    ]
    roster = read_roster(name, path, str(book["title"]), column, teams)
    if abs(roster.maximum - points) > 1e-6 and not scale:  # noqa: PLR2004 - rounding
        raise UsageError(
            f"{path}: '{roster.heading}' has {roster.maximum:g} points, the rubric {points:g}; "
            "convert with --scale, or change one of the two"
        )
    if not points:
        raise UsageError("the rubric has no points to fill in, only extra points")
    mapped = _mapped_rows(given, submissions, roster) if given else {}
    matching = matched(submissions, roster, mapped)
    decisions, values = _decided(matching, submissions, roster, roster.maximum / points, reasons)
    returned = tuple(
        (match.row, match.student)
        for match, decision in zip(matching.rows, decisions, strict=False)
        if decision.outcome in {"filled", "changed", "unchanged"}
    )
    return FilledExport(roster, points, decisions, filled_bytes(roster.table, values), returned)


def write_export(out: Path, export: FilledExport, *, force: bool = False) -> Path:
    """Write the file to upload beside the gradebook, record the decisions there, and return it.

    Raises:
        UsageError: another run uses the gradebook, it cannot be written, or is the export itself.
    """
    path = out / export.name
    if path.exists() and path.samefile(export.roster.path):
        raise UsageError(f"{path}: would be replaced by the points; keep it elsewhere")
    with locked(out, force=force):
        write_whole(path, export.data, force=True)
        record = {
            "export": export.roster.path.name,
            "column": export.roster.heading,
            "maximum": export.roster.maximum,
            "decisions": to_builtins(export.decisions),
        }
        record_decisions(out, export.roster.platform, record)
    return path


def decision_lines(export: FilledExport) -> Iterator[str]:
    """Yield the table that a person reads before uploading."""
    maximum, points = f"{export.roster.maximum:g}", f"{export.points:g}"
    scaled = "" if maximum == points else f", converted from {points} of the rubric"
    yield f"{printable(export.roster.heading)}: {maximum} points{scaled}"
    by_outcome: defaultdict[str, list[Decision]] = defaultdict(list)
    for decision in export.decisions:
        by_outcome[decision.outcome].append(decision)
    for outcome, title in _TITLES.items():
        decisions = by_outcome[outcome]
        yield f"{len(decisions):>5} {title}{':' if decisions else ''}"
        lines: list[list[str]] = []
        for decision in decisions:
            change = " -> ".join(filter(None, (decision.before, decision.after)))
            cells = (decision.row, change, decision.submission, decision.why)
            lines.append([printable(cell) for cell in cells])
        widths = [max((len(line[place]) for line in lines), default=0) for place in range(3)]
        for line in lines:
            padded = [cell.ljust(width) for cell, width in zip(line, widths, strict=False)]
            yield f"        {'  '.join([*(cell for cell in padded if cell), line[3]])}".rstrip()


def _decided(
    matching: Matching,
    submissions: Iterable[GradedSubmission],
    roster: Roster,
    factor: float,
    reasons: Mapping[str, tuple[str, ...]] | None,
) -> tuple[tuple[Decision, ...], dict[tuple[int, int], str]]:
    """Return the decisions, and the values to fill in by row and column.

    With `reasons`, those whose points are there already get theirs as well.
    """
    by_student = {submission.student: submission for submission in submissions}
    decisions, values = [], {}
    outcomes = {"filled", "changed"} if reasons is None else {"filled", "changed", "unchanged"}
    for match in matching.rows:
        submission = by_student.get(match.student)
        decision = _decision(match, submission, roster, factor)
        decisions.append(decision)
        if submission is None or decision.outcome not in outcomes:
            continue
        if decision.after:
            values[match.row.line, roster.column] = decision.after
        has_cell = 0 <= roster.comment < len(roster.table.rows[match.row.line])
        is_open = has_cell and not roster.table.value(match.row.line, roster.comment).strip()
        remarks = () if PLATFORMS[roster.platform].comment_format else submission.because
        lines = (*remarks, *(reasons or {}).get(match.student, ()))
        if is_open and lines:
            values.update(_comments(lines, match.row.line, roster))
    decisions += [
        Decision("without a row", "", _called(by_student[student]), why=why)
        for student, why in matching.without_row
    ]
    return tuple(decisions), values


def _decision(
    match: Match, submission: GradedSubmission | None, roster: Roster, factor: float
) -> Decision:
    row = match.row
    before = row.points.strip()
    if match.ambiguous:
        return Decision("ambiguous", row.label, before=before, why=match.ambiguous)
    if submission is None:
        return Decision("without a submission", row.label, before=before)
    called = _called(submission)
    remark = match.remark
    if submission.has_points_by_hand:
        remark = "; ".join(filter(None, (f"{submission.status}: points by hand", remark)))
    elif submission.status != "graded" or submission.crashes:
        failed = f"a rule failed ({', '.join(submission.crashes)})" if submission.crashes else ""
        why = ": ".join(filter(None, (submission.status, submission.reason or failed)))
        return Decision("for a person", row.label, called, before, why=why)
    points = f"{submission.earned * factor:.2f}"
    pending = before.casefold().startswith(PLATFORMS[roster.platform].pending or ("\0",))
    if before not in _EMPTY and number_in(before) is None and not pending:
        return Decision("kept", row.label, called, before, why=remark)
    if number_in(before) == float(points):
        return Decision("unchanged", row.label, called, before, why=remark)
    after = points.replace(".", ",") if roster.decimal_comma else points
    outcome: Outcome = "filled" if before in _EMPTY or pending else "changed"
    return Decision(outcome, row.label, called, before, after, remark)


def _called(submission: GradedSubmission) -> str:
    """Return how a person finds a submission in the gradebook."""
    if submission.name in {"", submission.student}:
        return submission.student
    return f"{submission.student} ({submission.name})"


def _comments(
    lines: Iterable[str], line: int, roster: Roster
) -> Iterator[tuple[tuple[int, int], str]]:
    """Yield the cells of a comment: for a field that shows HTML, or of a format that is named."""
    name, form = PLATFORMS[roster.platform].comment_format or ("", "")
    # A grader's words may have several lines.
    shown = [visible(part) for each in lines for part in each.splitlines()]
    if form:
        text = "\n".join(shown)
        yield (line, roster.table.headings.index(name)), form
    else:
        text = "<br>".join(html.escape(each, quote=False) for each in shown)
    yield (line, roster.comment), f"'{text}" if text.startswith(FORMULA_STARTS) else text


# ---- a map of submissions


def _mapped_rows(
    path: Path, submissions: Sequence[GradedSubmission], roster: Roster
) -> dict[str, list[RosterRow]]:
    """Return the rows that somebody gave for each submission, by student.

    Raises:
        UsageError: the file is no map, or names a submission that does not exist.
    """
    table = read_text_table(path)
    headings = [heading.casefold() for heading in table.headings] if table.rows else []
    if set(_GITHUB) <= set(headings):
        pairs = _github_pairs(table, [headings.index(name) for name in _GITHUB], submissions)
        heading = ""
    elif len(headings) > 1 and headings[0] == "submission":
        names = _by_name(submissions)
        pairs = []
        for line in table.lines:
            name = table.value(line, 0).strip()
            students = names.get(name, set())
            if len(students) != 1:
                what = "several submissions are" if students else "no submission is"
                raise UsageError(f"{path}: row {line + 1}: {what} called '{name}'")
            pairs.append((next(iter(students)), table.value(line, 1)))
        heading = table.headings[1]
    else:
        raise UsageError(
            f"{path}: needs the columns submission and id, or identifier and github_username"
        )
    rows: dict[str, list[RosterRow]] = {}
    for student, value in pairs:
        own = rows.setdefault(student, [])
        own += [row for row in _rows_called(value, heading, roster, path) if row not in own]
    return rows


def _by_name(submissions: Iterable[GradedSubmission]) -> dict[str, set[str]]:
    """Return the students whose submission may be meant by a name."""
    names: defaultdict[str, set[str]] = defaultdict(set)
    for submission in submissions:
        for name in (submission.student, submission.folder, *submission.entries):
            names[name].add(submission.student)
    for submission in submissions:
        names[submission.student] = {submission.student}
    return names


def _rows_called(value: str, heading: str, roster: Roster, path: Path) -> list[RosterRow]:
    """Return the row of an id: in the column that the map names, else by any id, else by name.

    Raises:
        UsageError: several rows have it.
    """
    key = id_key(value)
    columns = [place for place, own in enumerate(roster.table.headings) if own == heading]
    if columns:
        rows = [
            row for row in roster.rows if id_key(roster.table.value(row.line, columns[0])) == key
        ]
    else:
        rows = [
            row
            for row in roster.rows
            if key in row.ids.values()  # or after the word that Moodle puts before its number
            or (row.word and key == id_key(f"{row.word} {row.ids.get(MOODLE_NUMBER, '')}"))
        ]
        rows = rows or [row for row in roster.rows if name_keys(value) & row.names]
    if not key:
        return []
    if len(rows) > 1:
        labels = ", ".join(row.label for row in rows)
        raise UsageError(
            f"{path}: '{value}' may be {labels}; head the column of the ids as the export does"
        )
    return rows


def _github_pairs(
    table: TextTable, columns: Sequence[int], submissions: Iterable[GradedSubmission]
) -> list[tuple[str, str]]:
    """Return submission and identifier for the clones of an assignment: `lab3-octocat`.

    Assignment and user may hold hyphens: every clone begins with the assignment.

    Raises:
        UsageError: it is not clear where the users begin, or a user is listed twice.
    """
    users: dict[str, str] = {}
    for line in table.lines:
        user = table.value(line, columns[1]).strip().casefold()
        if user in users:
            raise UsageError(f"the roster of GitHub Classroom names the user '{user}' twice")
        if user:
            users[user] = table.value(line, columns[0])
    clones = {
        submission.student: [
            submission.student[: -len(user)]
            for user in users
            if submission.student.casefold().endswith(f"-{user}")
        ]
        for submission in submissions
        if not submission.platform
    }
    ours = [clone for clone, starts in clones.items() if starts]
    starts = sorted(
        {
            start
            for starts in clones.values()
            for start in starts
            if all(clone.startswith(start) for clone in ours)
        }
    )
    if len(starts) != 1:
        raise UsageError(
            "the folders of the class do not show where the users of GitHub begin "
            f"({' or '.join(starts) or 'no common start'}); give --map with submission and id"
        )
    return [
        (clone, users[user])
        for clone in ours
        if (user := clone.removeprefix(starts[0]).casefold()) in users
    ]
