"""The syntax tree of a text layer: blocks, metadata and statements, as offsets."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

from msgspec import Struct, field

from lab3_usd.stage.statements import (
    BLOCK_COMMENT,
    HEAD,
    LIST_EDITS,
    OPENING,
    ORDER,
    STRING,
    VARIANT,
    after_blank,
    group_end,
    opened_path,
    statement_end,
)

ROOT = "/"
_SUFFIX = re.compile(r"\.(\w+)")
_BLANKS = re.compile(rf"(?:[ \t]|{BLOCK_COMMENT})*")
_ATOM = re.compile(rf"""{STRING}|@@@.*?@@@|@[^@]*@|<[^>]*>|[^\s()\[\]{{}};"'@<>#]+""", re.DOTALL)
_DOCUMENTATION = '"'


class Statement(Struct, frozen=True):
    """A statement of a body or of metadata, as offsets.

    `key` tells statements of one property apart: `` for the declaration, ` connect`, `prepend`,
    `delete connect`. `stop` is where the statement itself ends, `end` is past its line end.
    """

    name: str
    key: str
    start: int
    stop: int
    end: int
    head: int  # where the words before the value end
    value: tuple[int, int] | None = None
    meta: tuple[int, int] | None = None


class Block(Struct):
    """A prim, a variant or the layer itself: `body` and `meta` lie between their brackets.

    `inner` are the blocks that stand in its body.
    """

    path: str
    start: int = 0
    head: int = 0
    name: tuple[int, int] = (0, 0)
    meta: tuple[int, int] | None = None
    body: tuple[int, int] = (0, 0)
    end: int = 0
    statements: list[Statement] = field(default_factory=list)
    inner: list[Block] = field(default_factory=list)

    def of(self, name: str) -> list[Statement]:
        """Return the statements of one property, in the order of the file."""
        return [statement for statement in self.statements if statement.name == name]


def parent_path(path: str) -> str:
    """Return the path of the block around a prim."""
    return path.rpartition("/")[0] or ROOT


@lru_cache(maxsize=8)  # several edits look at one text
def read_blocks(text: str) -> Mapping[str, Block]:
    """Return the blocks of a layer by their paths; the layer's own is `/`.

    The text is one that OpenUSD accepts.
    """
    first = text.find("\n") if "\n" in text else len(text)
    pos = after_blank(text, 0)
    root = Block(ROOT, start=first, head=first, end=len(text))
    if text.startswith("(", pos):
        root.meta = (pos + 1, group_end(text, pos) - 1)
        pos = root.meta[1] + 1
    root.body = (pos, len(text))
    blocks, opened = {ROOT: root}, [root]
    pos = after_blank(text, pos)
    while pos < len(text):
        block = opened[-1]
        opening = (VARIANT if block.path.endswith("=") else OPENING).match(text, pos)
        if text[pos] == "}":
            pos += 1
            block.body, block.end = (block.body[0], pos - 1), pos
            opened.pop()
        elif opening:
            inner = _opened(text, block, opening)
            blocks.setdefault(inner.path, inner)
            block.inner.append(inner)
            opened.append(inner)
            pos = inner.body[0]
        else:
            statement = _statement(text, pos)
            if not ORDER.match(text, pos):
                block.statements.append(statement)
            pos = statement.end
        pos = after_blank(text, pos)
    return blocks


def _opened(text: str, block: Block, opening: re.Match[str]) -> Block:
    body = "" if block.path == ROOT else block.path
    path = opened_path(body, opening)
    kind = str(opening.lastgroup)
    first, last = opening.span(kind)
    inner = Block(
        path=f"{path}}}" if path.endswith("=") and kind == "variant" else path,
        start=opening.start(),
        head=opening.end(),
        name=(first + 1, last - 1),
    )
    pos = after_blank(text, opening.end())
    if text.startswith("(", pos):
        inner.meta = (pos + 1, group_end(text, pos) - 1)
        pos = after_blank(text, inner.meta[1] + 1)
    inner.body = (pos + 1, pos + 1)
    return inner


def read_metadata(text: str, block: Block) -> list[Statement]:
    """Return the statements between the brackets of a block's metadata."""
    statements: list[Statement] = []
    start, stop = block.meta or (0, 0)
    pos = after_blank(text, start) if block.meta else stop
    while pos < stop:
        statements.append(_statement(text, pos))
        pos = after_blank(text, statements[-1].end)
    return statements


def _statement(text: str, pos: int) -> Statement:
    end = statement_end(text, pos)
    if text[end - 1 : end + 1] == "\r\n":
        end += 1
    words = HEAD.match(text, pos, end)
    if words is None:  # documentation stands alone
        stop = _value_end(text, pos)
        return Statement("", _DOCUMENTATION, pos, stop, end, stop)
    name = words["name"] or words["first"]
    suffix = _SUFFIX.match(text, words.end())
    edit = words["first"] if words["first"] in LIST_EDITS else ""
    last = words.end("name" if words["name"] else "first")
    head = suffix.end() if suffix else last
    value, meta = _parts(text, head, end)
    stop = (meta or value or (0, head))[1]
    key = f"{edit} {suffix[1]}" if suffix else edit
    return Statement(name, key, pos, stop, end, head, value, meta)


def _parts(text: str, pos: int, stop: int) -> tuple[tuple[int, int] | None, tuple[int, int] | None]:
    """Return where the value of a statement and its metadata stand, brackets included."""
    value = None
    pos = _past_blanks(text, pos)
    if text.startswith("=", pos) and pos < stop:
        pos = _past_blanks(text, pos + 1)
        value = (pos, _value_end(text, pos))
        pos = _past_blanks(text, value[1])
    if text.startswith("(", pos) and pos < stop:
        return value, (pos, group_end(text, pos))
    return value, None


def _past_blanks(text: str, pos: int) -> int:
    blanks = _BLANKS.match(text, pos)
    return blanks.end() if blanks else pos


def _value_end(text: str, pos: int) -> int:
    if text[pos] in "([{":
        return group_end(text, pos)
    atom = _ATOM.match(text, pos)
    return atom.end() if atom else pos + 1


def list_items(text: str) -> list[tuple[int, int]] | None:
    """Return where the items of a list stand in its text; None for any other value."""
    if not text.startswith("["):
        return None
    items = []
    pos, last = after_blank(text, 1), group_end(text, 0) - 1
    while pos < last:
        items.append((pos, _value_end(text, pos)))
        pos = after_blank(text, items[-1][1])
        if text.startswith(",", pos):
            pos = after_blank(text, pos + 1)
        elif pos < last:
            return None
    return items
