"""Finds and reads configuration: `.lab3.toml`, `lab3.toml`, `[tool.lab3]` in `pyproject.toml`."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lab3_usd.errors import UsageError
from lab3_usd.files import undecodable

NAME, HIDDEN_NAME, SHARED_NAME = "lab3.toml", ".lab3.toml", "pyproject.toml"
TOOL, TABLE = "tool", "lab3"
_PLACE = r"\(at line (\d+), column (\d+)\)"


def find_file(path: Path) -> Path | None:
    """Return the nearest configuration file in the folder of `path` or above it.

    Of several in one folder `.lab3.toml` counts first, as ruff has it, then `lab3.toml`. Called for
    every file that is checked: a folder without any costs a look for each name.
    """
    start = path.absolute()
    for folder in (start, *start.parents):
        try:
            file = _file_in(folder)
        except OSError:  # a folder without permission, or a name too long for one
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
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: {undecodable(error)}") from error
    except tomllib.TOMLDecodeError as error:
        match = re.search(_PLACE, str(error))
        lines = path.read_bytes().splitlines() or [b""]
        place = f"{match[1]}:{match[2]}" if match else f"{len(lines)}:{len(lines[-1]) + 1}"
        what = re.sub(_PLACE, "", str(error)).strip()
        raise UsageError(f"{path}: is not TOML: {what}, at {path}:{place}") from error
    return content


def located_in_config(error: UsageError, path: Path) -> UsageError:
    """Return an error that begins with a configuration file and its keys, with the place added."""
    text = path.read_text(encoding="utf-8")
    start = max(0, text.find(f"[{TOOL}.{TABLE}")) if path.name == SHARED_NAME else 0
    for name in str(error).removeprefix(f"{path}: ").split(": "):
        quoted = re.findall(r"'([^']+)'", name)
        match = re.search("|".join(map(re.escape, filter(None, (name, *quoted)))), text[start:])
        start += match.start() if match else 0
    line = text.count("\n", 0, start) + 1
    return UsageError(f"{error}, at {path}:{line}:{start - text.rfind(chr(10), 0, start)}")
