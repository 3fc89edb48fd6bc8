"""The drawings of a run from above: the room, a close-up of the path, the map."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from operator import itemgetter

from lab3_usd.model.dry_run import Behaviour, Place, Replay, Segment
from lab3_usd.model.occupancy import MapFit, OccupancyMap

FULL = 720.0  # pixels that a drawing is wide in full size
_SCALE = 100.0  # units of the drawing in a metre
_DOT = "h0"  # a line without length, which a round cap makes a dot

EDGE = 0.3  # metres around what is drawn
FAR = 25.0  # metres from the robot beyond which nothing is drawn
STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # metres between lines of the grid
LINES = 12  # of the grid, at most
AXIS, AROUND = 0.1, 0.015  # of the larger side: room for the axes, and at the other two sides
Extent = tuple[float, float, float, float]


def room_svg(replay: Replay, shown: int, *, still: bool = False) -> str:
    """Return the room with the robot and what its lidar sees: each moment, or the shown one."""
    start = replay.moments[0].robot
    walls = [wall for wall in replay.walls if _near(wall[:2], start) and _near(wall[2:], start)]
    ends = [point for a, b, c, d in walls for point in ((a, b), (c, d))]
    seen = [point for moment in replay.moments for point in moment.points if _near(point, start)]
    box = _box([*ends, *seen, *_path(replay)], least=2.0)
    parts = [
        f'<path class="wall" d="{_segments_path(walls)}"/>',
        f'<path class="path" d="{_line_path(_path(replay))}"/>',
        _moments_svg(replay, shown, scan=True, still=still),
    ]
    drawn = "the path and the scan" if seen else "and the path"
    return _svg_element(box, f"The room, the walls, {drawn}", "room", parts)


def near_svg(replay: Replay, shown: int, *, still: bool = False) -> str:
    """Return a close-up of the path, with the poses of odometry."""
    odometry = [moment.odometry for moment in replay.moments if moment.odometry is not None]
    start, edge = replay.moments[0].robot, min(replay.radius, FAR)
    estimates = [(x, y) for x, y, _ in odometry if _near((x, y), start)]
    corners = ((edge, edge), (-edge, -edge))
    ends = [(x + dx, y + dy) for x, y in (*_path(replay), *estimates) for dx, dy in corners]
    box = _box(ends, least=0.8, edge=0.05)
    parts = [
        f'<path class="wall" d="{_segments_path(replay.walls)}"/>',
        f'<g class="start">{_robot_svg(replay.moments[0].robot, replay.radius)}</g>',
        f'<path class="path" d="{_line_path(_path(replay))}"/>',
        f'<path class="told" d="{_dots_path(estimates)}"/>' if estimates else "",
        _moments_svg(replay, shown, scan=False, still=still),
    ]
    drawn = ", and odometry as dots" if estimates else ""
    return _svg_element(box, f"The path of the robot{drawn}", "near", parts)


def map_svg(fit: MapFit) -> str:
    """Return the map with the points of all scans: those at a wall and those elsewhere."""
    start = fit.ends[0]
    ends = [end for end in fit.ends if _near(end, start)]
    runs = [run for run in _wall_runs(fit.map) if all(_near(corner, start) for corner in run)]
    box = _box([*(end[:2] for end in ends), *(corner for run in runs for corner in run)], least=2.0)
    parts = [
        f'<path class="cells" d="{"".join(f"{_line_path(run)}Z" for run in runs)}"/>',
        f'<path class="scan" d="{_dots_path((x, y) for x, y, is_met in ends if is_met)}"/>',
        f'<path class="off" d="{_dots_path((x, y) for x, y, is_met in ends if not is_met)}"/>',
    ]
    return _svg_element(box, "The map, and the scans on it", "map", parts)


def _wall_runs(grid: OccupancyMap) -> Iterator[list[tuple[float, float]]]:
    """Yield the corners of each run of walls in a row of a map."""
    for row, cells in groupby(sorted(grid.walls, key=lambda cell: cell[::-1]), itemgetter(1)):
        columns = [column for column, _ in cells]
        for _, run in groupby(enumerate(columns), lambda pair: pair[1] - pair[0]):
            along = [column for _, column in run]
            left, right = along[0], along[-1] + 1
            corners = ((left, row), (right, row), (right, row + 1), (left, row + 1))
            yield [grid.point(*corner) for corner in corners]


_OFF = 0.02  # metres between the robot and where odometry has it, that can be seen


def first_moment(behaviour: Behaviour, replay: Replay) -> int:
    """Return the number of the moment to show first, at which something is wrong.

    That is the end of the first leg that is wrong, else when odometry first is off, else when the
    robot has gone furthest.
    """
    moments = replay.moments
    wrong = [leg.name.rpartition(": ")[2] for leg in behaviour.legs if leg.fault]
    of_leg = [number for number, moment in enumerate(moments) if moment.leg in wrong[:1]]
    if of_leg:
        return of_leg[-1]
    is_off = any(check.name == "odometry" and check.verdict == "bad" for check in behaviour.checks)
    for number, moment in enumerate(moments if is_off else ()):
        if moment.odometry is not None and math.dist(moment.odometry[:2], moment.robot[:2]) > _OFF:
            return number
    x, y, _ = moments[0].robot
    ways = [math.dist(moment.robot[:2], (x, y)) for moment in moments]
    return ways.index(max(ways))


def _path(replay: Replay) -> list[tuple[float, float]]:
    start = replay.moments[0].robot
    return [
        (x, y) for x, y, _ in (moment.robot for moment in replay.moments) if _near((x, y), start)
    ]


def _near(point: Sequence[float], start: Sequence[float]) -> bool:
    return math.hypot(point[0] - start[0], point[1] - start[1]) < FAR


def _box(points: Iterable[tuple[float, float]], least: float, edge: float = EDGE) -> Extent:
    """Return the box around points: left, bottom, width, height."""
    xs, ys = zip(*points, strict=True)
    sides = []
    for values in (xs, ys):
        low, high = min(values) - edge, max(values) + edge
        more = max(0.0, least - (high - low)) / 2
        sides.append((low - more, high + more))
    (left, right), (bottom, top) = sides
    return (left, bottom, right - left, top - bottom)


def _grid(box: Extent) -> str:
    """Return lines a round number of metres apart, and the axes with their numbers outside."""
    left, bottom, wide, tall = box
    size = max(wide, tall)
    step = next(width for width in STEPS if size / width <= LINES)
    across, upward = list(_rounds(left, wide, step)), list(_rounds(bottom, tall, step))
    lines = [(x, bottom, x, bottom + tall) for x in across]
    lines += [(left, y, left + wide, y) for y in upward]
    low, letter = bottom - size * 0.04, size * 0.03
    texts = [_text(x, low, f"{x:g}") for x in across]
    texts += [_text(left - size * 0.012, y - letter / 3, f"{y:g}", "end") for y in upward]
    texts.append(_text(left + wide / 2, low - letter * 1.3, "x, m"))
    beside = _at(left - size * 0.075, bottom + tall / 2)
    texts.append(f'<text transform="translate({beside}) rotate(-90)">y, m</text>')
    frame = f"M{_at(left, bottom)}h{_units(wide)}v-{_units(tall)}h-{_units(wide)}z"
    return (
        f'<path class="grid" d="{_segments_path(lines)}"/><path class="edge" d="{frame}"/>'
        f'<g class="axes" font-size="{_units(letter)}">{"".join(texts)}</g>'
    )


def _text(x: float, y: float, text: str, anchor: str = "") -> str:
    anchoring = f' text-anchor="{anchor}"' if anchor else ""
    return f'<text x="{_units(x)}" y="{_units(-y)}"{anchoring}>{text}</text>'


def _rounds(first: float, length: float, step: float) -> Iterator[float]:
    number = math.ceil(first / step)
    while number * step < first + length:
        yield number * step
        number += 1


def _units(metres: float) -> str:
    """Return a length as the drawing has it."""
    return f"{metres * _SCALE:.1f}".removesuffix(".0")


def _at(x: float, y: float) -> str:
    """Return a point; y goes up in a room and down in a drawing."""
    return f"{_units(x)} {_units(-y)}"


def _line_path(points: Iterable[tuple[float, float]]) -> str:
    """Return a line through points."""
    return "M" + "L".join(_at(x, y) for x, y in points)


def _segments_path(segments: Iterable[Segment]) -> str:
    """Return separate lines."""
    return "".join(f"M{_at(a, b)}L{_at(c, d)}" for a, b, c, d in segments)


def _dots_path(points: Iterable[tuple[float, float]]) -> str:
    """Return dots."""
    return "".join(f"M{_at(x, y)}{_DOT}" for x, y in points)


def _robot_svg(place: Place, radius: float) -> str:
    """Return a robot: a circle with a line to where it looks."""
    x, y, turned = place
    ahead = (x + radius * math.cos(turned), y + radius * math.sin(turned))
    circle = f'<circle cx="{_units(x)}" cy="{_units(-y)}" r="{_units(radius)}"/>'
    return f'{circle}<path d="{_line_path([(x, y), ahead])}"/>'


def _moments_svg(replay: Replay, shown: int, *, scan: bool, still: bool) -> str:
    """Return a group for each moment, all but one hidden; a still has that one alone."""
    groups = []
    for number, moment in enumerate(replay.moments):
        if still and number != shown:
            continue
        hidden = "" if number == shown else " hidden"
        points = f'<path class="scan" d="{_dots_path(moment.points)}"/>' if scan else ""
        robot = f'<g class="robot">{_robot_svg(moment.robot, replay.radius)}</g>'
        groups.append(f'<g data-moment="{number}"{hidden}>{points}{robot}</g>')
    return "".join(groups)


def _svg_element(
    box: tuple[float, float, float, float], label: str, kind: str, parts: Iterable[str]
) -> str:
    """Return a whole drawing of a box of the room: left, bottom, width, height in metres."""
    left, bottom, wide, tall = box
    axis, edge = AXIS * max(wide, tall), AROUND * max(wide, tall)
    whole = _view(left - axis, bottom - axis, wide + axis + edge, tall + axis + edge)
    size = f'width="{FULL:g}" height="{FULL * (tall + axis + edge) / (wide + axis + edge):.0f}"'
    head = f'<svg class="{kind}" role="img" aria-label="{label}" {size} viewBox="{whole}">'
    place = (
        f'x="{_units(left)}" y="{_units(-bottom - tall)}"'
        f' width="{_units(wide)}" height="{_units(tall)}" viewBox="{_view(*box)}"'
    )
    return f"{head}{_grid(box)}<svg {place}>{''.join(parts)}</svg></svg>"


def _view(left: float, bottom: float, wide: float, tall: float) -> str:
    return f"{_units(left)} {_units(-bottom - tall)} {_units(wide)} {_units(tall)}"
