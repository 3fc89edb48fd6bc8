"""Numbers and choices of a rubric, each within its limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lab3_usd.errors import SpecError
from lab3_usd.spec.yaml_file import need

_NUMBER = (int, float)
_LEAST, _MOST = 0.001, 1e6  # of points and weights: their sums and shares stay sane numbers


def positive(data: Mapping[str, Any], key: str, place: str) -> float:
    """Return the points or the weight at `key`.

    Raises:
        SpecError: it is missing, or no number above 0 that can be reckoned with.
    """
    return _between(need(data, key, _NUMBER, place), (_LEAST, _MOST), f"{place}: '{key}'")


def share(data: Mapping[str, Any], place: str) -> float:
    """Return the share at `at_most`, from 0 to 1.

    Raises:
        SpecError: it is missing, or no such number.
    """
    return _between(need(data, "at_most", _NUMBER, place), (0, 1), f"{place}: 'at_most'")


def _between(value: float, ends: tuple[float, float], place: str) -> float:
    least, most = ends
    if least <= value <= most:
        return float(value)
    try:
        shown = f"{value:g}"
    except OverflowError:
        shown = "a number without end"
    message = f"{place} is {shown}, expected a number from {least:.7g} to {most:.7g}"
    raise SpecError(message)


def one_of(value: str, known: tuple[str, ...], place: str) -> str:
    """Return `value`, which must be one of the `known`.

    Raises:
        SpecError: it is not; the message names them.
    """
    if value not in known:
        message = f"{place}: {value!r} is not known; known are {', '.join(known)}"
        raise SpecError(message)
    return value
