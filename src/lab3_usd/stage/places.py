"""Where prims stand: local and world transforms, for types that usd-core does not know as well."""

from __future__ import annotations

from pxr import Usd

from lab3_usd.check.model import Matrix
from lab3_usd.check.poses import IDENTITY, multiply
from lab3_usd.stage.transforms import ORDER, local_transform


class Places:
    """Composes transforms down the namespace, each once.

    `UsdGeom.XformCache` skips prims whose type usd-core does not know, an OmniLidar among them;
    their own operations are read all the same here.
    """

    def __init__(self) -> None:
        """Start with nothing known but the root."""
        self._worlds = {"/": IDENTITY}

    def of(self, prim: Usd.Prim, path: str) -> tuple[Matrix | None, Matrix]:
        """Return the local transform (None where none is authored) and the world transform.

        Every Xform has the order of its operations by its schema; only one that a layer states
        says where the prim stands.
        """
        parent = self._above(prim, path.rpartition("/")[0] or "/")
        if not prim.GetAttribute(ORDER).HasAuthoredValue():
            self._worlds[path] = parent
            return None, parent
        local, is_reset = local_transform(prim)
        world = local if is_reset else multiply(local, parent)
        self._worlds[path] = world
        return local, world

    def know(self, path: str, world: Matrix) -> None:
        """Take the world transform of a prim as it is known from before."""
        self._worlds[path] = world

    def world(self, prim: Usd.Prim) -> Matrix:
        """Return the world transform of a prim that was met before, else compute it."""
        path = str(prim.GetPath())
        if path not in self._worlds:
            self.of(prim, path)
        return self._worlds[path]

    def _above(self, prim: Usd.Prim, path: str) -> Matrix:
        if path not in self._worlds:
            self.of(prim.GetParent(), path)
        return self._worlds[path]
