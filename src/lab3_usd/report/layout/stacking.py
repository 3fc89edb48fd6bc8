"""Vertical positions of boxes and lanes: straight wires, no overlap, the order kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lab3_usd.report.layout.ordering import Columns, Link, Slot, SlotKey

SWEEPS = 12
STRAIGHT = 4.0  # how much more it matters that a passing wire runs straight
WEAK = 0.001

Wish = tuple[float, float]  # a height and how much it matters
Pull = tuple[SlotKey, float, float]
Pulls = Mapping[SlotKey, Sequence[Pull]]


def stacked(columns: Columns, links: Sequence[Link], gap: float) -> dict[SlotKey, float]:
    """Return the top of each slot; neighbours of a column stand at least `gap` apart.

    Lanes need no gap between each other.
    """
    tops: dict[SlotKey, float] = {}
    for column in columns:
        top = 0.0
        for slot in column:
            tops[slot.key] = top
            top += slot.height + gap
    pulls = _pulls(columns, links)
    for sweep in range(SWEEPS):
        order = columns if sweep % 2 == 0 else tuple(reversed(columns))
        for column in order:
            wishes = {slot.key: _wishes(slot.key, pulls, tops) for slot in column}
            tops.update(_settled(column, wishes, gap))
    lowest = min(tops.values(), default=0.0)
    return {key: float(round(top - lowest)) for key, top in tops.items()}


def _pulls(columns: Columns, links: Sequence[Link]) -> Pulls:
    """Return, per slot, what it is wired to: that slot, how much lower it stands, the weight."""
    lanes = {slot.key for column in columns for slot in column if slot.lane}
    pulls: dict[SlotKey, list[Pull]] = {}
    for link in links:
        weight = 1.0 + STRAIGHT * ((link.left in lanes) + (link.right in lanes))
        lower = link.left_height - link.right_height
        pulls.setdefault(link.right, []).append((link.left, lower, weight))
        pulls.setdefault(link.left, []).append((link.right, -lower, weight))
    return pulls


def _wishes(key: SlotKey, pulls: Pulls, tops: Mapping[SlotKey, float]) -> list[Wish]:
    wishes = [(tops[other] + lower, weight) for other, lower, weight in pulls.get(key, ())]
    return [*wishes, (tops[key], WEAK)]  # a slot that nothing pulls stays where it is


def _settled(
    column: Sequence[Slot], wishes: Mapping[SlotKey, Sequence[Wish]], gap: float
) -> dict[SlotKey, float]:
    """Return the tops that come nearest to the wishes (least squares) without an overlap.

    Slots that would overlap are joined to a block that moves as one.
    """
    offsets = _offsets(column, gap)
    blocks: list[tuple[float, float, int]] = []  # weighted sum, weight, number of slots
    for slot, offset in zip(column, offsets, strict=True):
        asked = wishes[slot.key]
        weight = sum(weight for _, weight in asked)
        blocks.append((sum((height - offset) * pull for height, pull in asked), weight, 1))
        while len(blocks) > 1 and blocks[-1][0] * blocks[-2][1] < blocks[-2][0] * blocks[-1][1]:
            below, above = blocks.pop(), blocks.pop()
            blocks.append((above[0] + below[0], above[1] + below[1], above[2] + below[2]))
    heights = [total / weight for total, weight, count in blocks for _ in range(count)]
    return {
        slot.key: height + offset
        for slot, height, offset in zip(column, heights, offsets, strict=True)
    }


def _offsets(column: Sequence[Slot], gap: float) -> list[float]:
    offsets = []
    top = 0.0
    for number, slot in enumerate(column):
        offsets.append(top)
        following = column[number + 1] if number + 1 < len(column) else None
        both = slot.lane and following is not None and following.lane
        top += slot.height + (0.0 if both else gap)
    return offsets
