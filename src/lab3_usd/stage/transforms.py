"""The local transform of a prim, out of its own operations.

The same as `UsdGeom.Xformable` gives, for types that usd-core does not know as well, and without
loading UsdGeom's Python classes, which takes as long as judging a stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from pxr import Gf, Usd

ORDER = "xformOpOrder"
_RESET = "!resetXformStack!"
_INVERSE = "!invert!"
_AXES = {"X": Gf.Vec3d(1, 0, 0), "Y": Gf.Vec3d(0, 1, 0), "Z": Gf.Vec3d(0, 0, 1)}


def local_transform(prim: Usd.Prim) -> tuple[Gf.Matrix4d, bool]:
    """Return the local matrix, and whether it leaves the parent's transform out.

    An operation without a value, or of a kind that USD does not have, moves nothing.
    """
    matrix, is_reset = Gf.Matrix4d(1.0), False
    for name in _names(prim.GetAttribute(ORDER).Get()):
        if name == _RESET:
            matrix, is_reset = Gf.Matrix4d(1.0), True
            continue
        operation = _operation(prim, name.removeprefix(_INVERSE))
        if operation is not None:
            inverse = name.startswith(_INVERSE)
            matrix = (operation.GetInverse() if inverse else operation) * matrix
    return matrix, is_reset


def _names(order: Any) -> list[str]:  # noqa: ANN401 - of any type where a file is damaged
    names = order if isinstance(order, Iterable) else ()
    return [name for name in names if isinstance(name, str)]


def _operation(prim: Usd.Prim, name: str) -> Gf.Matrix4d | None:
    attribute = prim.GetAttribute(name)
    value = attribute.Get() if attribute else None
    make = _MAKERS.get(name.split(":")[1]) if value is not None and ":" in name else None
    try:
        return None if make is None else make(value)
    except (TypeError, ValueError):  # a value of a type that the operation does not take
        return None


def _translation(value: Any) -> Gf.Matrix4d:  # noqa: ANN401 - of any precision
    return Gf.Matrix4d(1.0).SetTranslate(Gf.Vec3d(value))


def _scaling(value: Any) -> Gf.Matrix4d:  # noqa: ANN401
    return Gf.Matrix4d(1.0).SetScale(Gf.Vec3d(value))


def _orientation(value: Any) -> Gf.Matrix4d:  # noqa: ANN401
    return Gf.Matrix4d(1.0).SetRotate(Gf.Quatd(value))


def _turn(axis: str, degrees: float) -> Gf.Matrix4d:
    return Gf.Matrix4d(1.0).SetRotate(Gf.Rotation(_AXES[axis], degrees))


def _about(axis: str) -> Callable[[Any], Gf.Matrix4d]:
    return lambda degrees: _turn(axis, degrees)


def _turns(order: str) -> Callable[[Any], Gf.Matrix4d]:
    """Return the maker of three turns; the first letter turns first."""

    def make(value: Any) -> Gf.Matrix4d:  # noqa: ANN401
        first, second, third = (_turn(axis, value["XYZ".index(axis)]) for axis in order)
        return first * second * third

    return make


def _along(axis: str, make: Callable[[Any], Gf.Matrix4d], rest: float) -> Callable[[Any], Any]:
    """Return the maker of an operation on one axis; the others keep `rest`."""
    index = "XYZ".index(axis)

    def one(value: float) -> Gf.Matrix4d:
        parts = [rest, rest, rest]
        parts[index] = value
        return make(Gf.Vec3d(*parts))

    return one


_MAKERS: dict[str, Callable[[Any], Gf.Matrix4d]] = {
    "translate": _translation,
    "scale": _scaling,
    "orient": _orientation,
    "transform": Gf.Matrix4d,
    **{f"translate{axis}": _along(axis, _translation, 0.0) for axis in "XYZ"},
    **{f"scale{axis}": _along(axis, _scaling, 1.0) for axis in "XYZ"},
    **{f"rotate{axis}": _about(axis) for axis in "XYZ"},
    **{f"rotate{order}": _turns(order) for order in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")},
}
