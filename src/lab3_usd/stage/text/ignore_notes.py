"""Reads the notes of a stage that say which findings are ignored on purpose."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from lab3_usd.model.finding import IgnoreNote
from lab3_usd.stage.text.usda_scan import ASSET, BLOCK_COMMENT, LINE_COMMENT, STRING

_GROUP, _KEY = "lab3", "ignore"
NAME = f"{_GROUP}:{_KEY}"
_COMMENT = re.compile(r"#[ \t]*lab3:[ \t]*ignore\b(?:\[([^\]\r\n]*)\])?")
# Strings and paths of assets come first: what looks like a comment inside of them is none.
_TOKEN = re.compile(
    rf"{STRING}|{ASSET}|{BLOCK_COMMENT}|(?P<comment>{LINE_COMMENT})", re.DOTALL | re.VERBOSE
)
_ALONE = re.compile(r"\s*(?:#.*)?")
_IN_TEXT = (NAME.encode(), f"dictionary {_GROUP} ".encode())
# A binary layer is packed: of a name in it, at least one of these stands as it is.
_TRACES = (b"lab3", b"ab3:", b"b3:i", b"3:ig")


def read_ignore_notes(stage: Usd.Stage, given: str) -> tuple[IgnoreNote, ...]:
    """Return the notes of a stage; `given` names its root layer.

    Most stages have none: their files are searched for the name and nothing else is done.
    """
    comments: list[IgnoreNote] = []
    may_hold_data = False
    root = stage.GetRootLayer()
    for layer in stage.GetUsedLayers():
        data = _bytes_of(layer)
        if data.startswith(b"#"):
            may_hold_data |= any(form in data for form in _IN_TEXT)
            if _GROUP.encode() in data:
                from lab3_usd.stage.text.source_locations import layer_name  # noqa: PLC0415 - rare

                name = given if layer == root else layer_name(layer, root, given)
                comments += _comments(data.decode("utf-8", "replace"), name)
        else:
            may_hold_data |= any(trace in data for trace in _TRACES)
    return (*comments, *(_in_custom_data(stage) if may_hold_data else ()))


def _bytes_of(layer: Sdf.Layer) -> bytes:
    with suppress(OSError, ValueError):
        return Path(layer.realPath).read_bytes() if layer.realPath else b""
    return _TRACES[0]  # packed in another file: it has to be searched


def _comments(text: str, layer: str) -> Iterator[IgnoreNote]:
    """Yield the notes in comments: of the line that they end, else of the next that says more."""
    if _COMMENT.search(text) is None:
        return
    lines = text.splitlines(keepends=True)
    starts = [*accumulate(map(len, lines), initial=0)]
    for token in _TOKEN.finditer(text):
        found = _COMMENT.search(token["comment"] or "")
        if found is None:
            continue
        number = about = bisect_right(starts, token.start())
        while about <= len(lines) and _ALONE.fullmatch(lines[about - 1].rstrip()):
            about += 1
        for rule in _rules(found[1] or ""):
            yield IgnoreNote(rule, layer=layer, line=about, written=number)


def _rules(text: str) -> list[str]:
    return [name for part in text.split(",") if (name := part.strip().upper())] or [""]


def _in_custom_data(stage: Usd.Stage) -> Iterator[IgnoreNote]:
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        path = str(prim.GetPath())
        if prim.HasAuthoredCustomData():
            yield from (IgnoreNote(rule, path) for rule in _noted(prim.GetCustomData()))
        for each in prim.GetAuthoredProperties():
            if each.HasAuthoredCustomData():
                noted = _noted(each.GetCustomData())
                yield from (IgnoreNote(rule, path, each.GetName()) for rule in noted)


def _noted(data: Mapping[str, Any]) -> list[str]:
    """Return the rules in custom data; by USD's own interface the name is one in a group."""
    group = data.get(_GROUP)
    text = data.get(NAME) or (group.get(_KEY) if isinstance(group, dict) else None)
    return [] if text is None else _rules(str(text))
