"""The local and world transforms of prims, out of their own operations.

They equal those of `UsdGeom.Xformable`, also for types unknown to usd-core. UsdGeom's Python
classes, which take half as long to load as a stage takes to check, are loaded for operations alone
that Isaac Sim does not write. Matrices are plain tuples: converting one of Gf's takes longer than
composing two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache
from struct import Struct
from typing import Any

from pxr import Tf, Usd, Vt

from lab3_usd.model.prims import Matrix, is_at_or_below
from lab3_usd.model.transforms import IDENTITY, multiply
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.properties import authored_data, elements

ORDER = "xformOpOrder"
RESET = "!resetXformStack!"
_INVERSE = "!invert!"
_SIXTEEN = Struct("16d")
_SHORTEST = 1e-10  # length of an axis that is one, as in Gf


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

    One without a value, or of a kind that USD does not have, moves nothing. Most stages have those
    alone that Isaac Sim writes, and do not load UsdGeom.
    """
    if not isinstance(order, Vt.TokenArray):
        return IDENTITY, False
    # Iterating over a Vt type is five times as slow as asking for its elements.
    names = [order[index] for index in range(len(order))]
    if not all(name in _USUAL for name in names):
        return _composed_by_usdgeom(prim, names)
    matrix = IDENTITY
    for name in names:
        value = Usd.Attribute.Get(Usd.Prim.GetAttribute(prim, name))
        try:
            operation = IDENTITY if value is None else _USUAL[name](value)
        except (TypeError, ValueError, AttributeError):  # not what the operation takes
            continue
        if operation is not IDENTITY:
            matrix = operation if matrix is IDENTITY else multiply(operation, matrix)
    return matrix, False


@quiet()  # UsdGeom warns of names that are no operations
def _composed_by_usdgeom(prim: Usd.Prim, names: Iterable[str]) -> tuple[Matrix, bool]:
    """Compose operations of any kind, without those that UsdGeom refuses.

    They are asked for one by one: of all at once it gives none where it refuses one.
    """
    from pxr import UsdGeom

    matrix, is_reset = IDENTITY, False
    for name in names:
        if name == RESET:
            matrix, is_reset = IDENTITY, True
            continue
        with suppress(Tf.ErrorException):
            attribute = prim.GetAttribute(name.removeprefix(_INVERSE))
            if attribute:
                operation = UsdGeom.XformOp(attribute, isInverseOp=name.startswith(_INVERSE))
                numbers = operation.GetOpTransform(Usd.TimeCode.Default())
                matrix = multiply(_SIXTEEN.unpack(numbers), matrix)
    return matrix, is_reset


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


# The operations that Isaac Sim writes.
_USUAL: dict[str, Callable[[Any], Matrix]] = {
    "xformOp:translate": _translation,
    "xformOp:orient": _orientation,
    "xformOp:scale": _scaling,
}
