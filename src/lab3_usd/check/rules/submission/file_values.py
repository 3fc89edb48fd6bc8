"""Values of files that a student wrote by hand: compared, and in words, however large they are."""

from __future__ import annotations

import math
import reprlib

from lab3_usd.model.formatting import MOST_ITEMS, MOST_LETTERS

_DEEPEST = 3


def same(actual: object, expected: object) -> bool:
    """Whether a value that was read is the one that is asked for."""
    if isinstance(actual, (int, float)) and isinstance(expected, (int, float)):
        return math.isclose(actual, expected, rel_tol=1e-6, abs_tol=1e-9)
    return actual == expected


def shortened(value: object) -> str:
    """Return a value of a YAML file or a message, as YAML writes it, and not too long to read."""
    if isinstance(value, (list, tuple, dict)):
        return _repr.repr(value)
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}..."


def _shortening() -> reprlib.Repr:
    made = reprlib.Repr()
    made.maxlevel = _DEEPEST
    made.maxlist = made.maxtuple = made.maxdict = MOST_ITEMS
    made.maxstring = made.maxother = made.maxlong = MOST_LETTERS
    return made


_repr = _shortening()
