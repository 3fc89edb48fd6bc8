"""Writes the changes of a layer into its text, and leaves every other byte as it was.

What changed is told by two layers of usd-core, before and after. A statement whose rendering is
the same in both is not touched; of one that differs, only the part that differs is replaced.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from lab3_usd.fix.source_tree import ROOT, Block, Statement, parent_path, read_blocks, read_metadata
from lab3_usd.fix.splices import (
    STEP,
    Splice,
    indent_at,
    insertion,
    line_start,
    reindented,
    removal,
    spliced,
)


class PrimChange(NamedTuple):
    """A prim before and after, each rendered as a layer of its own without its children.

    `before` is None for a prim that is new, whose `after` then holds all that is below it;
    `after` is None for one that is gone.
    """

    path: str
    before: str | None
    after: str | None


def apply_changes(text: str, changes: Iterable[PrimChange]) -> str:
    """Return the text of a layer with these changes made."""
    blocks = read_blocks(text)
    return spliced(text, (one for each in changes for one in _prim(text, blocks, each)))


def _prim(text: str, blocks: Mapping[str, Block], change: PrimChange) -> Iterator[Splice]:
    if change.after is None:
        block = blocks[change.path]
        yield removal(text, block.start, block.end, block.end)
    elif change.before is None:
        yield _new_prim(text, blocks[parent_path(change.path)], change)
    else:
        before, after = change.before, change.after
        olds, news = (read_blocks(each)[change.path] for each in (before, after))
        block = blocks[change.path]
        if _words(before, olds) != _words(after, news):
            yield Splice(block.start, block.name[0] - 1, _words(after, news))
        yield from _metadata(text, block, (before, olds), (after, news))
        yield from _properties(text, block, (before, olds), (after, news))


def _words(text: str, block: Block) -> str:
    """Return specifier and type: what stands before the name."""
    return text[block.start : block.name[0] - 1] if block.path != ROOT else ""


def _new_prim(text: str, parent: Block, change: PrimChange) -> Splice:
    rendered = change.after or ""
    block = read_blocks(rendered)[change.path]
    return insertion(text, parent, reindented(rendered, block.start, block.end, ""))


_Source = tuple[str, Block]
_Parts = tuple[str, str, str]  # words, value, metadata


def _properties(text: str, block: Block, before: _Source, after: _Source) -> Iterator[Splice]:
    names = dict.fromkeys(each.name for each in (*before[1].statements, *after[1].statements))
    for name in names:
        here = block.of(name)
        declared = [each for each in here if each.key == ""]
        olds, news = (_parts_of(*one, name, assumed=bool(declared)) for one in (before, after))
        for key in dict.fromkeys((*olds, *news)):
            own = [each for each in here if each.key == key]
            if key not in news:
                yield from (removal(text, each.start, each.stop, each.end) for each in own)
            elif own:
                yield from _changed(text, own[-1], olds.get(key, _split(text, own[-1])), news[key])
            elif olds.get(key) != news[key]:
                shown = _written(news[key], after, name, _indent_in(text, block))
                yield _new_statement(text, block, here[-1] if here else None, shown)


def _parts_of(text: str, block: Block, name: str, *, assumed: bool) -> dict[str, _Parts]:
    """Return the statements of a property by their keys, each as words, value and metadata.

    usd-core leaves out a declaration that says nothing beside other statements. One that stands in
    the file is `assumed` in the rendering as well.
    """
    found = {each.key: _split(text, each) for each in block.of(name)}
    if assumed and found and "" not in found:
        key, (words, *_) = next(iter(found.items()))
        edit, _, suffix = key.partition(" ")
        bare = words.removeprefix(edit).removesuffix(f".{suffix}").strip()
        found = {"": (bare, "", ""), **found}
    return found


def _written(parts: _Parts, rendered: _Source, name: str, indent: str) -> str:
    """Return a statement as it is written at an indent."""
    source, block = rendered
    for each in block.of(name):
        if _split(source, each) == parts:
            return _statement_text(source, each, indent)
    return indent + parts[0]


def _statement_text(rendered: str, statement: Statement, indent: str) -> str:
    return reindented(rendered, statement.start, statement.stop, indent)


def _changed(text: str, own: Statement, old: _Parts, new: _Parts) -> Iterator[Splice]:
    """Replace the words, the value or the metadata of a statement, whichever differs."""
    if old[0] != new[0]:
        yield Splice(own.start, own.head, new[0])
    at = own.head
    if old[1] != new[1]:
        yield _part(own.value, at, new[1], " = ")
    at = own.value[1] if own.value else at
    if old[2] != new[2]:
        shown = reindented(new[2], 0, len(new[2]), indent_at(text, own.start)).lstrip()
        yield _part(own.meta, at, shown, " ")


def _split(text: str, statement: Statement) -> _Parts:
    """Return the words of a statement, its value and its metadata."""
    value, meta = (slice(*(each or (0, 0))) for each in (statement.value, statement.meta))
    return text[statement.start : statement.head], text[value], text[meta]


def _part(span: tuple[int, int] | None, at: int, new: str, lead: str) -> Splice:
    if span is None:
        return Splice(at, at, f"{lead}{new}")
    return Splice(*span, new) if new else Splice(at, span[1], "")


def _metadata(text: str, block: Block, before: _Source, after: _Source) -> Iterator[Splice]:
    olds, news = (
        {(each.key, each.name): each for each in read_metadata(*one)} for one in (before, after)
    )
    own = {(each.key, each.name): each for each in read_metadata(text, block)}
    added = []
    for key in dict.fromkeys((*olds, *news)):
        if key not in news:
            found = own[key]
            yield removal(text, found.start, found.stop, found.end)
        elif key not in own:
            added.append(_statement_text(after[0], news[key], _indent_in(text, block)))
        elif key not in olds:
            continue
        else:
            old, new = _split(before[0], olds[key]), _split(after[0], news[key])
            yield from _changed(text, own[key], old, new)
    if added:
        yield _new_metadata(text, block, added)


def _new_metadata(text: str, block: Block, added: list[str]) -> Splice:
    indent = "" if block.path == ROOT else indent_at(text, block.start)
    lines = "\n".join(added)
    if block.meta is None:
        return Splice(block.head, block.head, f" (\n{lines}\n{indent})")
    close = block.meta[1]
    line = line_start(text, close)
    if text[line:close].strip():
        return Splice(close, close, f"\n{lines}\n{indent}")
    return Splice(line, line, f"{lines}\n")


def _new_statement(text: str, block: Block, after: Statement | None, new: str) -> Splice:
    """Put a statement behind another one, else behind the last property of its prim."""
    last = after or (block.statements[-1] if block.statements else None)
    pos = last.end if last else block.body[0]
    if last and text[pos - 1] == "\n":
        return Splice(pos, pos, f"{new}\n")
    if last:
        return Splice(pos, pos, f"\n{new}\n{indent_at(text, block.start)}")
    rest = text[pos:].partition("\n")
    if not rest[0].strip() and rest[1]:
        pos += len(rest[0]) + 1
        return Splice(pos, pos, f"{new}\n")
    return Splice(pos, pos, f"\n{new}\n{indent_at(text, block.start)}")


def _indent_in(text: str, block: Block) -> str:
    """Return how far the statements of a block stand in."""
    for each in block.statements[:1]:
        if not text[line_start(text, each.start) : each.start].strip():
            return indent_at(text, each.start)
    return indent_at(text, block.start) + STEP
