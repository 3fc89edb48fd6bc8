"""Writes the changes of a layer into its text, and leaves every other byte as it was.

Two layers of usd-core, before and after, show what changed. A statement whose rendering is
the same in both is not touched; of one that differs, only the part that differs is replaced.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lab3_usd.errors import StageError
from lab3_usd.fix.source_tree import (
    ROOT,
    Block,
    Statement,
    list_items,
    parent_path,
    read_blocks,
    read_metadata,
)
from lab3_usd.fix.splices import (
    OPAQUE,
    STEP,
    Splice,
    indent_at,
    indented,
    insertion,
    line_rest,
    line_start,
    reindented,
    removal,
    spliced,
)
from lab3_usd.stage.edit.session import (
    EditedLayer,
    child_names,
    crate_bytes,
    has_prim,
    is_text,
    layer_from,
    render_prim,
    render_tree,
    same_content,
    same_prim,
)
from lab3_usd.stage.statements import ASSET

if TYPE_CHECKING:
    from pxr import Sdf


_Source = tuple[str, Block]  # a rendering, and a block of it
_Parts = tuple[str, str, str]  # words, value, metadata


class PrimChange(NamedTuple):
    """A prim before and after, each rendered as a layer of its own without its children.

    `before` is None for a prim that is new, whose `after` then holds all that is below it;
    `after` is None for one that is gone.
    """

    path: str
    before: str | None
    after: str | None


def new_bytes(edited: EditedLayer, content: bytes) -> bytes:
    """Return what the file of an edited layer is to hold; `content` is what it holds.

    Raises:
        StageError: the text cannot be made to say what the edits ask for.
    """
    path, before = Path(edited.layer.realPath), edited.before
    # Single prims tell sooner than the whole layers; text that is written anew may be the same.
    seems_same = all(same_prim(before, edited.layer, prim) for prim in edited.touched)
    if (seems_same or not is_text(edited.layer)) and same_content(before, edited.layer):
        return content
    if not is_text(edited.layer):
        return crate_bytes(edited.layer)
    text = new_text(content.decode(), edited)
    written = layer_from(text)
    if written is None or not same_content(written, edited.layer):
        raise StageError(f"{path}: the repaired text does not say what the repairs ask for")
    return text.encode()


def new_text(text: str, edited: EditedLayer) -> str:
    """Return the text of a layer with its edits."""
    text = _with_renamed_properties(text, edited.renames)
    for path, to in edited.moves:
        text = _moved_text(text, path, to)
    is_renamed = bool(edited.renames or edited.moves)
    before = (layer_from(text) if is_renamed else None) or edited.before
    touched = dict.fromkeys(_moved_path(path, edited.moves) for path in edited.touched)
    return apply_changes(text, _changes(before, edited.layer, touched))


def prim_splices(text: str, edited: EditedLayer) -> dict[str, list[Splice]]:
    """Return what is replaced in the text of a layer of which single prims were kept.

    It is given by prim, of new ones by the highest. Only one property may have been renamed, and
    nothing else edited then.
    """
    if edited.renames:
        return {path: _renames(text, edited.renames) for path in edited.touched}
    changes = _changes(edited.before, edited.layer, edited.touched)
    blocks = read_blocks(text)
    return {change.path: [*_prim(text, blocks, change)] for change in changes}


def _moved_path(path: str, moves: list[tuple[str, str]]) -> str:
    """Return where a prim stands after it was moved."""
    for old, to in moves:
        if path == old or path.startswith(f"{old}/"):
            path = to + path[len(old) :]
    return path


def _changes(before: Sdf.Layer, after: Sdf.Layer, paths: dict[str, None]) -> Iterator[PrimChange]:
    """Yield how prims differ; what is new or gone as a whole is one change."""
    seen: set[str] = set()
    for path in paths:
        top = _top(path, before, after)
        if top in seen:
            continue
        seen.add(top)
        was_there, is_there = has_prim(before, top), has_prim(after, top)
        if was_there and is_there:
            yield PrimChange(top, render_prim(before, top), render_prim(after, top))
            children = {f"{top.rstrip('/')}/{name}" for name in child_names(before, top)}
            for child in sorted(children):
                if not has_prim(after, child) and child not in seen:
                    seen.add(child)
                    yield PrimChange(child, "", None)
        elif is_there:
            yield PrimChange(top, None, render_tree(after, top))
        elif was_there:
            yield PrimChange(top, "", None)


def _top(path: str, before: Sdf.Layer, after: Sdf.Layer) -> str:
    """Return the highest prim at or above a path that only one of two layers has."""
    parts = path.split("/")
    for count in range(2, len(parts) + 1):
        above = "/".join(parts[:count])
        if has_prim(before, above) != has_prim(after, above):
            return above
    return path


def _moved_text(text: str, path: str, to: str) -> str:
    """Return the text of a layer with one prim moved or renamed, and every path that names it."""
    if path in read_blocks(text):
        text = _moved_block(text, path, to)
    # Strings and comments stay, and paths in other files.
    paths = re.compile(
        rf"(?:{ASSET})<[^>]*>|{OPAQUE.pattern}|<{re.escape(path)}(?=[>/.])", re.DOTALL
    )
    return paths.sub(lambda match: f"<{to}" if match[0].startswith("<") else match[0], text)


def _with_renamed_properties(text: str, renames: Iterable[tuple[str, str, str]]) -> str:
    """Return the text of a layer with properties renamed where they stand: prim, name, new name."""
    renamed: list[Splice] = []
    named: set[tuple[str, str]] = set()
    for path, name, to in renames:
        if {(path, name), (path, to)} & named:  # which stands in the text only after the others
            text, renamed, named = spliced(text, renamed), [], set()
        renamed += _renames(text, [(path, name, to)])
        named |= {(path, name), (path, to)}
    return spliced(text, renamed)


def _renames(text: str, renames: Iterable[tuple[str, str, str]]) -> list[Splice]:
    """Return where the text names properties: prim, name, new name."""
    blocks = read_blocks(text)
    return [
        Splice(start := text.rindex(name, statement.start, statement.head), start + len(name), to)
        for path, name, to in renames
        if path in blocks
        for statement in blocks[path].of(name)
    ]


def _moved_block(text: str, path: str, to: str) -> str:
    """Rename a block where it stands, or take it to the end of another."""
    text = _with_prim(text, parent_path(to))
    blocks = read_blocks(text)
    block = blocks[path]
    name = to.rpartition("/")[2]
    renamed = text[block.start : block.name[0]] + name + text[block.name[1] : block.end]
    if parent_path(path) == parent_path(to):
        return spliced(text, [Splice(block.start, block.end, renamed)])
    lines = indented(renamed, "", indent_at(text, block.start))
    taken = removal(text, block.start, block.end, block.end)
    return spliced(text, (taken, insertion(text, blocks[parent_path(to)], lines)))


def _with_prim(text: str, path: str) -> str:
    """Return a text in which a prim stands, as an empty over where it was not there."""
    if path == ROOT or path in read_blocks(text):
        return text
    text = _with_prim(text, parent_path(path))
    over = f'over "{path.rpartition("/")[2]}"\n{{\n}}'
    return spliced(text, [insertion(text, read_blocks(text)[parent_path(path)], over)])


def apply_changes(text: str, changes: Iterable[PrimChange]) -> str:
    """Return the text of a layer with these changes made."""
    blocks = read_blocks(text)
    return spliced(text, (splice for change in changes for splice in _prim(text, blocks, change)))


def _prim(text: str, blocks: Mapping[str, Block], change: PrimChange) -> Iterator[Splice]:
    if change.after is None:
        block = blocks[change.path]
        yield removal(text, block.start, block.end, block.end)
    elif change.before is None:
        rendered = read_blocks(change.after)[change.path]
        lines = reindented(change.after, rendered.start, rendered.end, "")
        yield insertion(text, blocks[parent_path(change.path)], lines)
    else:
        block = blocks[change.path]
        before, after = (
            (rendered, read_blocks(rendered)[change.path])
            for rendered in (change.before, change.after)
        )
        if _words(*before) != _words(*after):
            yield Splice(block.start, block.name[0] - 1, _words(*after))
        yield from _metadata(text, block, before, after)
        yield from _properties(text, block, before, after)


def _words(text: str, block: Block) -> str:
    """Return specifier and type: what stands before the name."""
    return text[block.start : block.name[0] - 1] if block.path != ROOT else ""


def _properties(text: str, block: Block, before: _Source, after: _Source) -> Iterator[Splice]:
    names = dict.fromkeys(
        statement.name for statement in (*before[1].statements, *after[1].statements)
    )
    for name in names:
        statements = block.of(name)
        declared = any(statement.key == "" for statement in statements)
        olds, news = (_parts_of(*source, name, assumed=declared) for source in (before, after))
        for key in dict.fromkeys((*olds, *news)):
            own = [statement for statement in statements if statement.key == key]
            if key not in news:
                yield from (
                    removal(text, statement.start, statement.stop, statement.end)
                    for statement in own
                )
            elif own:
                yield from _changed(text, own[-1], olds.get(key, _split(text, own[-1])), news[key])
            elif olds.get(key) != news[key]:
                line = _statement_line(news[key], after, name, _indent_in(text, block))
                yield _new_statement(text, block, statements[-1] if statements else None, line)


def _parts_of(text: str, block: Block, name: str, *, assumed: bool) -> dict[str, _Parts]:
    """Return the statements of a property by their keys, each as words, value and metadata.

    usd-core leaves out a declaration that says nothing beside other statements. One that stands in
    the file is `assumed` in the rendering as well.
    """
    parts = {statement.key: _split(text, statement) for statement in block.of(name)}
    if assumed and parts and "" not in parts:
        key, (words, *_) = next(iter(parts.items()))
        edit, _, suffix = key.partition(" ")
        bare = words.removeprefix(edit).removesuffix(f".{suffix}").strip()
        parts = {"": (bare, "", ""), **parts}
    return parts


def _statement_line(parts: _Parts, rendered: _Source, name: str, indent: str) -> str:
    """Return a statement as it is written at an indent."""
    source, block = rendered
    for statement in block.of(name):
        if _split(source, statement) == parts:
            return reindented(source, statement.start, statement.stop, indent)
    return indent + parts[0]


def _changed(text: str, own: Statement, old: _Parts, new: _Parts) -> Iterator[Splice]:
    """Replace the words, the value or the metadata of a statement, whichever differs."""
    if old[0] != new[0]:
        yield Splice(own.start, own.head, new[0])
    at = own.head
    if old[1] != new[1]:
        items = _changed_items(text, own, old[1], new[1])
        yield from items or [_part(own.value, at, new[1], " = ")]
    at = own.value[1] if own.value else at
    if old[2] != new[2]:
        meta = reindented(new[2], 0, len(new[2]), indent_at(text, own.start)).lstrip()
        yield _part(own.meta, at, meta, " ")


def _changed_items(text: str, own: Statement, old: str, new: str) -> list[Splice]:
    """Replace, add and take out the items of a list that differ, so that its comments stay.

    Empty where the value is no list with comments, or not the list that is rendered as `old`.
    """
    start, stop = own.value or (0, 0)
    is_commented = any(piece[0][0] in "#/" for piece in OPAQUE.finditer(text, start, stop))
    spans = list_items(text[start:stop]) if is_commented else None
    before, after = (_items(value) for value in (old, new))
    if not spans or not after or len(before) != len(spans):
        return []
    matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
    splices = []
    for kind, first, last, begin, end in matcher.get_opcodes():
        if kind == "equal":
            continue
        common = min(last - first, end - begin)
        for (at, to), item in zip(spans[first:], after[begin : begin + common], strict=False):
            splices.append(Splice(start + at, start + to, item))
        added = after[begin + common : end]
        if added and first + common:
            at = start + spans[first + common - 1][1]
            splices.append(Splice(at, at, "".join(f", {item}" for item in added)))
        elif added:
            at = start + spans[0][0]
            splices.append(Splice(at, at, "".join(f"{item}, " for item in added)))
        splices += (
            _without_item(text, start, spans, index) for index in range(first + common, last)
        )
    return splices


def _items(value: str) -> list[str]:
    """Return the items of a rendered list; usd-core writes one target without brackets."""
    spans = list_items(value)
    return [value] if spans is None else [value[at:to] for at, to in spans]


def _without_item(text: str, start: int, spans: list[tuple[int, int]], index: int) -> Splice:
    """Take an item out of a list with the comma behind it, the last one with that before it."""
    at, to = start + spans[index][0], start + spans[index][1]
    rest, _ = line_rest(text, to)
    behind = len(rest) - len(rest.lstrip(" \t"))
    if rest[behind:].startswith(","):
        close = to + behind + 1
        line = line_start(text, at)
        end = text.find("\n", close)
        if not text[line:at].strip() and end >= 0 and not text[close:end].strip():
            return Splice(line, end + 1, "")
        return Splice(at, close + (text[close : close + 1] == " "), "")
    comma = text.rfind(",", start, at)
    is_between = comma >= start + (spans[index - 1][1] if index else 0)
    if index and is_between and not text[comma + 1 : at].strip():
        return Splice(comma, to, "")
    return Splice(at, to, "")


def _split(text: str, statement: Statement) -> _Parts:
    """Return the words of a statement, its value and its metadata."""
    value, meta = (slice(*(span or (0, 0))) for span in (statement.value, statement.meta))
    return text[statement.start : statement.head], text[value], text[meta]


def _part(span: tuple[int, int] | None, at: int, new: str, lead: str) -> Splice:
    if span is None:
        return Splice(at, at, f"{lead}{new}")
    return Splice(*span, new) if new else Splice(at, span[1], "")


def _metadata(text: str, block: Block, before: _Source, after: _Source) -> Iterator[Splice]:
    olds, news = (
        {(statement.key, statement.name): statement for statement in read_metadata(*source)}
        for source in (before, after)
    )
    own = {(statement.key, statement.name): statement for statement in read_metadata(text, block)}
    added = []
    for key in dict.fromkeys((*olds, *news)):
        if key not in news:
            old = own[key]
            yield removal(text, old.start, old.stop, old.end)
        elif key not in own:
            new = news[key]
            added.append(reindented(after[0], new.start, new.stop, _indent_in(text, block)))
        elif key in olds:
            parts = _split(before[0], olds[key]), _split(after[0], news[key])
            yield from _changed(text, own[key], *parts)
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
    rest, end = line_rest(text, pos)
    if not rest.strip() and end:
        pos += len(rest) + 1
        return Splice(pos, pos, f"{new}\n")
    return Splice(pos, pos, f"\n{new}\n{indent_at(text, block.start)}")


def _indent_in(text: str, block: Block) -> str:
    """Return how far the statements of a block stand in."""
    for statement in block.statements[:1]:
        if not text[line_start(text, statement.start) : statement.start].strip():
            return indent_at(text, statement.start)
    return indent_at(text, block.start) + STEP
