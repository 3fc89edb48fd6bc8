"""Writes the gradebook: a folder of reports for each student, then the tables of the class."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import msgspec
from msgspec import to_builtins

from lab3_usd.check.manual import rules_in
from lab3_usd.errors import UsageError
from lab3_usd.files import leftover_files, make_folder, write_parts, write_whole
from lab3_usd.grade.adjustments import ADJUSTMENTS, LATE
from lab3_usd.grade.deductions import reasons
from lab3_usd.grade.intake.submissions import StudentSubmission
from lab3_usd.grade.lock import LOCK
from lab3_usd.grade.rubric import COLUMNS, TEAM_COLUMN, Item, Rubric, load_rubric
from lab3_usd.grade.scoring import Deduction, Grade, State, facts_of, grade_facts
from lab3_usd.grade.shared_reports import (
    REPORTS,
    SHARED,
    remove_unshared,
    shared_folder,
    write_shared,
)
from lab3_usd.grade.text_table import csv_line
from lab3_usd.model.finding import Report
from lab3_usd.model.grade import GradeItem, GradeSummary, LostPoints
from lab3_usd.report.entries import plural
from lab3_usd.report.formats.registry import render
from lab3_usd.report.html.class_page import class_page
from lab3_usd.report.options import NAME, Options, tool_version
from lab3_usd.report.safe_text import json_text, safe_cell
from lab3_usd.spec.lab import RUBRIC, Lab
from lab3_usd.spec.load.loader import lab_of_team, load_lab
from lab3_usd.spec.submission import has_teams

MOST_LOST = 12  # of what costs no more points at an item: the findings name the rest


def grade_sheet(
    rubric: Rubric, points: Grade, student: str, name: str, remarks: tuple[str, ...] = ()
) -> GradeSummary:
    """Return the grade as the student's page shows it; `remarks` say what of it was judged."""
    graded = {grade.id: grade for grade in points.items}
    items = []
    for item in rubric.items:
        own = graded[item.id]
        lost = reasons(line for line in points.lost if line.item == item.id)
        shown = max(MOST_LOST, sum(line.points > 0 for line in lost))
        items.append(
            GradeItem(
                title=item.title,
                state=own.state,
                earned=own.earned,
                possible=own.possible,
                points=item.points,
                why=tuple(_reasons(item, own.state)),
                lost=tuple(lost[:shown]),
                more=max(len(lost) - shown, 0),
                groups=tuple(
                    dict.fromkeys(
                        f"Checkpoint {item.checkpoint}: {requirement.group}"
                        for requirement in rubric.asked[item.id]
                    )
                ),
                visibility=item.visibility,
            )
        )
    return GradeSummary(
        title=rubric.title,
        student=student,
        name=name,
        earned=points.earned,
        possible=points.possible,
        percent=points.percent,
        because=(*remarks, *points.because),
        items=tuple(items),
    )


def _reasons(item: Item, state: State) -> Iterator[str]:
    """Yield what is to be known of an item beside what it lost."""
    if item.optional:
        yield "extra points: nothing is lost without them"
    if state == "open":
        yield f"for a person to judge: {item.checklist}"
    elif state == "none" and not item.checklist and not item.partial:
        yield "all or nothing"


def grade_of(report: Report, lab: Lab) -> GradeSummary | None:
    """Return the grade of what was checked, whose files are trusted, by the lab's rubric.

    None without a stage of a checkpoint. What is missing of the checkpoints earns nothing.

    Raises:
        SpecError: the rubric of the lab is wrong, or it has none.
        UsageError: there are several submissions.
    """
    if len(report.submissions) > 1:
        raise UsageError("a Gradescope result covers one submission; name one folder")
    results = [result for result in report.results if result.checkpoint in lab.checkpoints]
    if not results:
        return None
    from lab3_usd.grade.dry_runs import with_dry_runs

    rubric = load_rubric(None, lab)
    findings = [finding for about in report.submissions for finding in about.findings]
    checklist = [line for about in report.submissions for line in about.checklist]
    facts = facts_of(results, rubric.required, findings, checklist)
    lab = lab_of_team(lab, ((stage.path, stage.checkpoint) for stage in facts.stages))
    points = grade_facts(rubric, with_dry_runs(facts, lab, {}))
    return grade_sheet(rubric, points, "", "")


HTML, JSON, GRADESCOPE = "report.html", "report.json", "results.json"


def write_reports(
    report: Report, rubric: Rubric, points: Grade, name: str, remarks: tuple[str, ...] = ()
) -> dict[str, str]:
    """Return the texts of the report files by name; `name` is the student's, where it is known."""
    student = report.submissions[0].path if report.submissions else ""
    summary = grade_sheet(rubric, points, student, name, remarks)
    return {
        HTML: render("html", report, rules_in(load_lab()), Options(grade=summary)),
        JSON: render("json", report, None, Options()),
        GRADESCOPE: render("gradescope", report, None, Options(grade=summary)),
    }


STUDENTS, RESULT = "students", "result.json"
CSV, GRADEBOOK_JSON, PAGE = "grades.csv", "grades.json", "index.html"
FINISHED = ("graded", "empty", "unreadable")  # the other ways to end may go better next time
MAP = "supplied-map.json"
_TABLES = (CSV, GRADEBOOK_JSON, PAGE, ADJUSTMENTS, LATE, RUBRIC, MAP)
_FILES = (HTML, JSON, GRADESCOPE, RESULT)
_VERSION = 1
# What `--gradebook` writes beside the tables.
_EXPORTS = (
    *("canvas.csv", "moodle.csv", "brightspace.csv", "blackboard.csv", "blackboard.xls"),
    *("canvas-rubric.csv", "canvas-feedback.zip", "moodle-feedback.zip"),
)
TABLES = (CSV, GRADEBOOK_JSON, PAGE, *_EXPORTS)  # what is written to a gradebook as a whole
# What desktops and spreadsheet programs leave in a folder that somebody looked into.
_LITTER = (".ds_store", "thumbs.db", "desktop.ini", ".directory", "._*", ".~lock.*#", "~$*")
Row = dict[str, Any]


def exports_in(out: Path) -> Iterator[Path]:
    """Yield what `--gradebook` wrote beside the tables, which are older or newer."""
    yield from (out / name for name in _EXPORTS if (out / name).is_file())


def check_target(out: Path, *, resume: bool) -> None:
    """Refuse to grade into a folder that holds something else, or a gradebook without `--resume`.

    Raises:
        UsageError: the folder is in use, or is no folder.
    """
    if not out.exists():
        return
    if not out.is_dir():
        raise UsageError(f"{out}: is not a folder; choose another one for -o")
    half = leftover_files(out, _TABLES)
    names = {path.name for path in out.iterdir()} - {path.name for path in half} - {LOCK}
    holds = {name for name in names if not _is_litter(name)}
    if (holds or half) and not resume:
        raise UsageError(f"{out}: is not empty; choose another folder, or continue with --resume")
    foreign = sorted(holds - {STUDENTS, REPORTS, *_TABLES, *_EXPORTS})
    for folder in sorted((*out.glob(f"{STUDENTS}/*"), *out.glob(f"{REPORTS}/*"))):
        foreign += [path.relative_to(out).as_posix() for path in _foreign_in(folder)]
    if foreign:
        raise UsageError(
            f"{out}: holds {foreign[0]}, which is not part of a gradebook; choose another folder"
        )


def _foreign_in(folder: Path) -> list[Path]:
    """Return what a folder of reports, of a student or of all, has of others.

    It may be what was handed in, as may be what is no folder.
    """
    if not folder.is_dir() or folder.is_symlink():
        return [] if _is_litter(folder.name) else [folder]
    ours = {*(folder / name for name in _FILES), *leftover_files(folder, _FILES)}
    return sorted(
        path for path in folder.iterdir() if path not in ours and not _is_litter(path.name)
    )


def _is_litter(name: str) -> bool:
    return any(fnmatchcase(name.lower(), pattern) for pattern in _LITTER)


def clear_halves(out: Path) -> None:
    """Remove halves of files, which a run leaves that is killed as it writes them.

    Raises:
        UsageError: one cannot be removed.
    """
    half = leftover_files(out, _TABLES)
    students = [*out.glob(f"{STUDENTS}/*/"), *out.glob(f"{REPORTS}/*/")]
    _remove([*half, *(path for student in students for path in leftover_files(student, _FILES))])


def _remove(files: Iterable[Path]) -> None:
    try:
        for path in files:
            path.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(f"{error.filename} cannot be removed ({error.strerror})") from error


def known_digest(out: Path, submission: StudentSubmission, salt: str, items: Sequence[str]) -> str:
    """Return the digest of what was judged before under the same conditions, '' for nothing.

    `items` are those of the rubric, which each result has. The file may have been edited.
    """
    row = read_result(out, submission)
    if row is None or row.get("salt") != salt or row.get("status") not in FINISHED:
        return ""
    if any(row.get(key) != value for key, value in owner_record(submission).items()):
        return ""
    try:
        recorded = msgspec.convert(row, _Recorded)
    except msgspec.ValidationError:
        return ""
    folder = shared_folder(out, row) or out / STUDENTS / submission.folder
    reports = row.get("reports")
    if (
        [item.id for item in recorded.items] != list(items)
        or not isinstance(reports, list)
        or not all((folder / str(name)).is_file() for name in reports)
    ):
        return ""
    return recorded.digest


def owner_record(submission: StudentSubmission) -> Row:
    """Return what a result says of whose a submission is, and what the platform called it."""
    return {
        "student": submission.student,
        "name": submission.name,
        "folder": submission.folder,
        "late": submission.late,
        "platform": submission.platform,
        "entries": list(submission.entries),
        "people": list(to_builtins(submission.people)),
        "may_be": list(to_builtins(submission.may_be)),
    }


class _Recorded(Grade, frozen=True, kw_only=True):
    """What the tables need of a result, which somebody may have edited."""

    reason: str
    digest: str
    verdicts: dict[str, str]
    crashes: list[str]
    remarks: tuple[str, ...]
    unconfined: tuple[str, ...] = ()


def read_result(out: Path, submission: StudentSubmission) -> Row | None:
    """Return what was recorded of a student, None where nothing was or it cannot be read."""
    try:
        row = json.loads((out / STUDENTS / submission.folder / RESULT).read_bytes())
    except (OSError, ValueError):
        return None
    return row if isinstance(row, dict) and row.get("version") == _VERSION else None


def write_student(
    out: Path, submission: StudentSubmission, salt: str, answer: Mapping[str, Any]
) -> None:
    """Write a student's reports, and last the result, which says that the rest is complete.

    The result of before goes first: it says nothing of reports that are written anew. Reports that
    name nobody (`SHARED` in the answer) are stored once for all students of whom they are true.
    """
    folder = out / STUDENTS / submission.folder
    make_folder(folder)
    _remove([folder / RESULT])
    place: Row = {}
    if answer.get(SHARED):
        place = {SHARED: write_shared(out, answer["reports"])}
        _remove(folder / name for name in answer["reports"])
    else:
        for name, contents in sorted(answer["reports"].items()):
            write_whole(folder / name, contents.encode("utf-8", "replace"), force=True)
    row = {
        "version": _VERSION,
        **owner_record(submission),
        "salt": salt,
        **{key: value for key, value in answer.items() if key not in {"reports", SHARED}},
        **place,
        "reports": sorted(answer["reports"]),
    }
    write_whole(folder / RESULT, json_text(row, 1).encode(), force=True)


class Rows(Sized, Iterable[Row]):
    """The rows of a gradebook, in the order of the students; read from its files as they pass by.

    A class may be large: its rows are never in memory all at once.
    """

    def __init__(self, out: Path, submissions: Iterable[StudentSubmission]) -> None:
        """Find the students of whom there is a result."""
        self._out = out
        self._submissions = tuple(
            submission for submission in submissions if read_result(out, submission) is not None
        )

    def __len__(self) -> int:
        """Return how many students there are."""
        return len(self._submissions)

    def __iter__(self) -> Iterator[Row]:
        """Yield one row after the other."""
        for submission in self._submissions:
            row = read_result(self._out, submission)
            if row is not None:
                yield row


def write_tables(out: Path, submissions: Iterable[StudentSubmission], rubric: Rubric) -> Rows:
    """Write the tables and the page of the class from the students' results, and return those."""
    rows = Rows(out, submissions)
    page = class_page(rubric.title, _columns(rubric), rows, alike(rows))
    write_parts(out / CSV, _csv_lines(rows, rubric), force=True)
    write_parts(out / GRADEBOOK_JSON, _json_parts(rows, rubric), force=True)
    write_parts(out / PAGE, (part.encode() for part in page), force=True)
    remove_unshared(out, rows)
    return rows


_NOT_IN_TABLES = ("version", "salt", "facts", "work")


def alike(rows: Iterable[Row]) -> list[Row]:
    """Return who handed in the same: the same files, or last stages that differ in names only.

    It is for the grader to judge: who works by the handout alone may come to the same.
    """
    by_file: dict[tuple[str, str], list[str]] = {}
    by_content: dict[str, list[str]] = {}
    for row in rows:
        work = row.get("work") or {}
        for number, digest in work.get("files", {}).items():
            by_file.setdefault((number, digest), []).append(row["student"])
        by_content.setdefault(work.get("likeness", ""), []).append(row["student"])
    shared: dict[tuple[str, ...], list[str]] = {}
    for (number, _), students in by_file.items():
        if len(students) > 1:
            shared.setdefault(tuple(students), []).append(number)
    groups: list[Row] = [
        {"students": list(students), "what": "the same files", "checkpoints": sorted(numbers)}
        for students, numbers in shared.items()
    ]
    groups += [
        {"students": students, "what": "the same graphs, except names", "checkpoints": []}
        for signature, students in by_content.items()
        if signature and len(students) > 1 and tuple(students) not in shared
    ]
    return sorted(groups, key=lambda group: (group["students"], group["what"]))


def _columns(rubric: Rubric) -> list[Row]:
    return [
        {"id": item.id, "title": item.title, "points": item.points, "optional": item.optional}
        for item in rubric.items
    ]


def _csv_lines(rows: Iterable[Row], rubric: Rubric) -> Iterator[bytes]:
    """Yield the lines of the table of grades; they end in CR LF, and no cell is a formula."""
    names = [item.id for item in rubric.items]
    team = [TEAM_COLUMN] if has_teams(rubric.files) else []
    yield _line([*COLUMNS[:2], *team, *COLUMNS[2:-1], *names, COLUMNS[-1]])
    for row in rows:
        earned = {item["id"]: item for item in row["items"]}
        cells = [row["student"], row["name"], *(row.get(key, "") for key in team)]
        days = row.get("days_late")
        late = "yes" if row["late"] else ""
        cells += [row["status"], plural(days, "day") if days or (late and days == 0) else late]
        cells += [_number(row[key]) for key in ("earned", "possible", "percent")]
        for name in names:  # blocked and open items have no points
            has_points = earned[name]["state"] not in {"blocked", "open"}
            cells.append(_number(earned[name]["earned"]) if has_points else "")
        yield _line([*cells, _remarks_text(row)])


def _line(cells: Iterable[str]) -> bytes:
    return csv_line(map(safe_cell, cells)).encode("utf-8", "replace")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


_LINES = 3  # of what an item lost in the table; the student's page has all


def _remarks_text(row: Row) -> str:
    remarks = [row["reason"], *row["remarks"], *row["because"]]
    for item in row["items"]:
        lost = lost_by(row, item["id"])
        if item["state"] in {"missing", "unreadable", "blocked", "open"}:
            causes = [line for line in lost if line.rule or line.place][:1]
            where = " ".join(filter(None, (causes[0].rule, causes[0].place))) if causes else ""
            said = [line.text for line in lost if line.is_shown and not line.points]
            state = f"{item['state']}{f' ({where})' if where else ''}"
            remarks.append(f"{item['id']}: {', '.join([state, *said])}")
        elif lost:
            first = ([line for line in lost if line.is_shown] or lost)[:_LINES]
            lines = [line.text for line in first]
            lines += [f"{len(lost) - len(lines)} more"] if len(lost) > len(lines) else []
            remarks.append(f"{item['id']}: {', '.join(lines)}")
        elif item["because"]:
            remarks.append(f"{item['id']}: {item['because']}")
    return "; ".join(filter(None, remarks))


def lost_by(row: Row, item: str) -> list[LostPoints]:
    """Return what an item of a student's row lost, as people read it."""
    return reasons(line for line in deductions_in(row) if line.item == item)


def deductions_in(row: Row) -> list[Deduction]:
    """Return the deductions of a student's row."""
    return msgspec.convert(row["lost"], list[Deduction])


def _json_parts(rows: Iterable[Row], rubric: Rubric) -> Iterator[bytes]:
    """Yield the gradebook as JSON, each student on a line."""
    head = {
        "version": _VERSION,
        "tool": {"name": NAME, "version": tool_version()},
        "title": rubric.title,
        "points": rubric.points,
        "items": _columns(rubric),
        "alike": alike(rows),
        "unconfined": sorted({name for row in rows for name in row.get("unconfined", [])}),
    }
    shown = ({key: row[key] for key in row if key not in _NOT_IN_TABLES} for row in rows)
    yield from _with_students(head, shown)


def _with_students(head: Row, rows: Iterable[Row]) -> Iterator[bytes]:
    yield json_text(head, 1).removesuffix("\n}\n").encode() + b',\n "students": ['
    between = b"\n"
    for row in rows:
        yield between + b"  " + json.dumps(row).encode()
        between = b",\n"
    yield b"\n ]\n}\n"


def record_decisions(out: Path, platform: str, record: Row) -> None:
    """Write into grades.json what `--gradebook` decided about an export of a platform.

    Raises:
        UsageError: there is no gradebook, or it cannot be written.
    """
    book = read_gradebook(out)
    students = book.pop("students")
    book["exports"] = {**book.get("exports", {}), platform: record}
    write_parts(out / GRADEBOOK_JSON, _with_students(book, students), force=True)


def read_gradebook(out: Path) -> Row:
    """Return what grades.json says of a class.

    Raises:
        UsageError: there is no gradebook.
    """
    try:
        book = json.loads((out / GRADEBOOK_JSON).read_bytes())
        book["students"] = [dict(row) for row in book["students"]]
        book["items"] = [dict(item) for item in book["items"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{out}: contains no readable gradebook") from error
    return dict(book)
