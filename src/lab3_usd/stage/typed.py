"""Plain Python values as usd-core wants them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pxr import Gf, Sdf, Vt

from lab3_usd.spec.catalog import Value


def value_type(usd_type: str) -> Sdf.ValueTypeName:
    """Return usd-core's name for a type as the catalog writes it."""
    return Sdf.ValueTypeNames.Find(usd_type)


def _quaternion(value: Any) -> Gf.Quatd:  # noqa: ANN401
    x, y, z, w = value
    return Gf.Quatd(w, x, y, z)


_MAKERS: dict[str, Callable[[Any], Any]] = {
    "int2": lambda v: Gf.Vec2i(*v),
    "float2": lambda v: Gf.Vec2f(*v),
    "float3": lambda v: Gf.Vec3f(*v),
    "double3": lambda v: Gf.Vec3d(*v),
    "vector3d": lambda v: Gf.Vec3d(*v),
    "quatd": _quaternion,
    "token[]": Vt.TokenArray,
    "int[]": Vt.IntArray,
    "uint[]": Vt.UIntArray,
    "float[]": Vt.FloatArray,
    "double[]": Vt.DoubleArray,
}


def usd_value(value: Value, usd_type: str) -> Any:  # noqa: ANN401 - one of many Gf and Vt types
    """Return a plain value as the type asks; quaternions come in as x, y, z, w."""
    make = _MAKERS.get(usd_type)
    return value if make is None else make(value)
