"""The name and version of the program, for reports."""

from __future__ import annotations

import os
import sys
from functools import lru_cache

NAME = "lab3-usd"
UNKNOWN = "0+unknown"
_PREFIX = "lab3_usd-"
_SUFFIX = ".dist-info"


def tool_version() -> str:
    """Return the version of the installed package, `0+unknown` where it is not installed.

    Reads the name of the folder that every installer leaves beside the package; asking
    `importlib.metadata` costs more than checking a stage does, most of it for e-mail parsing.
    """
    return _first_version(tuple(sys.path))


@lru_cache(maxsize=1)  # each report of a class has it
def _first_version(folders: tuple[str, ...]) -> str:
    for folder in folders:
        version = _version_in(folder)
        if version:
            return version
    return UNKNOWN


def _version_in(folder: str) -> str:
    try:
        names = sorted(os.listdir(folder or "."))  # noqa: PTH208 - pathlib is not needed here
    except OSError:
        return ""
    for name in names:
        if name.startswith(_PREFIX) and name.endswith(_SUFFIX):
            return name[len(_PREFIX) : -len(_SUFFIX)]
    return ""
