"""An occupancy map in localization, and how well a scan fits it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

from msgspec import Struct

Cell = tuple[int, int]  # column, row from below


class OccupancyMap(Struct, frozen=True):
    """The walls of a map: `origin` is the place of its lower left corner, in metres and radians.

    `given` maps belong to what is judged; the lab's own may be of another room.
    """

    name: str
    resolution: float
    origin: tuple[float, float, float]
    width: int
    height: int
    walls: frozenset[Cell]
    given: bool = True

    def cell(self, x: float, y: float) -> Cell:
        """Return the cell of a point of the map's frame; it may lie outside."""
        return self.cells()(x, y)

    def cells(self) -> Callable[[float, float], Cell]:
        """Return what gives the cells of many points."""
        left, bottom, turn = self.origin
        c, s, size, floor = math.cos(turn), math.sin(turn), self.resolution, math.floor

        def cell(x: float, y: float) -> Cell:
            x, y = x - left, y - bottom
            return floor((c * x + s * y) / size), floor((c * y - s * x) / size)

        return cell

    def point(self, column: float, row: float) -> tuple[float, float]:
        """Return the place of a corner of cells in the map's frame."""
        left, bottom, turn = self.origin
        c, s = math.cos(turn) * self.resolution, math.sin(turn) * self.resolution
        return (left + c * column - s * row, bottom + s * column + c * row)

    def walls_within(self, cells: int) -> frozenset[Cell]:
        """Return the cells that are no further than so many from a wall, diagonals included."""
        return cells_within(self.walls, cells)


@lru_cache(maxsize=4)
def cells_within(walls: frozenset[Cell], cells: int) -> frozenset[Cell]:
    """Return the cells around walls; the runs of a class are laid on one map."""
    steps = range(-cells, cells + 1)
    beside = {(u + i, v) for u, v in walls for i in steps}
    return frozenset({(u, v + j) for u, v in beside for j in steps})


class MapFit(Struct, frozen=True):
    """How well a scan fits a map.

    Of `count` points the share `near` lies at a wall, and the share `through` has a wall before it.
    The share `unmet` of all rays returns nothing, although the map has a wall in their range.
    The share `shifted` would lie at one if the map were moved by `shift`. `ends` are points of the
    scan in the map's frame, each with whether it lies at a wall. What is not `sure` may be the map
    of another room.
    """

    map: OccupancyMap
    count: int
    near: float
    through: float
    ends: tuple[tuple[float, float, bool], ...]
    shift: tuple[float, float] | None = None
    shifted: float = 0.0
    unmet: float = 0.0
    sure: bool = True

    @property
    def text(self) -> str:
        """How many points of the scan lie at walls."""
        return f"{self.near:.0%} of {self.count} points of the scan lie at walls of {self.map.name}"
