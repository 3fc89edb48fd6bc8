"""Writes files whole: a reader sees the old file or the new one, never a half of it."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path

from lab3_usd.errors import UsageError

_DEVICES = ("/", "dev")
_RANDOM = re.compile("[a-z0-9_]{8}")  # what tempfile puts behind a prefix


def write_whole(target: Path, data: bytes, *, force: bool) -> None:
    """Write `data` to a new file beside `target`, then rename it to `target`.

    Raises:
        UsageError: `target` exists and `force` is not set, or it cannot be written.
    """
    write_parts(target, (data,), force=force)


def write_parts(target: Path, parts: Iterable[bytes], *, force: bool) -> None:
    """Write one part after the other to a new file beside `target`, then rename it to `target`.

    Devices, pipes and what lies below /dev, as /dev/stdout does, are written to and stay.

    Raises:
        UsageError: `target` exists and `force` is not set, or it cannot be written.
    """
    refuse_existing(target, force=force)
    try:
        if target.exists() and (not target.is_file() or target.parts[:2] == _DEVICES):
            with target.open("wb") as file:
                file.writelines(parts)
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = temporary_beside(target)
        try:
            with temporary.open("wb") as file:
                file.writelines(parts)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(f"{target} cannot be written ({error.strerror})") from error


def temporary_beside(target: Path, suffix: str = "") -> Path:
    """Make an empty file in the folder of `target`, which others may read, under a hidden name.

    Raises:
        OSError: it cannot be made.
    """
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=suffix)
    os.close(handle)
    temporary = Path(name)
    temporary.chmod(0o644)
    return temporary


def leftover_files(folder: Path, names: Iterable[str]) -> tuple[Path, ...]:
    """Return what writing files of these `names` in `folder` left when it was killed, in order."""
    prefixes = tuple(f".{name}." for name in names)
    return tuple(
        path
        for path in sorted(folder.glob(".*"))
        if path.name.startswith(prefixes)
        and any(_RANDOM.fullmatch(path.name.removeprefix(prefix)) for prefix in prefixes)
        and path.is_file()
    )


def refuse_existing(target: Path, *, force: bool) -> None:
    """Raise UsageError where writing would replace a file that nobody said to replace."""
    if target.exists() and not force:
        raise UsageError(f"{target} exists already; use --force to replace it")
