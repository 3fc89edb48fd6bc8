"""Reports which files in some folders are saved, whether in place or by renaming."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

# Milliseconds without another event before a save counts as over, and at most.
STEP, DEBOUNCE = 5, 100

Stamp = tuple[int, int, int]


def saves(folders: Iterable[str]) -> Iterator[frozenset[str]]:
    """Yield the files that were written, moved or removed in these folders, save by save.

    Folders are watched rather than files: whoever saves by renaming makes another file.
    """
    from watchfiles import watch as file_events  # noqa: PLC0415 - an extra

    events = file_events(*folders, watch_filter=None, step=STEP, debounce=DEBOUNCE, recursive=False)
    for changes in events:
        yield frozenset(os.path.realpath(path) for _, path in changes)


def folders_of(files: Iterable[str]) -> set[str]:
    """Return the folders of files, and of folders all that are in them."""
    found: set[str] = set()
    for path in map(os.path.realpath, files):
        inside = (folder for folder, _, _ in os.walk(path))
        found.update(inside if Path(path).is_dir() else [str(Path(path).parent)])
    return {folder for folder in found if Path(folder).is_dir()}


def stamp(path: Path) -> Stamp | None:
    """Return what changes when a file is written; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def holds(top: str, changed: Iterable[str]) -> bool:
    """Whether a file that was saved is this one, or lies in this folder."""
    whole = os.path.realpath(top)
    return any(path == whole or path.startswith(f"{whole}{os.sep}") for path in changed)
