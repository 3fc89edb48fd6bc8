"""Values of usd-core as plain Python: numbers, text, tuples."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Sdf

from lab3_usd.spec.catalog import Value

LONGEST = 4096  # elements; longer arrays (points, faces) are nothing a rule asks about


def plain(value: Any) -> Value | None:  # noqa: ANN401 - whatever usd-core returns
    """Return the value without Gf, Sdf and Vt; None where there is none or nobody asks for it.

    Quaternions come in OGN's order x, y, z, w.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Sdf.AssetPath):
        return str(value.path)
    if isinstance(value, (Gf.Quatd, Gf.Quatf, Gf.Quath)):
        x, y, z = value.GetImaginary()
        return (float(x), float(y), float(z), float(value.GetReal()))
    try:
        if len(value) > LONGEST:
            return None
        return tuple(item for item in map(plain, value) if item is not None)
    except TypeError:
        return None
