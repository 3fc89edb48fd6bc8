"""The motion of a robot over time: where it was, how fast it went, what it was commanded to."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

from msgspec import Struct

from lab3_usd.model.dry_run import Moment, Place, Replay

WIDTH, ROW, LEFT, RIGHT, TOP = 720.0, 96.0, 124.0, 16.0, 26.0
WHEELS = 6  # that are drawn
_STEPS = (1, 2, 5, 10, 20, 60, 300)  # seconds between numbers of the axis
_NUMBERS = 16  # of the axis, at most
_WIDE = 34.0  # that the name of a leg needs
Points = Sequence[tuple[float, float]]


class _Row(Struct, frozen=True):
    """One row of the chart: its name, digits and least height of its axis, and its lines by class.

    Lines of the class `told` are dots; those of `command` have steps.
    """

    name: str
    digits: int
    least: float
    lines: tuple[tuple[str, Points], ...]


def chart_svg(replay: Replay) -> str:
    """Return the drawing; what odometry reports are the dots on the lines of the motion."""
    moments = replay.moments
    rows = [*_place_rows(moments), *_speed_rows(replay)]
    end = moments[-1].seconds or 1.0
    parts = [_legs(moments, end, len(rows))]
    for number, row in enumerate(rows):
        parts += _row(number, row, end)
    bottom = TOP + len(rows) * ROW
    tall = bottom + 24
    parts += _time_axis(bottom + 14, end)
    parts.append(f'<path class="now" d="M0 {TOP - 6:g}V{bottom:g}" hidden=""/>')
    has_odometry = any(moment.odometry is not None for moment in moments)
    label = f"{', '.join(row.name for row in rows)} over time"
    label += "; odometry as dots" if has_odometry else ""
    size = f'width="{WIDTH:g}" height="{tall:g}" viewBox="0 0 {WIDTH:g} {tall:g}"'
    return f'<svg class="chart" role="img" aria-label="{label}" {size}>{"".join(parts)}</svg>'


def cursor_places(moments: Sequence[Moment]) -> list[str]:
    """Return where in the chart each moment is."""
    end = moments[-1].seconds or 1.0
    return [f"{_across(moment.seconds, end):.1f}" for moment in moments]


def _across(seconds: float, end: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * seconds / end


def _place_rows(moments: Sequence[Moment]) -> Iterator[_Row]:
    start = moments[0].robot
    of: dict[str, Callable[[Place], float]] = {
        "x, m": lambda place: place[0] - start[0],
        "y, m": lambda place: place[1] - start[1],
        "heading, degrees": lambda place: math.degrees(
            math.remainder(place[2] - start[2], 2 * math.pi)
        ),
    }
    for name, value in of.items():
        is_angle = "degrees" in name
        moved = [(moment.seconds, value(moment.robot)) for moment in moments]
        told = [(m.seconds, value(m.odometry)) for m in moments if m.odometry is not None]
        lines = (("path", moved), ("told", told))
        yield _Row(name, 0 if is_angle else 1, 10.0 if is_angle else 0.1, lines)


def _speed_rows(replay: Replay) -> Iterator[_Row]:
    """Yield the rows of speeds, as far as there are any."""
    speeds = replay.speeds
    if not speeds:
        return
    for number, name in enumerate(("ahead, m/s", "turning, rad/s")):
        driven = [(each.seconds, each.driven[number]) for each in speeds]
        told = [(e.seconds, e.commanded[number]) for e in speeds if e.commanded is not None]
        yield _Row(name, 2, 0.1, (("path", driven), ("command", told)))
    count = min(len(replay.wheels), WHEELS)
    if count:
        lines = (
            (f"path wheel{number}", [(each.seconds, each.wheels[number]) for each in speeds])
            for number in range(count)
        )
        yield _Row("wheels, rad/s", 1, 1.0, tuple(lines))


def _row(number: int, row: _Row, end: float) -> Iterator[str]:
    values = [value for _, points in row.lines for _, value in points]
    low, high = min(values), max(values)
    more = max(0.0, row.least - (high - low)) / 2
    low, high = low - more, high + more
    bottom, tall = TOP + (number + 1) * ROW - 12, ROW - 24

    def point(seconds: float, value: float) -> str:
        return f"{_across(seconds, end):.1f} {bottom - tall * (value - low) / (high - low):.1f}"

    zero = min(max(0.0, low), high)
    yield f'<path class="grid" d="M{point(0.0, zero)}H{WIDTH - RIGHT:g}"/>'
    yield f'<text x="4" y="{bottom - tall / 2 + 4:.1f}">{row.name}</text>'
    for y, value in ((bottom + 4, low), (bottom - tall + 4, high)):
        text = f"{round(value, row.digits) + 0.0:.{row.digits}f}"
        yield f'<text class="end" x="{LEFT - 6:g}" y="{y:.1f}">{text}</text>'
    for kind, points in row.lines:
        places = [point(*each) for each in points]
        drawn = "M" + "L".join(places) if places else ""
        if kind == "told":
            drawn = "".join(f"M{place}h0" for place in places)
        elif kind == "command" and places:
            steps = (place.split() for place in places[1:])
            drawn = f"M{places[0]}" + "".join(f"H{x}V{y}" for x, y in steps)
        yield f'<path class="{kind}" d="{drawn}"/>'


def _time_axis(y: float, end: float) -> Iterator[str]:
    """Yield the seconds below the rows."""
    yield f'<text x="4" y="{y:g}">time, s</text>'
    step = next((step for step in _STEPS if end / step <= _NUMBERS), _STEPS[-1])
    for seconds in range(0, math.floor(end) + 1, step):
        x = f"{_across(seconds, end):.1f}"
        yield f'<text text-anchor="middle" x="{x}" y="{y:g}">{seconds}</text>'


def _legs(moments: Sequence[Moment], end: float, rows: int) -> str:
    """Return the names of the legs above, as far as there is room, and lines between them."""
    parts, before = [], 0.0
    scale = (WIDTH - LEFT - RIGHT) / end
    for name, group in groupby(moments, key=lambda moment: moment.leg):
        last = [*group][-1].seconds
        x = LEFT + scale * before
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP - 6:g}V{TOP + rows * ROW:g}"/>')
        if scale * (last - before) >= _WIDE and name.isalpha():
            parts.append(f'<text x="{x + 3:.1f}" y="16">{name}</text>')
        before = last
    return "".join(parts)
