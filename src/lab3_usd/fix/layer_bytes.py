"""Turns an edited layer into the bytes of its file, and makes sure that they say the same."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from lab3_usd.errors import StageError
from lab3_usd.fix.source_tree import ROOT, parent_path, read_blocks
from lab3_usd.fix.splices import Splice, indent_at, indented, insertion, removal, spliced
from lab3_usd.fix.text_editor import PrimChange, apply_changes
from lab3_usd.stage.edit.contents import (
    child_names,
    crate_bytes,
    has_prim,
    is_text,
    layer_from,
    render_prim,
    render_tree,
    same_content,
)
from lab3_usd.stage.edit.session import EditedLayer
from lab3_usd.stage.text.usda_scan import ASSET, BLOCK_COMMENT, LINE_COMMENT, STRING

if TYPE_CHECKING:
    from pxr import Sdf

_OPAQUE = f"{STRING}|{ASSET}|{LINE_COMMENT}|{BLOCK_COMMENT}"


def new_bytes(edited: EditedLayer) -> bytes:
    """Return what the file of an edited layer is to hold.

    Raises:
        StageError: the text cannot be made to say what the edits ask for.
    """
    path = Path(edited.layer.realPath)
    if same_content(edited.before, edited.layer):
        return path.read_bytes()
    if not is_text(edited.layer):
        return crate_bytes(edited.layer)
    text = new_text(path.read_bytes().decode(), edited)
    written = layer_from(text)
    if written is None or not same_content(written, edited.layer):
        message = f"{path}: the repaired text does not say what the repairs ask for"
        raise StageError(message)
    return text.encode()


def new_text(text: str, edited: EditedLayer) -> str:
    """Return the text of a layer with its edits."""
    for path, name, to in edited.renames:
        text = _renamed_property(text, path, name, to)
    for path, to in edited.moves:
        text = _moved_text(text, path, to)
    is_renamed = bool(edited.renames or edited.moves)
    before = (layer_from(text) if is_renamed else None) or edited.before
    touched = dict.fromkeys(_now(each, edited.moves) for each in edited.touched)
    return apply_changes(text, _changes(before, edited.layer, touched))


def _now(path: str, moves: list[tuple[str, str]]) -> str:
    """Return where a prim stands after it was moved."""
    for old, to in moves:
        if path == old or path.startswith(f"{old}/"):
            path = to + path[len(old) :]
    return path


def _changes(before: Sdf.Layer, after: Sdf.Layer, paths: dict[str, None]) -> Iterator[PrimChange]:
    """Yield how prims differ; what is new or gone as a whole is one change."""
    told: set[str] = set()
    for path in paths:
        top = _top(path, before, after)
        if top in told:
            continue
        told.add(top)
        was, is_there = has_prim(before, top), has_prim(after, top)
        if was and is_there:
            yield PrimChange(top, render_prim(before, top), render_prim(after, top))
            children = {f"{top.rstrip('/')}/{name}" for name in child_names(before, top)}
            for child in sorted(children):
                if not has_prim(after, child) and child not in told:
                    told.add(child)
                    yield PrimChange(child, "", None)
        elif is_there:
            yield PrimChange(top, None, render_tree(after, top))
        elif was:
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
    return _renamed_paths(text, path, to)


def _renamed_property(text: str, path: str, name: str, to: str) -> str:
    """Return the text of a layer with one property of a prim renamed where it stands."""
    block = read_blocks(text).get(path)
    renamed = []
    for each in block.of(name) if block else ():
        start = text.rindex(name, each.start, each.head)
        renamed.append(Splice(start, start + len(name), to))
    return spliced(text, renamed)


def _renamed_paths(text: str, path: str, to: str) -> str:
    """Let what names a prim name it at its new path; strings and comments stay."""
    named = re.compile(rf"{_OPAQUE}|<{re.escape(path)}(?=[>/.])", re.DOTALL)
    return named.sub(lambda found: f"<{to}" if found[0].startswith("<") else found[0], text)


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
