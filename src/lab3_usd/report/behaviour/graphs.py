"""The graphs of a stage, with how often each node computed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from lab3_usd.errors import Lab3Error
from lab3_usd.report.picture import Box, Picture
from lab3_usd.report.picture_formats.svg import svg
from lab3_usd.report.pictures.stage_pictures import stage_pictures
from lab3_usd.spec.lab import Lab

_ABOVE = 6  # pixels between a node and its count


def graph_drawings(path: Path, lab: Lab, computed: Mapping[str, int]) -> Iterator[tuple[str, str]]:
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
