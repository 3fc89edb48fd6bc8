"""Submissions in object storage: lists them through fsspec, and copies one at a time."""

from __future__ import annotations

import importlib
import os
import queue
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import Lab3Error, UsageError, is_no_room
from lab3_usd.grade.awake import AwakeClock
from lab3_usd.grade.intake.archives import is_archive
from lab3_usd.grade.intake.platforms import LARGEST
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import (
    Limits,
    RefusedFile,
    TooLargeError,
    is_hidden,
    is_read,
    name_fault,
    path_parts,
)
from lab3_usd.installation import install_command

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


def fetch(storage: Any, root: str, target: Path, bounds: FetchLimits) -> Fetched:
    """Copy the file or folder at `root` to `target`, and return what is no plain file there.

    Files that are not read are not fetched: an empty file of the same size replaces them.

    Raises:
        TooLargeError: there are too many files, or there is too much in them.
        FetchError: something cannot be read.
    """
    try:
        listing = storage.find(root, detail=True)
    except Exception as error:
        raise FetchError(f"cannot be listed ({reason_of(error)})") from error
    plain, left_out = _sorted_out(listing, root, bounds.limits)
    if list(plain) != [""]:
        target.mkdir(parents=True, exist_ok=True)
    room = bounds.limits.total_size
    for inside, (path, size) in plain.items():
        place = target / inside if inside else target
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            place.open("xb").close()
        except OSError:
            reason = "a file and a folder have the same name, or the name is too long"
            left_out.append(RefusedFile(inside, reason))
            continue
        if size is not None and not bounds.whole and _is_unread(path, inside, size, bounds.limits):
            os.truncate(place, min(size, max(bounds.limits.file_size + 1, _LARGER_THAN_PICTURES)))
        else:
            room -= _copy(storage, path, place, room, bounds)
        os.utime(place, (0.0, 0.0))  # not the time of the download
    return tuple(left_out)


def _sorted_out(
    listing: dict[str, Any], root: str, limits: Limits
) -> tuple[dict[str, tuple[str, int | None]], list[RefusedFile]]:
    """Return plain files and their sizes by their names below `root`, and what is left out."""
    plain: dict[str, tuple[str, int | None]] = {}
    left_out = []
    total = 0
    for path in sorted(listing):
        details = listing[path]
        inside = path[len(root) :].strip("/")
        is_folder = path.endswith("/") or details["type"] == "directory"
        if is_folder or is_hidden(path_parts(inside)):
            continue
        fault = name_fault(inside, limits) if inside else ""
        if details["type"] != "file" or details.get("islink"):
            fault = "it is a link, pipe or device; not fetched"
        if fault:
            left_out.append(RefusedFile(inside or path.rpartition("/")[2], fault))
            continue
        size = details.get("size")
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


def _copy(storage: Any, path: str, place: Path, room: int, bounds: FetchLimits) -> int:
    copied = 0
    try:
        with storage.open(path, "rb") as stream, place.open("wb") as file:
            while data := stream.read(_CHUNK):
                copied += len(data)
                _check_progress(copied, room, bounds)
                file.write(data)
    except Lab3Error:
        raise
    except Exception as error:
        if is_no_room(error):
            raise
        raise FetchError(
            f"{path.rpartition('/')[2]}: cannot be fetched ({reason_of(error)})"
        ) from error
    return copied


def _check_progress(copied: int, room: int, bounds: FetchLimits) -> None:
    bounds.limits.check_size(bounds.limits.total_size - room + copied)
    if bounds.stopped.is_set():
        raise FetchError("took too long")


_SLASHES = "://"
_HOUR = 3600.0
_POLL_SECONDS = 0.2


class StorageLocation(Struct, frozen=True):
    """A storage of fsspec, and a path in it."""

    storage: Any
    root: str


def is_address(place: str) -> bool:
    """Whether a place is an address for fsspec (`s3://course/lab3`) and not a path."""
    return _SLASHES in place


def local_path(place: Path | str) -> Path | str:
    """Return the path of an address that is on this computer (`file://`), others as they are.

    Raises:
        UsageError: fsspec is not installed, or knows no such address.
    """
    if isinstance(place, Path):
        return place
    location = _storage(place)
    local: type = importlib.import_module("fsspec.implementations.local").LocalFileSystem
    return Path(location.root) if isinstance(location.storage, local) else place


def entries_at(address: str) -> list[tuple[str, bool]]:
    """Return the names at an address, and which of them are folders, in order.

    Raises:
        UsageError: fsspec is not installed, knows no such address, or cannot list it.
    """
    location = _storage(address)
    try:
        listing = location.storage.ls(location.root, detail=True)
    except Exception as error:
        raise UsageError(
            f"{address}: cannot be listed ({type(error).__name__}: {error})"
        ) from error
    names = [(_name(entry["name"]), entry["type"] == "directory") for entry in listing]
    return sorted((name, is_folder) for name, is_folder in names if name)


def read_at(address: str, name: str) -> bytes | str:
    """Return a file's bytes, or a few words about why it cannot be read."""
    location = _storage(address)
    path = f"{location.root.rstrip('/')}/{name}"
    try:
        with location.storage.open(path, "rb") as stream:
            data: bytes = stream.read(LARGEST + 1)
    except Exception as error:  # noqa: BLE001 - a storage may raise anything
        return f"it cannot be read: {reason_of(error)}"
    return data if len(data) <= LARGEST else f"it is larger than {LARGEST // 1_000_000} MB"


def archive_at(address: str, scratch: Path, limits: Limits) -> Path | None:
    """Fetch the archive of a class that lies location an address; None where a folder lies there.

    Raises:
        UsageError: it cannot be fetched, or what lies there is neither.
    """
    location = _storage(address)
    name = _name(location.root)
    try:
        is_file = bool(location.storage.isfile(location.root))
    except Exception as error:
        raise UsageError(f"{address}: cannot be read ({reason_of(error)})") from error
    if not is_file:
        return None
    if not is_archive(name):
        raise UsageError(f"{address}: is neither a folder nor an archive of submissions")
    bounds = FetchLimits(limits, threading.Event(), whole=True)
    try:
        within(
            _HOUR, lambda: fetch(location.storage, location.root, scratch / name, bounds), bounds
        )
    except (FetchError, TooLargeError) as error:
        raise UsageError(f"{address}: {error}") from error
    return scratch / name


def _name(path: str) -> str:
    return path.rstrip("/").rpartition("/")[2]


def _storage(address: str) -> StorageLocation:
    try:
        core = importlib.import_module("fsspec.core")
    except ImportError as error:
        raise UsageError(
            f"{address}: addresses need the extra cluster: {install_command('cluster')}"
        ) from error
    try:
        storage, root = core.url_to_fs(address)
    except Exception as error:
        raise UsageError(f"{address}: fsspec does not know it ({error})") from error
    return StorageLocation(storage, str(root))


def fetched(
    sources: Iterable[Source],
    folder: Path,
    limits: Limits,
    stopped: Callable[[], bool] = lambda: False,
) -> tuple[Source, ...]:
    """Return sources on this computer: sources with an address are fetched into `folder`.

    What cannot be fetched becomes the fault of its source, for the one submission alone; so does
    everything once `stopped` is true.

    Raises:
        TooLargeError: more would be fetched than a submission may hold.
    """
    return tuple(
        _fetched(source, folder / str(n), limits, stopped) if source.address else source
        for n, source in enumerate(sources)
    )


def _fetched(source: Source, target: Path, limits: Limits, stopped: Callable[[], bool]) -> Source:
    target.mkdir(parents=True, exist_ok=True)
    bounds = FetchLimits(limits, threading.Event())

    def get() -> tuple[Path, Fetched]:
        at = _storage(source.address)
        path = target / _name(at.root)
        return path, fetch(at.storage, at.root, path, bounds)

    try:
        path, left_out = within(limits.all_seconds, get, bounds, stopped)
    except (FetchError, UsageError) as error:
        return replace(source, path=target, address="", fault=str(error))
    return replace(source, path=path, address="", left_out=left_out)


def within(
    seconds: float,
    get: Callable[[], Any],
    bounds: FetchLimits,
    stopped: Callable[[], bool] = lambda: False,
) -> Any:
    """Return what `get` returns or raise what it raises; a storage that hangs is not waited for.

    Raises:
        FetchError: it took too long, or `stopped` became true.
    """
    answers: queue.Queue[Any] = queue.Queue()

    def run() -> None:
        try:
            answers.put(get())
        except Exception as error:  # noqa: BLE001 - raised again in the caller's thread
            answers.put(error)

    threading.Thread(target=run, daemon=True).start()
    clock = AwakeClock()
    while True:
        with suppress(queue.Empty):
            answer = answers.get(timeout=min(_POLL_SECONDS, seconds))
            break
        if stopped() or clock.seconds() > seconds:
            bounds.stopped.set()
            raise FetchError(f"cannot be fetched: took longer than {seconds:g} s")
    if isinstance(answer, Exception):
        raise answer
    return answer
