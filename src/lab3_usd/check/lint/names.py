"""Which known name was likely meant where an unknown one was written."""

from __future__ import annotations

from collections.abc import Collection

_ALIKE = 0.8


def likely_name(written: str, known: Collection[str]) -> str | None:
    """Return the known name that a name was likely meant to be, None where none is near."""
    same = [name for name in known if name.lower() == written.lower()]
    return same[0] if same else _near(written, known, _ALIKE)


def likely_type(written: str, known: Collection[str]) -> str | None:
    """Return the node type that was likely meant: of the same last name, or of one alike."""
    last = written.rpartition(".")[2].removeprefix("Ogn")
    same = [name for name in known if name.rpartition(".")[2].removeprefix("Ogn") == last]
    if len(same) == 1 and last:
        return same[0]
    return _near(written, known, _NEAR_TYPE)


def _near(written: str, known: Collection[str], least: float) -> str | None:
    from difflib import get_close_matches  # noqa: PLC0415 - only after a slip

    near = get_close_matches(written, known, 1, least)
    return near[0] if near else None


def did_you_mean(name: str | None) -> str:
    """Return the end of a sentence that offers a name, nothing without one."""
    return f"; did you mean {name}?" if name else ""


_NEAR_TYPE = 0.92
