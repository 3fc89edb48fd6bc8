"""Odometry against motion: x, y and heading over time, one above the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from lab3_usd.model.dry_run.behaviour import Moment, Place

WIDTH, ROW, LEFT, RIGHT, TOP = 720.0, 96.0, 92.0, 16.0, 26.0
_NAMES = (("x", "m"), ("y", "m"), ("heading", "degrees"))
_DIGITS = (1, 1, 0)
_LEAST = (0.1, 0.1, 10.0)  # of an axis
_WIDE = 34.0  # that the name of a leg needs


def chart_svg(moments: Sequence[Moment]) -> str:
    """Return the drawing; what odometry says are the dots on the lines of the motion."""
    start = moments[0].robot
    end = moments[-1].seconds or 1.0
    parts = [_legs(moments, end)]
    for number, (name, unit) in enumerate(_NAMES):
        moved = [(each.seconds, _value(each.robot, start, number)) for each in moments]
        told = [
            (each.seconds, _value(each.odometry, start, number))
            for each in moments
            if each.odometry is not None
        ]
        parts += _row(number, f"{name}, {unit}", moved, told, end)
    tall = TOP + 3 * ROW + 8
    label = "x, y and heading over time; odometry as dots"
    head = f'<svg class="chart" role="img" aria-label="{label}" viewBox="0 0 {WIDTH:g} {tall:g}">'
    return f"{head}{''.join(parts)}</svg>"


def _value(place: Place, start: Place, number: int) -> float:
    moved = place[number] - start[number]
    return math.degrees(math.remainder(moved, 2 * math.pi)) if number == 2 else moved  # noqa: PLR2004 - the heading


def _row(
    number: int,
    name: str,
    moved: Sequence[tuple[float, float]],
    told: Sequence[tuple[float, float]],
    end: float,
) -> list[str]:
    values = [value for _, value in (*moved, *told)]
    low, high = min(values), max(values)
    more = max(0.0, _LEAST[number] - (high - low)) / 2
    low, high = low - more, high + more
    bottom, tall = TOP + (number + 1) * ROW - 12, ROW - 24

    def point(seconds: float, value: float) -> str:
        x = LEFT + (WIDTH - LEFT - RIGHT) * seconds / end
        return f"{x:.1f} {bottom - tall * (value - low) / (high - low):.1f}"

    zero = point(0.0, 0.0)
    return [
        f'<path class="grid" d="M{zero}H{WIDTH - RIGHT:g}"/>',
        f'<text x="4" y="{bottom - tall / 2 + 4:.1f}">{name}</text>',
        _label(bottom + 4, low, number),
        _label(bottom - tall + 4, high, number),
        f'<path class="path" d="M{"L".join(point(*each) for each in moved)}"/>',
        f'<path class="told" d="{"".join(f"M{point(*each)}h0" for each in told)}"/>',
    ]


def _label(y: float, value: float, number: int) -> str:
    said = f"{round(value, _DIGITS[number]) + 0.0:.{_DIGITS[number]}f}"
    return f'<text class="end" x="{LEFT - 6:g}" y="{y:.1f}">{said}</text>'


def _legs(moments: Sequence[Moment], end: float) -> str:
    """Return the names of the legs above, as far as there is room, and lines between them."""
    parts, before = [], 0.0
    scale = (WIDTH - LEFT - RIGHT) / end
    for name, group in groupby(moments, key=lambda each: each.leg):
        last = [*group][-1].seconds
        x = LEFT + scale * before
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP - 6:g}V{TOP + 3 * ROW:g}"/>')
        if scale * (last - before) >= _WIDE and name.isalpha():
            parts.append(f'<text x="{x + 3:.1f}" y="16">{name}</text>')
        before = last
    return "".join(parts)
