"""Places in the text of a stage: its graphs and nodes, and what stands at the end of a path."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.fix.source_tree import ROOT, Block, read_blocks

_PATH = re.compile(r"<([^<>\n]*)>")
_TYPE = re.compile(r"(?:def|over|class)\s+(\w+)?")
_NODE_TYPE = re.compile(r'node:type\s*=\s*"([^"\n]*)"')
_VARIANT = re.compile(r"\{[^}]*\}")


class Span(Struct, frozen=True):
    """A part of a text: offsets of its begin and its end."""

    start: int
    stop: int


class Symbol(Struct, frozen=True):
    """A prim of a text: its name, what it is, where it stands, and the prims below it."""

    name: str
    kind: str
    whole: Span
    name_span: Span
    below: tuple[Symbol, ...] = ()


class Lines:
    """Where the lines of a text begin: offsets to lines and columns, both from 0, and back."""

    def __init__(self, text: str) -> None:
        """Find where each line begins."""
        self.starts = [0, *(match.end() for match in re.finditer("\n", text))]

    def place(self, offset: int) -> tuple[int, int]:
        """Return the line and the column of an offset."""
        line = bisect_right(self.starts, offset) - 1
        return line, offset - self.starts[line]

    def offset(self, line: int, column: int) -> int:
        """Return the offset of a place; the end of the last line for lines beyond it."""
        return self.starts[min(line, len(self.starts) - 1)] + column


def outline(text: str) -> tuple[Symbol, ...]:
    """Return the prims of a layer as its text has them; nodes are called by their type.

    The text is one that OpenUSD accepts.
    """
    return tuple(_symbols(text, read_blocks(text)[ROOT]))


def _symbols(text: str, block: Block) -> Iterator[Symbol]:
    for inner in block.inner:
        if inner.path.endswith(("=", "}")):  # variants
            yield from _symbols(text, inner)
            continue
        typed = _TYPE.match(text, inner.start)
        node = _NODE_TYPE.search(text, *inner.body) if not inner.inner else None
        yield Symbol(
            inner.path.rpartition("/")[2],
            node[1] if node else (typed[1] or "" if typed else ""),
            Span(inner.start, inner.end),
            Span(*inner.name),
            tuple(_symbols(text, inner)),
        )


def path_at(text: str, offset: int) -> tuple[str, Span] | None:
    """Return the path between the angle brackets around an offset, made absolute, and its span."""
    line_start = text.rfind("\n", 0, offset) + 1
    line_end = text.find("\n", offset)
    for match in _PATH.finditer(text, line_start, line_end if line_end >= 0 else len(text)):
        if match.start() <= offset <= match.end():
            return _absolute(match[1], text, offset), Span(match.start(1), match.end(1))
    return None


def _absolute(path: str, text: str, offset: int) -> str:
    """Return a path as it is from the root; one that begins with no slash is from its prim."""
    if path.startswith("/") or not path:
        return path
    here = block_at(text, offset).path
    while path.startswith("../"):
        here, path = here.rpartition("/")[0], path[3:]
    return f"{here}{path}" if path.startswith(".") else f"{here}/{path}"


def block_at(text: str, offset: int) -> Block:
    """Return the innermost prim of a text around an offset, the layer itself outside of all."""
    blocks = read_blocks(text)
    around = [block for block in blocks.values() if block.start <= offset < block.end]
    return max(around, key=lambda block: block.start, default=blocks[ROOT])


def definition(text: str, path: str) -> Span | None:
    """Return where a layer has the prim or property at a path, None where it does not."""
    prim, _, name = path.partition(".")
    block = _without_variants(read_blocks(text)).get(prim)
    if block is None:
        return None
    statements = block.of(name) if name else []
    if statements:
        return Span(statements[0].start, statements[0].stop)
    return Span(*block.name)


def _without_variants(blocks: Mapping[str, Block]) -> dict[str, Block]:
    """Return the blocks by the paths that prims have on a stage."""
    by_path: dict[str, Block] = {}
    for path, block in blocks.items():
        by_path.setdefault(_VARIANT.sub("", path), block)
    return by_path
