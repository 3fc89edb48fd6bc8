"""The text in which a prim is written, where nothing else has a say in it.

The stages of one student hold mostly the same prims, and those of the starter. A prim that is
written in the same letters below the same ancestors is the same prim, and need not be read again.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from pxr import Sdf, Usd

from lab3_usd.stage.opening import memory, remembered

_INDENT = 4  # as usd-core and Isaac Sim write; files that are laid out in another way are read
_HEADER = re.compile(r'\n( *)(?:def|over|class) (?:\w+ )?"([^"\n]+)"(?: \()?(?=\n)')
# What spans lines, or could hide that a line is no header.
_UNCLEAR = ('"""', "'''", "/*", "@@@", "\r", "\t")
# What brings opinions from elsewhere to the prim and to those below it.
_LOCAL_ARCS = ("references", "instanceable")
_OTHER_ARCS = ("payload", "inherits", "specializes", "variant", "clips")
_TARGET = re.compile(r"<([^<>]*)>")
_ASSET = "@"
_NOWHERE = "//"  # no path begins so
# What the head of a layer may say without a say in its prims.
_HARMLESS = frozenset({
    *("documentation", "comment", "customLayerData", "defaultPrim", "upAxis", "metersPerUnit"),
    *("kilogramsPerUnit", "startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond"),
    *("renderSettingsPrimPath",),
})  # fmt: skip


def texts_of(stage: Usd.Stage) -> Mapping[str, str]:
    """Return the texts of an open stage where stages stay open, else none: nobody compares them."""
    if memory.get() is None:
        return {}
    return remembered(("texts", id(stage)), lambda: own_texts(stage))


def own_texts(stage: Usd.Stage) -> Mapping[str, str]:
    """Return the text of every prim without its children, by path.

    What refers to prims of the same layer has their text as well. Left out are prims that take
    anything else from elsewhere. There is none at all where the stage consists of several layers,
    or its one layer is not laid out as usd-core writes it.
    """
    root = stage.GetRootLayer()
    if not _is_alone(stage, root):
        return {}
    try:
        text = Path(root.realPath).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return {}
    texts = _split(text) if text.startswith("#usda") else {}
    paths, mixed = _paths(stage), _mixed(texts)
    written = _outside(texts, mixed)
    if written != _outside(paths, mixed):
        return {}  # a line that looks like a prim is none, or a prim does not look like one
    own = {path: texts[path] for path in written if path not in mixed}
    return own | {path: text for top in mixed for path, text in _borrowed(top, paths, texts, own)}


def _paths(stage: Usd.Stage) -> list[str]:
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    prims = Usd.PrimRange(stage.GetPseudoRoot(), everything)
    return [str(prim.GetPath()) for prim in prims][1:]


def _mixed(texts: Mapping[str, str]) -> dict[str, None]:
    """Return the topmost prims to which an arc brings anything, in their order."""
    found: dict[str, None] = {}
    below = _NOWHERE
    whole = "".join(texts.values())
    words = [word for word in (*_LOCAL_ARCS, *_OTHER_ARCS) if word in whole]
    for path, text in texts.items():
        if not path.startswith(below) and any(word in text for word in words):
            found[path] = None
            below = f"{path}/"
    return found


def _outside(paths: Iterable[str], mixed: Collection[str]) -> list[str]:
    """Return the paths that are not below any of the mixed ones."""
    kept = []
    below = _NOWHERE
    for path in paths:
        if path.startswith(below):
            continue
        kept.append(path)
        if path in mixed:
            below = f"{path}/"
    return kept


def _borrowed(
    top: str, paths: Iterable[str], texts: Mapping[str, str], own: Mapping[str, str]
) -> Iterator[tuple[str, str]]:
    """Yield, for a prim that refers to others of its stage and for all below it, all their text."""
    said = [texts[path] for path in _inside(texts, top)]
    whole = "".join(said)
    if _ASSET in whole or any(word in whole for word in _OTHER_ARCS):
        return
    for target in dict.fromkeys(_TARGET.findall(whole)):
        parts = _inside(texts, target)
        if not parts or not all(path in own for path in parts):
            return
        said += [own[path] for path in parts]
    text = "\0".join(said)
    for path in _inside(paths, top):
        yield path, text


def _inside(paths: Iterable[str], top: str) -> list[str]:
    below = f"{top}/"
    return [path for path in paths if path.startswith(below) or path == top]


def _is_alone(stage: Usd.Stage, root: Sdf.Layer) -> bool:
    others = [layer for layer in stage.GetUsedLayers() if layer != root]
    is_alone = others == [stage.GetSessionLayer()] and others[0].empty
    return is_alone and _HARMLESS.issuperset(root.pseudoRoot.ListInfoKeys())


def _split(text: str) -> dict[str, str]:
    """Cut a layer at the first line of every prim; empty where the cuts may be wrong."""
    headers = list(_HEADER.finditer(text))
    if not headers:
        return {}
    body = text[headers[0].start() :]
    if any(mark in body for mark in _UNCLEAR):
        return {}
    texts: dict[str, str] = {}
    names: list[str] = []
    ends = [(header.start(), len(header[1])) for header in headers[1:]]
    for header, (end, indent) in zip(headers, [*ends, (len(text), 0)], strict=True):
        depth, odd = divmod(len(header[1]), _INDENT)
        names[depth:] = [header[2]]
        has_children = indent > len(header[1])
        own = _closed(text[header.start() : end], header[1], has_children=has_children)
        path = "/" + "/".join(names)
        if odd or len(names) != depth + 1 or own is None or path in texts:
            return {}
        texts[path] = own
    return texts


def _closed(own: str, indent: str, *, has_children: bool) -> str | None:
    """Return a prim's text up to the brace that closes it; None where that is not clear."""
    text, closing, rest = own.partition(f"\n{indent}}}\n")
    if has_children:
        return None if closing else text.rstrip()
    return text if closing and not rest.strip(" }\n") else None
