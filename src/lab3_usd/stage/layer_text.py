"""The text of layers: the lines of prims and properties, and suppression comments."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.model.changes import Site
from lab3_usd.model.finding import IgnoreNote
from lab3_usd.stage.read.opening import cached, quiet
from lab3_usd.stage.read.properties import AuthoredProperties

_GROUP, _KEY = "lab3", "ignore"
NAME = f"{_GROUP}:{_KEY}"
_COMMENT = r"#[ \t]*lab3:[ \t]*ignore\b(?:\[([^\]\r\n]*)\])?"
_LIKE_A_NOTE = r"\blab[ \t]?3[ \t]*[:=.-]?[ \t]*ignore\b"
_ALONE = r"\s*(?:#.*)?"
_IN_TEXT = (NAME.encode(), f"dictionary {_GROUP} ".encode())
# A binary layer is packed: of a name in it, at least one of these stands as it is.
_TRACES = (b"lab3", b"ab3:", b"b3:i", b"3:ig")

# The fields in which a property's opinion stands; a spec without them only declares it.
_OPINIONS = ("default", "timeSamples", "spline", "connectionPaths", "targetPaths")


def read_ignore_notes(stage: Usd.Stage, given: str) -> tuple[IgnoreNote, ...]:
    """Return the notes of a stage; `given` names its root layer.

    Most stages have none: their files are searched for the name and nothing else is done.
    """
    comments: list[IgnoreNote] = []
    may_hold_data = False
    root = stage.GetRootLayer()
    for layer in stage.GetUsedLayers():
        data = _bytes_of(layer)
        if not data.startswith(b"#"):
            may_hold_data |= any(trace in data for trace in _TRACES)
        elif _GROUP.encode() in data:
            may_hold_data |= any(form in data for form in _IN_TEXT)
            name = given if layer == root else layer_name(layer, root, given)
            comments += _comments(data.decode("utf-8", "replace"), name)
    return (*comments, *(_in_custom_data(stage) if may_hold_data else ()))


def _bytes_of(layer: Sdf.Layer) -> bytes:
    with suppress(OSError, ValueError):
        return Path(layer.realPath).read_bytes() if layer.realPath else b""
    return _TRACES[0]  # packed in another file: it has to be searched


def _comments(text: str, layer: str) -> Iterator[IgnoreNote]:
    """Yield the notes in comments: of the line that they end, else of the next that says more."""
    if re.search(_LIKE_A_NOTE, text) is None:
        return
    from lab3_usd.files import lines_of
    from lab3_usd.stage.statements import TOKEN

    lines = lines_of(text)
    starts = [*accumulate(map(len, lines), initial=0)]
    for token in re.finditer(TOKEN, text, re.DOTALL | re.VERBOSE):
        comment = token["comment"] or ""
        note = re.search(_COMMENT, comment)
        if note is None:
            if re.search(_LIKE_A_NOTE, comment):
                line = bisect_right(starts, token.start())
                yield IgnoreNote("", layer=layer, line=line, written=line, misspelt=True)
            continue
        number = about = bisect_right(starts, token.start())
        while about <= len(lines) and re.fullmatch(_ALONE, lines[about - 1].rstrip()):
            about += 1
        for rule in _rules(note[1] or ""):
            yield IgnoreNote(rule, layer=layer, line=about, written=number)


def _rules(text: str) -> list[str]:
    return [name for part in text.split(",") if (name := part.strip().upper())] or [""]


def _in_custom_data(stage: Usd.Stage) -> Iterator[IgnoreNote]:
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        path = str(prim.GetPath())
        if prim.HasAuthoredCustomData():
            yield from (IgnoreNote(rule, path) for rule in _noted(prim.GetCustomData()))
        for authored in prim.GetAuthoredProperties():
            if authored.HasAuthoredCustomData():
                rules = _noted(authored.GetCustomData())
                yield from (IgnoreNote(rule, path, authored.GetName()) for rule in rules)


def _noted(data: Mapping[str, Any]) -> list[str]:
    """Return the rules in custom data; by USD's own interface the name is one in a group."""
    group = data.get(_GROUP)
    text = data.get(NAME) or (group.get(_KEY) if isinstance(group, dict) else None)
    return [] if text is None else _rules(str(text))


class SourceLocation(Struct, frozen=True):
    """The position of a statement; line and column count from 1, in characters.

    `layer` is the root layer's path as it was given, or the path of another layer from the same
    folder, and empty for a layer in memory. Line and column are None where no text says it.
    """

    layer: str
    line: int | None
    column: int | None


@quiet()
def locate(stage: Usd.Stage, given: str, sites: Iterable[Site]) -> dict[Site, SourceLocation]:
    """Return the place of each site: a prim path, and the name of a property or None.

    It is the start of the strongest opinion. A property without an opinion has the place of its
    prim, a prim without one that of its nearest ancestor. Without any, the place is the root layer,
    which `given` names, without a line. Every layer is read at most once.
    """
    root = stage.GetRootLayer()
    specs = {site: _spec(stage, *site) for site in sites}
    paths: dict[str, list[str]] = {}
    for layer, path in specs.values():
        paths.setdefault(layer.realPath, []).append(path)
    texts: dict[str, _Text | None] = {}
    for file, spec_paths in paths.items():
        asked = frozenset(spec_paths)
        # What copies of a stage have in common is looked for once.
        texts[file] = cached(("places", id(stage), file, asked), partial(_read, file, asked))
    locations: dict[Site, SourceLocation] = {}
    for site, (layer, path) in specs.items():
        name = given if layer == root else layer_name(layer, root, given)
        text = texts[layer.realPath]
        offset = text.specs.get(path) if text else None
        if text is None or offset is None:
            locations[site] = SourceLocation(name, None, None)
        else:
            line = bisect_right(text.lines, offset)
            locations[site] = SourceLocation(name, line, offset - text.lines[line - 1] + 1)
    return locations


def _spec(stage: Usd.Stage, prim_path: str, name: str | None) -> tuple[Sdf.Layer, str]:
    """Return the layer that holds a site, and the path of the spec in it."""
    if prim_path == "/" and name:  # the metadata of the stage
        return stage.GetRootLayer(), f"/.{name}"
    prim = _nearest_prim(stage, prim_path)
    specs: Sequence[Any] = ()  # from the strongest to the weakest
    if name and prim and str(prim.GetPath()) == prim_path:
        specs = AuthoredProperties(prim)[name].specs
    if specs:
        specs = _saved(specs, stage)
        holds_opinion = (spec for spec in specs if any(map(spec.HasInfo, _OPINIONS)))
        spec = next(holds_opinion, specs[0])
        return spec.layer, str(spec.path)
    stack: Sequence[Any] = prim.GetPrimStack() if prim else ()
    if stack:
        spec = _saved(stack, stage)[0]
        return spec.layer, str(spec.path)
    return stage.GetRootLayer(), ""


def _saved(specs: Sequence[Any], stage: Usd.Stage) -> Sequence[Any]:
    """Leave out what the session layer says, unless no other layer has an opinion."""
    return [spec for spec in specs if spec.layer != stage.GetSessionLayer()] or specs


def _nearest_prim(stage: Usd.Stage, path: str) -> Usd.Prim | None:
    """Return the prim at `path` or the nearest above it; None where that is the root."""
    while path.startswith("/") and path != "/":
        if Sdf.Path.IsValidPathString(path) and (prim := stage.GetPrimAtPath(path)):
            return prim
        path = path.rpartition("/")[0]
    return None


def layer_name(layer: Sdf.Layer, root: Sdf.Layer, given: str) -> str:
    """Return the path of a layer as somebody would write it who wrote `given` for the root."""
    from lab3_usd.stage.read.server_assets import local_file

    file = local_file(layer.realPath)
    if not file or not root.realPath:
        return file
    try:
        relative = os.path.relpath(file, Path(root.realPath).parent)
    except ValueError:  # another drive
        return file
    return os.path.normpath(Path(given).parent / relative)


class _Text(Struct, frozen=True):
    """Where lines begin in a text layer, and the specs that are asked for, as offsets."""

    specs: Mapping[str, int]
    lines: Sequence[int]


def _read(path: str, spec_paths: Iterable[str]) -> _Text | None:
    """Find specs in a text layer; None for a binary one, one in a package and one in memory."""
    try:
        data = Path(path).read_bytes() if path else b""
    except (OSError, ValueError):
        return None
    if not data.startswith(b"#"):
        return None
    from lab3_usd.stage.statements import scan_text

    text = data.decode("utf-8", errors="replace")
    lines = [0]
    while end := text.find("\n", lines[-1]) + 1:
        lines.append(end)
    return _Text(scan_text(text, spec_paths), lines)
