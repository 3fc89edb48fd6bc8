"""The text of layers: the lines of prims and properties, and suppression comments."""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.files import lines_of
from lab3_usd.model.changes import Site
from lab3_usd.model.finding import IgnoreNote
from lab3_usd.stage.read.opening import cached, quiet
from lab3_usd.stage.read.properties import AuthoredProperties
from lab3_usd.stage.read.server_assets import local_file

STRING = (
    r'"""[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"""'
    r"|'''[^'\\]*(?:(?:\\.|'(?!''))[^'\\]*)*'''"
    r'|"[^"\\\r\n]*(?:\\.[^"\\\r\n]*)*"'
    r"|'[^'\\\r\n]*(?:\\.[^'\\\r\n]*)*'"
)
# Three to five @ close an asset path that three opened; all but the last three belong to the path.
ASSET = r"@@@(?:\\@@@|[^\r\n])*?@@@@{0,2}|@[^@\r\n]*@"
BLOCK_COMMENT = r"/\*[^*]*\*+(?:[^/*][^*]*\*+)*/"
LINE_COMMENT = r"(?:\#|//)[^\r\n]*"
_PAD = rf"(?:[ \t]|{BLOCK_COMMENT})*"
_WORD = r"""[^\s"'@<>=()\[\]{};,.\#/]+"""

BLANK = re.compile(rf"(?:[\s;]+|{LINE_COMMENT}|{BLOCK_COMMENT})*")
OPENING = re.compile(
    rf"""(?:def|over|class)(?=[ \t/])(?:[^"'/\r\n]|{BLOCK_COMMENT})*(?P<prim>{STRING})"""
    rf"|variantSet(?=[ \t/]){_PAD}(?P<set>{STRING}){_PAD}=",
    re.DOTALL,
)
VARIANT = re.compile(rf"(?P<variant>{STRING})", re.DOTALL)
ORDER = re.compile(rf"reorder(?=[ \t/]){_PAD}(?:nameChildren|properties|rootPrims){_PAD}=")
# Qualifiers, type and name are words; the group `name` keeps the last, `first` a lone one.
HEAD = re.compile(
    rf"(?P<first>{_WORD})(?:(?:[ \t]|{BLOCK_COMMENT}|\[{_PAD}\])*(?P<name>{_WORD}))*{_PAD}"
)
LIST_EDITS = frozenset({"add", "append", "delete", "prepend", "reorder"})

# A run of plain text and what ends it. A bracket with only plain text in it goes in one step.
PIECE = re.compile(
    rf"""[^()\[\]{{}}"'@\#/;\r\n]*
    (?:[(\[{{][^()\[\]{{}}"'@\#/]*[)\]}}]
    |(?P<open>[(\[{{])|(?P<close>[)\]}}])|(?P<end>[;\r\n])
    |{STRING}|{ASSET}|{LINE_COMMENT}|{BLOCK_COMMENT}|.)""",
    re.DOTALL | re.VERBOSE,
)
_BODY = re.compile(r"[/{=}.]")  # around what can stand in the path of something that has a body

_GROUP, _KEY = "lab3", "ignore"
NAME = f"{_GROUP}:{_KEY}"
_COMMENT = r"#[ \t]*lab3:[ \t]*ignore\b(?:\[([^\]\r\n]*)\])?"
_LIKE_A_NOTE = re.compile(r"\blab[ \t]?3[ \t]*[:=.-]?[ \t]*ignore\b")
# Strings and paths of assets come first: what looks like a comment inside of them is none.
_TOKEN = rf"{STRING}|{ASSET}|{BLOCK_COMMENT}|(?P<comment>{LINE_COMMENT})"
_ALONE = r"\s*(?:#.*)?"
_IN_TEXT = (NAME.encode(), f"dictionary {_GROUP} ".encode())
# A binary layer is packed: of a name in it, at least one of these stands as it is.
_TRACES = (b"lab3", b"ab3:", b"b3:i", b"3:ig")

# The fields in which a property's opinion stands; a spec without them only declares it.
_OPINIONS = ("default", "timeSamples", "spline", "connectionPaths", "targetPaths")


def scan_text(text: str, paths: Iterable[str] | None = None) -> dict[str, int]:
    """Return the offset of the statement that opens each spec, by the spec's path in the layer.

    Where paths are asked for, bodies that hold none of them are passed over, and what is in them
    is left out. The paths are Sdf's: `/A/B.size`, `/A{shape=box}B`. A property's declaration
    counts before statements that wire it, sample it or edit its list. The fields of the layer's
    metadata stand as properties of the root (`/.upAxis`).

    The text is one that OpenUSD accepts. Of any other the result is what could be made out.
    """
    around = None
    if paths is not None:
        cuts = ((path, match.span()) for path in paths for match in _BODY.finditer(path))
        around = {path[:end] for path, span in cuts for end in span}
    declared: dict[str, int] = {}
    edited: dict[str, int] = {}
    for path, offset, is_edit in _statements(text, around):
        (edited if is_edit else declared).setdefault(path, offset)
    return edited | declared


def _statements(text: str, around: Collection[str] | None) -> Iterator[tuple[str, int, bool]]:
    """Yield path and offset of each statement, and whether it only edits what stands elsewhere.

    Of the bodies only those `around` what is asked for are looked into, else all.
    `bodies` holds the paths of the bodies that are open; that of a variant set ends in `=`.
    """
    bodies = [""]
    pos = after_blank(text, 0)
    while bodies and pos < len(text):
        body = bodies[-1]
        if text[pos] in ")]}":
            bodies.pop()
            pos += 1
        elif text[pos] == "(":
            bodies.append("/")
            pos += 1
        elif opening := (VARIANT if body.endswith("=") else OPENING).match(text, pos):
            path = opened_path(body, opening)
            yield (f"{path}}}" if path.endswith("=") else path), pos, False
            pos = after_blank(text, opening.end())
            if text.startswith("(", pos):  # the metadata before the body
                pos = after_blank(text, group_end(text, pos))
            if around is None or path in around:
                bodies.append(path)
                pos += 1
            else:
                pos = group_end(text, pos)
        else:
            head = HEAD.match(text, pos)
            if head and not (head["first"] == "reorder" and ORDER.match(text, pos)):
                is_edit = head["first"] in LIST_EDITS or text.startswith(".", head.end())
                yield f"{body}.{head['name'] or head['first']}", pos, is_edit
            pos = statement_end(text, pos)
        pos = after_blank(text, pos)


def opened_path(body: str, opening: re.Match[str]) -> str:
    """Return the path of what opens in a body; that of a variant set ends in `=`."""
    kind = str(opening.lastgroup)
    quoted = opening[kind]
    width = 3 if quoted[:3] in ('"""', "'''") else 1
    name = quoted[width:-width]
    if kind == "set":
        return f"{body}{{{name}="
    if kind == "variant":
        return f"{body}{name}}}"
    return f"{body}{name}" if body.endswith("}") else f"{body}/{name}"


def after_blank(text: str, pos: int) -> int:
    """Return the position after white space and comments."""
    blank = BLANK.match(text, pos)
    return blank.end() if blank else pos


def group_end(text: str, pos: int) -> int:
    """Return the position after the bracket that closes the one at `pos`."""
    depth = 0
    for piece in PIECE.finditer(text, pos):
        depth += (piece.lastgroup == "open") - (piece.lastgroup == "close")
        if depth <= 0:
            return piece.end()
    return len(text)


def statement_end(text: str, pos: int) -> int:
    """Return the position after the statement at `pos`: past its `;` or line end, if it has one."""
    depth = 0
    for piece in PIECE.finditer(text, pos):
        if piece.lastgroup == "end" and not depth:
            return piece.end()
        if piece.lastgroup == "close" and not depth:
            return piece.end() - 1
        depth += (piece.lastgroup == "open") - (piece.lastgroup == "close")
    return len(text)


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
    if _LIKE_A_NOTE.search(text) is None:
        return
    lines = lines_of(text)
    starts = [*accumulate(map(len, lines), initial=0)]
    for token in re.finditer(_TOKEN, text, re.DOTALL | re.VERBOSE):
        comment = token["comment"] or ""
        note = re.search(_COMMENT, comment)
        if note is None:
            if _LIKE_A_NOTE.search(comment):
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

    It is where the strongest opinion begins. A property that no layer holds is at its prim, a
    prim that no layer holds at the nearest prim above it; what has nothing above it is in the
    root layer, which `given` names, at no line. Every layer is read once at most.
    """
    root = stage.GetRootLayer()
    specs = {site: _spec(stage, *site) for site in sites}
    paths: dict[str, list[str]] = {}
    for layer, path in specs.values():
        paths.setdefault(layer.realPath, []).append(path)
    texts = {file: _read_once(file, spec_paths, stage) for file, spec_paths in paths.items()}
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


def _read_once(path: str, spec_paths: Iterable[str], stage: Usd.Stage) -> _Text | None:
    """Find specs in a text layer; what copies of a stage have in common is looked for once."""
    asked = frozenset(spec_paths)
    return cached(("places", id(stage), path, asked), lambda: _read(path, asked))


def _read(path: str, spec_paths: Iterable[str]) -> _Text | None:
    """Find specs in a text layer; None for a binary one, one in a package and one in memory."""
    try:
        data = Path(path).read_bytes() if path else b""
    except (OSError, ValueError):
        return None
    if not data.startswith(b"#"):
        return None
    text = data.decode("utf-8", errors="replace")
    lines = [0]
    while end := text.find("\n", lines[-1]) + 1:
        lines.append(end)
    return _Text(scan_text(text, spec_paths), lines)
