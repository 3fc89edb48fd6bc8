"""Tells by the names of files and folders whose they are, as learning platforms write them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from msgspec import Struct

from lab3_usd.check.checker import checkpoint_of
from lab3_usd.grade.archives import OTHER_ENDINGS, is_archive
from lab3_usd.grade.intake import LEFTOVERS
from lab3_usd.grade.platforms import file_owners, is_platform_name
from lab3_usd.grade.staging import Source
from lab3_usd.spec.loader import load_lab

_STAGE = (".usd", ".usda", ".usdc", ".usdz", ".uda")
ARCHIVE_END = re.compile(r"(\.tar)?\.[A-Za-z0-9]+$")
# jane_Lab3_05_odometry_tf.usda: a student's name before a checkpoint's
_NAMED_STAGE = re.compile(r"^(?P<name>.+?)[ _-]+(?P<file>lab[ _-]*3[ _-].*)$", re.IGNORECASE)
Entry = tuple[str, bool]
Known = Mapping[str, tuple[str, str]]


class Part(Struct, frozen=True):
    """A file or folder of a class, and whose it is.

    `entry` is its name where it belongs to nobody else, whatever student it says it is of;
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


def is_part(entry: Entry) -> bool:
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


def parts_of(entries: Iterable[Entry], known: Known) -> Iterator[Part]:
    """Yield whose each entry is; `known` are the numbers and names of students by their folders."""
    every = list(entries)
    owners = file_owners(name for name, _ in every)
    for name, is_folder in every:
        owner = owners.get(name)
        if is_folder and name in known:
            student, called = known[name]
            yield Part(student, called, Source(Path(name)), entry=name)
        elif owner is not None:
            file = "" if is_folder else owner.file or name
            source = Source(Path(name), file)
            yield Part(
                owner.student, owner.name, source, owner.late, owner.upload, doubt=owner.doubt
            )
        else:
            yield _of_folder(Path(name)) if is_folder else _of_file(Path(name))


def _of_folder(path: Path) -> Part:
    return Part(path.name, path.name, Source(path))


def _of_file(path: Path) -> Part:
    named = _NAMED_STAGE.match(path.name)
    if named is not None and path.name.lower().endswith(_STAGE):
        return Part(named["name"], named["name"], Source(path, named["file"]))
    student = ARCHIVE_END.sub("", path.name) or path.name
    return Part(student, student, Source(path, path.name))
