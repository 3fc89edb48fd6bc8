"""The options of every output format, and the program's name and version."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from msgspec import Struct

from lab3_usd.check.registry import Rule
from lab3_usd.model.changes import TextChange
from lab3_usd.model.finding import Site

if TYPE_CHECKING:
    from lab3_usd.model.grade import GradeSummary


Verbosity = Literal["quiet", "normal", "verbose"]
Source = Literal["auto", "always", "never"]
Rules = Mapping[str, Rule]


class Options(Struct, frozen=True):
    """The options of a renderer.

    Only text heeds the first of these. `color` and `width` (columns) describe the terminal;
    `statistics` adds the table of faults by rule; `source` says whether lines of the files are
    shown (auto: for a single stage); `each` asks for every file by itself where the stages of a
    folder would be reported together; `points` are what each checkpoint is worth. `verbosity` is
    heeded by text and json. `root` is the folder that paths in SARIF, GitHub and GitLab are
    relative to (None: the current one). `visibility` says when Gradescope shows the results to the
    student. `grade` is the grade of the one submission that is reported, and with `editor` a place
    in a file is a link that opens it there; only HTML shows these two. The links name the folders
    of this computer.
    `changes` are the lines that the repairs of a stage's findings would change, for SARIF. `lab`
    and `given` are the words of the command line that a printed command has to repeat: before the
    name of the command, and behind it.
    """

    color: bool = False
    width: int = 80
    verbosity: Verbosity = "normal"
    statistics: bool = False
    source: Source = "auto"
    each: bool = False
    points: Mapping[str, float] = {}
    root: str | None = None
    visibility: str = "visible"
    grade: GradeSummary | None = None
    editor: bool = False
    changes: Mapping[tuple[str, Site], tuple[TextChange, ...]] = {}
    lab: tuple[str, ...] = ()
    given: tuple[str, ...] = ()


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
        try:
            names = sorted(os.listdir(folder or "."))  # noqa: PTH208 - pathlib is not needed here
        except OSError:
            continue
        for name in names:
            if name.startswith(_PREFIX) and name.endswith(_SUFFIX):
                return name[len(_PREFIX) : -len(_SUFFIX)]
    return UNKNOWN
