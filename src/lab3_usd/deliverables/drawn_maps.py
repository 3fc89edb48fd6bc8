"""Occupancy maps drawn from segments, as a robot with a lidar would see the walls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from msgspec import Struct

from lab3_usd.deliverables.maps import FREE, OCCUPIED, UNKNOWN, Grid
from lab3_usd.errors import UsageError

Point = tuple[float, float]
# Arithmetic noise must not decide on which side of a cell's edge a wall stands.
_DIGITS = 6


class MapFrame(Struct, frozen=True):
    """Where a map lies: the world's place of its lower left corner, in metres, and its cells."""

    resolution: float
    origin: Point
    width: int
    height: int

    def to_cells(self, point: Point) -> Point:
        """Return a point of the world in cells from the lower left corner."""
        x, y = (
            round((value - start) / self.resolution, _DIGITS)
            for value, start in zip(point, self.origin, strict=True)
        )
        return (x, y)


class DrawnMap(Struct, frozen=True):
    """A map, and whether walls keep its free space from the edge."""

    grid: Grid
    closed: bool


def draw_map(frame: MapFrame, segments: Sequence[tuple[Point, Point]], start: Point) -> DrawnMap:
    """Draw the cells that the robot reaches as free and the walls around them as occupied.

    The rest is unknown: a lidar sees neither the inside nor the back of a wall. The robot goes
    from cell to cell over edges, not corners; a wall beside a free cell's corner is seen.

    Raises:
        UsageError: `start` lies outside the map or on a wall.
    """
    cells = bytearray([UNKNOWN]) * (frame.width * frame.height)
    for begin, end in segments:
        for column, row in _touched(frame, frame.to_cells(begin), frame.to_cells(end)):
            cells[row * frame.width + column] = OCCUPIED
    column, row = (math.floor(value) for value in frame.to_cells(start))
    if not (0 <= column < frame.width and 0 <= row < frame.height):
        raise UsageError(f"the start {start} is outside the map, give --start or another frame")
    if cells[row * frame.width + column] == OCCUPIED:
        raise UsageError(f"the start {start} is on a wall, give --start")
    _flood(cells, frame.width, row * frame.width + column)
    _forget_unseen(cells, frame.width)
    rows = [cells[at : at + frame.width] for at in range(0, len(cells), frame.width)]
    edge = rows[0] + rows[-1] + bytes(row[0] for row in rows) + bytes(row[-1] for row in rows)
    grid = Grid(frame.width, frame.height, b"".join(bytes(row) for row in reversed(rows)))
    return DrawnMap(grid, closed=FREE not in edge)


def _touched(frame: MapFrame, begin: Point, end: Point) -> Iterator[tuple[int, int]]:
    """Yield (column, row from below) of every cell that a segment passes through."""
    (x0, y0), (x1, y1) = sorted((begin, end))
    for column in range(max(0, math.floor(x0)), min(frame.width - 1, math.floor(x1)) + 1):
        if x1 == x0:
            low, high = y0, y1
        else:
            slope = (y1 - y0) / (x1 - x0)
            at_left = y0 + slope * (max(column, x0) - x0)
            at_right = y0 + slope * (min(column + 1, x1) - x0)
            low, high = sorted((at_left, at_right))
        first, last = max(0, _floor(low)), min(frame.height - 1, _floor(high))
        yield from ((column, row) for row in range(first, last + 1))


def _floor(value: float) -> int:
    return math.floor(round(value, _DIGITS))


def _flood(cells: bytearray, width: int, start: int) -> None:
    """Turn the unknown cells that hang together with `start` into free ones, run by run."""
    waiting = [start]
    while waiting:
        cell = waiting.pop()
        if cells[cell] != UNKNOWN:
            continue
        row = cell - cell % width
        left = cells.rfind(OCCUPIED, row, cell) + 1 or row
        right = cells.find(OCCUPIED, cell, row + width)
        right = row + width if right < 0 else right
        cells[left:right] = bytes([FREE]) * (right - left)
        for neighbours in (left - width, left + width):
            if 0 <= neighbours < len(cells):
                waiting.extend(_runs(cells, neighbours, neighbours + right - left))


def _runs(cells: bytearray, begin: int, end: int) -> Iterator[int]:
    """Yield one cell of each unknown run between two cells of a row."""
    while (cell := cells.find(UNKNOWN, begin, end)) >= 0:
        yield cell
        begin = cells.find(OCCUPIED, cell, end)
        if begin < 0:
            return


def _forget_unseen(cells: bytearray, width: int) -> None:
    """Turn the occupied cells without a free neighbour into unknown ones."""
    free = bytes([FREE])
    cell = cells.find(OCCUPIED)
    while cell >= 0:
        row = cell - cell % width
        left, right = max(row, cell - 1), min(row + width, cell + 2)
        # The rows below and above; slices beyond the first and last row are empty.
        near = [cells[max(0, left + step) : max(0, right + step)] for step in (-width, 0, width)]
        if not any(free in part for part in near):
            cells[cell] = UNKNOWN
        cell = cells.find(OCCUPIED, cell + 1)
