"""The order of boxes and passing wires in each column, with few crossings."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Mapping, Sequence

from msgspec import Struct

SWEEPS = 16
MANY = 1000  # more slots are ordered in less time
SlotKey = tuple[str, ...]
Columns = tuple[tuple["Slot", ...], ...]


class Slot(Struct, frozen=True):
    """A box in a column, or the lane of a wire that passes the column."""

    key: SlotKey
    rank: int
    height: float
    lane: bool = False


class Link(Struct, frozen=True):
    """A piece of wire from one column to the next; heights are from the top of each slot."""

    left: SlotKey
    left_height: float
    right: SlotKey
    right_height: float


def ordered(slots: Sequence[Slot], links: Sequence[Link]) -> Columns:
    """Return the columns from left to right, each from top to bottom."""
    count = max((slot.rank for slot in slots), default=-1) + 1
    columns: Columns = tuple(
        tuple(slot for slot in slots if slot.rank == rank) for rank in range(count)
    )
    best, fewest = columns, crossings(columns, links)
    for sweep in range(SWEEPS if len(slots) <= MANY else 2):
        columns = _swept(columns, links, rightward=sweep % 2 == 0)
        now = crossings(columns, links)
        if now < fewest:
            best, fewest = columns, now
    return best


def crossings(columns: Columns, links: Sequence[Link]) -> int:
    """Count the crossings of links between neighbouring columns."""
    heights = _heights(columns)
    rank = {slot.key: slot.rank for column in columns for slot in column}
    ends: dict[int, list[tuple[float, float]]] = {}
    for link in links:
        start = heights[link.left] + link.left_height
        end = heights[link.right] + link.right_height
        ends.setdefault(rank[link.left], []).append((start, end))
    return sum(_inversions(sorted(pairs)) for pairs in ends.values())


def _inversions(pairs: Sequence[tuple[float, float]]) -> int:
    seen: list[float] = []
    count = 0
    for _, end in pairs:
        count += len(seen) - bisect_right(seen, end)
        insort(seen, end)
    return count


def _heights(columns: Columns) -> dict[SlotKey, float]:
    """Return where each slot would stand if every column were packed tight around one line."""
    heights: dict[SlotKey, float] = {}
    for column in columns:
        heights.update(_packed(column))
    return heights


def _packed(column: Sequence[Slot]) -> dict[SlotKey, float]:
    heights = {}
    top = -sum(slot.height for slot in column) / 2
    for slot in column:
        heights[slot.key] = top
        top += slot.height
    return heights


def _swept(columns: Columns, links: Sequence[Link], *, rightward: bool) -> Columns:
    result = list(columns)
    order = range(1, len(columns)) if rightward else range(len(columns) - 2, -1, -1)
    pulls = _pulls(links, rightward=rightward)
    heights = _heights(columns)
    for rank in order:
        wishes = {slot.key: _wish(slot, pulls, heights) for slot in result[rank]}
        result[rank] = tuple(sorted(result[rank], key=lambda slot: wishes[slot.key]))
        heights.update(_packed(result[rank]))
    return tuple(result)


Pulls = Mapping[SlotKey, Sequence[tuple[SlotKey, float, float]]]


def _pulls(links: Sequence[Link], *, rightward: bool) -> Pulls:
    pulls: dict[SlotKey, list[tuple[SlotKey, float, float]]] = {}
    for link in links:
        if rightward:
            pull = (link.left, link.left_height, link.right_height)
            pulls.setdefault(link.right, []).append(pull)
        else:
            pull = (link.right, link.right_height, link.left_height)
            pulls.setdefault(link.left, []).append(pull)
    return pulls


def _wish(slot: Slot, pulls: Pulls, heights: Mapping[SlotKey, float]) -> float:
    """Return where the middle of the slot would have to be for its wires to run straight."""
    here = heights[slot.key] + slot.height / 2
    wishes = [
        heights[other] + there - own + slot.height / 2
        for other, there, own in pulls.get(slot.key, ())
    ]
    return sum(wishes) / len(wishes) if wishes else here
