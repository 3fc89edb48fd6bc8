"""A code frame: numbered lines of a layer with a caret under the fault, fitted to the terminal."""

from __future__ import annotations

from unicodedata import combining, east_asian_width

from lab3_usd.report.escape import visible
from lab3_usd.report.excerpt import Excerpt

TAB = "    "
MORE = "..."
LEAD = 20  # columns kept before the caret when a long line is cut


def code_frame(excerpt: Excerpt, line: int, column: int | None, width: int) -> list[str]:
    """Return the lines of the frame, none wider than `width` columns.

    `column` counts characters from 1; without it the line alone is marked.
    """
    numbers = range(excerpt.first, excerpt.first + len(excerpt.lines))
    gutter = len(str(numbers[-1]))
    margin = _common_indent(excerpt.lines)
    room = max(width - gutter - 5, LEAD + len(MORE) * 2)
    frame = []
    for number, raw in zip(numbers, excerpt.lines, strict=True):
        mark = ">" if number == line else " "
        shown, caret = _fitted(raw[margin:], (column or 1) - 1 - margin, room)
        frame.append(f"{mark} {number:>{gutter}} | {shown}".rstrip())
        if number == line and column is not None:
            frame.append(f"  {'':>{gutter}} | {' ' * caret}^")
    return frame


def _common_indent(lines: tuple[str, ...]) -> int:
    indents = [len(line) - len(line.lstrip(" \t")) for line in lines if line.strip()]
    return min(indents, default=0)


def _fitted(raw: str, position: int, room: int) -> tuple[str, int]:
    """Return the line as shown in `room` columns, and the column of the character `position`."""
    position = min(max(position, 0), len(raw))
    caret = _columns(_printed(raw[:position]))
    shown = _printed(raw)
    if _columns(shown) <= room:
        return shown, caret
    if caret + len(MORE) < room:
        return _cut(shown, room - len(MORE)) + MORE, caret
    start = max(position - LEAD, 0)
    head = MORE + _printed(raw[start:position])
    if _columns(head) >= room - len(MORE):
        head = MORE
    rest = head + _printed(raw[position : position + room])
    tail = MORE if _columns(rest) > room else ""
    return _cut(rest, room - len(tail)) + tail, _columns(head)


def _printed(raw: str) -> str:
    return visible(raw.replace("\t", TAB))


def _cut(shown: str, room: int) -> str:
    while _columns(shown) > room:
        shown = shown[: room - _columns(shown)]
    return shown


def _columns(shown: str) -> int:
    if shown.isascii():
        return len(shown)
    return sum(_letter_columns(letter) for letter in shown)


def _letter_columns(letter: str) -> int:
    if combining(letter):
        return 0
    return 2 if east_asian_width(letter) in "WF" else 1
