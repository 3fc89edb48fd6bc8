"""Writes files atomically: a reader sees the old file or the new one, never a part."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path
from typing import NamedTuple

from lab3_usd.errors import Lab3Error, UsageError, unwritten

SCRIPT_ENDINGS = (".py", ".ipynb")
_DEVICES = Path("/dev")
_MEMORY = Path("/dev/shm")  # noqa: S108 - below it are files as anywhere
_ORIGINAL = r"\.orig(\.[0-9]+)?$"
_ADDRESS = r"(\w{2,}):/+(.+)"  # of which a path keeps one slash
_LINE = "[^\n]*\n|[^\n]+"
_HALF = ".lab3-half"  # ends the name of what is being written, and of nothing that people keep
_HALF_NAME = f"[a-z0-9_]{{8}}{re.escape(_HALF)}"  # behind the prefix, as tempfile names


def is_script_file(name: str | Path) -> bool:
    """Whether a file of this name is a script or a notebook; hidden files are left by programs."""
    path = Path(name)
    return not path.name.startswith(".") and path.suffix in SCRIPT_ENDINGS


def write_whole(target: Path, data: bytes, *, force: bool) -> None:
    """Write `data` to a new file beside `target`, then rename it to `target`.

    Raises:
        UsageError: `target` exists and `force` is not set, or it cannot be written.
        NoRoomError: the disk is full.
    """
    write_parts(target, (data,), force=force)


def write_parts(target: Path, parts: Iterable[bytes], *, force: bool) -> None:
    """Write one part after the other to a new file beside `target`, then rename it to `target`.

    Devices, pipes and what lies below /dev, as /dev/stdout does, are written to and stay; the files
    in /dev/shm are ordinary ones.

    Raises:
        UsageError: `target` exists and `force` is not set, or it cannot be written.
        NoRoomError: the disk is full.
    """
    refuse_existing(target, force=force)
    try:
        is_device = target.is_relative_to(_DEVICES) and not target.is_relative_to(_MEMORY)
        if target.exists() and (is_device or not target.is_file()):
            with target.open("wb") as file:
                file.writelines(parts)
            return
        temporary = temporary_beside(target, _HALF)
        try:
            with temporary.open("wb") as file:
                file.writelines(parts)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise unwritten(target, error) from error


def make_folder(folder: Path) -> None:
    """Make a folder for what a command writes, and those above it, where they do not exist.

    Raises:
        UsageError: it cannot be made, or a file has its name.
        NoRoomError: the disk is full.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        file = next((place for place in (folder, *folder.parents) if place.is_file()), None)
        if file is None:
            raise unwritten(folder, error) from error
        raise UsageError(f"{file}: is a file, and a folder is needed; name another one") from error
    except OSError as error:
        raise unwritten(folder, error) from error


class FileState(NamedTuple):
    """A file when it was read: which file it was, its last change in nanoseconds, its content."""

    device: int
    inode: int
    changed: int
    content: bytes


def read_state(path: Path) -> FileState:
    """Read a file, or the one that a link names, so that a later change of it can be seen.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        status = os.fstat(file.fileno())
        return FileState(status.st_dev, status.st_ino, status.st_mtime_ns, file.read())


def refuse_shared(path: Path) -> None:
    """Refuse to replace a file that is read-only, somebody else's, or has several names.

    Raises:
        UsageError: it is one of these.
    """
    status = path.stat()
    reason = ""
    if not status.st_mode & stat.S_IWUSR:
        reason = "is read-only"
    elif hasattr(os, "geteuid") and status.st_uid != os.geteuid():
        reason = "belongs to another user"
    elif status.st_nlink > 1:
        reason = f"has {status.st_nlink} names (hard links), and only this one would change"
    if reason:
        raise UsageError(f"{path} {reason}; use --force to replace it")


def replace_files(contents: Mapping[Path, bytes], states: Mapping[Path, FileState]) -> None:
    """Replace files that are still as they were read, all of them or none; links stay links.

    Mode and owner stay as they were.

    Raises:
        UsageError: one was changed meanwhile, or cannot be written; nothing was written.
        NoRoomError: the disk is full; nothing was written.
    """
    waiting: dict[Path, Path] = {}  # what is to be replaced, by the new file
    try:
        for path, data in contents.items():
            target = path.resolve()
            status = target.stat()
            temporary = temporary_beside(target)
            waiting[temporary] = target
            temporary.write_bytes(data)
            if hasattr(os, "chown") and os.geteuid() == 0:
                os.chown(temporary, status.st_uid, status.st_gid)
            temporary.chmod(status.st_mode)
        for path, state in states.items():
            if path in contents and read_state(path) != state:
                raise UsageError(f"{path} was changed meanwhile; nothing was written")
        for temporary, target in waiting.items():
            temporary.replace(target)
    except OSError as error:
        raise unwritten(error.filename or next(iter(contents)), error) from error
    finally:
        for temporary in waiting:
            temporary.unlink(missing_ok=True)


def temporary_beside(target: Path, suffix: str = "") -> Path:
    """Make an empty file in the folder of `target`, which others may read, under a hidden name.

    Raises:
        OSError: it cannot be made.
    """
    import tempfile  # which loads what most commands do without

    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=suffix)
    os.close(handle)
    temporary = Path(name)
    temporary.chmod(0o644)
    return temporary


def first_bytes(path: Path, most: int) -> bytes:
    """Return what a file begins with; nothing of one that cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError:
        return b""


@contextmanager
def copy_beside(target: Path, data: bytes, suffix: str = "") -> Iterator[Path]:
    """Hold what may come to stand at `target` in a file beside it, whence its assets are found.

    Raises:
        UsageError: nothing can be written there.
        NoRoomError: the disk is full.
    """
    try:
        copy = temporary_beside(target, suffix or target.suffix)
    except OSError as error:
        raise unwritten(target, error) from error
    try:
        try:
            copy.write_bytes(data)
        except OSError as error:
            raise unwritten(target, error) from error
        yield copy
    finally:
        copy.unlink(missing_ok=True)


def leftover_files(folder: Path, names: Iterable[str]) -> tuple[Path, ...]:
    """Return what writing files of these `names` in `folder` left when it was killed, in order."""
    prefixes = tuple(f".{name}." for name in names)
    return tuple(
        path
        for path in sorted(folder.glob(".*"))
        if path.name.startswith(prefixes)
        and any(re.fullmatch(_HALF_NAME, path.name.removeprefix(prefix)) for prefix in prefixes)
        and path.is_file()
    )


def keep_original(path: Path, content: bytes) -> Path:
    """Keep what a file held before it is replaced, and return where.

    That is `NAME.orig`, and where that is taken the next of `NAME.orig.2`, `NAME.orig.3`: the first
    original stays, also one that another process keeps at the same time.

    Raises:
        UsageError: it cannot be written.
        NoRoomError: the disk is full.
    """
    endings = chain([".orig"], (f".orig.{number}" for number in count(2)))
    originals = (path.with_name(path.name + ending) for ending in endings)
    try:
        original = next(filter(_claimed, originals))
    except OSError as error:
        raise unwritten(error.filename or path, error) from error
    try:
        write_whole(original, content, force=True)
    except Lab3Error:
        original.unlink(missing_ok=True)
        raise
    original.chmod(path.stat().st_mode)
    return original


def _claimed(path: Path) -> bool:
    """Make an empty file where there is none; whether that was done."""
    try:
        path.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def is_original(name: str) -> bool:
    """Whether a file has the name of an original that was kept."""
    return bool(re.search(_ORIGINAL, name))


def original_of(path: Path) -> Path | None:
    """Return the name of the file of which an original was kept at a path, None for another one."""
    name = re.sub(_ORIGINAL, "", path.name)
    return None if name == path.name else path.with_name(name)


def refuse_existing(target: Path, *, force: bool) -> None:
    """Raise UsageError where writing would replace a file without permission."""
    if target.exists() and not force:
        raise UsageError(f"{target} exists already; use --force to replace it")


def lines_of(text: str) -> list[str]:
    """Return the lines of a text with their ends, as editors and patch count them.

    Form feeds and the line ends of other alphabets, which may stand in comments, end none.
    """
    return re.findall(_LINE, text)


def undecodable(error: UnicodeDecodeError) -> str:
    """Say in which line bytes are no text, as the end of a sentence about a file."""
    line = error.object.count(b"\n", 0, error.start) + 1
    byte = f"0x{error.object[error.start]:02x}"
    return f"is not {error.encoding.upper()} text: line {line} holds the byte {byte}"


def absence(path: Path, what: str = "file") -> str:
    """Say that nothing is at a path, and which file may be meant, or where the link there leads."""
    from difflib import get_close_matches

    address = re.match(_ADDRESS, str(path))
    if address is not None:
        name = f"{address[1]}://{address[2]}"
        return f"{name}: is an address, and only files are read; download it first"
    if path.is_symlink():
        return f"{path}: is a link to {path.readlink()}, which does not exist"
    absent = f"{path}: there is no such {what}"
    try:
        names = sorted(beside.name for beside in path.parent.iterdir())
    except OSError:
        return absent
    alike = [name for name in names if Path(name).stem == path.stem]
    alike = alike or get_close_matches(path.name, names, 1)
    return f"{absent}; did you mean {path.with_name(alike[0])}?" if alike else absent
