"""Finds and reads configuration: `.lab3.toml`, `lab3.toml`, `[tool.lab3]` in `pyproject.toml`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lab3_usd.errors import UsageError

NAME, HIDDEN_NAME, SHARED_NAME = "lab3.toml", ".lab3.toml", "pyproject.toml"
TOOL, TABLE = "tool", "lab3"


def find_file(path: Path) -> Path | None:
    """Return the nearest configuration file in the folder of `path` or above it.

    Of several in one folder `.lab3.toml` counts first, as ruff has it, then `lab3.toml`. Called for
    every file that is checked: a folder without any costs a look for each name.
    """
    start = path.absolute()
    for folder in (start, *start.parents):
        try:
            file = _file_in(folder)
        except OSError:  # a folder that nobody may look into, or a name too long for one
            continue
        if file is not None:
            return file
    return None


def _file_in(folder: Path) -> Path | None:
    for own in (folder / HIDDEN_NAME, folder / NAME):
        if own.is_file():
            return own
    shared = folder / SHARED_NAME
    content = shared.read_bytes() if shared.is_file() else b""
    is_mentioned = TABLE.encode() in content and TOOL.encode() in content
    return shared if is_mentioned and TABLE in _parsed(shared).get(TOOL, {}) else None


def read_table(path: Path) -> Mapping[str, Any]:
    """Return what a configuration file says.

    Raises:
        UsageError: it cannot be read, is not TOML, or has no table of this program.
    """
    content = _parsed(path)
    if path.name != SHARED_NAME:
        return content
    table = content.get(TOOL, {}).get(TABLE)
    if not isinstance(table, dict):
        raise UsageError(f"{path}: has no table [{TOOL}.{TABLE}]")
    return table


def _parsed(path: Path) -> dict[str, Any]:
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    try:
        content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: is not TOML: {error}") from error
    return content
