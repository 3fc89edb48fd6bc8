"""Tells which file of a submission is meant for which checkpoint, however it is named."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from pathlib import PurePosixPath

from msgspec.structs import replace

from lab3_usd.model.folder.submission import Entry, StageFile
from lab3_usd.spec.file_names import nearly_named
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import StageFiles

_MOST_GUESSED = 100
_ALIKE = 0.82  # of 1; `Lab3_lidar` and `Lab3_03_lidar` are alike to 0.87


def find_stages(
    usable: Sequence[Entry], home: str, lab: Lab, files: StageFiles
) -> dict[str, StageFile]:
    """Return the file of each checkpoint: the one named right, else the one most likely meant.

    A file in `home` goes before one elsewhere, and no file stands for two checkpoints.
    """
    stages = [entry for entry in usable if _ending(entry, files)]
    ordered = sorted(stages, key=lambda entry: (entry.folder != home, entry.path))
    found = {
        number: stage
        for number, checkpoint in lab.checkpoints.items()
        if (stage := _right(ordered, number, checkpoint.file, home, files)) is not None
    }
    taken = {path for stage in found.values() for path in (stage.path, *stage.others)}
    left = [entry for entry in ordered if entry.path not in taken]
    names = {number: each.file for number, each in lab.checkpoints.items() if number not in found}
    for entry, number in _guesses(left[:_MOST_GUESSED], names):
        if number not in found and entry.path not in taken:
            taken.add(entry.path)
            slip = _ending(entry, files) in files.slips
            found[number] = StageFile(number, entry.path, "slip" if slip else "misnamed")
    rest = [entry for entry in left if entry.path not in taken]
    order = list(lab.checkpoints)
    seconds = _seconds(rest[:_MOST_GUESSED], {n: each.file for n, each in lab.checkpoints.items()})
    return {
        number: replace(stage, more=seconds.get(number, ()))
        for number, stage in sorted(found.items(), key=lambda pair: order.index(pair[0]))
    }


def _seconds(rest: Sequence[Entry], names: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Return the files that seem to be of a checkpoint whose stage is another file."""
    likeliest: dict[str, str] = {}
    for entry, number in _guesses(rest, names):
        likeliest.setdefault(entry.path, number)
    return {
        number: tuple(sorted(path for path, said in likeliest.items() if said == number))
        for number in names
    }


def _ending(entry: Entry, files: StageFiles) -> str:
    """Return the ending of a stage, '' for other files; `.usda.txt` is one of a stage as well."""
    known = (*files.endings, *files.openable, *files.slips)
    endings = [each.lower() for each in PurePosixPath(entry.name).suffixes]
    return next((each for each in reversed(endings) if each in known), "")


def _stem(entry: Entry) -> str:
    return PurePosixPath(entry.name).name.partition(".")[0]


def _right(
    ordered: Sequence[Entry], number: str, name: str, home: str, files: StageFiles
) -> StageFile | None:
    """Return the file with exactly the handout's name; of two endings the handout's own."""
    forms = {f"{name}{ending}": rank for rank, ending in enumerate(files.endings)}
    named = [entry for entry in ordered if entry.name in forms]
    if not named:
        return None
    first, *more = [entry for entry in named if entry.folder == named[0].folder]
    if more and forms[more[0].name] < forms[first.name]:
        first, more = more[0], [first]
    others = tuple(entry.path for entry in more)
    return StageFile(number, first.path, "right" if first.folder == home else "misplaced", others)


def _guesses(left: Sequence[Entry], names: Mapping[str, str]) -> Iterator[tuple[Entry, str]]:
    """Yield files and the checkpoint that each may be meant for, the likeliest first."""
    guesses = []
    for rank, entry in enumerate(left):
        stem = _stem(entry)
        said = nearly_named(stem, names)
        for number, name in names.items():
            alike = SequenceMatcher(None, stem.lower(), name.lower(), autojunk=False).ratio()
            is_said = said == number
            if is_said or alike >= _ALIKE:
                guesses.append((-(alike + is_said), rank, entry, number))
    for _, _, entry, number in sorted(guesses, key=lambda guess: guess[:2]):
        yield entry, number
