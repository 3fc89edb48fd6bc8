"""Writes files whole: a reader sees the old file or the new one, never a half of it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

from lab3_usd.errors import UsageError


def write_whole(target: Path, data: bytes, *, force: bool = False) -> None:
    """Write `data` to a new file beside `target`, then rename it to `target`.

    Raises:
        UsageError: `target` exists and `force` is not set, or it cannot be written.
    """
    write_parts(target, (data,), force=force)


def write_parts(target: Path, parts: Iterable[bytes], *, force: bool = False) -> None:
    """Write one part after the other to a new file beside `target`, then rename it to `target`.

    Raises:
        UsageError: `target` exists and `force` is not set, or it cannot be written.
    """
    refuse_existing(target, force=force)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        temporary = Path(name)
        try:
            with open(handle, "wb") as file:  # noqa: PTH123 - a handle, not a path
                file.writelines(parts)
            temporary.chmod(0o644)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        message = f"{target} cannot be written ({error.strerror})"
        raise UsageError(message) from error


def refuse_existing(target: Path, *, force: bool) -> None:
    """Raise UsageError where writing would replace a file that nobody said to replace."""
    if target.exists() and not force:
        message = f"{target} exists already; use --force to replace it"
        raise UsageError(message)
