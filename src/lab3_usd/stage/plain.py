"""Values of usd-core as plain Python: numbers, text, tuples."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Sdf

from lab3_usd.spec.catalog import Value

LONGEST = 4096  # elements; longer arrays (points, faces) are nothing a rule asks about
_PLAIN = (bool, int, float, str)
_QUATERNIONS = (Gf.Quatd, Gf.Quatf, Gf.Quath)


def plain(value: Any) -> Value | None:  # noqa: ANN401 - whatever usd-core returns
    """Return the value without Gf, Sdf and Vt; None where there is none or nobody asks for it.

    Quaternions come in OGN's order x, y, z, w.
    """
    if value is None or isinstance(value, _PLAIN):
        result: Value | None = value
        return result
    if isinstance(value, _QUATERNIONS):
        x, y, z = (float(value.imaginary[index]) for index in range(3))
        return (x, y, z, float(value.real))
    if isinstance(value, Sdf.AssetPath):
        return str(value.path)
    try:
        count = len(value)
    except TypeError:
        return None
    if count > LONGEST:
        return None
    # Iterating over a Gf type is twenty times as slow as asking for its elements.
    items = (plain(value[index]) for index in range(count))
    return tuple(item for item in items if item is not None)
