"""What a prim goes with: the base, a link or the world, and where it is with that."""

from __future__ import annotations

from functools import cached_property

from msgspec import Struct

from lab3_usd.model.dry_run import Affine
from lab3_usd.physics.machine import Machine, Posture


class Spot(Struct, frozen=True, dict=True):
    """A prim, and where it is in the frame of the body that it goes with, or in the world."""

    path: str
    body: str
    machine: Machine | None
    local: Affine

    @property
    def base(self) -> str:
        """The base of what it goes with; '' for the world."""
        return "" if self.machine is None else self.machine.base

    def posture(self) -> Posture | None:
        """Return how what it goes with stands now; None where it goes with nothing."""
        return None if self.machine is None else self.machine.posture()

    def place(self, posture: Posture | None) -> Affine:
        """Return where it is when what it goes with stands so."""
        if posture is None:
            return self.local
        stored = posture.known.get(self.path)
        if stored is None:
            stored = posture.known[self.path] = self._place(posture)
        return stored

    def _place(self, posture: Posture) -> Affine:
        if self.path == posture.machine.base:
            return posture.base
        offset = posture.offset(self.body)
        return posture.base.then(offset if self.path == self.body else offset.then(self.local))

    def back(self, posture: Posture | None) -> Affine:
        """Return the way from the world into its frame when what it goes with stands so."""
        if posture is None:
            return self._back
        stored = posture.backs.get(self.path)
        if stored is None:
            stored = posture.backs[self.path] = self.place(posture).inverse()
        return stored

    @cached_property
    def _back(self) -> Affine:
        return self.local.inverse()
