"""The names of stage files: which checkpoint a name says, exactly or nearly."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache

_WORD = re.compile(r"[A-Za-z]+|\d+")
_GAP = r"[\s_-]*"


def _leads(files: Mapping[str, str]) -> dict[str, str]:
    """Map each checkpoint to what its file has before the id.

    The id may stand in what all names begin with as well: `Week5_5_imu`. A file that does not hold
    the id of its checkpoint has no such part.
    """
    names = list(files.items())
    first = names[0][1] if names else ""
    for end in range(len(first)):
        if all(file[:end] == first[:end] and file[end:].startswith(id_) for id_, file in names):
            return dict.fromkeys(files, first[:end])
    return {id_: file.partition(id_)[0] if id_ in file else "" for id_, file in names}


def _prefixes(files: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield each checkpoint and what names of its files begin with: `Lab3_03` of `Lab3_03_lidar`.

    A name that does not hold the id of its checkpoint is a prefix as a whole.
    """
    leads = _leads(files)
    for checkpoint, file in files.items():
        prefix = f"{leads[checkpoint]}{checkpoint}"
        yield checkpoint, prefix if file.startswith(prefix) else file


def named_checkpoint(name: str, files: Mapping[str, str]) -> str | None:
    """Return the checkpoint that a file name begins with, None for none.

    `files` holds the names of the lab, without ending, by checkpoint. `Lab3_031` is not of 03.
    """
    for checkpoint, prefix in _prefixes(files):
        rest = name[len(prefix) :]
        goes_on = rest[:1].isdigit() if prefix[-1:].isdigit() else rest[:1].isalnum()
        if name.startswith(prefix) and not goes_on:
            return checkpoint
    return None


def nearly_named(stem: str, files: Mapping[str, str]) -> str | None:
    """Return the checkpoint whose prefix a name has but for case, gaps and leading zeros."""
    for checkpoint, prefix in _prefixes(files):
        if _loose(prefix).match(stem):
            return checkpoint
    return None


@lru_cache(maxsize=64)
def _loose(prefix: str) -> re.Pattern[str]:
    words = [_loose_word(word) for word in _WORD.findall(prefix)]
    return re.compile(rf"{_GAP.join(words)}(?![0-9])" if words else r"(?!)", re.IGNORECASE)


def _loose_word(word: str) -> str:
    return rf"0*{int(word)}" if word.isdigit() else word


def after_a_student(files: Mapping[str, str]) -> re.Pattern[str]:
    """Return the pattern of stage files with a student's name before them.

    `jane_Lab3_05_odometry_tf.usda`: the group `name` is the student's, `file` the stage's. `files`
    holds the names of the lab, without ending, by checkpoint.
    """
    leads = {lead or files[checkpoint] for checkpoint, lead in _leads(files).items()}
    loose = (_GAP.join(map(_loose_word, _WORD.findall(lead))) for lead in sorted(leads))
    starts = "|".join(start for start in loose if start)
    return re.compile(rf"^(?P<name>.+?)[ _-]+(?P<file>(?:{starts})[ _-].*)$", re.IGNORECASE)
