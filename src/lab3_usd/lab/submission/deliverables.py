"""Finds what is handed in beside the stages: report, images, video link, configuration, logs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from lab3_usd.model.folder.submission import Entry
from lab3_usd.spec.submission import Deliverable, FolderNames, SubmissionSpec

_ADDRESS = re.compile(r"https?://[^\s<>\"')\]]+", re.IGNORECASE)
_MOST_BYTES = 1_000_000
_PARAMETERS = re.compile(rb"ros_+parameters?[ \t]*:")  # with a slip too


def find_deliverables(
    root: Path, usable: Sequence[Entry], spec: SubmissionSpec
) -> dict[str, tuple[str, ...]]:
    """Return the paths of the files that count for each deliverable, by its name."""
    return {
        name: tuple(_files(root, usable, wanted, spec))
        for name, wanted in spec.deliverables.items()
    }


def _files(
    root: Path, usable: Sequence[Entry], wanted: Deliverable, spec: SubmissionSpec
) -> Iterator[str]:
    folders = spec.folders
    for entry in usable:
        top = entry.path.partition("/")[0].lower() if entry.folder else ""
        if top in {folders.stages, folders.starter} or _is_stage(entry, spec):
            continue
        if wanted.folder and top not in folders.shown:
            continue
        if _counts(root, entry, wanted):
            yield entry.path


def _is_stage(entry: Entry, spec: SubmissionSpec) -> bool:
    stages = spec.stages
    return entry.name.lower().endswith((*stages.endings, *stages.openable, *stages.slips))


def _counts(root: Path, entry: Entry, wanted: Deliverable) -> bool:
    name = entry.name.lower()
    if any(fnmatchcase(name, pattern) for pattern in wanted.never):
        return False
    if PurePosixPath(name).suffix in wanted.endings:
        return True
    if not any(fnmatchcase(name, pattern) for pattern in wanted.names):
        return False
    return not wanted.links or _has_link(_bytes(root / entry.path), wanted.links)


def _has_link(data: bytes, places: Sequence[str]) -> bool:
    text = data.decode("utf-8", errors="replace")
    return any(place in address.lower() for address in _ADDRESS.findall(text) for place in places)


def _bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_MOST_BYTES)
    except OSError:
        return b""


def find_parameter_files(root: Path, usable: Sequence[Entry], folders: FolderNames) -> list[str]:
    """Return the YAML files that hold parameters of ROS 2 nodes, saved output left aside."""
    found = []
    for entry in usable:
        top = entry.path.partition("/")[0].lower() if entry.folder else ""
        is_yaml = entry.name.lower().endswith((".yaml", ".yml")) and top not in folders.shown
        if is_yaml and _PARAMETERS.search(_bytes(root / entry.path)):
            found.append(entry.path)
    return found
