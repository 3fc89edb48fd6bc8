"""Values of usd-core as plain Python: numbers, text, tuples."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Sdf

from lab3_usd.spec.catalog import Value

CENTIMETRES = 0.01  # per unit, where a stage does not say
LONGEST = 4096  # elements; longer arrays (points, faces) are nothing a rule asks about
# Sets of types, as to ask whether a value is an instance of one takes many times as long.
_NUMBERS = {int, float}
_PLAIN = {type(None), bool, int, float, str}
_VECTORS = {
    *(Gf.Vec2d, Gf.Vec2f, Gf.Vec2h, Gf.Vec2i),
    *(Gf.Vec3d, Gf.Vec3f, Gf.Vec3h, Gf.Vec3i),
    *(Gf.Vec4d, Gf.Vec4f, Gf.Vec4h, Gf.Vec4i),
}
_HALF = "e"
_QUATERNIONS = {Gf.Quatd, Gf.Quatf, Gf.Quath}


def plain_value(value: Any) -> Value | None:  # noqa: ANN401 - whatever usd-core returns
    """Return the value without Gf, Sdf and Vt; None where there is none or nobody asks for it.

    Quaternions come in OGN's order x, y, z, w.
    """
    kind = type(value)
    if kind in _PLAIN:
        result: Value | None = value
        return result
    if kind in _QUATERNIONS:
        x, y, z = elements(value.imaginary)
        return (x, y, z, float(value.real))
    if kind is Sdf.AssetPath:
        return str(value.path)
    return tuple(elements(value)) if kind in _VECTORS else _items(value)


def stage_number(value: Any, otherwise: float) -> float:  # noqa: ANN401
    """Return a number that a stage says of itself, else the default.

    A damaged file may say anything; to usd-core that is nothing.
    """
    return float(value) if type(value) in _NUMBERS else otherwise


def _items(value: Any) -> Value | None:  # noqa: ANN401
    try:
        count = len(value)
    except TypeError:
        return None
    if count > LONGEST:
        return None
    # Iterating over a Vt or Gf type is five to twenty times as slow as asking for its elements.
    items = (plain_value(value[index]) for index in range(count))
    return tuple(item for item in items if item is not None)


def elements(vector: Any) -> list[Any]:  # noqa: ANN401 - of any size and precision
    """Return the numbers of a vector of Gf's.

    Raises:
        TypeError: the value is none.
    """
    view = memoryview(vector)
    if view.format == _HALF:  # which Python reads no buffer of
        return [vector[index] for index in range(len(vector))]
    return view.tolist()
