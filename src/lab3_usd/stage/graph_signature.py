"""A signature of the graphs that ignores comments, layers, node names and positions."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from pxr import Usd

from lab3_usd.errors import StageError
from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors
from lab3_usd.stage.read.properties import AuthoredProperties

_GRAPH, _NODE, _TYPE = "OmniGraph", "OmniGraphNode", "node:type"
_OF_THE_EDITOR = "ui:"


def graph_signature(path: Path) -> str:
    """Return a digest of the graphs of a composed stage, which renaming does not change.

    A node counts by its graph, its type and what its inputs hold or come from, whichever layer says
    so; '' where the stage has no graph or cannot be read.
    """
    try:
        stage = open_stage(path)  # which keeps its layers
        with quiet(), stage_errors(path):
            lines = sorted(_lines(stage))
    except StageError:
        return ""
    text = "\n".join(lines).encode("utf-8", "replace")
    return hashlib.sha256(text).hexdigest() if lines else ""


def files_read(path: Path) -> tuple[str, ...]:
    """Return the real paths of the layers that a stage is composed of, none if it is unreadable."""
    try:
        stage = open_stage(path)  # which keeps its layers
    except StageError:
        return ()
    layers = stage.GetUsedLayers()
    return tuple(sorted(os.path.realpath(layer.realPath) for layer in layers if layer.realPath))


def _lines(stage: Usd.Stage) -> Iterator[str]:
    everything = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    every_prim = Usd.PrimRange(stage.GetPseudoRoot(), everything)
    prims = {str(p.GetPath()): p for p in every_prim if p.GetTypeName() in {_GRAPH, _NODE}}
    holds = {path: AuthoredProperties(prim) for path, prim in prims.items()}
    names = {
        path: f"<{holds[path][_TYPE].value()}>"
        for path, prim in prims.items()
        if prim.GetTypeName() == _NODE
    }
    for path, prim in prims.items():
        place = _renamed(path, names)
        yield f"{place} {prim.GetTypeName()}"
        for name in holds[path].names():
            if not name.startswith(_OF_THE_EDITOR):
                held = holds[path][name]
                leads = sorted(_renamed(to, names) for to in (*held.sources(), *held.targets()))
                yield f"{place}.{name} {held.type} {held.value()} {leads}"


def _renamed(path: str, names: dict[str, str]) -> str:
    """Return a path in which nodes are called by their types."""
    prim, dot, name = path.partition(".")
    head, _, _ = prim.rpartition("/")
    return f"{head}/{names.get(prim, prim.rpartition('/')[2])}{dot}{name}"
