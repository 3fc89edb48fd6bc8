"""Which known name was likely meant where an unknown one was written."""

from __future__ import annotations

import re
from collections.abc import Collection

_ALIKE = 0.8
_NEAR_TYPE = 0.92
_NUMBER = re.compile(r"\d+")


def likely_name(written: str, known: Collection[str]) -> str | None:
    """Return the known name that a name was likely meant to be, None where none is near."""
    same = [name for name in known if name.lower() == written.lower()]
    return same[0] if same else _near(written, known, _ALIKE)


def likely_type(written: str, known: Collection[str]) -> str | None:
    """Return the node type that was likely meant: of the same last name, or of one alike.

    One of the same last name that somebody else publishes is a type of its own, and so is one that
    differs in a number.
    """
    *before, last = written.split(".")
    parts = {part for name in known for part in name.split(".")[:-1]}
    last = last.removeprefix("Ogn")
    same = [name for name in known if name.rpartition(".")[2].removeprefix("Ogn") == last]
    if len(same) == 1 and last and (not before or before[0] in parts):
        return same[0]
    letters = _NUMBER.sub("", written)
    return _near(written, [name for name in known if _NUMBER.sub("", name) != letters], _NEAR_TYPE)


def _near(written: str, known: Collection[str], least: float) -> str | None:
    from difflib import get_close_matches  # noqa: PLC0415 - only after a slip

    near = get_close_matches(written, known, 1, least)
    return near[0] if near else None


def did_you_mean(name: str | None) -> str:
    """Return the end of a sentence that offers a name, nothing without one."""
    return f"; did you mean {name}?" if name else ""
