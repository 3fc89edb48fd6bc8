"""Reports of a large class: they name nobody, and equal ones are stored once."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from lab3_usd.files import make_folder, write_whole

REPORTS = "reports"  # the folder in the gradebook
SHARED = "shared"  # the name of the folder there, in a result
MOST_NAMED = 1500  # students of a class, each of whom has reports of 160 kB
_NAME = re.compile("[0-9a-f]{32}")


def shared_folder(out: Path, row: Mapping[str, Any]) -> Path | None:
    """Return where the reports of a result are stored; None where they are the student's own."""
    name = row.get(SHARED)
    return out / REPORTS / name if isinstance(name, str) and _NAME.fullmatch(name) else None


def write_shared(out: Path, reports: Mapping[str, str]) -> str:
    """Store reports where no equal ones are stored, and return the name of their folder.

    Raises:
        UsageError: they cannot be written.
    """
    contents = {name: text.encode("utf-8", "replace") for name, text in reports.items()}
    folder = out / REPORTS / _name_of(contents)
    make_folder(folder)
    for name, data in contents.items():
        if not (folder / name).is_file():
            write_whole(folder / name, data, force=True)
    return folder.name


def _name_of(contents: Mapping[str, bytes]) -> str:
    """Return the name of the folder that holds these files, and no others."""
    digest = hashlib.sha256()
    for name, data in sorted(contents.items()):
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest()[:32]


def remove_unshared(out: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Remove reports that no result names any more; a folder that holds anything else stays."""
    if not (out / REPORTS).is_dir():
        return
    named = {row.get(SHARED) for row in rows}
    for folder in (out / REPORTS).iterdir():
        if not _NAME.fullmatch(folder.name) or folder.name in named or folder.is_symlink():
            continue
        with suppress(OSError):
            files = list(folder.iterdir())
            if _name_of({path.name: path.read_bytes() for path in files}) == folder.name:
                for path in files:
                    path.unlink()
                folder.rmdir()
