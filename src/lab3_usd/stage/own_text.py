"""The text in which a prim is written, where nothing else has a say in it.

The stages of one student hold mostly the same prims, and those of the starter. A prim that is
written in the same letters below the same ancestors is the same prim, and need not be read again.

The text is what usd-core writes of the layer that it has read, never the file: how a file is laid
out, and what its comments hold, is up to whoever wrote it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from hashlib import sha256

from pxr import Sdf, Usd

from lab3_usd.stage.opening import memory, remembered

_LARGEST = 4 << 20  # letters; larger stages are read
_FORMAT = "usda"  # a binary layer may hold names that no text can have
_INDENT = 4  # as usd-core writes
# From line end to line end, which is found twice as fast as from the start of a line.
_HEADER = re.compile(r'\n( *)(?:def|over|class) (?:\w+ )?"([^"\n]+)"(?: \()?(?=\n)')
# Only such strings span lines, and could hold one that looks like the first line of a prim.
_OF_LINES = ('"""', "'''")
_CLOSING = " }\n"
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
    """Return what stands for each prim without its children, by path: the same for the same prim.

    What refers to prims of the same layer stands for their text as well. Left out are prims that
    take anything else from elsewhere. There is none at all where the stage consists of several
    layers, or its one layer is binary, or has strings of several lines.
    """
    texts = _written(stage)
    paths, mixed = _paths(stage) if texts else [], _mixed(texts)
    outside = _outside(texts, mixed)
    if outside != _outside(paths, mixed):
        return {}  # a prim is not active, and those below it are not there
    own = {path: texts[path] for path in outside if path not in mixed}
    return own | dict(_borrowed(mixed, paths, _Trees(texts, own)))


def _written(stage: Usd.Stage) -> dict[str, str]:
    """Cut what usd-core writes of each prim at the first line of every prim in it."""
    root = stage.GetRootLayer()
    texts: dict[str, str] = {}
    for spec in root.rootPrims if _is_alone(stage, root) else ():
        text = spec.GetAsText()
        if len(text) > _LARGEST or any(mark in text for mark in _OF_LINES):
            return {}
        texts.update(_split(text))
    return texts


def _is_alone(stage: Usd.Stage, root: Sdf.Layer) -> bool:
    others = [layer for layer in stage.GetUsedLayers() if layer != root]
    is_alone = others == [stage.GetSessionLayer()] and others[0].empty
    is_text = root.GetFileFormat().formatId == _FORMAT
    return is_alone and is_text and _HARMLESS.issuperset(root.pseudoRoot.ListInfoKeys())


def _split(text: str) -> Iterator[tuple[str, str]]:
    text = f"\n{text}"
    headers = list(_HEADER.finditer(text))
    ends = [header.start() for header in headers[1:]]
    names: list[str] = []
    for header, end in zip(headers, [*ends, len(text)], strict=True):
        names[len(header[1]) // _INDENT :] = [header[2]]
        # Usd-core closes what it opens: which braces end here, the rest of the text tells.
        yield "/" + "/".join(names), text[header.start() + 1 : end].rstrip(_CLOSING)


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


class _Trees:
    """The written prims with all below them, looked up by the topmost."""

    def __init__(self, texts: Mapping[str, str], own: Collection[str]) -> None:
        self.texts = texts
        self._own = own
        self._spans = _spans(texts)
        self._order = [*texts]
        self._digests: dict[str, str] = {}

    def paths(self, top: str) -> list[str]:
        """Return the paths of a prim and of all below it; none where it is not written."""
        start, end = self._spans.get(top, (0, 0))
        return self._order[start:end]

    def digest(self, top: str) -> str:
        """Return what stands for a whole tree; '' where an arc brings anything to it."""
        if top not in self._digests:
            paths = self.paths(top)
            is_whole = bool(paths) and all(path in self._own for path in paths)
            self._digests[top] = _digest(self.texts[path] for path in paths) if is_whole else ""
        return self._digests[top]


def _digest(texts: Iterable[str]) -> str:
    return sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()


def _spans(paths: Iterable[str]) -> dict[str, tuple[int, int]]:
    """Return where each path and those below it begin and end, in the order of a traversal."""
    spans: dict[str, tuple[int, int]] = {}
    above: list[tuple[str, int]] = []
    place = 0
    for place, path in enumerate(paths):
        while above and not path.startswith(f"{above[-1][0]}/"):
            top, start = above.pop()
            spans[top] = (start, place)
        above.append((path, place))
    spans.update((top, (start, place + 1)) for top, start in above)
    return spans


def _borrowed(
    tops: Iterable[str], paths: Sequence[str], trees: _Trees
) -> Iterator[tuple[str, str]]:
    """Yield what stands for each prim that refers to others of its stage, and for all below it."""
    spans = _spans(paths)
    for top in tops:
        said = [trees.texts[path] for path in trees.paths(top)]
        whole = "".join(said)
        if _ASSET in whole or any(word in whole for word in _OTHER_ARCS):
            continue
        targets = [trees.digest(target) for target in dict.fromkeys(_TARGET.findall(whole))]
        if all(targets):
            start, end = spans[top]
            text = _digest([*said, *targets])
            yield from ((path, text) for path in paths[start:end])
