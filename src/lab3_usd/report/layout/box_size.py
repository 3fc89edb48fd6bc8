"""The size of a box and the height of each row."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from lab3_usd.report.layout.text_width import text_width
from lab3_usd.report.picture import HEADER, Box, Row

TITLE_SIZE = 13.0
SMALL = 11.0  # subtitles, values, the line about ports that are not drawn
LABEL_SIZE = 12.0
ROW = 22.0
LINE = 15.0  # every further line of a row
PAD = 14.0  # from a port's place on the edge to its text
SPACE = 18.0  # between the two texts of a line
EDGE = 8.0  # above the first and below the last row
SMALLEST = 170.0
BADGE = 22.0  # the mark of a faulty box, right of its title
EXPECTED = "expected "


def sized(box: Box) -> Box:
    """Return the box with its size, and its rows with their heights."""
    bands = max(len(box.inputs), len(box.outputs))
    top = HEADER + EDGE
    inputs = _stacked(box.inputs, top)
    outputs = _stacked(box.outputs, top)
    top += bands * ROW
    if bands and box.settings:
        top += EDGE
    settings = _stacked(box.settings, top)
    top += sum(row_height(row) for row in box.settings)
    if box.more:
        top += ROW
    empty = not (bands or box.settings or box.more)
    return replace(
        box,
        inputs=inputs,
        outputs=outputs,
        settings=settings,
        w=_width(box),
        h=HEADER if empty else top + EDGE,
    )


def row_height(row: Row) -> float:
    """Return the height of a row: a line per value and per expected value."""
    lines = max(1, len(row.value)) + len(row.expected)
    return ROW + LINE * (lines - 1)


def _stacked(rows: Sequence[Row], top: float) -> tuple[Row, ...]:
    placed = []
    for row in rows:
        placed.append(replace(row, y=top + ROW / 2))
        top += row_height(row)
    return tuple(placed)


def _width(box: Box) -> float:
    title = text_width(box.title, TITLE_SIZE, bold=True) + 2 * PAD
    if box.state != "ok":
        title += BADGE
    left = max((_label(row) for row in box.inputs), default=0.0)
    right = max((_label(row) for row in box.outputs), default=0.0)
    widest = max(
        SMALLEST,
        title,
        text_width(box.subtitle, SMALL) + 2 * PAD,
        left + right + 2 * PAD + (SPACE if left and right else 0),
        text_width(box.more, SMALL) + 2 * PAD,
        *(_setting(row) for row in box.settings),
    )
    return float(round(widest / 2 + 0.5) * 2)


def _label(row: Row) -> float:
    return text_width(row.label, LABEL_SIZE, bold=row.state != "ok")


def _setting(row: Row) -> float:
    bold = row.state != "ok"
    first = text_width(row.value[0], SMALL, bold=bold) if row.value else 0.0
    lines = [_label(row) + SPACE + first]
    lines += [text_width(line, SMALL, bold=bold) for line in row.value[1:]]
    lines += [text_width(EXPECTED + line, SMALL) for line in row.expected]
    return max(lines) + 2 * PAD
