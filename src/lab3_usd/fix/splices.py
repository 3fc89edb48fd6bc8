"""Parts of a text that are replaced, and how lines and prims are put in and taken out."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from lab3_usd.fix.source_tree import ROOT, Block
from lab3_usd.stage.statements import ASSET, BLOCK_COMMENT, LINE_COMMENT, STRING

STEP = "    "
OPAQUE = re.compile(f"{STRING}|{ASSET}|{LINE_COMMENT}|{BLOCK_COMMENT}", re.DOTALL)


class Splice(NamedTuple):
    """A text that replaces what is between two offsets."""

    start: int
    end: int
    text: str


def spliced(text: str, splices: Iterable[Splice], start: int = 0, stop: int | None = None) -> str:
    """Return the text, or a part of it, with all of these replaced; they do not overlap.

    What is inserted at one place stays in the order given.
    """
    line_end = _line_end_of(text)
    pieces: list[str] = []
    pos = start
    for splice in sorted(splices, key=lambda splice: splice[:2]):
        pieces += (text[pos : splice.start], splice.text.replace("\n", line_end))
        pos = splice.end
    return "".join((*pieces, text[pos:stop]))


@lru_cache(maxsize=8)
def _line_end_of(text: str) -> str:
    """Return how the lines of a text end."""
    return "\r\n" if "\r\n" in text else "\n"


def insertion(text: str, parent: Block, block: str) -> Splice:
    """Put the text of a prim at the end of a body."""
    lines = indented(block, "" if parent.path == ROOT else indent_at(text, parent.start) + STEP)
    if parent.path == ROOT:
        gap = "" if text.endswith("\n") else "\n"
        return Splice(len(text), len(text), f"{gap}\n{lines}\n")
    close = parent.body[1]
    line = line_start(text, close)
    if text[line:close].strip():
        return Splice(close, close, f"\n{lines}\n{indent_at(text, parent.start)}")
    gap = "\n" if text[parent.body[0] : line].strip() else ""
    return Splice(line, line, f"{gap}{lines}\n")


def removal(text: str, start: int, stop: int, end: int) -> Splice:
    """Take out what stands between two offsets, with its lines where nothing else is in them."""
    line = line_start(text, start)
    rest = text[stop:].partition("\n")
    is_block = text[stop - 1] == "}" and stop == end
    if text[line:start].strip() or rest[0].strip(" \t\r;"):
        close = max(stop, end) if text[end - 1 : end] == ";" else stop
        if not (is_block or text[line:start].strip()):  # a comment stands where it stood
            close += len(text[close:]) - len(text[close:].lstrip(" \t"))
        return Splice(start, close, "")
    last = stop + len(rest[0]) + len(rest[1])
    above = line_start(text, line - 1) if line else 0
    if is_block and line and not text[above:line].strip():
        line = above
    return Splice(line, last, "")


def line_rest(text: str, pos: int) -> tuple[str, str]:
    """Return what is left of a line, and its end."""
    end = text.find("\n", pos)
    return (text[pos:], "") if end < 0 else (text[pos:end], "\n")


def line_start(text: str, pos: int) -> int:
    """Return where the line of an offset begins."""
    return text.rfind("\n", 0, max(pos, 0)) + 1


def indent_at(text: str, pos: int) -> str:
    """Return the white space before the first word of a line."""
    line = text[line_start(text, pos) : pos]
    return line[: len(line) - len(line.lstrip())]


def indented(text: str, indent: str, was: str = "") -> str:
    """Return a text whose lines stand in by one indent instead of another; strings stay."""
    kept = {
        match.start() + index + 1
        for match in OPAQUE.finditer(text)
        for index, letter in enumerate(match[0])
        if letter == "\n" and match[0][0] in "\"'"
    }
    lines, pos = [], 0
    for line in text.split("\n"):
        moved = indent + line.removeprefix(was) if line.strip() else line
        lines.append(line if pos in kept else moved)
        pos += len(line) + 1
    return "\n".join(lines)


def reindented(text: str, start: int, stop: int, indent: str) -> str:
    """Return a part of a text as it stands at another depth."""
    return indented(text[start:stop], indent, indent_at(text, start))
