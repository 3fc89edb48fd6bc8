"""Plain values of USD types: which fit a type, and how they are stored."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Union

from lab3_usd.errors import SpecError

Value = Union[bool, int, float, str, tuple["Value", ...]]  # noqa: UP007 - evaluated at run time


class Margin(NamedTuple):
    """What numbers of one kind may differ by: a part of the larger one, or so much near zero."""

    relative: float
    near_zero: float = 0.0


SAVED = Margin(1e-6, 1e-9)  # single precision, into which the GUI writes doubles


def same_numbers(was: Sequence[float], now: Sequence[float], margin: Margin) -> bool:
    """Whether numbers are the same up to a margin; those of a vector are measured by the longest.

    Infinities, and what is no number (NaN), are the same as themselves alone.
    """
    pairs = [*zip(was, now, strict=False)]
    if len(was) != len(now) or not all(map(math.isfinite, (*was, *now))):
        alike = (a == b or (math.isnan(a) and math.isnan(b)) for a, b in pairs)
        return len(was) == len(now) and all(alike)
    longest = max(map(abs, (*was, *now))) if len(pairs) > 1 else 0.0
    near = max(margin.near_zero, margin.relative * longest)
    return all(math.isclose(a, b, rel_tol=margin.relative, abs_tol=near) for a, b in pairs)


_RANGES = {
    "uchar": (0, 2**8 - 1),
    "int": (-(2**31), 2**31 - 1),
    "uint": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1),
    "uint64": (0, 2**64 - 1),
}
_PRECISIONS = {"d": "double", "f": "float", "h": "half"}
_TUPLES = {
    **{
        f"{kind}{size}": (kind, size)
        for kind in ("double", "float", "half", "int")
        for size in (2, 3, 4)
    },
    **{
        f"{role}{size}{short}": (precision, size)
        for short, precision in _PRECISIONS.items()
        for role, sizes in {
            "color": (3, 4), "normal": (3,), "point": (3,), "vector": (3,), "texCoord": (2, 3),
        }.items()
        for size in sizes
    },
    **{f"quat{short}": (precision, 4) for short, precision in _PRECISIONS.items()},
    **{f"matrix{size}d": (f"double{size}", size) for size in (2, 3, 4)},
    "frame4d": ("double4", 4),
}  # fmt: skip


_REALS = ("half", "float", "double", "timecode")
_OTHERS = {"bool": bool, "string": str, "token": str}


def is_known_type(usd_type: str) -> bool:
    """Whether values of this USD type can be written in a spec."""
    base = usd_type.removesuffix("[]")
    return base in (*_TUPLES, *_RANGES, *_REALS, *_OTHERS)


def fits_type(value: Any, usd_type: str) -> bool:
    """Whether a plain value can be stored in an attribute of this USD type."""
    if usd_type.endswith("[]"):
        return isinstance(value, (list, tuple)) and all(fits_type(v, usd_type[:-2]) for v in value)
    if usd_type in _TUPLES:
        element, count = _TUPLES[usd_type]
        return (
            isinstance(value, (list, tuple))
            and len(value) == count
            and all(fits_type(v, element) for v in value)
        )
    if usd_type in _OTHERS:
        return isinstance(value, _OTHERS[usd_type])
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    if usd_type in _RANGES:
        low, high = _RANGES[usd_type]
        return isinstance(value, int) and low <= value <= high
    return usd_type in _REALS and math.isfinite(value)


# Types of which each can hold the values of the others. Isaac Sim reads them for one another: files
# of earlier releases declare some inputs so.
_ALIKE = (
    frozenset({"float", "double", "half"}),
    frozenset({"int", "uint", "int64", "uint64", "uchar"}),
    frozenset({"string", "token"}),
    frozenset({"vector3d", "double3"}),
)


def are_alike(first: str, second: str) -> bool:
    """Whether values of two USD types stand for one another."""
    return first == second or any({first, second} <= types for types in _ALIKE)


def typed_value(value: Any, usd_type: str, where: str) -> Value:
    """Return `value` as it is stored: lists become tuples, numbers of float types floats.

    Raises:
        SpecError: the value does not fit the type; `where` opens the message.
    """
    if not fits_type(value, usd_type):
        raise SpecError(f"{where} is {value!r}, expected a value of type {usd_type}")
    return _frozen(value, usd_type)


def _frozen(value: Any, usd_type: str) -> Value:
    if usd_type.endswith("[]"):
        return tuple(_frozen(v, usd_type[:-2]) for v in value)
    if usd_type in _TUPLES:
        return tuple(_frozen(v, _TUPLES[usd_type][0]) for v in value)
    if usd_type in _REALS:
        return float(value)
    result: Value = value
    return result
