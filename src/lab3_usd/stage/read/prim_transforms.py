"""The local and world transforms of prims, out of their own operations.

They equal those of `UsdGeom.Xformable`, also for types unknown to usd-core. UsdGeom's Python
classes are not loaded, since that takes as long as checking a stage. Matrices are plain tuples:
converting one of Gf's takes longer than composing two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from struct import Struct
from typing import Any

from pxr import Gf, Tf, Usd, Vt

from lab3_usd.model.prims import Matrix, is_at_or_below
from lab3_usd.model.transforms import IDENTITY, multiply
from lab3_usd.stage.read.properties import authored_data, elements

ORDER = "xformOpOrder"
RESET = "!resetXformStack!"
_USUAL = ("xformOp:translate", "xformOp:orient", "xformOp:scale")
_USUAL_ORDER = Vt.TokenArray(_USUAL)
_INVERSE = "!invert!"
_SIXTEEN = Struct("16d")
_SHORTEST = 1e-10  # length of an axis that is one, as in Gf
_Maker = Callable[[Any], Matrix]


class TransformCache:
    """Composes transforms down the namespace, each once.

    `UsdGeom.XformCache` skips prims whose type usd-core does not know, an OmniLidar among them;
    their own operations are read all the same here. Those of a prim without a type, or of one that
    is no Xformable, place nothing.
    """

    def __init__(self, hidden: Iterable[str] = ("/",)) -> None:
        """Start with nothing known but the root.

        At and below the `hidden` prims a missing asset may say the type.
        """
        self._hidden = tuple(hidden)
        self._known: dict[str, tuple[Matrix | None, Matrix]] = {"/": (None, IDENTITY)}

    def of(self, prim: Usd.Prim, path: str) -> tuple[Matrix | None, Matrix]:
        """Return the local transform (None where none is authored) and the world transform.

        Every Xform has the order of its operations by its schema; only one that a layer states
        says where the prim stands.
        """
        ahead = []
        while path not in self._known:
            ahead.append((prim, path))
            prim, path = Usd.Prim.GetParent(prim), path.rpartition("/")[0] or "/"
        for child, child_path in reversed(ahead):
            parent, order = self._known[path][1], authored_data(child, ORDER)
            kind = Usd.Prim.GetTypeName(child)
            if order is None or is_placeless(kind, child_path, self._hidden):
                self._known[child_path] = None, parent
            else:
                local, is_reset = _composed(child, order)
                world = local if is_reset or parent is IDENTITY else multiply(local, parent)
                self._known[child_path] = local, world
            path = child_path
        return self._known[path]

    def world(self, prim: Usd.Prim) -> Matrix:
        """Return the world transform of a prim."""
        return self.of(prim, str(Usd.Prim.GetPath(prim)))[1]


def is_placeless(kind: str, path: str, hidden: Iterable[str]) -> bool:
    """Whether a prim of a type has the pose of its parent, because the type is not Xformable.

    False for a prim whose type a missing asset may define; assets are missing below `hidden` prims.
    """
    if _is_xformable(kind):
        return False
    return bool(kind) or not any(is_at_or_below(path, top) for top in hidden)


@lru_cache(maxsize=1024)
def _is_xformable(kind: str) -> bool:
    """Whether prims of a type have a place; those of types that usd-core does not know have."""
    schema = Usd.SchemaRegistry.GetTypeFromSchemaTypeName(kind) if kind else None
    if schema is None:
        return False
    return bool(schema.isUnknown or schema.IsA(Tf.Type.FindByName("UsdGeomXformable")))


def local_transform(prim: Usd.Prim) -> tuple[Matrix, bool]:
    """Return the local matrix, and whether it leaves the parent's transform out."""
    return _composed(prim, authored_data(prim, ORDER))


def _composed(prim: Usd.Prim, order: Any) -> tuple[Matrix, bool]:
    """Compose the operations of a prim.

    One without a value, or of a kind that USD does not have, moves nothing.
    """
    matrix, is_reset = IDENTITY, False
    for name in _names(order):
        if name == RESET:
            matrix, is_reset = IDENTITY, True
            continue
        attribute, make, is_inverted = _parsed(name)
        operation = None if make is None else _operation(prim, attribute, make)
        if operation is None or operation is IDENTITY:
            continue
        if is_inverted:
            operation = _matrix(Gf.Matrix4d(*operation).GetInverse())
        matrix = operation if matrix is IDENTITY else multiply(operation, matrix)
    return matrix, is_reset


def _names(order: Any) -> Sequence[str]:
    """Return the operations of an order, most often those that Isaac Sim writes."""
    if not isinstance(order, Vt.TokenArray):
        return ()
    if order == _USUAL_ORDER:
        return _USUAL
    # Iterating over a Vt type is five times as slow as asking for its elements.
    return [order[index] for index in range(len(order))]


@lru_cache(maxsize=1024)
def _parsed(name: str) -> tuple[str, _Maker | None, bool]:
    """Return the attribute of an operation, what makes a matrix of it, and whether inverted."""
    attribute = name.removeprefix(_INVERSE)
    kind = attribute.split(":")[1] if ":" in attribute else ""
    return attribute, _MAKERS.get(kind), attribute != name


def _operation(prim: Usd.Prim, attribute: str, make: _Maker) -> Matrix | None:
    value = Usd.Attribute.Get(Usd.Prim.GetAttribute(prim, attribute))
    try:
        return None if value is None else make(value)
    except (TypeError, ValueError, AttributeError):  # not what the operation takes
        return None


def _translation(value: Any) -> Matrix:
    x, y, z = _vector(value)
    if not (x or y or z):
        return IDENTITY
    return (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0)


def _scaling(value: Any) -> Matrix:
    x, y, z = _vector(value)
    if x == y == z == 1.0:
        return IDENTITY
    return (x, 0.0, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, 0.0, z, 0.0, 0.0, 0.0, 0.0, 1.0)


def _vector(value: Any) -> tuple[float, float, float]:
    x, y, z = elements(value)
    return _number(x), y, z  # which are of one type


def _number(value: Any) -> float:
    if type(value) is float:
        return value
    raise TypeError(value)  # UsdGeom takes no whole numbers either


def _orientation(value: Any) -> Matrix:
    """Return the rotation of a quaternion.

    As in Gf, the imaginary part gives the axis and the real part the angle, whatever the length.
    """
    x, y, z = _vector(value.imaginary)
    length = math.sqrt(x * x + y * y + z * z)
    if length <= _SHORTEST:
        return IDENTITY
    w = max(-1.0, min(1.0, float(value.real)))
    part = math.sqrt(1.0 - w * w) / length
    x, y, z = x * part, y * part, z * part
    return (
        *(1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (z * x - y * w), 0.0),
        *(2 * (x * y - z * w), 1 - 2 * (z * z + x * x), 2 * (y * z + x * w), 0.0),
        *(2 * (z * x + y * w), 2 * (y * z - x * w), 1 - 2 * (y * y + x * x), 0.0),
        *(0.0, 0.0, 0.0, 1.0),
    )


def _matrix(value: Any) -> Matrix:
    return _SIXTEEN.unpack(Gf.Matrix4d(value))


def _turn(axis: str, degrees: float) -> Matrix:
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    matrix = [*IDENTITY]
    row, column = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    matrix[5 * row] = matrix[5 * column] = cosine
    matrix[4 * row + column], matrix[4 * column + row] = sine, -sine
    return tuple(matrix)


def _about(axis: str) -> _Maker:
    return lambda degrees: _turn(axis, _number(degrees))


def _turns(order: str) -> _Maker:
    """Return the maker of three turns; the first letter turns first."""

    def make(value: Any) -> Matrix:
        degrees = _vector(value)
        first, second, third = (_turn(axis, degrees["XYZ".index(axis)]) for axis in order)
        return multiply(multiply(first, second), third)

    return make


def _along(axis: str, make: _Maker, rest: float) -> _Maker:
    """Return the maker of an operation on one axis; the others keep `rest`."""
    index = "XYZ".index(axis)

    def make_one(value: Any) -> Matrix:
        parts = [rest, rest, rest]
        parts[index] = _number(value)
        return make(Gf.Vec3d(*parts))

    return make_one


_MAKERS: dict[str, _Maker] = {
    "translate": _translation,
    "scale": _scaling,
    "orient": _orientation,
    "transform": _matrix,
    **{f"translate{axis}": _along(axis, _translation, 0.0) for axis in "XYZ"},
    **{f"scale{axis}": _along(axis, _scaling, 1.0) for axis in "XYZ"},
    **{f"rotate{axis}": _about(axis) for axis in "XYZ"},
    **{f"rotate{order}": _turns(order) for order in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")},
}
