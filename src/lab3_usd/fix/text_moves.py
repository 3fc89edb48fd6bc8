"""Moves and renames prims, and renames properties, in the text of a layer."""

from __future__ import annotations

import re

from lab3_usd.fix.source_tree import ROOT, parent_path, read_blocks
from lab3_usd.fix.splices import Splice, indent_at, indented, insertion, removal, spliced
from lab3_usd.stage.read.usda_scan import ASSET, BLOCK_COMMENT, LINE_COMMENT, STRING

_OPAQUE = f"{STRING}|{ASSET}|{LINE_COMMENT}|{BLOCK_COMMENT}"


def moved_text(text: str, path: str, to: str) -> str:
    """Return the text of a layer with one prim moved or renamed, and every path that names it."""
    if path in read_blocks(text):
        text = _moved_block(text, path, to)
    return _renamed_paths(text, path, to)


def renamed_property(text: str, path: str, name: str, to: str) -> str:
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
