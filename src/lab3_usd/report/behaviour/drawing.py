"""Numbers and points as SVG writes them, and what both maps draw of a moment."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from lab3_usd.model.behaviour import Moment, Place, Segment

SCALE = 100.0  # units of the drawing in a metre
_DOT = "h0"  # a line without length, which a round cap makes a dot


def units(metres: float) -> str:
    """Return a length as the drawing has it."""
    return f"{metres * SCALE:.1f}".removesuffix(".0")


def at(x: float, y: float) -> str:
    """Return a point; y goes up in a room and down in a drawing."""
    return f"{units(x)} {units(-y)}"


def line_path(points: Iterable[tuple[float, float]]) -> str:
    """Return a line through points."""
    return "M" + "L".join(at(x, y) for x, y in points)


def segments_path(segments: Iterable[Segment]) -> str:
    """Return separate lines."""
    return "".join(f"M{at(a, b)}L{at(c, d)}" for a, b, c, d in segments)


def dots_path(points: Iterable[tuple[float, float]]) -> str:
    """Return dots."""
    return "".join(f"M{at(x, y)}{_DOT}" for x, y in points)


def robot_svg(place: Place, radius: float) -> str:
    """Return a robot: a circle with a line to where it looks."""
    x, y, turned = place
    ahead = (x + radius * math.cos(turned), y + radius * math.sin(turned))
    circle = f'<circle cx="{units(x)}" cy="{units(-y)}" r="{units(radius)}"/>'
    return f'{circle}<path d="{line_path([(x, y), ahead])}"/>'


def moments_svg(
    moments: Sequence[Moment], radius: float, shown: int, *, scan: bool, still: bool
) -> str:
    """Return a group for each moment, all but one hidden; a still has that one alone."""
    groups = []
    for number, moment in enumerate(moments):
        if still and number != shown:
            continue
        hidden = "" if number == shown else " hidden"
        points = f'<path class="scan" d="{dots_path(moment.points)}"/>' if scan else ""
        robot = f'<g class="robot">{robot_svg(moment.robot, radius)}</g>'
        groups.append(f'<g data-moment="{number}"{hidden}>{points}{robot}</g>')
    return "".join(groups)


def svg_element(
    box: tuple[float, float, float, float], label: str, kind: str, parts: Iterable[str]
) -> str:
    """Return a whole drawing of a box of the room: left, bottom, width, height in metres."""
    left, bottom, wide, tall = box
    view = f"{units(left)} {units(-bottom - tall)} {units(wide)} {units(tall)}"
    head = f'<svg class="{kind}" role="img" aria-label="{label}" viewBox="{view}">'
    return f"{head}{''.join(parts)}</svg>"
