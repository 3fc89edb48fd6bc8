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
        self._places: dict[str, tuple[Matrix | None, Matrix]] = {"/": (None, IDENTITY)}

    def of(self, prim: Usd.Prim, path: str) -> tuple[Matrix | None, Matrix]:
        """Return the local transform (None where none is authored) and the world transform.

        Every Xform has the order of its operations by its schema; only one that a layer states
        says where the prim stands.
        """
        ahead = []
        while path not in self._places:
            ahead.append((prim, path))
            prim, path = prim.GetParent(), path.rpartition("/")[0] or "/"
        for each, place in reversed(ahead):
            self._places[place] = self._place(each, self._places[path][1])
            path = place
        return self._places[path]

    def world(self, prim: Usd.Prim) -> Matrix:
        """Return the world transform of a prim."""
        return self.of(prim, str(prim.GetPath()))[1]

    def _place(self, prim: Usd.Prim, parent: Matrix) -> tuple[Matrix | None, Matrix]:
        if not prim.GetAttribute(ORDER).HasAuthoredValue():
            return None, parent
        local, is_reset = local_transform(prim)
        return local, local if is_reset else multiply(local, parent)
