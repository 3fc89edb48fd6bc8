"""Lists the files of a student's folder; what leads out of it or is no file is never opened."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from lab3_usd.lab.submission.deliverables import find_deliverables
from lab3_usd.lab.submission.stage_names import find_stages
from lab3_usd.model.folder.submission import Entry, Listing
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import SubmissionSpec

MOST_ENTRIES = 5_000
DEEPEST = 12
_NOT_OURS = "__MACOSX"


def list_submission(root: Path, lab: Lab, spec: SubmissionSpec) -> Listing:
    """List what a folder holds and which file stands for what.

    Hidden files are left out. Links are followed to files inside the folder only.
    """
    found: list[Entry] = []
    folders = spec.folders
    first = (folders.stages, folders.starter, folders.maps, *folders.shown)
    for entry in entries_below(root, first):
        if len(found) == MOST_ENTRIES:
            break
        found.append(entry)
    entries = tuple(sorted(found, key=lambda entry: entry.path))
    usable = [entry for entry in entries if not entry.why_not]
    home = folder_named(root, spec.folders.stages)
    return Listing(
        entries=entries,
        stage_folder=home,
        stages=find_stages(usable, home, lab, spec.stages),
        starter=_starter(usable, folder_named(root, spec.folders.starter), spec),
        found=find_deliverables(root, usable, spec),
        complete=len(found) < MOST_ENTRIES,
    )


def folder_named(root: Path, name: str) -> str:
    """Return the name of the folder in `root` that is called `name`, in small letters or not.

    Empty where there is none; a link to a folder is none.
    """
    names = sorted(each.name for each in _folders(root))
    alike = [each for each in names if each.lower() == name.lower()]
    return name if name in names else next(iter(alike), "")


def _folders(root: Path) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(root) as scan:
            yield from (each for each in scan if each.is_dir(follow_symlinks=False))
    except OSError:
        return


def entries_below(root: Path, first: tuple[str, ...] = ()) -> Iterator[Entry]:
    """Yield every file of a folder, those of the folders named `first` before others.

    Each says why it may not be opened, where that is so.
    """
    return _entries(root, root.resolve(), (), first)


def _entries(
    root: Path, real_root: Path, below: tuple[str, ...], first: tuple[str, ...] = ()
) -> Iterator[Entry]:
    """Yield every file at or below a folder, those of the folders named `first` before others."""
    folder = root.joinpath(*below)
    try:
        with os.scandir(folder) as scan:
            inside = sorted(scan, key=lambda each: (each.name.lower() not in first, each.name))
    except OSError as error:
        yield Entry("/".join(below) or ".", f"the folder cannot be read ({error.strerror})")
        return
    for each in inside:
        if each.name.startswith(".") or each.name == _NOT_OURS:
            continue
        names = (*below, each.name)
        if each.is_dir(follow_symlinks=False):
            if len(names) > DEEPEST:
                yield Entry("/".join(names), "the folders are nested too deep")
            else:
                yield from _entries(root, real_root, names)
            continue
        yield Entry("/".join(names), _why_not(Path(each.path), real_root))


def _why_not(path: Path, real_root: Path) -> str:
    """Say why a file is not opened; '' for a plain file that can be read."""
    try:
        if path.is_symlink():
            target = path.resolve(strict=True)
            if not target.is_relative_to(real_root):
                return "is a link that leads out of the submission"
        mode = path.stat().st_mode
    except (OSError, RuntimeError):
        return "is a link that leads nowhere"
    if stat.S_ISDIR(mode):
        return "is a link to a folder"
    if not stat.S_ISREG(mode):
        return "is no file but a pipe, socket or device"
    return "" if os.access(path, os.R_OK) else "cannot be read: permission denied"


def _starter(usable: Sequence[Entry], folder: str, spec: SubmissionSpec) -> str | None:
    """Return the starter: the one with the handout's name, else the only stage of its folder."""
    if not folder:
        return None
    endings = (*spec.stages.endings, *spec.stages.openable)
    stages = [
        entry
        for entry in usable
        if entry.folder == folder and PurePosixPath(entry.name).suffix.lower() in endings
    ]
    named = [entry for entry in stages if PurePosixPath(entry.name).stem == spec.stages.starter]
    chosen = named or (stages if len(stages) == 1 else [])
    return chosen[0].path if chosen else None
