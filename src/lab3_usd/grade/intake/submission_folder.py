"""Chooses the folder that is the submission, by what the folders of an upload hold.

The one with the most checkpoints that can be read counts, then the newest, then the one that lies
least deep. The others are named.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from msgspec import Struct

from lab3_usd.deliverables.submission_files import find_checkpoint_stages, folder_named
from lab3_usd.grade.intake.guard import can_be_read
from lab3_usd.grade.intake.submission_copy import FILE_PASSED_OVER, RefusedFile, SubmissionCopy
from lab3_usd.model.folder import FolderFile
from lab3_usd.pipeline.folder import is_submission
from lab3_usd.report.entries import plural
from lab3_usd.spec.load.loader import load_lab

_DEEPEST = 6
_MOST_NAMED = 8
AMBIGUOUS = "ambiguous, ask the student"
FOLDER_LEFT_ASIDE, UPLOAD_LEFT_ASIDE = "Z03", "Z04"  # the rules of remarks


class FolderRemark(Struct, frozen=True):
    """What a grader has to know of how a submission was taken: at which path, by which rule."""

    path: str
    text: str
    rule: str


class StageFolder(Struct, frozen=True):
    """A folder that may be the submission: its checkpoints that can be read, and its stages.

    `newest` is when the last of these was changed, `contents` are their digests by checkpoint, and
    `unread` is how many more stages there are, which cannot be read.
    """

    path: str
    checkpoints: tuple[str, ...]
    newest: float
    contents: frozenset[tuple[str, str]]
    unread: int = 0


class Choice(Struct, frozen=True):
    """The folder that is the submission, the remarks about others, and the files beside it."""

    path: str
    remarks: tuple[FolderRemark, ...] = ()
    beside: tuple[RefusedFile, ...] = ()


def choose_folder(copy: SubmissionCopy) -> Choice:
    """Choose among the folders of a copy; '' is the copy as a whole."""
    places = list(_places(copy)) or [""]
    if places == [""]:
        return Choice("")
    folders = sorted(
        (stage_folder(copy, place) for place in places),
        key=lambda folder: (
            -len(folder.checkpoints),
            -folder.newest,
            folder.path.count("/") + bool(folder.path),
            folder.path,
        ),
    )
    first = _with_its_files(copy, folders)
    rest = [folder for folder in folders if folder != first]
    aside = [folder for folder in rest if not _is_inside(folder.path, first.path)]
    aside += _stray_stages(copy, places)
    aside = [folder for folder in aside if folder.contents or folder.unread]
    covered = [first.path, *(folder.path for folder in aside)]
    return Choice(
        first.path, tuple(_remarks(first, aside)), tuple(_beside(copy, first.path, covered))
    )


def _with_its_files(copy: SubmissionCopy, folders: Sequence[StageFolder]) -> StageFolder:
    """Return the first folder, or where it is a mere folder of stages, the submission around it."""
    first = folders[0]
    if folder_named(copy.target / first.path, load_lab().submission.folders.stages):
        return first
    around = (
        folder for folder in folders if not folder.contents and _is_inside(first.path, folder.path)
    )
    return max(around, key=lambda folder: len(folder.path), default=first)


def _beside(copy: SubmissionCopy, chosen: str, covered: Sequence[str]) -> Iterator[RefusedFile]:
    """Yield what lies beside the folder that is the submission, and is no other one's."""
    left = sorted(
        name for name in copy.names if not any(_is_inside(name, path) for path in covered)
    )
    for name in left[:_MOST_NAMED]:
        yield RefusedFile(name, f"it is outside the judged folder {chosen}", FILE_PASSED_OVER)
    if len(left) > _MOST_NAMED:
        more = f"{len(left) - _MOST_NAMED} more files are outside the judged folder {chosen}"
        yield RefusedFile(left[_MOST_NAMED], more, FILE_PASSED_OVER)


def _is_inside(path: str, folder: str) -> bool:
    return not folder or path == folder or path.startswith(f"{folder}/")


def _places(copy: SubmissionCopy) -> Iterator[str]:
    """Yield the folders that look like a submission, and those of archives; '' is the top."""
    stages = load_lab().submission.folders.stages
    waiting = [""]
    while waiting:
        place = waiting.pop(0)
        folder = copy.target / place
        looks_so = is_submission(folder)
        if looks_so or place in copy.unpacked:
            yield place
        if place.count("/") + bool(place) >= _DEEPEST:
            continue
        home = folder_named(folder, stages) if looks_so else ""
        inside = sorted(entry.name for entry in os.scandir(folder) if entry.is_dir())
        waiting += [f"{place}/{name}".lstrip("/") for name in inside if name != home]


def stage_folder(copy: SubmissionCopy, place: str) -> StageFolder:
    """Return what a folder holds as a submission: the stages in it and in its folder of stages."""
    lab = load_lab()
    folder = copy.target / place
    home = folder_named(folder, lab.submission.folders.stages)
    entries = [
        FolderFile(f"{below}{entry.name}")
        for below in ("", *([f"{home}/"] if home else []))
        for entry in os.scandir(folder / below)
        if entry.is_file()
    ]
    stages = find_checkpoint_stages(
        sorted(entries, key=lambda entry: entry.path), home, lab, lab.submission.stages
    )
    files = {number: folder / stage.path for number, stage in stages.items()}
    whole = {number: file for number, file in files.items() if can_be_read(file, copy.limits)}
    return StageFolder(
        place,
        tuple(whole),
        max((file.stat().st_mtime for file in whole.values()), default=0.0),
        frozenset((number, copy.digests[str(file)]) for number, file in whole.items()),
        len(files) - len(whole),
    )


def _stray_stages(copy: SubmissionCopy, places: Sequence[str]) -> list[StageFolder]:
    """Return the folders that hold stages and lie in none of these places."""
    lab = load_lab()
    names = sorted(copy.names)
    outside = [name for name in names if not any(_is_inside(name, place) for place in places)]
    entries = [FolderFile(name) for name in outside]
    stages = find_checkpoint_stages(entries, "", lab, lab.submission.stages)
    parents = {stage.path.rpartition("/")[0] for stage in stages.values()}
    return [stage_folder(copy, parent) for parent in sorted(parents)]


def _remarks(chosen: StageFolder, aside: Sequence[StageFolder]) -> Iterator[FolderRemark]:
    """Yield the remarks about the folders that are left out."""
    if not aside:
        return
    judged = f"{_shown(chosen.path)} is judged ({counted(chosen.checkpoints)})"
    equal = [
        folder
        for folder in aside
        if len(folder.checkpoints) == len(chosen.checkpoints) and folder.contents != chosen.contents
    ]
    listed = [
        f"{_shown(folder.path)} ({_holding(folder, chosen)})" for folder in aside[:_MOST_NAMED]
    ]
    more = f" and {len(aside) - _MOST_NAMED} more" if len(aside) > _MOST_NAMED else ""
    doubt = f"{AMBIGUOUS}: as many in {_shown(equal[0].path)}; " if equal else ""
    text = f"{doubt}{judged}; left out: {', '.join(listed)}{more}"
    yield FolderRemark(chosen.path or ".", text, FOLDER_LEFT_ASIDE)


def _shown(path: str) -> str:
    return path or "the top folder"


def _holding(folder: StageFolder, chosen: StageFolder) -> str:
    if not folder.contents:
        return f"{plural(folder.unread, 'stage')}, none of which can be read"
    if folder.contents <= chosen.contents:
        return f"{counted(folder.checkpoints)}, the same files"
    lacking = [number for number in folder.checkpoints if number not in chosen.checkpoints]
    lacks = f"; only there: {', '.join(lacking)}" if lacking else ""
    return f"{counted(folder.checkpoints)}{lacks}"


def counted(checkpoints: Sequence[str]) -> str:
    """Say how many checkpoints can be read, and which."""
    if not checkpoints:
        return "no checkpoint that can be read"
    return f"{plural(len(checkpoints), 'checkpoint')}: {', '.join(checkpoints)}"
