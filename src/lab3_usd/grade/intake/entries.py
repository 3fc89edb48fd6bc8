"""Finds the student of each file and folder by its name, as learning platforms write it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.grade.intake.archives import OTHER_ENDINGS, is_archive
from lab3_usd.grade.intake.file_filter import LEFTOVERS
from lab3_usd.grade.intake.platforms import file_owners, is_platform_name
from lab3_usd.grade.intake.staging import Source
from lab3_usd.judge.stage import checkpoint_of
from lab3_usd.spec.file_names import after_a_student
from lab3_usd.spec.load.loader import load_lab

_STAGE = (".usd", ".usda", ".usdc", ".usdz", ".uda")
ARCHIVE_END = re.compile(r"(\.tar)?\.[A-Za-z0-9]+$")
Entry = tuple[str, bool]
StudentsByFolder = Mapping[str, tuple[str, str]]


class SubmissionPart(Struct, frozen=True):
    """A file or folder of a class, and whose it is.

    `entry` is the name of a folder that is a submission of its own, whatever student it names;
    parts without belong together when their students are the same. Of several uploads the one
    with the highest number is the last. `doubt` names another student that it may be of.
    """

    student: str
    name: str
    source: Source
    late: bool = False
    upload: int = 0
    entry: str = ""
    doubt: str = ""


def entries_in(folder: Path) -> list[Entry]:
    """Return the names in a folder, and which of them are folders, in order.

    Raises:
        OSError: the folder cannot be read.
    """
    return sorted((name, os.path.isdir(folder / name)) for name in os.listdir(folder))  # noqa: PTH112, PTH208 - pathlib raises where a link leads to what nobody may read


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
    return len(numbered) > 1 or any(each and name.lower() == stages for name, each in known)


def parts_of(entries: Iterable[Entry], known: StudentsByFolder) -> Iterator[SubmissionPart]:
    """Yield whose each entry is; `known` are the numbers and names of students by their folders."""
    every = list(entries)
    owners = file_owners(name for name, _ in every)
    for name, is_folder in every:
        owner = owners.get(name)
        if is_folder and name in known:
            student, called = known[name]
            yield SubmissionPart(student, called, Source(Path(name)), entry=name)
        elif owner is not None:
            file = "" if is_folder else owner.file or name
            source = Source(Path(name), file)
            yield SubmissionPart(
                owner.student, owner.name, source, owner.late, owner.upload, doubt=owner.doubt
            )
        else:
            yield _of_folder(Path(name)) if is_folder else _of_file(Path(name))


def _of_folder(path: Path) -> SubmissionPart:
    return SubmissionPart(path.name, path.name, Source(path))


def _of_file(path: Path) -> SubmissionPart:
    named = after_a_student(load_lab().files).match(path.name)
    if named is not None and path.name.lower().endswith(_STAGE):
        return SubmissionPart(named["name"], named["name"], Source(path, named["file"]))
    student = ARCHIVE_END.sub("", path.name) or path.name
    return SubmissionPart(student, student, Source(path, path.name))
