"""Finds who handed in what: folders, archives and files as learning platforms export them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.folder import is_submission
from lab3_usd.errors import UsageError
from lab3_usd.grade.archives import OTHER_ENDINGS, is_archive
from lab3_usd.grade.gradescope_export import METADATA, names_by_folder
from lab3_usd.grade.remote import entries_at
from lab3_usd.grade.staging import Source

_STAGE = (".usd", ".usda", ".usdc", ".usdz", ".uda")
_ARCHIVE_END = re.compile(r"(\.tar)?\.[A-Za-z0-9]+$")
# doejane_LATE_12345_67890_work-1.zip: name, student number, number of the upload, file.
_CANVAS = re.compile(r"^(?P<name>[^_]+)_(?:(?P<late>LATE)_)?(?P<id>\d+)_\d+_(?P<file>.+)$")
# Jane Doe_1234567_assignsubmission_file_work.zip, as a file or as a folder
_MOODLE = re.compile(
    r"^(?P<name>[^_]+)_(?P<id>\d+)_assignsubmission_(?:file|onlinetext)(?:_(?P<file>.*))?$"
)
# jane_Lab3_05_odometry_tf.usda: a student's name before a checkpoint's
_NAMED_STAGE = re.compile(r"^(?P<name>.+?)[ _-]+(?P<file>lab[ _-]*3[ _-].*)$", re.IGNORECASE)
_AGAIN = re.compile(r"-\d+(?=\.[A-Za-z0-9.]+$)")  # Canvas numbers what is uploaded again
_SLUG = re.compile(r"[^A-Za-z0-9._-]+")
_LONGEST_SLUG = 80


class Handed(Struct, frozen=True):
    """What one student handed in.

    `student` is the number or name that the platform gives, `folder` the name of the report
    folder, which no other student has.
    """

    student: str
    name: str
    folder: str
    sources: tuple[Source, ...]
    late: bool = False


class _Part(Struct, frozen=True):
    student: str
    name: str
    source: Source
    late: bool = False


def find_submissions(place: Path | str) -> tuple[Handed, ...]:
    """Return every student's submission in a folder, in the order of the students.

    A folder in object storage is given by its address, as text.

    Raises:
        UsageError: there is no such folder, or nothing in it is a submission.
    """
    if isinstance(place, str):
        parts = _of_entries(entries_at(place), {})
        elsewhere = [replace(each, source=_elsewhere(each.source, place)) for each in parts]
        return tuple(_joined(elsewhere, place))
    if not place.is_dir():
        message = f"{place}: there is no such folder or archive of submissions"
        raise UsageError(message)
    return tuple(_joined(_parts(place), place))


def _elsewhere(source: Source, address: str) -> Source:
    return replace(source, address=f"{address.rstrip('/')}/{source.path}")


def within_wrapper(place: Path) -> Path:
    """Return the one folder that an archive of a class wraps its students' folders in, if any."""
    inside = [each for each in place.iterdir() if not each.name.startswith((".", "__MACOSX"))]
    if len(inside) != 1 or not inside[0].is_dir() or is_submission(inside[0]):
        return place
    students = [each for each in inside[0].iterdir() if each.is_dir() or is_archive(each.name)]
    return inside[0] if len(students) > 1 else place


def _parts(place: Path) -> list[_Part]:
    if is_submission(place):
        name = place.resolve().name or "submission"
        return [_Part(name, name, Source(place))]
    entries = sorted((path.name, path.is_dir()) for path in place.iterdir())
    parts = _of_entries(entries, names_by_folder(place / METADATA))
    return [replace(each, source=_within(each.source, place)) for each in parts]


def _within(source: Source, place: Path) -> Source:
    return replace(source, path=place / source.path)


def _of_entries(
    entries: Iterable[tuple[str, bool]], known: dict[str, tuple[str, str]]
) -> list[_Part]:
    """Tell by their names whose the entries of a folder are."""
    parts = []
    for name, is_folder in entries:
        path = Path(name)
        if name.startswith((".", "__MACOSX")):
            continue
        if is_folder:
            parts.append(_of_folder(path, known))
        elif is_archive(path.name) or path.name.lower().endswith((*OTHER_ENDINGS, *_STAGE)):
            parts.append(_of_file(path))
        else:
            parts += _of_platform(path)
    return parts


def _of_folder(path: Path, known: dict[str, tuple[str, str]]) -> _Part:
    if path.name in known:
        student, name = known[path.name]
        return _Part(student, name, Source(path))
    moodle = _MOODLE.match(path.name)
    if moodle is not None:
        return _Part(moodle["id"], moodle["name"], Source(path))
    return _Part(path.name, path.name, Source(path))


def _of_platform(path: Path) -> Iterator[_Part]:
    """Yield files of any other kind when a platform put a student's name before theirs."""
    if _CANVAS.match(path.name) or _MOODLE.match(path.name):
        yield _of_file(path)


def _of_file(path: Path) -> _Part:
    canvas = _CANVAS.match(path.name)
    if canvas is not None:
        file = _AGAIN.sub("", canvas["file"])
        return _Part(canvas["id"], canvas["name"], Source(path, file), canvas["late"] is not None)
    moodle = _MOODLE.match(path.name)
    if moodle is not None:
        return _Part(moodle["id"], moodle["name"], Source(path, moodle["file"] or path.name))
    named = _NAMED_STAGE.match(path.name)
    if named is not None and path.name.lower().endswith(_STAGE):
        return _Part(named["name"], named["name"], Source(path, named["file"]))
    student = _ARCHIVE_END.sub("", path.name) or path.name
    return _Part(student, student, Source(path, path.name))


def _joined(parts: list[_Part], place: Path | str) -> Iterator[Handed]:
    """Put together what belongs to one student; two of them never share a report folder."""
    if not parts:
        message = f"{place}: holds no submission: no folder, archive or stage"
        raise UsageError(message)
    students: dict[str, list[_Part]] = {}
    for part in parts:
        students.setdefault(part.student, []).append(part)
    taken: set[str] = set()
    for student, own in sorted(students.items()):
        folder = _slug(student, taken)
        taken.add(folder.casefold())
        sources = tuple(part.source for part in own)
        late = any(part.late for part in own)
        yield Handed(_text(student), _text(own[0].name), folder, sources, late)


def _text(name: str) -> str:
    """Return a name as text, also where the file system holds bytes that are none."""
    return name.encode("utf-8", "backslashreplace").decode()


def _slug(student: str, taken: set[str]) -> str:
    """Return a folder name that every file system and every link takes as it is."""
    plain = _SLUG.sub("_", student).strip("._-")[:_LONGEST_SLUG]
    if plain == student and plain.casefold() not in taken:
        return plain
    digest = hashlib.sha256(student.encode("utf-8", "backslashreplace")).hexdigest()
    return f"{plain or 'student'}-{digest[:8]}"
