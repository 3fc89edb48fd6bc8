"""Tells whose the entries of a class are, by their names and what platforms put beside them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from msgspec import Struct

from lab3_usd.grade.intake.archives import OTHER_ENDINGS, is_archive
from lab3_usd.grade.intake.download_names import ARCHIVE_END, file_owners, is_platform_name
from lab3_usd.grade.intake.people import ADDRESS, STUDENT_ID, Person
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import LEFTOVERS
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import after_a_student
from lab3_usd.yaml_file import refuse_deep

METADATA = "submission_metadata.yml"
LARGEST = 20_000_000  # bytes
TOO_LARGE = f"it is larger than {LARGEST // 1_000_000} MB"
# Takes every value as the text it is, whatever its tag says.
_AsText: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
_TOP = re.compile(rb"^(?=[^\s#%-])", re.MULTILINE)  # where an entry of the whole file begins
_NOTHING = {"", "~", "null", "Null", "NULL"}


class Submitters(Struct, frozen=True):
    """Who handed in a folder of Gradescope: what tells them from others, and the people."""

    student: str
    people: tuple[Person, ...]

    @property
    def name(self) -> str:
        """The names to show, '' where none is known."""
        return ", ".join(person.name for person in self.people if person.name)


class StudentNames(Struct, frozen=True):
    """Who handed in each folder, and in a few words what could not be read."""

    by_folder: Mapping[str, Submitters]
    fault: str


_IDS = {STUDENT_ID: ":sid", ADDRESS: ":email"}


def names_in(data: bytes | str) -> StudentNames:
    """Return who is who from the bytes of the file; a text says why there are none."""
    if isinstance(data, str):
        return StudentNames({}, data)
    names: dict[str, Submitters] = {}
    fault = ""
    for document in _documents(data):
        if isinstance(document, str):
            fault = fault or document
            continue
        for folder, entry in document.items():
            submitters = entry.get(":submitters") if isinstance(entry, dict) else None
            if not isinstance(folder, str) or not isinstance(submitters, list):
                continue
            people = tuple(
                Person(
                    _text(fields, ":name"),
                    {kind: value for kind, key in _IDS.items() if (value := _text(fields, key))},
                )
                for fields in submitters
                if isinstance(fields, dict)
            )
            if people:
                numbers = (next(iter(person.ids.values()), "") for person in people)
                student = "+".join(filter(None, numbers)) or folder
                names.setdefault(folder, Submitters(student, people))
    return StudentNames(names, fault)


class _YamlFault(Struct, frozen=True):
    """What is wrong with a piece of YAML, and after how many lines (-1: not known)."""

    text: str
    line: int = -1


def _documents(data: bytes) -> Iterator[dict[Any, Any] | str]:
    """Yield the whole file, or where it is faulty what can be read of it, and the fault."""
    whole = _loaded(data)
    if not isinstance(whole, _YamlFault):
        yield whole
        return
    yield whole.text
    begins = [entry.start() for entry in _TOP.finditer(data)]
    for start, end in zip(begins, [*begins, len(data)][1:], strict=True):
        piece = data[start:end]
        part = _loaded(piece)
        if isinstance(part, _YamlFault) and part.line > 0:
            part = _loaded(b"\n".join(piece.splitlines()[: part.line]))
        if not isinstance(part, _YamlFault):
            yield part


def _loaded(data: bytes) -> dict[Any, Any] | _YamlFault:
    try:
        refuse_deep(data)
        document = yaml.load(data, Loader=_AsText)  # noqa: S506 - a safe loader
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or "is no YAML"
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            return _YamlFault(problem)
        return _YamlFault(f"line {mark.line + 1}: {problem}", mark.line)
    return document if isinstance(document, dict) else _YamlFault("it is not a mapping")


def _text(person: dict[Any, Any], key: str) -> str:
    value = person.get(key)
    return value.strip() if isinstance(value, str) and value.strip() not in _NOTHING else ""


_STAGE = (".usd", ".usda", ".usdc", ".usdz", ".uda")
Entry = tuple[str, bool]
StudentsByFolder = Mapping[str, Submitters]


class SubmissionPart(Struct, frozen=True):
    """A file or folder of a class, and whose it is.

    `entry` is its name in the class. One that `stands_alone` is a submission of its own, whatever
    student it names; others belong together when their students are the same. `platform` is the
    one whose form the name has, `people` are named as there, and `others` are further candidates.
    `upload` and `when` are as in `FileOwner`.
    """

    student: str
    name: str
    source: Source
    entry: str
    platform: str = ""
    people: tuple[Person, ...] = ()
    others: tuple[Person, ...] = ()
    late: bool = False
    upload: int = 0
    when: str = ""
    stands_alone: bool = False


def entries_in(folder: Path) -> list[Entry]:
    """Return the names in a folder, and which of them are folders, in order.

    Raises:
        OSError: the folder cannot be read.
    """
    return sorted((name, os.path.isdir(folder / name)) for name in os.listdir(folder))  # noqa: PTH112, PTH208 - pathlib raises for a link to something unreadable


def read_in(folder: Path, name: str) -> bytes | str:
    """Return a file's bytes, or a few words about why it cannot be read.

    What is handed in is not read where it is a link: it may lead out of the class.
    """
    path = folder / name
    try:
        if not path.is_file() or (path.is_symlink() and name != METADATA):
            return "it is not a file"
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        return f"it cannot be read: {error.strerror}"
    return data if len(data) <= LARGEST else TOO_LARGE


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


def parts_of(
    entries: Iterable[Entry],
    submitters: StudentsByFolder,
    receipts: Callable[[str], str] = lambda _name: "",
) -> Iterator[SubmissionPart]:
    """Yield whose each entry is.

    `submitters` are the submitters of folders, and `receipts` returns the text of a receipt of
    Blackboard.
    """
    class_entries = list(entries)
    owners = file_owners((name for name, _ in class_entries), receipts)
    for name, is_folder in class_entries:
        owner = owners.get(name)
        if is_folder and name in submitters:
            who = submitters[name]
            yield SubmissionPart(
                who.student,
                who.name or name,
                Source(Path(name)),
                name,
                "gradescope",
                who.people,
                stands_alone=True,
            )
        elif owner is not None:
            yield SubmissionPart(
                owner.student,
                owner.name,
                Source(Path(name), "" if is_folder else owner.file or name),
                name,
                owner.platform,
                (owner.person,),
                owner.others,
                owner.late,
                owner.upload,
                owner.when,
            )
        elif is_folder:
            yield _plain_part(name, name, "")
        else:
            stage = after_a_student(load_lab().files).match(name)
            if stage is not None and name.lower().endswith(_STAGE):
                yield _plain_part(stage["name"], name, stage["file"])
            else:
                yield _plain_part(ARCHIVE_END.sub("", name) or name, name, name)


def _plain_part(student: str, entry: str, file: str) -> SubmissionPart:
    """Return a part that no platform named: the student is called as it is."""
    return SubmissionPart(student, student, Source(Path(entry), file), entry)
