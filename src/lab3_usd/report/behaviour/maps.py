"""Maps of a run: the room with the scan, and the path of the robot from near."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from lab3_usd.model.dry_run.behaviour import Moment, Place, Replay, Segment

_SCALE = 100.0  # units of the drawing in a metre
_DOT = "h0"  # a line without length, which a round cap makes a dot

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
        f'<path class="wall" d="{_segments_path(walls)}"/>',
        f'<path class="path" d="{_line_path(_path(found))}"/>',
        _moments_svg(found.moments, found.radius, furthest(found), scan=True, still=still),
    ]
    return _svg_element(box, "The room, the walls, the path and the scan", "room", parts)


def near_svg(found: Replay, *, still: bool = False) -> str:
    """Return the path from near, with what odometry says of it."""
    told = [each.odometry for each in found.moments if each.odometry is not None]
    start, edge = found.moments[0].robot, min(found.radius, FAR)
    says = [(x, y) for x, y, _ in told if _near((x, y), start)]
    ends = [(x + dx, y + dy) for x, y in (*_path(found), *says) for dx, dy in _around(edge)]
    box = _box(ends, least=0.8, edge=0.05)
    parts = [
        _grid(box),
        f'<path class="wall" d="{_segments_path(found.walls)}"/>',
        f'<g class="start">{_robot_svg(found.moments[0].robot, found.radius)}</g>',
        f'<path class="path" d="{_line_path(_path(found))}"/>',
        f'<path class="told" d="{_dots_path(says)}"/>' if says else "",
        _moments_svg(found.moments, found.radius, furthest(found), scan=False, still=still),
    ]
    return _svg_element(box, "The path of the robot, and odometry as dots", "near", parts)


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
        f'<text x="{_units(left + size * 0.015)}" y="{_units(-bottom - size * 0.015)}"'
        f' font-size="{_units(size * 0.03)}">a square is {step:g} m</text>'
    )
    return f'<path class="grid" d="{_segments_path(lines)}"/>{text}'


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


def _moments_svg(
    moments: Sequence[Moment], radius: float, shown: int, *, scan: bool, still: bool
) -> str:
    """Return a group for each moment, all but one hidden; a still has that one alone."""
    groups = []
    for number, moment in enumerate(moments):
        if still and number != shown:
            continue
        hidden = "" if number == shown else " hidden"
        points = f'<path class="scan" d="{_dots_path(moment.points)}"/>' if scan else ""
        robot = f'<g class="robot">{_robot_svg(moment.robot, radius)}</g>'
        groups.append(f'<g data-moment="{number}"{hidden}>{points}{robot}</g>')
    return "".join(groups)


def _svg_element(
    box: tuple[float, float, float, float], label: str, kind: str, parts: Iterable[str]
) -> str:
    """Return a whole drawing of a box of the room: left, bottom, width, height in metres."""
    left, bottom, wide, tall = box
    view = f"{_units(left)} {_units(-bottom - tall)} {_units(wide)} {_units(tall)}"
    head = f'<svg class="{kind}" role="img" aria-label="{label}" viewBox="{view}">'
    return f"{head}{''.join(parts)}</svg>"
