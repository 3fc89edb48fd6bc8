"""The element of a picture that shows a fault, and the part of the picture around it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.model.finding import Finding
from lab3_usd.report.layout.canvas import LEGEND_LINE
from lab3_usd.report.picture import HEADER, Box, Picture, port_id

WIDTH = 380.0  # of the part of a picture beside a fault, unless the box is wider
SHAPE = 0.5  # its height, by its width
ROUND = 30.0  # room around the box
ABOVE = 14.0


class PictureTarget(Struct, frozen=True):
    """The id of an element of a picture, without prefix, and the view around it."""

    id: str
    view: str = ""


def target_of(finding: Finding, picture: Picture) -> PictureTarget | None:
    """Return the element that marks the fault in the picture, None if there is none.

    A missing node's finding lies at the graph and names the node.
    """
    if picture.kind == "frames":
        return None
    boxes = {box.key: box for box in picture.boxes}
    if finding.prim in boxes:
        return _target_in(boxes[finding.prim], finding.property, picture)
    if finding.prim != picture.path:
        return None
    for box in picture.boxes:
        name = re.escape(box.key.rpartition("/")[2].removesuffix("_missing"))
        if box.state == "missing" and re.search(rf"\({name}\)", finding.message):
            return _target_in(box, None, picture)
    return PictureTarget(port_id(picture.path))


def related_targets(finding: Finding, picture: Picture) -> Iterator[PictureTarget]:
    """Yield the other ports that a finding names, as far as they are in the picture."""
    boxes = {box.key: box for box in picture.boxes if picture.kind == "graph"}
    for site in finding.related:
        prim, _, prop = site.partition(".")
        if prim in boxes and (not prop or boxes[prim].row(prop)):
            yield _target_in(boxes[prim], prop or None, picture)


def _target_in(box: Box, prop: str | None, picture: Picture) -> PictureTarget:
    row = None if prop is None else box.row(prop)
    if row is None:
        return PictureTarget(port_id(box.key), _view(box, HEADER, picture))
    return PictureTarget(port_id(box.key, row.port), _view(box, row.y, picture))


def _view(box: Box, down: float, picture: Picture) -> str:
    """Return the part of the picture around a row of a box, its title too where that fits."""
    width = max(WIDTH, box.w + 2 * ROUND)
    height = width * SHAPE
    across = min(box.x + box.w / 2, box.x + width / 2 - ROUND)
    has_title = down + ROUND < height - ABOVE
    top = box.y - ABOVE if has_title else box.y + down - height / 2
    low = picture.legend[0].y - LEGEND_LINE  # the legend is no part of what is shown
    left, top = (_within(across - width / 2, picture.width - width), _within(top, low - height))
    return f"{left:.0f} {top:.0f} {width:.0f} {height:.0f}"


def _within(value: float, most: float) -> float:
    return max(0.0, min(value, most))
