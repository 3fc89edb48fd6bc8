"""Copies a submission out of a storage of fsspec: plain files only, and never too much."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.errors import Lab3Error
from lab3_usd.grade.intake.archives import is_archive, is_no_room
from lab3_usd.grade.intake.file_filter import (
    RefusedFile,
    is_hidden,
    is_read,
    name_fault,
    path_parts,
)
from lab3_usd.grade.intake.limits import Limits

_CHUNK = 1 << 20
_LARGER_THAN_PICTURES = 8 << 20
Fetched = tuple[RefusedFile, ...]


class FetchError(Lab3Error):
    """A submission cannot be fetched; the line says why."""


class FetchLimits(Struct, frozen=True):
    """How much is fetched; `stopped` ends it, and `whole` files are fetched as they are."""

    limits: Limits
    stopped: threading.Event
    whole: bool = False


def reason_of(error: Exception) -> str:
    """Say in a few words why a storage failed, without its addresses."""
    return str(getattr(error, "strerror", None) or type(error).__name__)


def fetch(storage: Any, root: str, target: Path, bounds: FetchLimits) -> Fetched:  # noqa: ANN401 - fsspec's
    """Copy the file or folder at `root` to `target`, and return what is no plain file there.

    Files that are not read are not fetched: an empty file of the same size replaces them.

    Raises:
        TooLargeError: there are too many files, or there is too much in them.
        FetchError: something cannot be read.
    """
    try:
        found = storage.find(root, detail=True)
    except Exception as error:
        message = f"cannot be listed ({reason_of(error)})"
        raise FetchError(message) from error
    plain, left_out = _sorted_out(found, root, bounds.limits)
    if list(plain) != [""]:
        target.mkdir(parents=True, exist_ok=True)
    room = bounds.limits.total_size
    for inside, (path, size) in plain.items():
        place = target / inside if inside else target
        try:
            _make_room_for(place)
        except OSError:
            reason = "a file and a folder have the same name, or the name is too long"
            left_out.append(RefusedFile(inside, reason))
            continue
        if size is not None and not bounds.whole and _is_unread(path, inside, size, bounds.limits):
            os.truncate(place, min(size, max(bounds.limits.file_size + 1, _LARGER_THAN_PICTURES)))
        else:
            room -= _copy(storage, path, place, room, bounds)
    return tuple(left_out)


def _sorted_out(
    found: dict[str, Any], root: str, limits: Limits
) -> tuple[dict[str, tuple[str, int | None]], list[RefusedFile]]:
    """Return plain files and their sizes by their names below `root`, and what is left out."""
    plain: dict[str, tuple[str, int | None]] = {}
    left_out = []
    total = 0
    for path in sorted(found):
        inside = path[len(root) :].strip("/")
        if (
            path.endswith("/")
            or found[path]["type"] == "directory"
            or is_hidden(path_parts(inside))
        ):
            continue
        fault = name_fault(inside, limits) if inside else ""
        if found[path]["type"] != "file" or found[path].get("islink"):
            fault = "it is a link, pipe or device; not fetched"
        if fault:
            left_out.append(RefusedFile(inside or path.rpartition("/")[2], fault))
            continue
        size = found[path].get("size")
        plain[inside] = (path, size)
        total += 0 if size is None or _is_unread(path, inside, size, limits) else size
    limits.check_count(len(plain) + len(left_out))
    limits.check_size(total)
    return plain, left_out


def _is_unread(path: str, inside: str, size: int, limits: Limits) -> bool:
    """Whether the contents of a file are never read: a video, or a file that is too large."""
    name = path.rpartition("/")[2]
    if is_archive(name) and "/" not in inside:
        return False
    return not is_read(name, size, limits)


def _make_room_for(place: Path) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    place.open("xb").close()


def _copy(storage: Any, path: str, place: Path, room: int, bounds: FetchLimits) -> int:  # noqa: ANN401
    copied = 0
    try:
        with storage.open(path, "rb") as stream, place.open("wb") as file:
            while data := stream.read(_CHUNK):
                copied += len(data)
                _check(copied, room, bounds)
                file.write(data)
    except Lab3Error:
        raise
    except Exception as error:
        if is_no_room(error):
            raise
        message = f"{path.rpartition('/')[2]}: cannot be fetched ({reason_of(error)})"
        raise FetchError(message) from error
    return copied


def _check(copied: int, room: int, bounds: FetchLimits) -> None:
    bounds.limits.check_size(bounds.limits.total_size - room + copied)
    if bounds.stopped.is_set():
        message = "took too long"
        raise FetchError(message)
