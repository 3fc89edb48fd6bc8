"""Where the data files live: beside the package in a wheel, at the top level of a checkout."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
LAB_VARIABLE = "LAB3_LAB"
SITE = ""  # the address of the documentation, once it has one; as in pyproject.toml and mkdocs.yml
TEAM_VARIABLE = "LAB3_TEAM"
PROGRAMS = ("lab3", "usdlab")  # the same program; the second names no lab
_PROGRAM = rf"(?<![.\w])(_?){PROGRAMS[0]}(?!-usd|\.toml|:|\w)"


def rule_address(rule_id: str) -> str:
    """Return the address of the page of a rule of this package, '' while it has none."""
    return f"{SITE}/rules/{rule_id}.html" if SITE else ""


def program() -> str:
    """Return the name by which the program was started, for what it says to type."""
    return _program(sys.argv[0] if sys.argv else "")


@cache
def _program(started: str) -> str:
    typed = Path(started).stem
    return typed if typed in PROGRAMS else PROGRAMS[0]


def as_called(text: str, called: str = "") -> str:
    """Return a text about the program with the name by which it was `called`, else started."""
    if PROGRAMS[0] not in text:
        return text
    return re.sub(_PROGRAM, rf"\1{called or program()}", text)


def own_lab() -> Path | None:
    """Return the folder of another lab that the environment names, None for the bundled one."""
    named = os.environ.get(LAB_VARIABLE, "")
    return Path(named).resolve() if named else None


def own_team() -> str:
    """Return the team that the environment names, whose values of the lab count; '' for none."""
    return os.environ.get(TEAM_VARIABLE, "")


@contextmanager
def variable_set(name: str, value: str | None) -> Iterator[None]:
    """Set a variable of the environment, or with None remove it, until the context is left."""
    before = os.environ.pop(name, None)
    if value is not None:
        os.environ[name] = value
    try:
        yield
    finally:
        os.environ.pop(name, None)
        if before is not None:
            os.environ[name] = before


def lab_folder() -> Path:
    """Return the folder that describes the lab: the one the environment names, else the bundled."""
    return own_lab() or data_folder("graphs")


@cache
def data_folder(name: str) -> Path:
    """Return the folder `name` (`graphs`, `maps`, `schema`) of this installation.

    A wheel carries the folders inside the package; an editable install finds them at the top
    level of the checkout.

    Raises:
        FileNotFoundError: the installation carries no such folder.
    """
    for folder in (PACKAGE / "_data" / name, PACKAGE.parents[1] / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"lab3-usd is installed without its folder '{name}'; install it again")
