"""Maps of a run: the room with the scan, and the path of the robot from near."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from lab3_usd.model.behaviour import Replay
from lab3_usd.report.behaviour.drawing import (
    dots_path,
    line_path,
    moments_svg,
    robot_svg,
    segments_path,
    svg_element,
    units,
)

EDGE = 0.3  # metres around what is drawn
FAR = 25.0  # metres from the robot beyond which nothing is drawn
STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # metres between lines of the grid
LINES = 12  # of the grid, at most
Box = tuple[float, float, float, float]


def room_svg(found: Replay, *, still: bool = False) -> str:
    """Return the room with the robot and what its lidar sees, moment by moment or at one."""
    start = found.moments[0].robot
    walls = [each for each in found.walls if _near(each[:2], start) and _near(each[2:], start)]
    ends = [point for a, b, c, d in walls for point in ((a, b), (c, d))]
    seen = [point for each in found.moments for point in each.points if _near(point, start)]
    box = _box([*ends, *seen, *_path(found)], least=2.0)
    parts = [
        _grid(box),
        f'<path class="wall" d="{segments_path(walls)}"/>',
        f'<path class="path" d="{line_path(_path(found))}"/>',
        moments_svg(found.moments, found.radius, furthest(found), scan=True, still=still),
    ]
    return svg_element(box, "The room, the walls, the path and the scan", "room", parts)


def near_svg(found: Replay, *, still: bool = False) -> str:
    """Return the path from near, with what odometry says of it."""
    told = [each.odometry for each in found.moments if each.odometry is not None]
    start, edge = found.moments[0].robot, min(found.radius, FAR)
    says = [(x, y) for x, y, _ in told if _near((x, y), start)]
    ends = [(x + dx, y + dy) for x, y in (*_path(found), *says) for dx, dy in _around(edge)]
    box = _box(ends, least=0.8, edge=0.05)
    parts = [
        _grid(box),
        f'<path class="wall" d="{segments_path(found.walls)}"/>',
        f'<g class="start">{robot_svg(found.moments[0].robot, found.radius)}</g>',
        f'<path class="path" d="{line_path(_path(found))}"/>',
        f'<path class="told" d="{dots_path(says)}"/>' if says else "",
        moments_svg(found.moments, found.radius, furthest(found), scan=False, still=still),
    ]
    return svg_element(box, "The path of the robot, and odometry as dots", "near", parts)


def furthest(found: Replay) -> int:
    """Return the number of the moment to show first: when the robot has gone furthest."""
    x, y, _ = found.moments[0].robot
    ways = [(each.robot[0] - x) ** 2 + (each.robot[1] - y) ** 2 for each in found.moments]
    return ways.index(max(ways))


def _path(found: Replay) -> list[tuple[float, float]]:
    start = found.moments[0].robot
    return [(x, y) for x, y, _ in (each.robot for each in found.moments) if _near((x, y), start)]


def _near(point: Sequence[float], start: Sequence[float]) -> bool:
    return math.hypot(point[0] - start[0], point[1] - start[1]) < FAR


def _around(edge: float) -> Iterator[tuple[float, float]]:
    yield from ((edge, edge), (-edge, -edge))


def _box(points: Iterable[tuple[float, float]], least: float, edge: float = EDGE) -> Box:
    """Return the box around points: left, bottom, width, height."""
    xs, ys = zip(*points, strict=True)
    sides = []
    for values in (xs, ys):
        low, high = min(values) - edge, max(values) + edge
        more = max(0.0, least - (high - low)) / 2
        sides.append((low - more, high + more))
    (left, right), (bottom, top) = sides
    return (left, bottom, right - left, top - bottom)


def _grid(box: Box) -> str:
    """Return lines a round number of metres apart, with that number at the lower edge."""
    left, bottom, wide, tall = box
    step = next(each for each in STEPS if max(wide, tall) / each <= LINES)
    lines = [(x, bottom, x, bottom + tall) for x in _rounds(left, wide, step)]
    lines += [(left, y, left + wide, y) for y in _rounds(bottom, tall, step)]
    size = max(wide, tall)
    text = (
        f'<text x="{units(left + size * 0.015)}" y="{units(-bottom - size * 0.015)}"'
        f' font-size="{units(size * 0.03)}">a square is {step:g} m</text>'
    )
    return f'<path class="grid" d="{segments_path(lines)}"/>{text}'


def _rounds(first: float, length: float, step: float) -> Iterator[float]:
    number = math.ceil(first / step)
    while number * step < first + length:
        yield number * step
        number += 1
