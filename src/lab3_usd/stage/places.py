"""Where prims stand: local and world transforms, for types that usd-core does not know as well."""

from __future__ import annotations

from pxr import Gf, Usd, UsdGeom

from lab3_usd.check.model import Matrix

_ORDER = "xformOpOrder"
_IDENTITY = Gf.Matrix4d(1.0)


class Places:
    """Composes transforms down the namespace, each once.

    `UsdGeom.XformCache` skips prims whose type usd-core does not know, an OmniLidar among them;
    their own operations are read all the same here.
    """

    def __init__(self) -> None:
        """Start with nothing known but the root."""
        self._worlds: dict[str, Gf.Matrix4d] = {"/": _IDENTITY}

    def of(self, prim: Usd.Prim) -> tuple[Matrix | None, Matrix]:
        """Return the local transform (None where the prim has none) and the world transform."""
        path = str(prim.GetPath())
        parent = self._worlds.get(path.rpartition("/")[0] or "/", _IDENTITY)
        if not prim.HasAttribute(_ORDER):
            self._worlds[path] = parent
            return None, _numbers(parent)
        xformable = UsdGeom.Xformable(prim)
        local = xformable.GetLocalTransformation()
        world = local if xformable.GetResetXformStack() else local * parent
        self._worlds[path] = world
        return _numbers(local), _numbers(world)

    def world(self, prim: Usd.Prim) -> Gf.Matrix4d:
        """Return the world transform of a prim that was met before, else compute it."""
        path = str(prim.GetPath())
        if path not in self._worlds:
            parent = prim.GetParent()
            if parent and not parent.IsPseudoRoot():
                self.world(parent)
            self.of(prim)
        return self._worlds[path]


def _numbers(matrix: Gf.Matrix4d) -> Matrix:
    return tuple(value for row in matrix for value in row)
