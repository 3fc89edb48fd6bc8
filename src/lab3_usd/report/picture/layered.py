"""A layered layout.

Boxes in columns, few crossings, straight wires, wires only where no box stands.

A wire that skips columns gets a lane of its own through each of them, so it cannot cross a box;
a wire that runs backward passes below all boxes.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterator, Mapping, Sequence
from graphlib import TopologicalSorter

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.report.picture.model import Box, Curve, End, Point, port_height, port_point
from lab3_usd.report.picture.routing import around, through

Edge = tuple[str, str]


def backward(keys: Sequence[str], edges: Sequence[Edge]) -> frozenset[int]:
    """Return the places in `edges` of those that close a cycle, seen from the first keys."""
    outgoing: dict[str, list[int]] = {key: [] for key in keys}
    for place, (source, _) in enumerate(edges):
        outgoing[source].append(place)
    closing: set[int] = set()
    done: set[str] = set()
    for start in keys:
        if start in done:
            continue
        # An own stack instead of recursion: a damaged file may hold a chain of thousands of nodes.
        open_keys = {start}
        stack = [(start, iter(outgoing[start]))]
        while stack:
            key, places = stack[-1]
            following = next(places, None)
            if following is None:
                stack.pop()
                open_keys.discard(key)
                done.add(key)
                continue
            target = edges[following][1]
            if target in open_keys:
                closing.add(following)
            elif target not in done:
                open_keys.add(target)
                stack.append((target, iter(outgoing[target])))
    return frozenset(closing)


def ranks(keys: Sequence[str], edges: Sequence[Edge]) -> dict[str, int]:
    """Return the column of each key, from 0; `edges` form no cycle and always lead rightward.

    To keep wires short, a box that feeds others is directly before the first of them, and one that
    feeds none is as far left as possible.
    """
    following: dict[str, list[str]] = {key: [] for key in keys}
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(keys, ()))
    for source, target in edges:
        sorter.add(target, source)
        following[source].append(target)
    rank: dict[str, int] = {}
    sorter.prepare()
    column = 0
    while sorter.is_active():
        # The keys that nothing feeds, then those that only these feed, and so on.
        ready = sorter.get_ready()
        rank.update(dict.fromkeys(ready, column))
        sorter.done(*ready)
        column += 1
    for key in reversed(rank):
        if following[key]:
            rank[key] = min(rank[target] for target in following[key]) - 1
    first = min(rank.values(), default=0)
    return {key: rank[key] - first for key in keys}


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


class WirePiece(Struct, frozen=True):
    """A piece of wire from one column to the next; heights are from the top of each slot."""

    left: SlotKey
    left_height: float
    right: SlotKey
    right_height: float


def ordered_columns(slots: Sequence[Slot], links: Sequence[WirePiece]) -> Columns:
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


def crossings(columns: Columns, links: Sequence[WirePiece]) -> int:
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


def _swept(columns: Columns, links: Sequence[WirePiece], *, rightward: bool) -> Columns:
    """Return the columns, each sorted so that the wires from the one before run straight."""
    pulls: dict[SlotKey, list[tuple[SlotKey, float, float]]] = {}
    for link in links:
        if rightward:
            pull = (link.left, link.left_height, link.right_height)
            pulls.setdefault(link.right, []).append(pull)
        else:
            pull = (link.right, link.right_height, link.left_height)
            pulls.setdefault(link.left, []).append(pull)
    sorted_columns = list(columns)
    heights = _heights(columns)
    order = range(1, len(columns)) if rightward else range(len(columns) - 2, -1, -1)
    for rank in order:
        wishes: dict[SlotKey, float] = {}
        for slot in sorted_columns[rank]:
            # Where the middle of the slot would have to be for its wires to run straight.
            middles = [
                heights[neighbour] + leaving - arriving + slot.height / 2
                for neighbour, leaving, arriving in pulls.get(slot.key, ())
            ]
            wishes[slot.key] = (
                sum(middles) / len(middles) if middles else heights[slot.key] + slot.height / 2
            )
        column = tuple(sorted(sorted_columns[rank], key=lambda slot: wishes[slot.key]))
        sorted_columns[rank] = column
        heights.update(_packed(column))
    return tuple(sorted_columns)


STACKING_SWEEPS = 12
STRAIGHT = 4.0  # how much more it matters that a passing wire runs straight
WEAK = 0.001

Wish = tuple[float, float]  # a height and how much it matters
Pull = tuple[SlotKey, float, float]


def stacked(columns: Columns, links: Sequence[WirePiece], gap: float) -> dict[SlotKey, float]:
    """Return the top of each slot; neighbours of a column stand at least `gap` apart.

    Lanes need no gap between each other.
    """
    tops: dict[SlotKey, float] = {}
    for column in columns:
        top = 0.0
        for slot in column:
            tops[slot.key] = top
            top += slot.height + gap
    pulls = _stacking_pulls(columns, links)
    for sweep in range(STACKING_SWEEPS):
        order = columns if sweep % 2 == 0 else tuple(reversed(columns))
        for column in order:
            wishes = {
                slot.key: [
                    *(
                        (tops[end] + lower, weight)
                        for end, lower, weight in pulls.get(slot.key, ())
                    ),
                    (tops[slot.key], WEAK),  # a slot that nothing pulls stays where it is
                ]
                for slot in column
            }
            tops.update(_settled(column, wishes, gap))
    lowest = min(tops.values(), default=0.0)
    return {key: float(round(top - lowest)) for key, top in tops.items()}


def _stacking_pulls(
    columns: Columns, links: Sequence[WirePiece]
) -> Mapping[SlotKey, Sequence[Pull]]:
    """Return, per slot, what it is wired to: that slot, how much lower it stands, the weight."""
    lanes = {slot.key for column in columns for slot in column if slot.lane}
    pulls: dict[SlotKey, list[Pull]] = {}
    for link in links:
        weight = 1.0 + STRAIGHT * ((link.left in lanes) + (link.right in lanes))
        lower = link.left_height - link.right_height
        pulls.setdefault(link.right, []).append((link.left, lower, weight))
        pulls.setdefault(link.left, []).append((link.right, -lower, weight))
    return pulls


def _settled(
    column: Sequence[Slot], wishes: Mapping[SlotKey, Sequence[Wish]], gap: float
) -> dict[SlotKey, float]:
    """Return the tops that come nearest to the wishes (least squares) without an overlap.

    Slots that would overlap are joined to a block that moves as one.
    """
    offsets = _offsets(column, gap)
    blocks: list[tuple[float, float, int]] = []  # weighted sum, weight, number of slots
    for slot, offset in zip(column, offsets, strict=True):
        slot_wishes = wishes[slot.key]
        weight = sum(weight for _, weight in slot_wishes)
        blocks.append((sum((height - offset) * pull for height, pull in slot_wishes), weight, 1))
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
        both_lanes = slot.lane and following is not None and following.lane
        top += slot.height + (0.0 if both_lanes else gap)
    return offsets


GAP = 26.0  # between two boxes of a column
LANE = 12.0  # the height that a passing wire takes up in a column
BETWEEN = 70.0  # between two columns, and a little more for every wire there
PER_WIRE = 4.0
MOST_BETWEEN = 156.0
BELOW = 34.0  # from the lowest box to the first wire that runs backward
BULGE = 26.0

Placed = tuple[tuple[Box, ...], tuple[Curve, ...]]


def layered(boxes: Sequence[Box], curves: Sequence[Curve]) -> Placed:
    """Return the boxes at their places and the curves with their paths; the highest is at 0."""
    by_key = {box.key: box for box in boxes}
    edges = [(curve.source.key, curve.target.key) for curve in curves]
    against = backward([*by_key], edges)
    rank = ranks([*by_key], [edge for place, edge in enumerate(edges) if place not in against])
    onward = [curve for place, curve in enumerate(curves) if place not in against]
    lasts: dict[End, int] = {}  # the column of the farthest box that each output feeds
    for curve in onward:
        lasts[curve.source] = max(rank[curve.target.key], lasts.get(curve.source, 0))
    slots = [Slot((key,), rank[key], box.h) for key, box in by_key.items()]
    slots += [
        Slot(_lane(end, column), column, LANE, lane=True)
        for end, last in lasts.items()
        for column in range(rank[end.key] + 1, last)
    ]
    links = list(_links(onward, lasts, by_key, rank))
    columns = ordered_columns(slots, links)
    tops = stacked(columns, links, GAP)
    sides = _sides(columns, links, by_key)
    placed = {}
    for key, box in by_key.items():
        left, right = sides[rank[key]]
        placed[key] = replace(box, x=left, y=tops[(key,)], w=right - left)
    # The height below everything at which each output's wires run backward.
    lowest = max([0.0, *tops.values(), *(box.y + box.h for box in placed.values())])
    returning = dict.fromkeys(curves[place].source for place in sorted(against))
    lanes = {end: lowest + BELOW + LANE * number for number, end in enumerate(returning)}
    drawn = []
    for place, curve in enumerate(curves):
        start = port_point(placed[curve.source.key], curve.source.port, leaving=True)
        end = port_point(placed[curve.target.key], curve.target.port, leaving=False)
        if place in against:
            path = around(start, end, lanes[curve.source], BULGE)
        else:  # rightward from column to column, and along its lane through each
            way: list[Point] = [start]
            for column in range(rank[curve.source.key] + 1, rank[curve.target.key]):
                height = tops[_lane(curve.source, column)] + LANE / 2
                way += [(side, height) for side in sides[column]]
            path = through([*way, end])
        drawn.append(replace(curve, path=path))
    return tuple(placed[box.key] for box in boxes), tuple(drawn)


def _lane(end: End, column: int) -> SlotKey:
    return (end.key, end.port, str(column))


def _links(
    curves: Sequence[Curve],
    lasts: Mapping[End, int],
    boxes: Mapping[str, Box],
    rank: Mapping[str, int],
) -> Iterator[WirePiece]:
    """Yield the pieces of wire between neighbouring columns; lanes of one output are shared."""

    def left(end: End, column: int) -> tuple[SlotKey, float]:
        if column == rank[end.key]:
            return (end.key,), port_height(boxes[end.key], end.port)
        return _lane(end, column), LANE / 2

    for end, last in lasts.items():
        for column in range(rank[end.key] + 1, last):
            yield WirePiece(*left(end, column - 1), _lane(end, column), LANE / 2)
    for curve in curves:
        target = curve.target
        arriving = port_height(boxes[target.key], target.port)
        yield WirePiece(*left(curve.source, rank[target.key] - 1), (target.key,), arriving)


def _sides(
    columns: Columns, links: Sequence[WirePiece], boxes: Mapping[str, Box]
) -> list[tuple[float, float]]:
    """Return the left and the right edge of each column."""
    crowd = [0] * len(columns)
    home = {slot.key: slot.rank for column in columns for slot in column}
    for link in links:
        crowd[home[link.left]] += 1
    sides = []
    left = 0.0
    for column, wires in zip(columns, crowd, strict=True):
        widths = (boxes[slot.key[0]].w for slot in column if not slot.lane)
        right = left + max(widths, default=0.0)
        sides.append((left, right))
        left = right + min(BETWEEN + PER_WIRE * wires, MOST_BETWEEN)
    return sides
