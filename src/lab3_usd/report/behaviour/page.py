"""A dry run as one HTML page: maps of the run, the drive over time, and the checks that failed.

Each graph is drawn with how often its nodes computed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path, PurePath

from markupsafe import Markup
from msgspec import Struct

from lab3_usd.check.explanations import explaining_rule
from lab3_usd.check.registry import all_rules
from lab3_usd.errors import Lab3Error
from lab3_usd.model.dry_run import Behaviour, Check, Frame, Moment, Place, Replay, Segment
from lab3_usd.model.occupancy import MapFit, OccupancyMap
from lab3_usd.report.behaviour.text import WHAT_IT_IS, leg_text, looks_of, rate, sum_text
from lab3_usd.report.html.templates import (
    content_policy,
    environment,
    own_markup,
    palette_style,
    text_of,
)
from lab3_usd.report.options import NAME, tool_version
from lab3_usd.report.picture.model import Box, port_id
from lab3_usd.report.picture.svg import stylesheet, svg
from lab3_usd.report.pictures.graph_picture import stage_pictures
from lab3_usd.spec.lab import Lab

WIDTH, ROW, LEFT, RIGHT, TOP = 720.0, 96.0, 124.0, 16.0, 26.0
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
        moved = [(moment.seconds, _value(moment.robot, start, number)) for moment in moments]
        odometry = [
            (moment.seconds, _value(moment.odometry, start, number))
            for moment in moments
            if moment.odometry is not None
        ]
        parts += _row(number, f"{name}, {unit}", moved, odometry, end)
    tall = TOP + 3 * ROW + 8
    has_odometry = any(moment.odometry is not None for moment in moments)
    label = f"x, y and heading over time{'; odometry as dots' if has_odometry else ''}"
    head = f'<svg class="chart" role="img" aria-label="{label}" viewBox="0 0 {WIDTH:g} {tall:g}">'
    return f"{head}{''.join(parts)}</svg>"


def _value(place: Place, start: Place, number: int) -> float:
    moved = place[number] - start[number]
    return math.degrees(math.remainder(moved, 2 * math.pi)) if number == 2 else moved  # noqa: PLR2004 - the heading


def _row(
    number: int,
    name: str,
    moved: Sequence[tuple[float, float]],
    odometry: Sequence[tuple[float, float]],
    end: float,
) -> list[str]:
    values = [value for _, value in (*moved, *odometry)]
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
        f'<path class="path" d="M{"L".join(point(*point_at) for point_at in moved)}"/>',
        f'<path class="told" d="{"".join(f"M{point(*point_at)}h0" for point_at in odometry)}"/>',
    ]


def _label(y: float, value: float, number: int) -> str:
    text = f"{round(value, _DIGITS[number]) + 0.0:.{_DIGITS[number]}f}"
    return f'<text class="end" x="{LEFT - 6:g}" y="{y:.1f}">{text}</text>'


def _legs(moments: Sequence[Moment], end: float) -> str:
    """Return the names of the legs above, as far as there is room, and lines between them."""
    parts, before = [], 0.0
    scale = (WIDTH - LEFT - RIGHT) / end
    for name, group in groupby(moments, key=lambda moment: moment.leg):
        last = [*group][-1].seconds
        x = LEFT + scale * before
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP - 6:g}V{TOP + 3 * ROW:g}"/>')
        if scale * (last - before) >= _WIDE and name.isalpha():
            parts.append(f'<text x="{x + 3:.1f}" y="16">{name}</text>')
        before = last
    return "".join(parts)


_SCALE = 100.0  # units of the drawing in a metre
_DOT = "h0"  # a line without length, which a round cap makes a dot

EDGE = 0.3  # metres around what is drawn
FAR = 25.0  # metres from the robot beyond which nothing is drawn
STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # metres between lines of the grid
LINES = 12  # of the grid, at most
Extent = tuple[float, float, float, float]


def room_svg(replay: Replay, *, still: bool = False) -> str:
    """Return the room with the robot and what its lidar sees, moment by moment or at one."""
    start = replay.moments[0].robot
    walls = [wall for wall in replay.walls if _near(wall[:2], start) and _near(wall[2:], start)]
    ends = [point for a, b, c, d in walls for point in ((a, b), (c, d))]
    seen = [point for moment in replay.moments for point in moment.points if _near(point, start)]
    box = _box([*ends, *seen, *_path(replay)], least=2.0)
    parts = [
        _grid(box),
        f'<path class="wall" d="{_segments_path(walls)}"/>',
        f'<path class="path" d="{_line_path(_path(replay))}"/>',
        _moments_svg(replay.moments, replay.radius, furthest(replay), scan=True, still=still),
    ]
    shown = "the path and the scan" if seen else "and the path"
    return _svg_element(box, f"The room, the walls, {shown}", "room", parts)


def near_svg(replay: Replay, *, still: bool = False) -> str:
    """Return the path from near, with what odometry says of it."""
    odometry = [moment.odometry for moment in replay.moments if moment.odometry is not None]
    start, edge = replay.moments[0].robot, min(replay.radius, FAR)
    estimates = [(x, y) for x, y, _ in odometry if _near((x, y), start)]
    corners = ((edge, edge), (-edge, -edge))
    ends = [(x + dx, y + dy) for x, y in (*_path(replay), *estimates) for dx, dy in corners]
    box = _box(ends, least=0.8, edge=0.05)
    parts = [
        _grid(box),
        f'<path class="wall" d="{_segments_path(replay.walls)}"/>',
        f'<g class="start">{_robot_svg(replay.moments[0].robot, replay.radius)}</g>',
        f'<path class="path" d="{_line_path(_path(replay))}"/>',
        f'<path class="told" d="{_dots_path(estimates)}"/>' if estimates else "",
        _moments_svg(replay.moments, replay.radius, furthest(replay), scan=False, still=still),
    ]
    shown = ", and odometry as dots" if estimates else ""
    return _svg_element(box, f"The path of the robot{shown}", "near", parts)


def map_svg(fit: MapFit) -> str:
    """Return the map with the points of all scans: those at a wall and those elsewhere."""
    start = fit.ends[0]
    ends = [end for end in fit.ends if _near(end, start)]
    runs = [run for run in _wall_runs(fit.map) if all(_near(corner, start) for corner in run)]
    box = _box([*(end[:2] for end in ends), *(corner for run in runs for corner in run)], least=2.0)
    parts = [
        _grid(box),
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


def furthest(replay: Replay) -> int:
    """Return the number of the moment to show first: when the robot has gone furthest."""
    x, y, _ = replay.moments[0].robot
    ways = [(moment.robot[0] - x) ** 2 + (moment.robot[1] - y) ** 2 for moment in replay.moments]
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
    """Return lines a round number of metres apart, with that number at the lower edge."""
    left, bottom, wide, tall = box
    step = next(width for width in STEPS if max(wide, tall) / width <= LINES)
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


class DryRunSummary(Struct, frozen=True):
    """What a report shows of the dry run of one stage; the maps are markup of our own."""

    summary: str
    legs: tuple[str, ...]
    wrong: tuple[Check, ...]
    room: Markup
    near: Markup


def dry_run_summary(behaviour: Behaviour, replay: Replay | None) -> DryRunSummary | None:
    """Return what a report shows, None where nothing was played."""
    if replay is None or not replay.moments:
        return None
    return DryRunSummary(
        sum_text(behaviour),
        tuple(map(leg_text, behaviour.legs)),
        tuple(check for check in behaviour.checks if check.verdict != "ok"),
        Markup(room_svg(replay, still=True)),  # noqa: S704 - no name of the stage is in it
        Markup(near_svg(replay, still=True)),  # noqa: S704
    )


_ABOVE = 6  # pixels between a node and its count

# In the order of the page.
VERDICTS = {"bad": "something is wrong", "not judged": "not judged", "ok": "all right"}


class GraphDrawing(Struct, frozen=True):
    """A graph as it is drawn; `nodes` are the ids of its elements by the prims of the nodes."""

    path: str
    title: str
    drawing: str
    nodes: Mapping[str, str]


def render(behaviour: Behaviour, replay: Replay | None, lab: Lab) -> str:
    """Return the page; without a replay it says why there is none."""
    style = palette_style() + text_of("sim.css") + text_of("maps.css") + stylesheet()
    script = text_of("sim.js")
    computed = replay.computed if replay is not None else {}
    replay = replay if replay is not None and replay.moments else None
    graphs = list(_graph_drawings(Path(behaviour.stage), lab, computed))
    failing = [check for check in behaviour.checks if check.verdict == "bad"]
    manuals = all_rules() if failing else {}

    def repair_of(check: Check) -> str:
        rule = manuals.get(explaining_rule(check))
        return rule.section("Fix") if rule is not None else ""

    return (
        environment()
        .get_template("sim.html.j2")
        .render(
            style=own_markup(style),
            script=own_markup(script),
            policy=content_policy(style, script),
            behaviour=behaviour,
            what=WHAT_IT_IS,
            name=PurePath(behaviour.stage).name,
            looks=looks_of(behaviour),
            verdicts=VERDICTS,
            checks=sorted(behaviour.checks, key=lambda check: list(VERDICTS).index(check.verdict)),
            nodes={prim: element for graph in graphs for prim, element in graph.nodes.items()},
            faulty=[
                graph.path
                for graph in graphs
                if any(check.prim in graph.nodes for check in failing)
            ],
            rule_of=explaining_rule,
            repair_of=repair_of,
            rate=rate,
            leg_text=leg_text,
            summary=sum_text(behaviour),
            replay=replay,
            shown=furthest(replay) if replay is not None else 0,
            moments=replay.moments if replay is not None else (),
            room=own_markup(room_svg(replay)) if replay is not None else "",
            near=own_markup(near_svg(replay)) if replay is not None else "",
            fit=replay.fit if replay is not None else None,
            on_map=own_markup(map_svg(replay.fit)) if replay is not None and replay.fit else "",
            chart=own_markup(chart_svg(replay.moments)) if replay is not None else "",
            tree=list(tree_lines(behaviour.frames)),
            graphs=graphs,
            tool=f"{NAME} {tool_version()}",
        )
    )


def tree_lines(frames: Sequence[Frame]) -> Iterator[str]:
    """Yield the TF tree line by line; a ring of frames is left where it closes."""
    below: dict[str, list[Frame]] = {}
    for frame in frames:
        below.setdefault(frame.parent, []).append(frame)
    children = {frame.child for frame in frames}
    roots = [parent for parent in below if parent not in children] or [*below][:1]
    for root in roots:
        yield root
        yield from _branches(root, below, "", {root})


def _branches(
    parent: str, below: dict[str, list[Frame]], lead: str, above: set[str]
) -> Iterator[str]:
    rows = below.get(parent, [])
    for number, frame in enumerate(rows, start=1):
        last = number == len(rows)
        static = " (static)" if frame.static else ""
        ring = " (again)" if frame.child in above else ""
        yield f"{lead}{'└── ' if last else '├── '}{frame.child}{static}{ring}"
        if not ring:
            inside = lead + ("    " if last else "│   ")
            yield from _branches(frame.child, below, inside, above | {frame.child})


def _graph_drawings(path: Path, lab: Lab, computed: Mapping[str, int]) -> Iterator[GraphDrawing]:
    """Yield the drawing of each graph of a stage; none where it can no longer be read."""
    from lab3_usd.stage.read.reader import read_stage

    try:
        pictures = list(stage_pictures(lab, None, read_stage(path, lab)))
    except (Lab3Error, OSError):
        return
    for number, picture in enumerate(pictures):
        if picture.kind == "graph":
            counts = "".join(_count_svg(box, computed.get(box.key)) for box in picture.boxes)
            drawing = svg(picture, f"g{number}-").removesuffix("</svg>")
            nodes = {box.key: f"g{number}-{port_id(box.key)}" for box in picture.boxes}
            yield GraphDrawing(picture.path, picture.title, f"{drawing}{counts}</svg>", nodes)


def _count_svg(box: Box, times: int | None) -> str:
    text = "not simulated" if times is None else f"{times} times" if times else "never"
    kind = "fired" if times else "fired none"
    x, y = box.x + box.w, box.y - _ABOVE
    return f'<text class="{kind}" text-anchor="end" x="{x:.0f}" y="{y:.0f}">{text}</text>'
