"""Tells by the names of files and folders whose they are, as learning platforms write them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.check.checker import checkpoint_of
from lab3_usd.grade.archives import OTHER_ENDINGS, is_archive
from lab3_usd.grade.intake import LEFTOVERS
from lab3_usd.grade.staging import Source
from lab3_usd.spec.load_submission import load_submission
from lab3_usd.spec.loader import load_lab

_STAGE = (".usd", ".usda", ".usdc", ".usdz", ".uda")
ARCHIVE_END = re.compile(r"(\.tar)?\.[A-Za-z0-9]+$")
# doejane_LATE_12345_67890_work-1.zip: name, student number, number of the upload, file.
_CANVAS = re.compile(
    r"^(?P<name>[^_]+)_(?:(?P<late>LATE)_)?(?P<id>\d+)_(?P<upload>\d+)_(?P<file>.+)$"
)
# Jane Doe_1234567_assignsubmission_file_work.zip, as a file or as a folder
_MOODLE = re.compile(
    r"^(?P<name>[^_]+)_(?P<id>\d+)_assignsubmission_(?:file|onlinetext)(?:_(?P<file>.*))?$"
)
# jane_Lab3_05_odometry_tf.usda: a student's name before a checkpoint's
_NAMED_STAGE = re.compile(r"^(?P<name>.+?)[ _-]+(?P<file>lab[ _-]*3[ _-].*)$", re.IGNORECASE)
_AGAIN = re.compile(r"-\d+(?=\.[A-Za-z0-9.]+$)")  # Canvas numbers what is uploaded again
Entry = tuple[str, bool]
Known = Mapping[str, tuple[str, str]]


class Part(Struct, frozen=True):
    """A file or folder of a class, and whose it is.

    `entry` is its name where it belongs to nobody else, whatever student it says it is of;
    parts without belong together when their students are the same. Of several uploads the one
    with the highest number is the last.
    """

    student: str
    name: str
    source: Source
    late: bool = False
    upload: int = 0
    entry: str = ""


def entries_in(folder: Path) -> list[Entry]:
    """Return the names in a folder, and which of them are folders, in order.

    Raises:
        OSError: the folder cannot be read.
    """
    return sorted((name, os.path.isdir(folder / name)) for name in os.listdir(folder))  # noqa: PTH112, PTH208 - pathlib raises where a link leads to what nobody may read


def is_leftover(name: str) -> bool:
    """Whether operating systems and editors leave a file or folder of this name behind."""
    return name in LEFTOVERS or name.startswith("._") or name in {".DS_Store", ".git"}


def is_part(entry: Entry) -> bool:
    """Whether an entry of a class is somebody's submission, or a part of it."""
    name, is_folder = entry
    if name.startswith(".") or is_leftover(name):
        return False
    if is_folder or is_archive(name) or name.lower().endswith((*OTHER_ENDINGS, *_STAGE)):
        return True
    # Files of any other kind are when a platform put a student's name before theirs.
    return bool(_CANVAS.match(name) or _MOODLE.match(name))


def looks_like_submission(entries: Iterable[Entry]) -> bool:
    """Whether a folder with these entries is itself a submission (see `check.folder`)."""
    lab, stages = load_lab(), load_submission().folders.stages.lower()
    known = list(entries)
    numbered = [name for name, _ in known if checkpoint_of(name, lab)]
    return len(numbered) > 1 or any(each and name.lower() == stages for name, each in known)


def part_of(entry: Entry, known: Known) -> Part:
    """Return whose an entry is; `known` are the numbers and names of students by their folders."""
    name, is_folder = entry
    return _of_folder(Path(name), known) if is_folder else _of_file(Path(name))


def _of_folder(path: Path, known: Known) -> Part:
    if path.name in known:
        student, name = known[path.name]
        return Part(student, name, Source(path), entry=path.name)
    moodle = _MOODLE.match(path.name)
    if moodle is not None:
        return Part(moodle["id"], moodle["name"], Source(path))
    return Part(path.name, path.name, Source(path))


def _of_file(path: Path) -> Part:
    canvas = _CANVAS.match(path.name)
    if canvas is not None:
        source = Source(path, _AGAIN.sub("", canvas["file"]))
        late, upload = canvas["late"] is not None, int(canvas["upload"][:18])
        return Part(canvas["id"], canvas["name"], source, late, upload)
    moodle = _MOODLE.match(path.name)
    if moodle is not None:
        return Part(moodle["id"], moodle["name"], Source(path, moodle["file"] or path.name))
    named = _NAMED_STAGE.match(path.name)
    if named is not None and path.name.lower().endswith(_STAGE):
        return Part(named["name"], named["name"], Source(path, named["file"]))
    student = ARCHIVE_END.sub("", path.name) or path.name
    return Part(student, student, Source(path, path.name))
