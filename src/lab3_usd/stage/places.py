"""Where prims stand: local and world transforms, for types that usd-core does not know as well."""

from __future__ import annotations

from pxr import Gf, Usd

from lab3_usd.check.model import Matrix
from lab3_usd.stage.transforms import ORDER, local_transform

_IDENTITY = Gf.Matrix4d(1.0)


class Places:
    """Composes transforms down the namespace, each once.

    `UsdGeom.XformCache` skips prims whose type usd-core does not know, an OmniLidar among them;
    their own operations are read all the same here.
    """

    def __init__(self) -> None:
        """Start with nothing known but the root."""
        self._worlds = {"/": (_IDENTITY, _numbers(_IDENTITY))}

    def of(self, prim: Usd.Prim, path: str) -> tuple[Matrix | None, Matrix]:
        """Return the local transform (None where none is authored) and the world transform.

        Every Xform has the order of its operations by its schema; only one that a layer states
        says where the prim stands.
        """
        parent = self._above(prim, path.rpartition("/")[0] or "/")
        if not prim.GetAttribute(ORDER).HasAuthoredValue():
            self._worlds[path] = parent
            return None, parent[1]
        local, is_reset = local_transform(prim)
        world = local if is_reset else local * parent[0]
        numbers = _numbers(world)
        self._worlds[path] = (world, numbers)
        return _numbers(local), numbers

    def world(self, prim: Usd.Prim) -> Gf.Matrix4d:
        """Return the world transform of a prim that was met before, else compute it."""
        path = str(prim.GetPath())
        if path not in self._worlds:
            self.of(prim, path)
        return self._worlds[path][0]

    def _above(self, prim: Usd.Prim, path: str) -> tuple[Gf.Matrix4d, Matrix]:
        if path not in self._worlds:
            self.of(prim.GetParent(), path)
        return self._worlds[path]


def _numbers(matrix: Gf.Matrix4d) -> Matrix:
    # Iterating over a Gf type is twenty times as slow as asking for its elements.
    a, b, c, d = matrix.GetRow(0), matrix.GetRow(1), matrix.GetRow(2), matrix.GetRow(3)
    return (
        *(a[0], a[1], a[2], a[3]),
        *(b[0], b[1], b[2], b[3]),
        *(c[0], c[1], c[2], c[3]),
        *(d[0], d[1], d[2], d[3]),
    )
