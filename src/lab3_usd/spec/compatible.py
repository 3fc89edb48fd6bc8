"""Which port types can be wired to which."""

from __future__ import annotations

from lab3_usd.spec.catalog import Port

# OmniGraph casts between numbers of one shape by itself; a union takes what it is given.
_NUMBERS = ("bool", "uchar", "int", "uint", "int64", "uint64", "half", "float", "double")


def _shape(ogn_type: str) -> tuple[str, str]:
    """Split a type into the name of its element and its shape (`[3]`, `[]`, ...)."""
    base, bracket, rest = ogn_type.partition("[")
    return base, bracket + rest


def compatible(source: Port, target: Port) -> bool:
    """Whether a wire can run from `source` to `target`.

    Signals go to signals, relationships are never wired, unions take any data, other ports their
    own type or a number of the same shape.
    """
    if source.is_execution or target.is_execution:
        return source.is_execution and target.is_execution
    if source.is_target or target.is_target:
        return False
    if source.is_union or target.is_union:
        return True
    return _same_or_castable(source.ogn_type, target.ogn_type)


def _same_or_castable(source: str, target: str) -> bool:
    if source == target or {source, target} == {"string", "token"}:
        return True
    (one, shape), (other, other_shape) = _shape(source), _shape(target)
    return shape == other_shape and one in _NUMBERS and other in _NUMBERS
