"""Where boxes stand that the file does not hold: near the nodes they belong to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec.structs import replace

from lab3_usd.report.picture_model import Box, Curve, Point

ASIDE = 80.0
ABOVE = 26.0


def settled(
    boxes: Sequence[Box], curves: Sequence[Curve], home: Mapping[str, Point], live: frozenset[str]
) -> tuple[Box, ...]:
    """Give the boxes without a place of their own one beside those that have it.

    A missing node stands to its neighbours as at `home`, its place and theirs in the spec; the
    end of a dead wire stands left of where that wire arrives. Where most live boxes have no place
    (they were made by a script) none gets one.
    """
    places = {box.key: box for box in boxes if box.key in live and box.at is not None}
    if 2 * len(places) < len(live):
        return tuple(replace(box, at=None) for box in boxes)
    for box in boxes:
        if box.key not in places and places:
            wish = _wish(box, curves, places, home)
            places[box.key] = _lowered(replace(box, at=wish), list(places.values()))
    return tuple(places.get(box.key, box) for box in boxes)


def _wish(
    box: Box, curves: Sequence[Curve], places: Mapping[str, Box], home: Mapping[str, Point]
) -> Point:
    if box.key in home:
        near = [key for key in _neighbours(box, curves) if key in places and key in home]
        near = near or [key for key in places if key in home]
        moves = [_move(home[key], places[key]) for key in near]
        if moves:
            return (
                home[box.key][0] + sum(move[0] for move in moves) / len(moves),
                home[box.key][1] + sum(move[1] for move in moves) / len(moves),
            )
    near = [key for key in _neighbours(box, curves) if key in places] or list(places)
    left, top = places[near[0]].at or (0.0, 0.0)
    return (left - box.w - ASIDE, top)


def _neighbours(box: Box, curves: Sequence[Curve]) -> Iterator[str]:
    for curve in curves:
        if curve.source.key == box.key:
            yield curve.target.key
        elif curve.target.key == box.key:
            yield curve.source.key


def _move(home: Point, place: Box) -> Point:
    left, top = place.at or home
    return (left - home[0], top - home[1])


def _lowered(box: Box, others: Sequence[Box]) -> Box:
    """Return the box moved down until it meets no other."""
    left, top = box.at or (0.0, 0.0)
    for other in sorted(others, key=lambda one: (one.at or (0.0, 0.0))[1]):
        x, y = other.at or (0.0, 0.0)
        beside = left < x + other.w + ABOVE and x < left + box.w + ABOVE
        if beside and top < y + other.h + ABOVE and y < top + box.h + ABOVE:
            top = y + other.h + ABOVE
    return replace(box, at=(left, top))
