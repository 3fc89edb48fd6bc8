"""Submissions in object storage: lists them through fsspec, and fetches one at a time."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake import TooLargeError
from lab3_usd.grade.judge import Task
from lab3_usd.grade.limits import Limits
from lab3_usd.grade.staging import Source

_SLASHES = "://"


def is_address(place: str) -> bool:
    """Whether a place is an address for fsspec (`s3://course/lab3`) and not a path."""
    return _SLASHES in place


def entries_at(address: str) -> list[tuple[str, bool]]:
    """Return the names at an address, and which of them are folders, in order.

    Raises:
        UsageError: fsspec is not installed, knows no such address, or cannot list it.
    """
    storage, root = _storage(address)
    try:
        found = storage.ls(root, detail=True)
    except Exception as error:
        message = f"{address}: cannot be listed ({type(error).__name__}: {error})"
        raise UsageError(message) from error
    names = [(_name(each["name"]), each["type"] == "directory") for each in found]
    return sorted((name, is_folder) for name, is_folder in names if name)


def _name(path: str) -> str:
    return path.rstrip("/").rpartition("/")[2]


def _storage(address: str) -> tuple[Any, str]:
    try:
        core = importlib.import_module("fsspec.core")
    except ImportError as error:
        message = f"{address}: addresses need fsspec; install lab3-usd[cluster]"
        raise UsageError(message) from error
    try:
        storage, root = core.url_to_fs(address)
    except Exception as error:
        message = f"{address}: fsspec does not know it ({error})"
        raise UsageError(message) from error
    return storage, str(root)


@contextmanager
def fetched(task: Task, folder: Path, limits: Limits) -> Iterator[Task]:
    """Yield the task with everything that lies elsewhere fetched into `folder`.

    Raises:
        TooLargeError: more would be fetched than a submission may hold.
    """
    if not any(source.address for source in task.sources):
        yield task
        return
    sources = [_fetch(source, folder / str(n), limits) for n, source in enumerate(task.sources)]
    yield replace(task, sources=tuple(sources))


def _fetch(source: Source, target: Path, limits: Limits) -> Source:
    storage, root = _storage(source.address)
    name = _name(root)
    files = storage.find(root, detail=True)
    if len(files) > limits.files or sum(each["size"] or 0 for each in files.values()) > (
        limits.total_size
    ):
        message = f"holds more than {limits.files} files or {limits.total_size >> 20} MB"
        raise TooLargeError(message)
    for path in sorted(files):
        inside = path[len(root) :].strip("/")
        place = target / name / inside if inside else target / name
        if not place.resolve().is_relative_to(target.resolve()):
            continue  # a key with dots in it, which is no file name
        place.parent.mkdir(parents=True, exist_ok=True)
        storage.get_file(path, str(place))
    return Source(target / name, source.name)
