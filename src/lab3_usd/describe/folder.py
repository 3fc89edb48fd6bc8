"""Writes the folder of a new lab: whole, and never over one that exists."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from lab3_usd.errors import UsageError


def refuse_existing_folder(folder: Path) -> None:
    """Refuse a place where something is.

    Raises:
        UsageError: there is a file or folder.
    """
    if folder.exists() or folder.is_symlink():
        message = f"{folder} exists; name a folder that does not"
        raise UsageError(message)


def write_folder(folder: Path, files: Mapping[str, str], check: Callable[[Path], None]) -> None:
    """Write the files to a new folder beside `folder`, check it, then rename it to `folder`.

    Raises:
        UsageError: `folder` exists, or cannot be written.
    """
    refuse_existing_folder(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
        try:
            for name, text in files.items():
                (temporary / name).write_text(text, encoding="utf-8")
            check(temporary)
            temporary.chmod(0o755)
            temporary.rename(folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        message = f"{folder} cannot be written ({error.strerror})"
        raise UsageError(message) from error
