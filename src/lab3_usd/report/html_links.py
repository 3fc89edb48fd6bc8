"""Where in a picture a fault is to be seen: the element to go to, and the part around it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from lab3_usd.check.finding import Finding
from lab3_usd.report.picture_model import Box, Picture, port_id

VIEW = (380.0, 190.0)  # width and height of the part of a picture beside a fault


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a picture: the id of its element without prefix, and the view around it."""

    id: str
    view: str = ""


def place_of(finding: Finding, picture: Picture) -> Place | None:
    """Return where the fault is marked in a graph's picture, None where it lies elsewhere.

    A missing node's finding lies at the graph and names the node.
    """
    if picture.kind == "frames":
        return None
    boxes = {box.key: box for box in picture.boxes}
    if finding.prim in boxes:
        return _at(boxes[finding.prim], finding.property, picture)
    if finding.prim != picture.path:
        return None
    for box in picture.boxes:
        name = re.escape(box.key.rpartition("/")[2].removesuffix("_missing"))
        if box.state == "missing" and re.search(rf"\({name}\)", finding.message):
            return _at(box, None, picture)
    return Place(port_id(picture.path))


def related_places(finding: Finding, picture: Picture) -> Iterator[Place]:
    """Yield the other ports that a finding names, as far as they are in the picture."""
    boxes = {box.key: box for box in picture.boxes if picture.kind == "graph"}
    for site in finding.related:
        prim, _, prop = site.partition(".")
        if prim in boxes and (not prop or boxes[prim].row(prop)):
            yield _at(boxes[prim], prop or None, picture)


def _at(box: Box, prop: str | None, picture: Picture) -> Place:
    row = None if prop is None else box.row(prop)
    if row is None:
        return Place(port_id(box.key), _view(box, VIEW[1] / 2 - 16, picture))
    return Place(port_id(box.key, row.port), _view(box, row.y, picture))


def _view(box: Box, down: float, picture: Picture) -> str:
    """Return the part of the picture around a point of a box, its title too where that fits."""
    is_near_top = down < VIEW[1] - 40
    across = min(box.x + box.w / 2, box.x + VIEW[0] / 2 - 40)
    left = _within(across - VIEW[0] / 2, picture.width - VIEW[0])
    top = box.y - 14 if is_near_top else box.y + down - VIEW[1] / 2
    top = _within(top, picture.height - VIEW[1])
    return f"{left:.0f} {top:.0f} {VIEW[0]:.0f} {VIEW[1]:.0f}"


def _within(value: float, most: float) -> float:
    return max(0.0, min(value, most))
