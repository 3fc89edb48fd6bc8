"""Copies a submission out of a storage of fsspec: plain files only, and never too much."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.errors import Lab3Error
from lab3_usd.grade.archives import is_archive, is_no_room
from lab3_usd.grade.intake import Refused, TooLargeError, only_name_counts
from lab3_usd.grade.limits import Limits

_CHUNK = 1 << 20
_LARGER_THAN_PICTURES = 8 << 20
Fetched = tuple[Refused, ...]


class FetchError(Lab3Error):
    """A submission cannot be fetched; the line says why."""


class Held(Struct, frozen=True):
    """What fetching is held to; `stopped` ends it, and `whole` files are fetched as they are."""

    limits: Limits
    stopped: threading.Event
    whole: bool = False


def reason_of(error: Exception) -> str:
    """Say in a few words why a storage failed, without its addresses."""
    return str(getattr(error, "strerror", None) or type(error).__name__)


def fetch(storage: Any, root: str, target: Path, held: Held) -> Fetched:  # noqa: ANN401 - fsspec's
    """Copy the file or folder at `root` to `target`, and return what is no plain file there.

    Files that nobody would open are not fetched: an empty one of their size stands for them.

    Raises:
        TooLargeError: there are too many files, or there is too much in them.
        FetchError: something cannot be read.
    """
    try:
        found = storage.find(root, detail=True)
    except Exception as error:
        message = f"cannot be listed ({reason_of(error)})"
        raise FetchError(message) from error
    plain, left_out = _sorted_out(found, root, held.limits)
    if list(plain) != [""]:
        target.mkdir(parents=True, exist_ok=True)
    room = held.limits.total_size
    for inside, (path, size) in plain.items():
        place = target / inside if inside else target
        try:
            _make_room_for(place)
        except OSError:
            reason = "a file and a folder have the same name, or the name is too long"
            left_out.append(Refused(inside, reason))
            continue
        if size is not None and not held.whole and _is_unread(path, inside, size, held.limits):
            os.truncate(place, min(size, max(held.limits.file_size + 1, _LARGER_THAN_PICTURES)))
        else:
            room -= _copy(storage, path, place, room, held)
    return tuple(left_out)


def _sorted_out(
    found: dict[str, Any], root: str, limits: Limits
) -> tuple[dict[str, tuple[str, int | None]], list[Refused]]:
    """Return plain files and their sizes by their names below `root`, and what is left out."""
    plain: dict[str, tuple[str, int | None]] = {}
    left_out = []
    total = 0
    for path in sorted(found):
        inside = path[len(root) :].strip("/")
        if path.endswith("/") or found[path]["type"] == "directory":
            continue
        if found[path]["type"] != "file" or found[path].get("islink"):
            name = inside or path.rpartition("/")[2]
            left_out.append(Refused(name, "it is a link, pipe or device; not fetched"))
        elif ".." in inside.split("/"):
            left_out.append(Refused(inside, "its name leads out of the submission; not fetched"))
        else:
            size = found[path].get("size")
            plain[inside] = (path, size)
            total += 0 if size is None or _is_unread(path, inside, size, limits) else size
    if len(plain) + len(left_out) > limits.files or total > limits.total_size:
        message = f"holds more than {limits.files} files or {limits.total_size >> 20} MB"
        raise TooLargeError(message)
    return plain, left_out


def _is_unread(path: str, inside: str, size: int, limits: Limits) -> bool:
    """Whether nobody reads the contents of a file: a video, or one that is too large."""
    name = path.rpartition("/")[2]
    if is_archive(name) and "/" not in inside:
        return False
    return only_name_counts(name, size) or size > limits.file_size


def _make_room_for(place: Path) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    place.open("xb").close()


def _copy(storage: Any, path: str, place: Path, room: int, held: Held) -> int:  # noqa: ANN401
    copied = 0
    try:
        with storage.open(path, "rb") as stream, place.open("wb") as file:
            while data := stream.read(_CHUNK):
                copied += len(data)
                _check(copied, room, held)
                file.write(data)
    except Lab3Error:
        raise
    except Exception as error:
        if is_no_room(error):
            raise
        message = f"{path.rpartition('/')[2]}: cannot be fetched ({reason_of(error)})"
        raise FetchError(message) from error
    return copied


def _check(copied: int, room: int, held: Held) -> None:
    if copied > room:
        message = f"holds more than {held.limits.total_size >> 20} MB"
        raise TooLargeError(message)
    if held.stopped.is_set():
        message = "took too long"
        raise FetchError(message)
