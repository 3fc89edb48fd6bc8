"""The files of a submission: those of a folder, stages by checkpoint, and deliverables."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from difflib import SequenceMatcher
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from msgspec.structs import replace

from lab3_usd.files import first_bytes, is_original
from lab3_usd.model.folder import FolderFile, Listing, StageFile
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import (
    Deliverable,
    FolderNames,
    StageFiles,
    SubmissionSpec,
    is_called,
    nearly_named,
)

MOST_ENTRIES = 5_000
DEEPEST = 12
_NOT_OURS = "__MACOSX"


def list_submission(
    root: Path, lab: Lab, spec: SubmissionSpec, most: int = MOST_ENTRIES
) -> Listing:
    """List what a folder holds, up to so many files, and which file stands for what.

    Hidden files are left out, and the originals that repairs keep. Links are followed to files
    inside the folder only.
    """
    listed: list[FolderFile] = []
    folders = spec.folders
    first = (folders.stages, folders.starter, folders.maps, *folders.shown)
    for entry in entries_below(root, first):
        if len(listed) == most:
            break
        listed.append(entry)
    entries = tuple(sorted(listed, key=lambda entry: entry.path))
    usable = [entry for entry in entries if not entry.why_not]
    home = folder_named(root, spec.folders.stages)
    return Listing(
        entries=entries,
        stage_folder=home,
        stages=find_checkpoint_stages(usable, home, lab, spec.stages),
        starter=_starter(usable, folder_named(root, spec.folders.starter), spec),
        deliverables=find_deliverables(root, usable, spec),
        complete=len(listed) < most,
    )


def folder_named(root: Path, name: str) -> str:
    """Return the name of the folder in `root` that is called `name`, in small letters or not.

    Empty where there is none; a link to a folder is none.
    """
    names: list[str] = []
    with suppress(OSError), os.scandir(root) as scan:
        names += (entry.name for entry in scan if entry.is_dir(follow_symlinks=False))
    alike = [candidate for candidate in sorted(names) if candidate.lower() == name.lower()]
    return name if name in names else next(iter(alike), "")


def entries_below(root: Path, first: tuple[str, ...] = ()) -> Iterator[FolderFile]:
    """Yield every file of a folder, those of the folders named `first` before others.

    Each says why it may not be opened, where that is so.
    """
    return _entries(root, root.resolve(), (), first)


def _entries(
    root: Path, real_root: Path, below: tuple[str, ...], first: tuple[str, ...] = ()
) -> Iterator[FolderFile]:
    """Yield every file at or below a folder, those of the folders named `first` before others."""
    folder = root.joinpath(*below)
    try:
        with os.scandir(folder) as scan:
            inside = sorted(scan, key=lambda entry: (entry.name.lower() not in first, entry.name))
    except OSError as error:
        yield FolderFile("/".join(below) or ".", f"the folder cannot be read ({error.strerror})")
        return
    for entry in inside:
        if entry.name.startswith(".") or entry.name == _NOT_OURS or is_original(entry.name):
            continue
        names = (*below, entry.name)
        if entry.is_dir(follow_symlinks=False):
            if len(names) > DEEPEST:
                yield FolderFile("/".join(names), "the folders are nested too deep")
            else:
                yield from _entries(root, real_root, names)
            continue
        yield FolderFile("/".join(names), _refusal_text(entry, real_root))


def _refusal_text(entry: os.DirEntry[str], real_root: Path) -> str:
    """Say why a file is not opened; '' for a plain file that can be read."""
    try:
        if entry.is_symlink():
            target = Path(entry.path).resolve(strict=True)
            if not target.is_relative_to(real_root):
                return "is a link that leads out of the submission"
        mode = entry.stat().st_mode
    except (OSError, RuntimeError):
        return "is a link that leads nowhere"
    if stat.S_ISDIR(mode):
        return "is a link to a folder"
    if not stat.S_ISREG(mode):
        return "is not a file but a pipe, socket or device"
    return "" if os.access(entry.path, os.R_OK) else "cannot be read: permission denied"


def _starter(usable: Sequence[FolderFile], folder: str, spec: SubmissionSpec) -> str | None:
    """Return the starter: the one with the handout's name, else the only stage of its folder."""
    if not folder:
        return None
    endings = (*spec.stages.endings, *spec.stages.openable)
    stages = [
        entry
        for entry in usable
        if entry.folder == folder and PurePosixPath(entry.name).suffix.lower() in endings
    ]
    starter = spec.stages.starter
    named = [entry for entry in stages if is_called(PurePosixPath(entry.name).stem, starter)]
    chosen = named or (stages if len(stages) == 1 else [])
    return chosen[0].path if chosen else None


_MOST_GUESSED = 100
_ALIKE = 0.82  # of 1; `Lab3_lidar` and `Lab3_03_lidar` are alike to 0.87


def find_checkpoint_stages(
    usable: Sequence[FolderFile], home: str, lab: Lab, files: StageFiles
) -> dict[str, StageFile]:
    """Return the file of each checkpoint: the one named right, else the one most likely meant.

    A file in `home` goes before one elsewhere, and no file stands for two checkpoints.
    """
    stages = [entry for entry in usable if stage_ending(entry, files)]
    ordered = sorted(stages, key=lambda entry: (entry.folder != home, entry.path))
    chosen = {
        number: stage
        for number, checkpoint in lab.checkpoints.items()
        if (stage := _right(ordered, number, checkpoint.file, home, files)) is not None
    }
    taken = {path for stage in chosen.values() for path in (stage.path, *stage.others)}
    left = [entry for entry in ordered if entry.path not in taken]
    names = {number: checkpoint.file for number, checkpoint in lab.checkpoints.items()}
    open_names = {number: name for number, name in names.items() if number not in chosen}
    for entry, number in _guesses(left[:_MOST_GUESSED], open_names):
        if number not in chosen and entry.path not in taken:
            taken.add(entry.path)
            slip = stage_ending(entry, files) in files.slips
            chosen[number] = StageFile(number, entry.path, "slip" if slip else "misnamed")
    rest = [entry for entry in left if entry.path not in taken]
    # Files that seem to be of a checkpoint whose stage is another file.
    likeliest: dict[str, str] = {}
    for entry, number in _guesses(rest[:_MOST_GUESSED], names):
        likeliest.setdefault(entry.path, number)
    return {
        number: replace(
            chosen[number],
            more=tuple(sorted(path for path, likely in likeliest.items() if likely == number)),
        )
        for number in names
        if number in chosen
    }


def stage_ending(entry: FolderFile, files: StageFiles) -> str:
    """Return the ending of a stage, '' for other files; `.usda.txt` is one of a stage as well."""
    accepted = (*files.endings, *files.openable, *files.slips)
    endings = [suffix.lower() for suffix in PurePosixPath(entry.name).suffixes]
    return next((ending for ending in reversed(endings) if ending in accepted), "")


def _right(
    ordered: Sequence[FolderFile], number: str, name: str, home: str, files: StageFiles
) -> StageFile | None:
    """Return the file with exactly the handout's name; of two endings the handout's own."""
    ranks = [f"{name}{ending}" for ending in files.endings]
    forms = {
        entry.name: rank
        for entry in ordered
        for rank, form in enumerate(ranks)
        if is_called(entry.name, form)
    }
    named = [entry for entry in ordered if entry.name in forms]
    if not named:
        return None
    first, *more = [entry for entry in named if entry.folder == named[0].folder]
    if more and forms[more[0].name] < forms[first.name]:
        first, more = more[0], [first]
    repeats = tuple(entry.path for entry in more)
    return StageFile(number, first.path, "right" if first.folder == home else "misplaced", repeats)


def _guesses(
    left: Sequence[FolderFile], names: Mapping[str, str]
) -> Iterator[tuple[FolderFile, str]]:
    """Yield files and the checkpoint that each may be meant for, the likeliest first."""
    guesses = []
    for rank, entry in enumerate(left):
        stem = PurePosixPath(entry.name).name.partition(".")[0]
        named = nearly_named(stem, names)
        for number, name in names.items():
            alike = SequenceMatcher(None, stem.lower(), name.lower(), autojunk=False).ratio()
            is_named = named == number
            if is_named or alike >= _ALIKE:
                guesses.append((-(alike + is_named), rank, entry, number))
    for _, _, entry, number in sorted(guesses, key=lambda guess: guess[:2]):
        yield entry, number


_ADDRESS = re.compile(r"https?://[^\s<>\"')\]]+", re.IGNORECASE)
_MOST_BYTES = 1_000_000
_PARAMETERS = re.compile(rb"ros_+parameters?[ \t]*:")  # with a slip too


def find_deliverables(
    root: Path, usable: Sequence[FolderFile], spec: SubmissionSpec
) -> dict[str, tuple[str, ...]]:
    """Return the paths of the files that count for each deliverable, by its name."""
    folders, stages = spec.folders, spec.stages
    stage_endings = (*stages.endings, *stages.openable, *stages.slips)
    candidates = [
        entry
        for entry in usable
        if _top(entry) not in {folders.stages, folders.starter}
        and not entry.name.lower().endswith(stage_endings)
    ]
    return {
        name: tuple(
            entry.path
            for entry in candidates
            if (not deliverable.folder or _top(entry) in folders.shown)
            and _counts(root / entry.path, deliverable)
        )
        for name, deliverable in spec.deliverables.items()
    }


def _top(entry: FolderFile) -> str:
    """Return the topmost folder that a file lies in, in small letters; '' for none."""
    return entry.path.partition("/")[0].lower() if entry.folder else ""


def _counts(path: Path, deliverable: Deliverable) -> bool:
    """Whether a file counts for a deliverable, by its name in small letters and its content."""
    name = path.name.lower()
    if any(fnmatchcase(name, pattern) for pattern in deliverable.never):
        return False
    if PurePosixPath(name).suffix in deliverable.endings:
        return True
    if not any(fnmatchcase(name, pattern) for pattern in deliverable.names):
        return False
    if not deliverable.links:
        return True
    text = first_bytes(path, _MOST_BYTES).decode("utf-8", errors="replace")
    addresses = _ADDRESS.findall(text)
    return any(link in address.lower() for address in addresses for link in deliverable.links)


def find_parameter_files(
    root: Path, usable: Sequence[FolderFile], folders: FolderNames
) -> list[str]:
    """Return the YAML files that hold parameters of ROS 2 nodes, saved output left aside."""
    yaml_files = [
        entry.path
        for entry in usable
        if entry.name.lower().endswith((".yaml", ".yml")) and _top(entry) not in folders.shown
    ]
    return [
        path for path in yaml_files if _PARAMETERS.search(first_bytes(root / path, _MOST_BYTES))
    ]
