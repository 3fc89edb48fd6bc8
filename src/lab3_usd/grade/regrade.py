"""Re-scores an existing gradebook by another rubric, and prints the sum of one student."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import msgspec
from msgspec import Struct, to_builtins
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.files import write_whole
from lab3_usd.grade.adjustments import ByItem, Decisions, Roll, Tables, decisions_in, keep_copy
from lab3_usd.grade.deductions import carried_text
from lab3_usd.grade.gradebook import (
    GRADESCOPE,
    HTML,
    JSON,
    RESULT,
    STUDENTS,
    Row,
    deductions_in,
    grade_sheet,
    lost_by,
    read_gradebook,
    read_result,
    write_reports,
    write_tables,
)
from lab3_usd.grade.intake.submissions import StudentSubmission
from lab3_usd.grade.lock import locked
from lab3_usd.grade.rubric import Rubric, load_rubric
from lab3_usd.grade.scoring import Grade, SubmissionFacts, grade_facts
from lab3_usd.grade.shared_reports import SHARED, shared_folder, write_shared
from lab3_usd.model.finding import Report, Submission
from lab3_usd.model.grade import ADJUSTED, REMARK
from lab3_usd.report.entries import plural
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options
from lab3_usd.report.safe_text import json_text
from lab3_usd.spec.lab import RUBRIC, Lab

# What of a student's page shows the grade; pictures have titles as well.
_OF_GRADE = re.compile(
    r"<!--grade-->.*?<!--/grade-->|<title>[^<]*</title>(?=\s*<link rel=.icon)", re.DOTALL
)


_NOTHING = Tables()
_KINDS = ("points", "days late", "remarks")


class ChangedGrade(Struct, frozen=True):
    """The grade that a student had, and has by another rubric or other decisions of a grader."""

    student: str
    before: Grade
    after: Grade

    @property
    def changes(self) -> tuple[str, ...]:
        """What of it is another: points, days late, remarks."""
        before, after = self.before, self.after
        are_other = (
            (before.earned, before.possible) != (after.earned, after.possible),
            (before.days_late or 0) != (after.days_late or 0),
            _words_by_hand(before) != _words_by_hand(after),
        )
        return tuple(kind for kind, is_other in zip(_KINDS, are_other, strict=True) if is_other)

    @property
    def text(self) -> str:
        """The change in one line."""
        before, after = self.before, self.after
        points = f"{after.earned:.2f} of {after.possible:g}"
        if "points" in self.changes:
            gained = f"{after.earned - before.earned:+.2f}"
            points = f"{before.earned:.2f} of {before.possible:g} -> {points} ({gained})"
        late = ""
        if "days late" in self.changes:
            late = ", days late not given"
            if after.days_late is not None:
                late = f", {plural(after.days_late, 'day')} late"
        remarks = ", other remarks" if "remarks" in self.changes else ""
        return f"{self.student}: {points}{late}{remarks}"


def _words_by_hand(grade: Grade) -> list[str]:
    words = [*(line.title for line in grade.lost), *grade.because]
    return [text for text in words if text.startswith((ADJUSTED, REMARK))]


class Regrade(Struct, frozen=True):
    """Whose grades changed, and what is told of lines of earlier tables that count no longer."""

    changed: tuple[ChangedGrade, ...]
    dropped: tuple[str, ...] = ()

    @property
    def counts(self) -> str:
        """How many changed, and of how many what."""
        kinds = Counter(kind for grade in self.changed for kind in grade.changes)
        of_kinds = ", ".join(f"{kind} of {kinds[kind]}" for kind in _KINDS if kinds[kind])
        return f"{len(self.changed)} changed{f' ({of_kinds})' if of_kinds else ''}"


def student_in(book: Row, name: str) -> Row:
    """Return the row of the student of this number or name.

    Raises:
        UsageError: there is none, or several are called so.
    """
    roll = Roll((row["student"], row["name"]) for row in book["students"])
    student = roll.student(name)
    return next(dict(row) for row in book["students"] if row["student"] == student)


def sum_of(book: Row, row: Row) -> Iterator[str]:
    """Yield the lines of a student's sum: every item, and what it lost and why."""
    titles = {item["id"]: item["title"] for item in book["items"]}
    width = max(len(title) for title in (*titles.values(), "total"))
    of = f" of {row['possible']:.2f} points"
    percent = "" if row["percent"] is None else f", {row['percent']:.2f} %"
    name = f" ({row['name']})" if row["name"] not in {"", row["student"]} else ""
    yield f"{row['student']}{name}: {row['status']}, {row['earned']:.2f}{of}{percent}"
    yield from filter(None, [row["reason"], *row.get("remarks", [])])
    yield ""
    for item in row["items"]:
        title = titles.get(item["id"], item["id"])
        points = f"{item['earned']:>8.2f} of {item['possible']:>6.2f}"
        yield f"{title:<{width}}  {points}  {item['state']}"
        yield from (f"    {line.text}" for line in lost_by(row, item["id"]))
    yield f"{'total':<{width}}  {row['earned']:>8.2f} of {row['possible']:>6.2f}"
    yield from row["because"]
    carried = carried_text(deductions_in(row))
    if not carried:
        return
    yield ""
    yield carried
    told = (line for item in row["items"] for line in lost_by(row, item["id"]))
    below = (replace(line, points=0.0, place="").text for each in told for line in each.below)
    for text in dict.fromkeys(below):
        yield f"    {text}"


def rubric_of(out: Path, given: Path | None) -> Path | None:
    """Return the rubric that counts for a gradebook: the one given, else the copy that it keeps.

    None for the lab's own, of which no copy is kept.
    """
    copy = out / RUBRIC
    return copy if given is None and copy.is_file() else given


def regrade(
    out: Path,
    given: Path | None,
    lab: Lab,
    by_hand: Tables = _NOTHING,
    *,
    force: bool = False,
) -> Regrade:
    """Give the students of a gradebook their points by another rubric, and return who changed.

    No submission is opened: what was found in it is in the results. Without a rubric `given` that
    counts by which the gradebook was made. `by_hand` are tables of what the grader decides; without
    them those count that the gradebook has.

    Raises:
        SpecError: the rubric is wrong.
        UsageError: there is no gradebook, or one of an earlier release, or a line of a table
            is wrong.
    """
    file = rubric_of(out, given)
    rubric = load_rubric(file, lab)
    with locked(out, force=force):
        submissions = [  # what was handed in is not needed again
            StudentSubmission(row["student"], row["name"], row["folder"], (), row["late"])
            for row in read_gradebook(out)["students"]
        ]
        results = [_recorded(out, submission) for submission in submissions]
        people = [(submission.student, submission.name) for submission in submissions]
        decisions = decisions_in(out, by_hand, rubric, people) or Decisions({})
        keep_copy(out / RUBRIC, file)
        grades = []
        for row, facts in results:
            student = row["student"]
            late = row["late"] or student in rubric.late.students
            points = grade_facts(rubric, facts, decisions.by_student.get(student, {}), late=late)
            grades.append(ChangedGrade(student, msgspec.convert(row, Grade), points))
            # Neither this rubric nor the starter made these findings: --resume judges them again.
            _write_points(out, rubric, row | {"late": late, "salt": ""}, points)
        write_tables(out, submissions, rubric)
    return Regrade(tuple(grade for grade in grades if grade.changes), decisions.dropped)


def _recorded(out: Path, submission: StudentSubmission) -> tuple[Row, SubmissionFacts]:
    """Return the result of a student, and what was found in the submission."""
    try:
        row = read_result(out, submission) or {}
        return row, msgspec.convert(row["facts"], SubmissionFacts)
    except (ValueError, KeyError) as error:
        raise UsageError(
            f"{out}: the result of {submission.student} does not say what was found; "
            "grade again with --resume"
        ) from error


def adjust(
    out: Path,
    submissions: Iterable[StudentSubmission],
    rubric: Rubric,
    by_hand: Mapping[str, ByItem],
) -> None:
    """Give the results of a run what the grader decided by hand, where they do not have it yet."""
    for submission in submissions:
        if read_result(out, submission) is None:
            continue
        row, facts = _recorded(out, submission)
        own = by_hand.get(submission.student, {})
        points = grade_facts(rubric, facts, own, late=row["late"])
        if msgspec.convert(row, Grade) != points:
            _write_points(out, rubric, row, points)


def _write_points(out: Path, rubric: Rubric, row: Row, points: Grade) -> None:
    """Write the points of a student into the result and the reports."""
    shared = shared_folder(out, row)
    folder = out / STUDENTS / row["folder"]
    empty = Report((), (Submission("submission" if shared else row["student"]),))
    remarks = tuple(row.get("remarks", ()))
    reports = write_reports(empty, rubric, points, "" if shared else row["name"], remarks)
    page = (shared or folder) / HTML
    parts = _OF_GRADE.findall(reports[HTML])
    old = page.read_text(encoding="utf-8") if page.is_file() else ""
    if len(_OF_GRADE.findall(old)) == len(parts):
        new = iter(parts)
        reports[HTML] = _OF_GRADE.sub(lambda _part: next(new), old)
    scored = (shared or folder) / GRADESCOPE
    if scored.is_file() and [each["id"] for each in row["items"]] == list(rubric.asked):
        try:
            sheet = grade_sheet(rubric, msgspec.convert(row, Grade), "", "")
            before = render("gradescope", empty, None, Options(grade=sheet))
            old_tests = scored.read_text(encoding="utf-8")
            reports[GRADESCOPE] = _with_findings(old_tests, before, reports[GRADESCOPE])
        except (ValueError, KeyError, TypeError):
            pass  # somebody edited the file: the points are right without its findings
    row |= to_builtins(points)
    if shared:
        about = shared / JSON
        reports[JSON] = about.read_text(encoding="utf-8") if about.is_file() else reports[JSON]
        row[SHARED] = write_shared(out, reports)
    else:
        for name in (HTML, GRADESCOPE):
            write_whole(folder / name, reports[name].encode("utf-8", "replace"), force=True)
    write_whole(folder / RESULT, json_text(row, 1).encode(), force=True)


def _with_findings(old: str, before: str, now: str) -> str:
    """Return the tests of `now` with the findings of `old`, which follow the reasons of `before`.

    Both were made without findings.
    """
    document, bare, new = json.loads(old), json.loads(before), json.loads(now)
    findings = {
        test["name"]: was["output"].removeprefix(test["output"]).strip("\n")
        for test, was in zip(bare["tests"], document["tests"], strict=False)
        if test["name"] == was["name"] and was["output"].startswith(test["output"])
    }
    for test in new["tests"]:
        blocks = (test["output"], findings.get(test["name"], ""))
        test["output"] = "\n\n".join(filter(None, blocks))
    new["output"] = document["output"]
    new["tests"] += [test for test in document["tests"] if "max_score" not in test]
    return json_text(new, 2)
