"""A signature of the graphs that ignores comments, node names and positions."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from pxr import Sdf

from lab3_usd.errors import StageError
from lab3_usd.stage.read.opening import open_stage

_GRAPH, _NODE, _TYPE = "OmniGraph", "OmniGraphNode", "node:type"
_OF_THE_EDITOR = "ui:"


def graph_signature(path: Path) -> str:
    """Return a digest of the graphs in a stage's own layer, which renaming does not change.

    A node counts by its graph, its type and what its inputs hold or come from; '' where the stage
    cannot be opened.
    """
    try:
        stage = open_stage(path)  # which keeps its layer
    except StageError:
        return ""
    lines = sorted(_lines(stage.GetRootLayer()))
    return hashlib.sha256("\n".join(lines).encode("utf-8", "replace")).hexdigest()


def _lines(layer: Sdf.Layer) -> Iterator[str]:
    prims = [prim for prim in _prims(layer) if prim.typeName in {_GRAPH, _NODE}]
    names: dict[str, str] = {}
    for prim in prims:
        kind = prim.attributes.get(_TYPE)
        if prim.typeName == _NODE:
            names[str(prim.path)] = f"<{'' if kind is None else kind.default}>"
    for prim in prims:
        place = _renamed(str(prim.path), names)
        yield f"{place} {prim.specifier} {prim.typeName}"
        for attribute in prim.attributes:
            if not attribute.name.startswith(_OF_THE_EDITOR):
                sources = attribute.connectionPathList.GetAddedOrExplicitItems()
                renamed = sorted(_renamed(str(source), names) for source in sources)
                yield f"{place}.{attribute.name} {attribute.typeName} {attribute.default} {renamed}"
        for relationship in prim.relationships:
            targets = relationship.targetPathList.GetAddedOrExplicitItems()
            yield f"{place}.{relationship.name} {sorted(map(str, targets))}"


def _prims(layer: Sdf.Layer) -> Iterator[Sdf.PrimSpec]:
    rest = [*layer.rootPrims]
    while rest:
        prim = rest.pop()
        yield prim
        rest += prim.nameChildren


def _renamed(path: str, names: dict[str, str]) -> str:
    """Return a path in which nodes are called by their types."""
    prim, dot, name = path.partition(".")
    head, _, _ = prim.rpartition("/")
    return f"{head}/{names.get(prim, prim.rpartition('/')[2])}{dot}{name}"
