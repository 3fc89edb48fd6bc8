"""Boxes at their positions in the graph editor, stretched only as far as needed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.report.layout.layered import Placed
from lab3_usd.report.layout.routing import routed
from lab3_usd.report.picture import Box, Curve

ASIDE = 64.0  # room for wires between boxes that stand side by side
ABOVE = 26.0  # between boxes that stand above each other
FACTORS = tuple(1 + step / 10 for step in range(16))
MOST_BOXES = 60


def at_editor_positions(boxes: Sequence[Box], curves: Sequence[Curve]) -> Placed | None:
    """Return boxes and curves at the positions of the editor; None if that is not possible.

    Boxes may be larger than in the editor. So all positions are stretched if boxes would be too
    close; their order does not change. None if a position is unknown or a wire has no route
    around the boxes.
    """
    if len(boxes) > MOST_BOXES or any(box.at is None for box in boxes):
        return None
    placed = _apart(boxes)
    if placed is None:
        return None
    paths = routed(placed, curves)
    if paths is None:
        return None
    drawn = tuple(replace(curve, path=path) for curve, path in zip(curves, paths, strict=True))
    return placed, drawn


def _apart(boxes: Sequence[Box]) -> tuple[Box, ...] | None:
    for across, down in sorted(_stretches(), key=lambda pair: (pair[0] * pair[1], pair)):
        placed = tuple(_at(box, across, down) for box in boxes)
        if not any(_too_close(one, other) for one, other in _pairs(placed)):
            return placed
    return None


def _stretches() -> Iterator[tuple[float, float]]:
    return ((across, down) for across in FACTORS for down in FACTORS)


def _at(box: Box, across: float, down: float) -> Box:
    left, top = box.at or (0.0, 0.0)
    return replace(box, x=float(round(left * across)), y=float(round(top * down)))


def _pairs(boxes: Sequence[Box]) -> Iterator[tuple[Box, Box]]:
    for place, one in enumerate(boxes):
        for other in boxes[place + 1 :]:
            yield one, other


def _too_close(one: Box, other: Box) -> bool:
    return (
        one.x < other.x + other.w + ASIDE
        and other.x < one.x + one.w + ASIDE
        and one.y < other.y + other.h + ABOVE
        and other.y < one.y + one.h + ABOVE
    )
