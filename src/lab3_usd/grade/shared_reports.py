"""Reports of a large class: they name nobody, and equal ones are stored once."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from lab3_usd.files import write_whole

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
    contents = {name: text.encode("utf-8", "replace") for name, text in sorted(reports.items())}
    digest = hashlib.sha256()
    for name, data in contents.items():
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    folder = out / REPORTS / digest.hexdigest()[:32]
    for name, data in contents.items():
        if not (folder / name).is_file():
            write_whole(folder / name, data, force=True)
    return folder.name


def remove_unshared(out: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Remove reports that no result names any more."""
    if not (out / REPORTS).is_dir():
        return
    named = {row.get(SHARED) for row in rows}
    for folder in (out / REPORTS).iterdir():
        if _NAME.fullmatch(folder.name) and folder.name not in named:
            shutil.rmtree(folder, ignore_errors=True)
