"""A dry run as one HTML page that needs nothing else: no network, and no script for reading.

Each graph is drawn with how often its nodes computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePath

from lab3_usd.errors import Lab3Error
from lab3_usd.model.dry_run.behaviour import Behaviour, Frame, Replay
from lab3_usd.report.behaviour.chart import chart_svg
from lab3_usd.report.behaviour.maps import furthest, near_svg, room_svg
from lab3_usd.report.behaviour.words import LOOKS, WHAT_IT_IS, leg_text, rate, sum_text
from lab3_usd.report.html.templates import (
    content_policy,
    environment,
    own_markup,
    palette_style,
    text_of,
)
from lab3_usd.report.picture import Box, Picture
from lab3_usd.report.picture_formats.svg import svg
from lab3_usd.report.picture_formats.svg_style import stylesheet
from lab3_usd.report.pictures.stage_pictures import stage_pictures
from lab3_usd.report.tool import NAME, tool_version
from lab3_usd.spec.lab import Lab

_ABOVE = 6  # pixels between a node and its count

MARKS = {"ok": "ok", "bad": "bad", "not-simulated": "not simulated"}


def render(found: Behaviour, seen: Replay | None, lab: Lab) -> str:
    """Return the page; without a replay it says why there is none."""
    style = palette_style() + text_of("sim.css") + text_of("maps.css") + stylesheet()
    script = text_of("sim.js")
    has_moments = seen is not None and bool(seen.moments)
    shown = furthest(seen) if seen is not None and has_moments else 0
    computed = seen.computed if seen is not None else {}
    graphs = _graph_drawings(Path(found.stage), lab, computed)
    return (
        environment()
        .get_template("sim.html.j2")
        .render(
            style=own_markup(style),
            script=own_markup(script),
            policy=content_policy(style, script),
            found=found,
            what=WHAT_IT_IS,
            name=PurePath(found.stage).name,
            looks=LOOKS,
            marks=MARKS,
            rate=rate,
            leg_text=leg_text,
            summary=sum_text(found),
            seen=seen if has_moments else None,
            shown=shown,
            moments=seen.moments if seen is not None else (),
            room=own_markup(room_svg(seen)) if seen is not None and has_moments else "",
            near=own_markup(near_svg(seen)) if seen is not None and has_moments else "",
            chart=own_markup(chart_svg(seen.moments)) if seen is not None and has_moments else "",
            tree=list(tree_lines(found.frames)),
            graphs=[(title, own_markup(drawn)) for title, drawn in graphs],
            tool=f"{NAME} {tool_version()}",
        )
    )


def tree_lines(frames: Sequence[Frame]) -> Iterator[str]:
    """Yield the TF tree line by line; a ring of frames is left where it closes."""
    below: dict[str, list[Frame]] = {}
    for each in frames:
        below.setdefault(each.parent, []).append(each)
    children = {each.child for each in frames}
    roots = [each for each in below if each not in children] or [*below][:1]
    for root in roots:
        yield root
        yield from _branches(root, below, "", {root})


def _branches(
    parent: str, below: dict[str, list[Frame]], lead: str, above: set[str]
) -> Iterator[str]:
    rows = below.get(parent, [])
    for number, each in enumerate(rows, start=1):
        last = number == len(rows)
        static = " (static)" if each.static else ""
        ring = " (again)" if each.child in above else ""
        yield f"{lead}{'└── ' if last else '├── '}{each.child}{static}{ring}"
        if not ring:
            inside = lead + ("    " if last else "│   ")
            yield from _branches(each.child, below, inside, above | {each.child})


def _graph_drawings(path: Path, lab: Lab, computed: Mapping[str, int]) -> Iterator[tuple[str, str]]:
    """Yield title and drawing of each graph of a stage; none where it can no longer be read."""
    from lab3_usd.stage.read.reader import read_stage  # noqa: PLC0415 - pxr, only for pages

    try:
        pictures = list(stage_pictures(lab, None, read_stage(path, lab)))
    except (Lab3Error, OSError):
        return
    for number, picture in enumerate(pictures):
        if picture.kind == "graph":
            yield picture.title, _counted(picture, computed, f"g{number}-")


def _counted(picture: Picture, computed: Mapping[str, int], ids: str) -> str:
    counts = "".join(_count(each, computed.get(each.key)) for each in picture.boxes)
    drawn = svg(picture, ids)
    return drawn.removesuffix("</svg>") + counts + "</svg>"


def _count(box: Box, times: int | None) -> str:
    said = "not simulated" if times is None else f"{times} times" if times else "never"
    kind = "fired" if times else "fired none"
    x, y = box.x + box.w, box.y - _ABOVE
    return f'<text class="{kind}" text-anchor="end" x="{x:.0f}" y="{y:.0f}">{said}</text>'
