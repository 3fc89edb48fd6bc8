"""Finds the student of each file and folder by its name, as learning platforms write it.

Canvas: `lib/content_zipper.rb` of instructure/canvas-lms. Moodle: `classes/downloader.php` of
`mod/assign` in moodle/moodle. Blackboard and Brightspace publish no source; their names are those
of public exports.
"""

from __future__ import annotations

import os
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.grade.intake.archives import OTHER_ENDINGS, is_archive
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import LEFTOVERS
from lab3_usd.judge.stage import checkpoint_of
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import after_a_student
from lab3_usd.yaml_file import refuse_deep


class FileOwner(Struct, frozen=True):
    """Whose a file or folder is, as its name says.

    `file` is the student's own name for it, '' for none. Files of one upload have one number, and
    the highest is that of the last; 0 belongs to every upload. `when` tells it to people. `doubt`
    names the other student that it may be of.
    """

    student: str
    name: str
    file: str = ""
    late: bool = False
    upload: int = 0
    when: str = ""
    doubt: str = ""


# Canvas: [name, LATE?, id] or [LATE?, anon_ID], then the number of the upload and the file.
_CANVAS_ANONYMOUS = re.compile(
    r"^(?P<late>LATE_)?(?P<id>anon_[A-Za-z0-9]+)_(?:(?P<upload>\d+)_(?P<file>.+)|(?P<page>text|link)\.html)$"
)
_CANVAS_PAGES = ("text.html", "link.html")
_LATE = "LATE"
_AGAIN = re.compile(r"-\d+(?=\.[A-Za-z0-9.]+$)")  # Canvas numbers what is uploaded again
# Moodle: [name, id?] assignsubmission, plugin, file; only the default group has no id.
_MOODLE = re.compile(
    r"^(?P<name>[^_]+)(?:_(?P<id>\d+))?_assignsubmission_[a-z]+(?:_(?P<file>.*))?$"
)
# Brightspace: numbers of user and folder - name - date - file
_BRIGHTSPACE = re.compile(
    r"^(?P<first>\d+)-(?P<second>\d+) ?- (?P<name>.+?) ?- "
    r"(?P<date>[A-Z][a-z]{2,8} \d{1,2}, \d{4} \d{3,4}(?: [AP]M)?)(?: ?- (?P<file>.+))?$"
)
# Blackboard: assignment, user, attempt, date, file; a receipt without a file for each attempt
_BLACKBOARD = re.compile(
    r"^(?P<head>.+)_attempt_(?P<date>\d{4}(?:-\d\d){5})(?:_(?P<file>.+)|\.txt)$"
)
_LONGEST_NUMBER = 18  # digits
_LONGEST_NAME = 255  # of what a file system takes


def is_platform_name(name: str) -> bool:
    """Whether a learning platform put a student's name before that of the file."""
    if len(name) > _LONGEST_NAME:
        return False
    return bool(
        _CANVAS_ANONYMOUS.match(name)
        or any(_canvas_readings(name))
        or any(form.match(name) for form in (_MOODLE, _BRIGHTSPACE, _BLACKBOARD))
    )


def file_owners(names: Iterable[str]) -> dict[str, FileOwner]:
    """Return whose each file or folder is; names that no platform wrote are left out.

    The names of a class are read together, because one alone may be ambiguous.
    """
    readable = [name for name in names if len(name) <= _LONGEST_NAME]
    owners: dict[str, FileOwner] = {}
    for reader in (_brightspace, _blackboard, _moodle, _canvas):
        owners.update(reader([name for name in readable if name not in owners]))
    return owners


def _number(digits: str) -> int:
    return int(digits[:_LONGEST_NUMBER])


def _canvas_readings(name: str) -> Iterator[FileOwner]:
    """Yield every way to read a name of Canvas, the shortest student's name first.

    Names of students and groups may hold underscores, and end in a number after one; Canvas takes
    the underscores from numbers in the middle of a name.
    """
    parts = name.split("_")
    for index in range(1, len(parts) - 1):
        if not _is_number(parts[index]):
            continue
        rest = parts[index + 1 :]
        is_late = index > 1 and parts[index - 1] == _LATE
        name_of = "_".join(parts[: index - is_late]).strip("_") or parts[index]
        owner = FileOwner(parts[index], name_of, "_".join(rest), is_late)
        if owner.file in _CANVAS_PAGES:
            yield owner
        elif len(rest) > 1 and _is_number(rest[0]) and any(rest[1:]):
            file = _AGAIN.sub("", "_".join(rest[1:]))
            yield replace(owner, file=file, upload=_number(rest[0]))
        if any(_is_number(part) for part in parts[1:index]):
            return


def _is_number(part: str) -> bool:
    return part.isascii() and part.isdecimal()


def _canvas(names: Iterable[str]) -> dict[str, FileOwner]:
    """Read the names of Canvas; numbers of uploads never repeat in a class."""
    readings: dict[str, list[FileOwner]] = {}
    for name in names:
        possible = list(_canvas_readings(name))
        anonymous = _CANVAS_ANONYMOUS.match(name)
        if anonymous:
            page = anonymous["page"]
            owner = FileOwner(
                student=anonymous["id"],
                name=anonymous["id"],
                file=f"{page}.html" if page else _AGAIN.sub("", anonymous["file"]),
                late=anonymous["late"] is not None,
                upload=0 if page else _number(anonymous["upload"]),
            )
            possible = [owner]
        if possible:
            readings[name] = [owner for owner in possible if owner.late] or possible
    certain = {
        (owners[0].student, owners[0].name) for owners in readings.values() if len(owners) == 1
    }
    used = [
        Counter(owners[min(rank, len(owners) - 1)].upload for owners in readings.values())
        for rank in range(2)
    ]
    owners = {name: _likeliest(possible, certain, used) for name, possible in readings.items()}
    return {**owners, **dict(_canvas_uploads(owners))}


def _canvas_uploads(owners: Mapping[str, FileOwner]) -> Iterator[tuple[str, FileOwner]]:
    """Yield files with the number of their upload in place of their own.

    Canvas numbers files one after the other, whoever hands them in: a student's next upload begins
    where the name of a file comes again.
    """
    numbered = (item for item in owners.items() if item[1].upload)
    uploads: dict[tuple[str, str], tuple[int, set[str]]] = {}
    for name, owner in sorted(numbered, key=lambda item: item[1].upload):
        student = (owner.student, owner.name)
        first, files = uploads.get(student, (owner.upload, set()))
        if owner.file in files:
            first, files = owner.upload, set()
        uploads[student] = (first, {*files, owner.file})
        yield name, replace(owner, upload=first, when=f"upload {first}")


def _likeliest(
    readings: list[FileOwner], certain: set[tuple[str, str]], used: list[Counter[int]]
) -> FileOwner:
    """Choose between two readings of a name by what the rest of the class shows."""
    if len(readings) == 1:
        return readings[0]
    known = [reading for reading in readings if (reading.student, reading.name) in certain]
    possible = [
        reading
        for rank, reading in enumerate(readings)
        if not reading.upload or used[rank][reading.upload] == 1
    ]
    for candidates in (known, possible):
        if len(candidates) == 1:
            return candidates[0]
    longest = max(readings, key=lambda reading: (len(str(reading.upload)), len(reading.student)))
    (rival, *_) = (reading for reading in readings if reading is not longest)
    return replace(longest, doubt=f"{rival.name} ({rival.student})")


def _moodle(names: Iterable[str]) -> dict[str, FileOwner]:
    matches = {name: match for name in names if (match := _MOODLE.match(name))}
    return {
        name: FileOwner(match["id"] or match["name"], match["name"], match["file"] or "")
        for name, match in matches.items()
    }


def _brightspace(names: Iterable[str]) -> dict[str, FileOwner]:
    matches = {name: match for name in names if (match := _BRIGHTSPACE.match(name))}
    # One of the two numbers is that of the assignment's folder, the same for the whole class.
    ours = "first" if len({match["first"] for match in matches.values()}) > 1 else "second"
    return {
        name: FileOwner(
            match[ours],
            match["name"],
            match["file"] or "",
            upload=_minutes(match["date"]),
            when=f"upload of {match['date']}",
        )
        for name, match in matches.items()
    }


def _minutes(date: str) -> int:
    """Return a date as a number that grows with time; 0 where it cannot be read."""
    day, _, time = date.rpartition(" ")
    if time in {"AM", "PM"}:
        day, _, clock = day.rpartition(" ")
        time = f"{clock.zfill(4)} {time}"
    for form in ("%b %d, %Y %I%M %p", "%b %d, %Y %H%M", "%B %d, %Y %I%M %p", "%B %d, %Y %H%M"):
        try:
            when = datetime.strptime(f"{day} {time}", form)  # noqa: DTZ007 - only compared
        except ValueError:
            continue
        return int(when.strftime("%Y%m%d%H%M"))
    return 0


def _blackboard(names: Iterable[str]) -> dict[str, FileOwner]:
    matches = {name: match for name in names if (match := _BLACKBOARD.match(name))}
    users = _users({match["head"] for match in matches.values()})
    return {
        name: FileOwner(
            users[match["head"]],
            users[match["head"]],
            match["file"] or name,
            upload=_number(match["date"].replace("-", "")),
            when=f"upload of {match['date']}",
        )
        for name, match in matches.items()
    }


def _users(heads: Iterable[str]) -> Mapping[str, str]:
    """Return the user in each `assignment_user`: the shortest end that tells them apart.

    Both may hold underscores.
    """
    users: dict[str, str] = {}
    waiting, taken = set(heads), 1
    while waiting:
        ends: defaultdict[str, list[str]] = defaultdict(list)
        for head in waiting:
            ends["_".join(head.split("_")[-taken:])].append(head)
        for end, same in ends.items():
            if len(same) == 1:
                users[same[0]] = end
        waiting -= users.keys()
        taken += 1
    return users


METADATA = "submission_metadata.yml"
LARGEST = 20_000_000  # bytes
_Safe: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TOP = re.compile(rb"^(?=[^\s#%-])", re.MULTILINE)  # where an entry of the whole file begins
_NOTHING = {"", "~", "null", "Null", "NULL"}


class _AsText(_Safe):  # type: ignore[misc]  # the base is chosen at run time
    """A safe loader that takes every value as the text it is, whatever its tag says."""

    yaml_constructors: Mapping[Any, Any] = {}
    yaml_multi_constructors: Mapping[Any, Any] = {}
    yaml_implicit_resolvers: Mapping[Any, Any] = {}


class StudentNames(Struct, frozen=True):
    """Student number and name by folder, and in a few words what could not be read."""

    by_folder: Mapping[str, tuple[str, str]]
    fault: str


def read_metadata(path: Path) -> StudentNames:
    """Return who is who from a file; folders that it does not name keep their numbers."""
    try:
        if path.stat().st_size > LARGEST:
            return StudentNames({}, f"it is larger than {LARGEST // 1_000_000} MB")
        return names_in(path.read_bytes())
    except OSError as error:
        return StudentNames({}, f"it cannot be read: {error.strerror}")


def names_in(data: bytes | str) -> StudentNames:
    """Return who is who from the bytes of the file; a text says why there are none."""
    if isinstance(data, str):
        return StudentNames({}, data)
    names: dict[str, tuple[str, str]] = {}
    fault = ""
    for document in _documents(data):
        if isinstance(document, str):
            fault = fault or document
            continue
        for folder, entry in document.items():
            submitters = entry.get(":submitters") if isinstance(entry, dict) else None
            if not isinstance(folder, str) or not isinstance(submitters, list):
                continue
            people = [person for person in submitters if isinstance(person, dict)]
            if people:
                numbers = [_text(person, ":sid") or _text(person, ":email") for person in people]
                student = "+".join(filter(None, numbers)) or folder
                called = ", ".join(filter(None, (_text(person, ":name") for person in people)))
                names.setdefault(folder, (student, called or folder))
    return StudentNames(names, fault)


class _Fault(Struct, frozen=True):
    """What is wrong with a piece of YAML, and after how many lines (-1: not known)."""

    text: str
    line: int = -1


def _documents(data: bytes) -> Iterator[dict[Any, Any] | str]:
    """Yield the whole file, or where it is faulty what can be read of it, and the fault."""
    whole = _loaded(data)
    if not isinstance(whole, _Fault):
        yield whole
        return
    yield whole.text
    begins = [entry.start() for entry in _TOP.finditer(data)]
    for start, end in zip(begins, [*begins, len(data)][1:], strict=True):
        piece = data[start:end]
        part = _loaded(piece)
        if isinstance(part, _Fault) and part.line > 0:
            part = _loaded(b"\n".join(piece.splitlines()[: part.line]))
        if not isinstance(part, _Fault):
            yield part


def _loaded(data: bytes) -> dict[Any, Any] | _Fault:
    try:
        refuse_deep(data)
        document = yaml.load(data, Loader=_AsText)  # noqa: S506 - a safe loader
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or "is no YAML"
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            return _Fault(problem)
        return _Fault(f"line {mark.line + 1}: {problem}", mark.line)
    return document if isinstance(document, dict) else _Fault("it is no mapping")


def _text(person: dict[Any, Any], key: str) -> str:
    value = person.get(key)
    return value.strip() if isinstance(value, str) and value.strip() not in _NOTHING else ""


_STAGE = (".usd", ".usda", ".usdc", ".usdz", ".uda")
ARCHIVE_END = re.compile(r"(\.tar)?\.[A-Za-z0-9]+$")
Entry = tuple[str, bool]
StudentsByFolder = Mapping[str, tuple[str, str]]


class SubmissionPart(Struct, frozen=True):
    """A file or folder of a class, and whose it is.

    `entry` is the name of a folder that is a submission of its own, whatever student it names;
    parts without belong together when their students are the same. `upload` and `when` are as in
    `FileOwner`; `doubt` names another student that it may be of.
    """

    student: str
    name: str
    source: Source
    late: bool = False
    upload: int = 0
    when: str = ""
    entry: str = ""
    doubt: str = ""


def entries_in(folder: Path) -> list[Entry]:
    """Return the names in a folder, and which of them are folders, in order.

    Raises:
        OSError: the folder cannot be read.
    """
    return sorted((name, os.path.isdir(folder / name)) for name in os.listdir(folder))  # noqa: PTH112, PTH208 - pathlib raises for a link to something unreadable


def is_leftover(name: str) -> bool:
    """Whether operating systems and editors leave a file or folder of this name behind."""
    return name in LEFTOVERS or name.startswith("._") or name in {".DS_Store", ".git"}


def is_submission_part(entry: Entry) -> bool:
    """Whether an entry of a class is somebody's submission, or a part of it."""
    name, is_folder = entry
    if name.startswith(".") or is_leftover(name):
        return False
    if is_folder or is_archive(name) or name.lower().endswith((*OTHER_ENDINGS, *_STAGE)):
        return True
    return is_platform_name(name)


def looks_like_submission(entries: Iterable[Entry]) -> bool:
    """Whether a folder with these entries is itself a submission (see `check.folder`)."""
    lab = load_lab()
    stages = lab.submission.folders.stages.lower()
    known = list(entries)
    numbered = [name for name, _ in known if checkpoint_of(name, lab)]
    return len(numbered) > 1 or any(
        is_folder and name.lower() == stages for name, is_folder in known
    )


def parts_of(entries: Iterable[Entry], known: StudentsByFolder) -> Iterator[SubmissionPart]:
    """Yield whose each entry is; `known` are the numbers and names of students by their folders."""
    class_entries = list(entries)
    owners = file_owners(name for name, _ in class_entries)
    for name, is_folder in class_entries:
        owner = owners.get(name)
        if is_folder and name in known:
            student, called = known[name]
            yield SubmissionPart(student, called, Source(Path(name)), entry=name)
        elif owner is not None:
            file = "" if is_folder else owner.file or name
            source = Source(Path(name), file)
            yield SubmissionPart(
                owner.student,
                owner.name,
                source,
                owner.late,
                owner.upload,
                owner.when,
                doubt=owner.doubt,
            )
        elif is_folder:
            yield SubmissionPart(name, name, Source(Path(name)))
        else:
            stage = after_a_student(load_lab().files).match(name)
            if stage is not None and name.lower().endswith(_STAGE):
                source = Source(Path(name), stage["file"])
                yield SubmissionPart(stage["name"], stage["name"], source)
            else:
                student = ARCHIVE_END.sub("", name) or name
                yield SubmissionPart(student, student, Source(Path(name), name))
