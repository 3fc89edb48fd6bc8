"""Positions for boxes that the file has none for: near the nodes they are connected to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec.structs import replace

from lab3_usd.report.picture import Box, Curve, Point

ASIDE = 80.0
ABOVE = 26.0


def position_missing(
    boxes: Sequence[Box],
    curves: Sequence[Curve],
    spec_positions: Mapping[str, Point],
    present: frozenset[str],
) -> tuple[Box, ...]:
    """Return the boxes, those without a position beside those that have one.

    `spec_positions` are the positions in the spec, `present` the keys of nodes in the file. A
    missing node keeps its distance to its neighbours in the spec. The box of a dangling source is
    left of the wire's target. Where most nodes of the file have no position (a script made them),
    no box gets one.
    """
    places = {box.key: box for box in boxes if box.key in present and box.at is not None}
    if 2 * len(places) < len(present):
        return tuple(replace(box, at=None) for box in boxes)
    for box in boxes:
        if box.key not in places and places:
            wanted = _wanted_position(box, curves, places, spec_positions)
            places[box.key] = _below_others(replace(box, at=wanted), list(places.values()))
    return tuple(places.get(box.key, box) for box in boxes)


def _wanted_position(
    box: Box,
    curves: Sequence[Curve],
    places: Mapping[str, Box],
    spec_positions: Mapping[str, Point],
) -> Point:
    if box.key in spec_positions:
        near = [key for key in _neighbours(box, curves) if key in places and key in spec_positions]
        near = near or [key for key in places if key in spec_positions]
        moves = [_move(spec_positions[key], places[key]) for key in near]
        if moves:
            return (
                spec_positions[box.key][0] + sum(move[0] for move in moves) / len(moves),
                spec_positions[box.key][1] + sum(move[1] for move in moves) / len(moves),
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


def _move(spec_positions: Point, place: Box) -> Point:
    left, top = place.at or spec_positions
    return (left - spec_positions[0], top - spec_positions[1])


def _below_others(box: Box, others: Sequence[Box]) -> Box:
    """Return the box moved down until it meets no other."""
    left, top = box.at or (0.0, 0.0)
    for other in sorted(others, key=lambda one: (one.at or (0.0, 0.0))[1]):
        x, y = other.at or (0.0, 0.0)
        beside = left < x + other.w + ABOVE and x < left + box.w + ABOVE
        if beside and top < y + other.h + ABOVE and y < top + box.h + ABOVE:
            top = y + other.h + ABOVE
    return replace(box, at=(left, top))
