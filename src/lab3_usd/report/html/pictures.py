"""The pictures of a block: one for all stages with the same graph, linked to its faults.

A link leads to the element of a picture that shows a fault, and to the view around it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

from msgspec import Struct

from lab3_usd.model.finding import SEVERITIES, Finding
from lab3_usd.report.grouped_stages import Block, ReportedFault
from lab3_usd.report.html.model import PagePicture, PortLink, StageContent
from lab3_usd.report.picture.canvas import LEGEND_LINE
from lab3_usd.report.picture.model import HEADER, Box, Picture, port_id
from lab3_usd.report.picture.svg import svg

_WIDTH = 380.0  # of the part of a picture beside a fault, unless the box is wider
_SHAPE = 0.5  # its height, by its width
_ROUND = 30.0  # room around the box
_ABOVE = 14.0


# The id of an element of a picture, without prefix, and the view around it, '' for the whole.
_PictureTarget = tuple[str, str]


# Characters in one block, so that the page of a whole submission stays below 400 kB.
PICTURE_CHARACTERS = 300_000
LEAST_CHARACTERS = 40_000
CHARACTERS_PER_FAULT = 1_500
CHARACTERS_PER_TOPIC = 800
MOST_LINKS = 4  # from one fault, where its graph differs from stage to stage


class _SharedPicture(Struct, frozen=True):
    """A picture with the stages that it shows and its id on the page."""

    id: str
    picture: Picture
    stages: tuple[int, ...]
    lines: tuple[str, ...]


def gallery(
    block: Block, contents: Mapping[int, StageContent], block_faults: Sequence[ReportedFault]
) -> tuple[list[PagePicture], dict[str, tuple[PortLink, ...]]]:
    """Draw every picture once, and return the links into them by the id of each fault.

    Pictures without faults are the first to be left out for size.
    Among the others, later checkpoints come first, because they include the earlier ones.
    """
    all_shared = list(_shared_pictures(block, contents))
    targets: dict[str, dict[str, _PictureTarget]] = {}  # of each picture, by the id of the fault
    faults = {fault.id: fault for fault in block_faults}
    by_prim: dict[str, list[int]] = {}
    for number, fault in enumerate(block_faults):
        by_prim.setdefault(fault.finding.prim, []).append(number)
    for shared in all_shared:
        targets[shared.id] = {}
        boxes = _boxes_of(shared.picture)
        prims = (*boxes, shared.picture.path)
        shown = {number for prim in prims for number in by_prim.get(prim, ())}
        for fault in map(block_faults.__getitem__, sorted(shown)):
            if set(fault.stages) & set(shared.stages):
                target = _target_of(fault.finding, shared.picture, boxes)
                targets[shared.id][fault.id] = target
    faults_and_topics = CHARACTERS_PER_FAULT * len(block_faults) + CHARACTERS_PER_TOPIC * len(
        topic_rows(contents)
    )
    characters_left = max(PICTURE_CHARACTERS - faults_and_topics, LEAST_CHARACTERS)
    drawn: dict[str, str] = {}

    def order(shared: _SharedPicture) -> tuple[bool, int]:
        return not targets[shared.id], -shared.stages[-1]

    for shared in sorted(all_shared, key=order):
        text = _svg(shared, targets[shared.id], faults)
        if len(text) <= characters_left:
            characters_left -= len(text)
            drawn[shared.id] = text
    links: dict[str, list[PortLink]] = {}
    pictures: list[PagePicture] = []
    for shared in all_shared:
        picture = shared.picture
        pictures.append(
            PagePicture(
                id=shared.id,
                title=picture.title,
                kind=picture.kind,
                stages=shared.stages,
                size=(picture.width, picture.height),
                faults=len(targets[shared.id]),
                severity=min(  # the gravest
                    (faults[name].finding.severity for name in targets[shared.id]),
                    key=SEVERITIES.index,
                    default="error",
                ),
                svg=drawn.get(shared.id),
                lines=shared.lines,
            )
        )
        for name, (port, view) in targets[shared.id].items() if shared.id in drawn else ():
            element = f"{shared.id}-{port}"
            link = PortLink(element, shared.id, picture.title, shared.stages, view)
            links.setdefault(name, []).append(link)
    return pictures, {name: tuple(ways[:MOST_LINKS]) for name, ways in links.items()}


def _shared_pictures(
    block: Block, contents: Mapping[int, StageContent]
) -> Iterator[_SharedPicture]:
    """Yield each different picture with its stages: graph by graph, in the order of the lab."""
    stages: dict[Picture, list[int]] = {}
    versions: dict[tuple[str, str], list[Picture]] = {}
    for index in sorted(contents):
        for picture in contents[index].pictures:
            if picture not in stages:
                versions.setdefault((picture.kind, picture.title), []).append(picture)
            stages.setdefault(picture, []).append(index)
    for number, picture in enumerate(chain.from_iterable(versions.values())):
        shown = tuple(stages[picture])
        lines = contents[shown[0]].tree if picture.kind == "frames" else ()
        yield _SharedPicture(f"{block.id}-g{number}", picture, shown, lines)


def _svg(
    shared: _SharedPicture,
    targets: Mapping[str, _PictureTarget],
    faults: Mapping[str, ReportedFault],
) -> str:
    links: dict[str, str] = {}
    for name, (target, _) in targets.items():
        links.setdefault(target, f"#{name}")
    boxes = _boxes_of(shared.picture)
    for fault in map(faults.__getitem__, targets):
        if boxes:
            for target, _ in _related_targets(fault.finding, shared.picture, boxes):
                links.setdefault(target, f"#{fault.id}")
    text = svg(shared.picture, f"{shared.id}-", links)
    # The parts beside the faults are drawn from this element; what has links is no image.
    role = 'role="group"' if links else 'role="img"'
    return text.replace("<svg ", f'<svg id="{shared.id}" ', 1).replace('role="img"', role, 1)


def topic_rows(contents: Mapping[int, StageContent]) -> dict[tuple[str, ...], tuple[int, ...]]:
    """Return the rows of the topic table, each once, with the stages that have it."""
    stages: dict[tuple[str, ...], list[int]] = {}
    for index in sorted(contents):
        for cells in contents[index].topics:
            stages.setdefault(cells, []).append(index)
    return {cells: tuple(dict.fromkeys(indexes)) for cells, indexes in stages.items()}


def _boxes_of(picture: Picture) -> Mapping[str, Box]:
    """Return the boxes in which findings are marked, by key."""
    return {box.key: box for box in picture.boxes if picture.kind != "frames"}


def _target_of(finding: Finding, picture: Picture, boxes: Mapping[str, Box]) -> _PictureTarget:
    """Return the element that marks a fault of a picture's graph or of one of its boxes.

    A missing node's finding lies at the graph and names the node.
    """
    if finding.prim in boxes:
        return _target_in(boxes[finding.prim], finding.property, picture)
    for box in picture.boxes:
        name = re.escape(box.key.rpartition("/")[2].removesuffix("_missing"))
        if box.state == "missing" and re.search(rf"\({name}\)", finding.message):
            return _target_in(box, None, picture)
    return port_id(picture.path), ""


def _related_targets(
    finding: Finding, picture: Picture, boxes: Mapping[str, Box]
) -> Iterator[_PictureTarget]:
    """Yield the other ports that a finding names, as far as they are in the picture."""
    for site in finding.related:
        prim, _, prop = site.partition(".")
        if prim in boxes and (not prop or boxes[prim].row(prop)):
            yield _target_in(boxes[prim], prop or None, picture)


def _target_in(box: Box, prop: str | None, picture: Picture) -> _PictureTarget:
    row = None if prop is None else box.row(prop)
    if row is None:
        return port_id(box.key), _view(box, HEADER, picture)
    return port_id(box.key, row.port), _view(box, row.y, picture)


def _view(box: Box, down: float, picture: Picture) -> str:
    """Return the part of the picture around a row of a box, its title too where that fits."""
    width = max(_WIDTH, box.w + 2 * _ROUND)
    height = width * _SHAPE
    across = min(box.x + box.w / 2, box.x + width / 2 - _ROUND)
    has_title = down + _ROUND < height - _ABOVE
    top = box.y - _ABOVE if has_title else box.y + down - height / 2
    entries = picture.legend  # no part of what is shown
    low = entries[0].y - LEGEND_LINE if entries else picture.height
    left, top = (_within(across - width / 2, picture.width - width), _within(top, low - height))
    return f"{left:.0f} {top:.0f} {width:.0f} {height:.0f}"


def _within(value: float, most: float) -> float:
    return max(0.0, min(value, most))
