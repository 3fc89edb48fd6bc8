"""A box as SVG: header, rows with their ports, values, and what should be there instead."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.report.layout.box_size import EXPECTED, LINE, PAD, ROW, row_height
from lab3_usd.report.picture import HEADER, Box, Row
from lab3_usd.report.picture_formats.svg_elements import (
    ElementIds,
    mark,
    note,
    number,
    port,
    rect,
    text,
)

CORNER = 8.0
BASELINE = 4.0  # from the middle of a line of 12 px to its baseline


def box_svg(box: Box, ids: ElementIds) -> str:
    """Return the group of one box."""
    ghost = " ghost" if box.state == "missing" else ""
    header = "".join(_header(box))
    head = ids.linked(f"<g{ids.id(box.key)}>{note(box.note)}{header}</g>", box.key)
    rows = "".join(_row(box, row, ids) for row in box.rows)
    more = text(box.more, box.x + PAD, box.y + box.h - 14, "m") if box.more else ""
    state = "" if box.state == "ok" else f" {box.state}"
    frame = rect(box.x, box.y, (box.w, box.h), f"b{state}", CORNER)
    return f'<g class="n{ghost}">{frame}{head}{_separator(box)}{rows}{more}</g>'


def _header(box: Box) -> Iterator[str]:
    if box.state != "missing":
        yield f'<path class="f-{box.family}" d="{_header_path(box)}"/>'
    yield text(box.title, box.x + PAD, box.y + (19 if box.subtitle else 27), "t")
    if box.subtitle:
        yield text(box.subtitle, box.x + PAD, box.y + 35, "u")
    if box.state != "ok":
        yield mark(box.x + box.w - 16, box.y + 16, box.state)


def _header_path(box: Box) -> str:
    """Return the header inside the border; its lower corners are round where nothing is below."""
    # Half a pixel inside, so that the border stays whole.
    left, top = number(box.x + 0.5), number(box.y + CORNER)
    width, radius = box.w - 1, CORNER - 0.5
    upper = f"M{left} {top}a{radius:g} {radius:g} 0 0 1 {radius:g}-{radius:g}"
    upper += f"h{number(width - 2 * radius)}a{radius:g} {radius:g} 0 0 1 {radius:g} {radius:g}"
    if box.h > HEADER:
        return f"{upper}v{number(HEADER - CORNER)}H{left}z"
    lower = f"v{number(HEADER - 2 * CORNER)}a{radius:g} {radius:g} 0 0 1-{radius:g} {radius:g}"
    lower += f"h-{number(width - 2 * radius)}a{radius:g} {radius:g} 0 0 1-{radius:g}-{radius:g}z"
    return upper + lower


def _separator(box: Box) -> str:
    if not box.settings or not (box.inputs or box.outputs):
        return ""
    y = box.y + box.settings[0].y - ROW / 2 - 4
    right = number(box.w - 2 * PAD)
    return f'<path class="rule" d="M{number(box.x + PAD)} {number(y)}h{right}"/>'


def _row(box: Box, row: Row, ids: ElementIds) -> str:
    content = "".join((*_texts(box, row), *_ports(box, row)))
    place = ids.id(box.key, row.port)
    if not place and row.state == "ok":
        # Nobody asks for this row by its id: a page of many pictures stays small.
        return f"<g>{note(row.note)}{content}</g>" if row.note else content
    state = "" if row.state == "ok" else f" {row.state}"
    group = f'<g class="r{state}"{place}>{note(row.note)}{_behind(box, row)}{content}</g>'
    return ids.linked(group, box.key, row.port)


def _behind(box: Box, row: Row) -> str:
    """Return the area that lights up; rows of ports share a line, each has its half."""
    width = box.w - 2
    left = box.x + 1
    if row not in box.settings and box.inputs and box.outputs:
        width /= 2
        left += width if row in box.outputs else 0.0
    height = row_height(row)
    return rect(left, box.y + row.y - ROW / 2, (width, height), "hit")


def _texts(box: Box, row: Row) -> Iterator[str]:
    y = box.y + row.y + BASELINE
    right = box.x + box.w - PAD
    if row.side == "out" and not row.value:
        yield text(row.label, right, y, "e")
    else:
        yield text(row.label, box.x + PAD, y)
    look = "v m" if row.muted and row.state == "ok" else "v"
    for line in row.value:
        yield text(line, right, y, look)
        y += LINE
    for line in row.expected:
        yield text(EXPECTED + line, right, y, "v s")
        y += LINE


def _ports(box: Box, row: Row) -> Iterator[str]:
    y = box.y + row.y
    if row.side in {"in", "both"}:
        yield port(box.x, y, execution=row.execution, wired=row.wired)
    if row.side in {"out", "both"}:
        yield port(box.x + box.w, y, execution=row.execution, wired=row.wired)
