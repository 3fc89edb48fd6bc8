"""Submissions in object storage: lists them through fsspec, and copies one at a time."""

from __future__ import annotations

import importlib
import os
import queue
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.grade.awake import AwakeClock
from lab3_usd.grade.intake.addresses import (
    WEB,
    StorageLocation,
    is_address,
    name_at,
    reason_of,
    storage_at,
    without_secrets,
)
from lab3_usd.grade.intake.archives import is_archive
from lab3_usd.grade.intake.platforms import LARGEST, TOO_LARGE
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import (
    Limits,
    RefusedFile,
    TooLargeError,
    UnreachedError,
    check_reached,
    is_content_read,
    is_hidden,
    name_fault,
)

_CHUNK = 1 << 20
_LARGER_THAN_PICTURES = 8 << 20
_SAME_NAME = "a file and a folder have the same name"
_PAGE, _PAGES = "text/html", (".html", ".htm", ".xhtml", ".php")
_LOGIN = re.compile(rb"""<input[^>]*\btype\s*=\s*["']?password""", re.IGNORECASE)
_OF_A_FOLDER = re.compile(rb"<title>[^<]*(?:index of|directory|listing)", re.IGNORECASE)
_MOST_OF_A_PAGE = 1 << 18  # bytes that are searched for these
Fetched = tuple[RefusedFile, ...]


class FetchLimits(Struct, frozen=True):
    """How much is fetched; `stopped` ends it, and `whole` files are fetched as they are."""

    limits: Limits
    stopped: threading.Event
    whole: bool = False


def fetch(location: StorageLocation, target: Path, bounds: FetchLimits) -> Fetched:
    """Copy the file or folder at a location to `target`, and return what is no plain file there.

    Files that are not read are not fetched: an empty file of the same size replaces them.

    Raises:
        TooLargeError: there are too many files, or there is too much in them.
        UnreachedError: something cannot be read, or is shorter than listed.
    """
    storage = location.storage
    listing, folders, left_out = _listing(location, bounds)
    plain = _sorted_out(listing, location, bounds.limits, left_out)
    for folder in folders:
        if not folder or not name_fault(folder, bounds.limits):
            with suppress(OSError):  # a name that no file system takes: its files say so
                (target / folder).mkdir(parents=True, exist_ok=True)
    room = bounds.limits.total_size
    for inside, (path, size) in plain.items():
        place = target / inside if inside else target
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            place.open("xb").close()
        except OSError as error:
            check_reached(inside, error)
            left_out.append(RefusedFile(inside, f"{_SAME_NAME}, or the name is too long"))
            continue
        if size is not None and not bounds.whole and _is_unread(path, inside, size, bounds.limits):
            os.truncate(place, min(size, max(bounds.limits.file_size + 1, _LARGER_THAN_PICTURES)))
        else:
            with _failing(inside or name_at(path)):
                room -= _copy(storage, path, place, size, room, bounds)
        os.utime(place, (0.0, 0.0))  # not the time of the download
    return tuple(left_out)


def _listing(
    location: StorageLocation, bounds: FetchLimits
) -> tuple[dict[str, dict[str, Any]], list[str], list[RefusedFile]]:
    """Return the files below a location by their names there, the folders, and what is left out.

    '' is the location itself. Of hidden folders there is the name alone.

    It walks by itself: `find` of fsspec passes over a folder that cannot be listed.

    Raises:
        TooLargeError: there are too many files and folders.
        UnreachedError: a folder cannot be listed.
    """
    storage, root = location.storage, location.root
    with _failing(""):
        details = storage.info(root)
        # The pages of a web server are files, also those that list a folder.
        if not (root.endswith("/") if is_address(root) else details["type"] == "directory"):
            return {"": details}, [], []
    files: dict[str, dict[str, Any]] = {}
    folders, waiting, walked = {"": root}, [""], 0
    left_out: list[RefusedFile] = []
    while waiting:
        bounds.limits.check_count(walked)  # a web page may lead to itself under longer names
        folder, walked = waiting.pop(), walked + 1
        entries = list(entries_of(storage, folders[folder], folder))
        plain = {name for name, is_folder, _ in entries if not is_folder}
        for name, is_folder, details in entries:
            inside = f"{folder}/{name}".lstrip("/")
            if inside in folders or (is_hidden([name]) and not is_folder):
                continue
            if not is_folder:
                files[inside] = details
            elif "\0" in name:  # which no path has
                files[f"{inside}/"] = details
            elif name in plain:
                left_out.append(RefusedFile(f"{inside}/", _SAME_NAME))
            elif inside.count("/") >= bounds.limits.folders:
                deep = f"it lies more than {bounds.limits.folders} folders deep"
                left_out.append(RefusedFile(inside, deep))
            else:
                folders[inside] = details["name"]
                if not is_hidden([name]):
                    waiting.append(inside)
            bounds.limits.check_count(len(files) + len(left_out))
            _check_progress(0, bounds.limits.total_size, bounds)
    return files, list(folders), left_out


def entries_of(
    storage: Any, folder: str, name: str = ""
) -> Iterator[tuple[str, bool, dict[str, Any]]]:
    """Yield the entries of a folder: the name, whether it is a folder, what the storage says of it.

    Of a web page those links are entries that lead to the next level.

    Raises:
        UnreachedError: the folder cannot be listed; `name` says to the reader which one it is.
    """
    with _failing(name, "listed"):
        listing = sorted(storage.ls(folder, detail=True), key=lambda details: details["name"])
        if is_address(folder):
            _refuse_login(storage, folder, listing)
    for details in listing:
        path = details["name"]
        parent, _, end = path.rstrip("/").rpartition("/")
        own = name_at(path)
        if not own or path.strip("/") == folder.strip("/"):
            continue
        is_own = parent == folder.rstrip("/") and not set(end) & set(":?#")
        if is_address(folder) and (not is_own or own in {".", ".."} or "/" in own):
            continue
        yield own, path.endswith("/") or details["type"] == "directory", details


def _refuse_login(storage: Any, folder: str, listing: Sequence[Any]) -> None:
    """Refuse a page in place of a folder's listing, as a server sends it that wants a login.

    Raises:
        UnreachedError: it asks for a password, or names no file and does not read as a listing.
    """
    with opened_at(storage, folder) as stream:
        page = stream.read(_MOST_OF_A_PAGE)
    if _LOGIN.search(page) or not (listing or _OF_A_FOLDER.search(page)):
        raise UnreachedError(
            f"{name_at(folder)}: the server sends another page in place of the list of its files, "
            "as where one has to log in"
        )


@contextmanager
def _failing(name: str, done: str = "fetched") -> Iterator[None]:
    """Let what a storage raises be the failure of a file or folder."""
    try:
        yield
    except Lab3Error:
        raise
    except Exception as error:
        place = f"{without_secrets(name)}: " if name else ""
        raise UnreachedError(f"{place}cannot be {done} ({reason_of(error)})") from error


def _sorted_out(
    listing: Mapping[str, Mapping[str, Any]],
    location: StorageLocation,
    limits: Limits,
    left_out: list[RefusedFile],
) -> dict[str, tuple[str, int | None]]:
    """Return plain files, with where they are and their sizes, by name, and add what is none."""
    plain: dict[str, tuple[str, int | None]] = {}
    total = 0
    for inside, details in sorted(listing.items()):
        path, size, kind = details["name"], details.get("size"), details.get("mimetype")
        fault = name_fault(inside, limits) if inside else ""
        if not fault and (details["type"] != "file" or details.get("islink")):
            fault = "it is a link, pipe or device; not fetched"
        if fault:
            left_out.append(RefusedFile(inside or name_at(path), fault))
            continue
        if size is None:  # a web page says no sizes
            with _failing(inside):
                told = location.storage.info(path)
            size, kind = told.get("size"), told.get("mimetype")
        if kind == _PAGE and not name_at(path).lower().endswith(_PAGES):
            raise UnreachedError(
                f"{inside or name_at(path)}: the server sends a web page in its place, as where "
                "one has to log in"
            )
        plain[inside] = (path, size)
        total += 0 if size is None or _is_unread(path, inside, size, limits) else size
    limits.check_count(len(plain) + len(left_out))
    limits.check_size(total)
    return plain


def _is_unread(path: str, inside: str, size: int, limits: Limits) -> bool:
    """Whether the contents of a file are never read: a video, or a file that is too large."""
    name = name_at(path)
    if is_archive(name) and "/" not in inside:
        return False
    return not is_content_read(name, size, limits)


def _copy(
    storage: Any, path: str, place: Path, size: int | None, room: int, bounds: FetchLimits
) -> int:
    """Copy a file and return how many bytes it has.

    Raises:
        UnreachedError: these are fewer than were listed; connections may end without a word.
    """
    copied = 0
    with opened_at(storage, path) as stream, place.open("wb") as file:
        while data := stream.read(_CHUNK):
            copied += len(data)
            _check_progress(copied, room, bounds)
            file.write(data)
    if size is not None and copied < size:
        raise UnreachedError(f"{name_at(path)}: the download ended after {copied} of {size} bytes")
    return copied


def opened_at(storage: Any, path: str) -> Any:
    """Open a file of a storage; that of a web server as one stream.

    By parts, a server that answers each request from the beginning would give the beginning twice.
    """
    options = {"block_size": 0} if path.startswith(WEB) else {}
    return storage.open(path, "rb", **options)


def _check_progress(copied: int, room: int, bounds: FetchLimits) -> None:
    bounds.limits.check_size(bounds.limits.total_size - room + copied)
    if bounds.stopped.is_set():
        raise UnreachedError("took too long")


_HOUR = 3600.0
_POLL_SECONDS = 0.2


def local_path(place: Path | str) -> Path | str:
    """Return the path of an address that is on this computer (`file://`), others as they are.

    Raises:
        UsageError: fsspec is not installed, or knows no such address.
    """
    if isinstance(place, Path):
        return place
    location = storage_at(place)
    local: type = importlib.import_module("fsspec.implementations.local").LocalFileSystem
    return Path(location.root) if isinstance(location.storage, local) else place


def entries_at(address: str) -> list[tuple[str, bool]]:
    """Return the names at an address, and which of them are folders, in order.

    Raises:
        UsageError: fsspec is not installed, knows no such address, or cannot list it.
    """
    location = storage_at(address)
    try:
        return sorted(
            (name, is_folder) for name, is_folder, _ in entries_of(location.storage, location.root)
        )
    except UnreachedError as error:
        raise UsageError(f"{without_secrets(address)}: {error}") from error


def read_at(address: str, name: str) -> bytes | str:
    """Return a file's bytes, or a few words about why it cannot be read."""
    location = storage_at(address)
    path = f"{location.root.rstrip('/')}/{name}"
    try:
        with opened_at(location.storage, path) as stream:
            data: bytes = stream.read(LARGEST + 1)
    except Exception as error:  # noqa: BLE001 - a storage may raise anything
        return f"it cannot be read: {reason_of(error)}"
    return data if len(data) <= LARGEST else TOO_LARGE


def archive_at(address: str, scratch: Path, limits: Limits) -> Path | None:
    """Fetch the archive of a class that lies at an address; None where a folder lies there.

    Raises:
        UsageError: it cannot be fetched, or what lies there is neither.
    """
    location, shown = storage_at(address), without_secrets(address)
    name = name_at(location.root)
    try:
        if is_address(location.root):  # a web server says of every page that it is a file
            is_file = is_archive(name) and not location.root.endswith("/")
        else:
            is_file = bool(location.storage.isfile(location.root))
    except Exception as error:
        raise UsageError(f"{shown}: cannot be read ({reason_of(error)})") from error
    if not is_file:
        return None
    if not is_archive(name):
        raise UsageError(f"{shown}: is neither a folder nor an archive of submissions")
    bounds = FetchLimits(limits, threading.Event(), whole=True)
    try:
        _fetched_within(_HOUR, lambda: location, scratch / name, bounds)
    except (UnreachedError, TooLargeError) as error:
        raise UsageError(f"{shown}: {error}") from error
    return scratch / name


def fetched(
    sources: Iterable[Source],
    folder: Path,
    limits: Limits,
    stopped: Callable[[], bool] = lambda: False,
) -> tuple[Source, ...]:
    """Return sources on this computer: sources with an address are fetched into `folder`.

    Raises:
        TooLargeError: more would be fetched than a submission may hold.
        UnreachedError: one cannot be fetched, or `stopped` became true; the line names it.
    """
    return tuple(
        _fetched(source, folder / str(n), limits, stopped)
        if source.address or source.fault
        else source
        for n, source in enumerate(sources)
    )


def _fetched(source: Source, target: Path, limits: Limits, stopped: Callable[[], bool]) -> Source:
    if source.fault:
        raise UnreachedError(f"{source.path.name}: {source.fault}")
    target.mkdir(parents=True, exist_ok=True)
    bounds = FetchLimits(limits, threading.Event())
    path = target / source.path.name
    try:
        at = partial(storage_at, source.address)
        left_out = _fetched_within(limits.all_seconds, at, path, bounds, stopped)
    except UnreachedError as error:
        raise UnreachedError(f"{source.path.name}: {error}") from error
    except UsageError as error:
        raise UnreachedError(str(error)) from error
    return replace(source, path=path, address="", left_out=left_out)


def _fetched_within(
    seconds: float,
    location: Callable[[], StorageLocation],
    target: Path,
    bounds: FetchLimits,
    stopped: Callable[[], bool] = lambda: False,
) -> Fetched:
    """Fetch what lies at a location (see `fetch`); a storage that hangs is not waited for.

    Raises:
        UnreachedError: it took too long, or `stopped` became true.
    """
    answers: queue.Queue[Fetched | Exception] = queue.Queue()

    def run() -> None:
        try:
            answers.put(fetch(location(), target, bounds))
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
            raise UnreachedError(f"cannot be fetched: took longer than {seconds:g} s")
    if isinstance(answer, Exception):
        raise answer
    return answer
