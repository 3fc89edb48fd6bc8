"""Returns the reasons and reports of a class in the form that a platform takes.

Rules of names: moodle/moodle, mod/assign/feedback/file/importziplib.php; instructure/canvas-lms,
app/models/abstract_assignment.rb (`infer_comment_context_from_filename`) and
rubric_assessment_import.rb. Nothing was tried on a live platform.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.errors import UsageError
from lab3_usd.files import write_whole
from lab3_usd.grade.filled_export import FilledExport
from lab3_usd.grade.gradebook import STUDENTS, Row, lost_by
from lab3_usd.grade.intake.people import CANVAS_USER, MOODLE_NUMBER
from lab3_usd.grade.rosters import PLATFORMS
from lab3_usd.grade.shared_reports import REPORTS
from lab3_usd.grade.text_table import csv_line
from lab3_usd.report.safe_text import CELL_LIMIT, visible

NAME = "lab3-report.html"  # not the name of anything that was handed in
_REPORT = "report.html"
_DATE = (1980, 1, 1, 0, 0, 0)  # the same bytes at any time
_ZIP = ".zip"


class Returned(Struct, frozen=True):
    """A file to upload, of how many students, and who is left out for what reason."""

    path: Path
    students: int
    left_out: tuple[str, ...] = ()


def reasons_by_student(book: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return what each student reads: why items lost points, and what the grader wrote."""
    titles = {item["id"]: item["title"] for item in book["items"]}
    return {
        row["student"]: tuple(
            f"{titles[item['id']]}: {line.text}"
            for item in row["items"]
            for line in lost_by(row, item["id"])
            if line.is_shown
        )
        for row in book["students"]
    }


def write_feedback(out: Path, export: FilledExport, book: Mapping[str, Any]) -> list[Returned]:
    """Write the files that return reports and reasons to students whose points were filled in.

    Raises:
        UsageError: the platform takes nothing that is known, or a file cannot be written.
    """
    roster, rows = export.roster, {row["student"]: row for row in book["students"]}
    if roster.platform == "moodle":
        return [_moodle(out, export, rows)]
    if roster.platform == "canvas":
        return [_canvas(out, export, rows), _assessments(out / "canvas-rubric.csv", export, book)]
    if roster.platform != "blackboard":
        raise UsageError(
            f"--feedback: how {roster.platform} takes reports is not known; moodle, canvas, "
            "blackboard is"
        )
    if roster.comment < 0:
        raise UsageError(
            f"{roster.path}: has no column of comments; choose Work Offline > Download with "
            "comments"
        )
    return []  # it takes comments in the export itself, and no files


def _moodle(out: Path, export: FilledExport, rows: Mapping[str, Row]) -> Returned:
    """Write the archive for "Upload multiple feedback files in a zip": a folder for each person."""
    files = [
        (f"lab3_{number}_assignsubmission_file/{NAME}", report.read_bytes())
        for row, student in export.returned
        if (number := row.ids.get(MOODLE_NUMBER)) and (report := _report(out, rows[student]))
    ]
    roster, without = export.roster, list[str]()
    if roster.comment < 0:
        heading = PLATFORMS[roster.platform].comment
        without = [
            f"{roster.path}: has no column '{heading}', so that reasons are in reports alone"
        ]
    return _archive(out / "moodle-feedback.zip", files, without)


def _canvas(out: Path, export: FilledExport, rows: Mapping[str, Row]) -> Returned:
    """Write the archive for "Upload Submissions".

    Canvas shows a file under the name of what was handed in: only an archive can come back.
    """
    files, left_out = [], []
    for row, student in export.returned:
        entries = [name for name in rows[student]["entries"] if name.lower().endswith(_ZIP)]
        report = _report(out, rows[student])
        if entries and report:
            files.append((entries[-1], _zipped([(_REPORT, report.read_bytes())])))
        else:
            left_out.append(f"{row.label}: handed in no archive")
    return _archive(out / "canvas-feedback.zip", files, left_out)


def _assessments(path: Path, export: FilledExport, book: Mapping[str, Any]) -> Returned:
    """Write points and comments for each criterion, called as the items are."""
    rows = {row["student"]: row for row in book["students"]}
    titles = {item["id"]: item["title"] for item in book["items"]}
    parts = ("Points", "Comments", "Rating")
    lines = [["Student Id", *(f"{t} - {part}" for t in titles.values() for part in parts)]]
    returned = [(row.ids[CANVAS_USER], rows[student]) for row, student in export.returned
             if CANVAS_USER in row.ids]  # fmt: skip
    for number, row in returned:
        cells: list[str] = []
        for item in row["items"]:
            is_open = item["state"] in {"open", "blocked"}
            told = [line.text for line in lost_by(dict(row), item["id"]) if line.is_shown]
            reasons = [visible(part) for text in told for part in text.splitlines()]
            # The comment begins with a word, since a sign would be a formula.
            comment = "\n".join(["Points:", *reasons])[:CELL_LIMIT] if reasons else ""
            cells += ["" if is_open else f"{item['earned']:g}", comment, ""]
        lines.append([number, *cells])
    write_whole(path, "".join(map(csv_line, lines)).encode(), force=True)
    return Returned(path, len(returned))


def _report(out: Path, row: Mapping[str, Any]) -> Path | None:
    """Return the page of a student, None where there is none."""
    shared = row.get("shared")
    folder = out / REPORTS / shared if shared else out / STUDENTS / row["folder"]
    page = folder / _REPORT
    return page if page.is_file() else None


def _archive(path: Path, files: Sequence[tuple[str, bytes]], left_out: Iterable[str]) -> Returned:
    write_whole(path, _zipped(files), force=True)
    return Returned(path, len(files), tuple(left_out))


def _zipped(files: Iterable[tuple[str, bytes]]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files:
            archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)
    return data.getvalue()
