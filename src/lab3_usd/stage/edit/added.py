"""What was added to a stage by recipes, as its custom data tells, and layers that hold it alone."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.stage.edit.prim_edits import MARK
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.write.graphs import PARENT

_EMPTY = {"", PARENT}
_SCENE = ("metersPerUnit", "kilogramsPerUnit", "upAxis", "timeCodesPerSecond")


class AddedPrims(Struct, frozen=True):
    """The prims that recipes brought, each with the kind: graphs, nodes, and parents of graphs."""

    graphs: Mapping[str, str]
    nodes: Mapping[str, str]
    parents: frozenset[str]


def added_prims(stage: Usd.Stage, graph_type: str, node_type: str) -> AddedPrims:
    """Return what recipes brought to the root layer of a stage."""
    kind_of: dict[str, dict[str, str]] = {graph_type: {}, node_type: {}, PARENT: {}}

    def keep(path: Sdf.Path) -> None:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        kind = spec.customData.get(MARK) if spec is not None else None
        if isinstance(kind, str) and spec is not None and spec.typeName in kind_of:
            kind_of[spec.typeName][str(path)] = kind

    layer = stage.GetRootLayer()
    layer.Traverse(Sdf.Path.absoluteRootPath, keep)
    return AddedPrims(kind_of[graph_type], kind_of[node_type], frozenset(kind_of[PARENT]))


def is_over(stage: Usd.Stage, path: str) -> bool:
    """Whether the root layer only overrides a prim."""
    spec = stage.GetRootLayer().GetPrimAtPath(path)
    return spec is not None and spec.specifier == Sdf.SpecifierOver


def is_in_root_alone(stage: Usd.Stage, path: str) -> bool:
    """Whether the root layer alone says what stands at a path."""
    prim, root = stage.GetPrimAtPath(path), stage.GetRootLayer()
    above = stage.GetSessionLayer()
    specs = [spec for spec in prim.GetPrimStack() if spec.layer != above] if prim else []
    return len(specs) == 1 and specs[0].layer == root


def is_bare(stage: Usd.Stage, path: str, without: str) -> bool:
    """Whether the root layer says nothing of a prim, and of nothing below it but the child named.

    That is an over without anything, or a prim that only holds others and no other layer knows.
    """
    spec = stage.GetRootLayer().GetPrimAtPath(path)
    if spec is None or spec.typeName not in _EMPTY:
        return False
    if spec.specifier != Sdf.SpecifierOver and not is_in_root_alone(stage, path):
        return False
    names = {"specifier", "typeName"} | ({"customData"} if MARK in spec.customData else set())
    children = {child.name for child in spec.nameChildren}
    return set(spec.ListInfoKeys()) <= names and not spec.properties and children == {without}


def layer_over(path: Path, target: Path) -> str:
    """Return the text of a layer at `target` that has a stage below it, and nothing else yet.

    Raises:
        StageError: the stage cannot be opened.
    """
    stage = open_stage(path)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    below = os.path.relpath(path.resolve(), target.resolve().parent)
    layer.subLayerPaths.append(below if below.startswith("..") else f"./{below}")
    root = stage.GetRootLayer()
    if root.defaultPrim:
        layer.defaultPrim = root.defaultPrim
    for name in _SCENE:
        if root.pseudoRoot.HasInfo(name):
            layer.pseudoRoot.SetInfo(name, root.pseudoRoot.GetInfo(name))
    return str(layer.ExportToString())


def sublayers(path: Path) -> list[Path]:
    """Return the files that a layer has directly below it.

    Raises:
        StageError: the file cannot be opened.
    """
    stage = open_stage(path)
    root = stage.GetRootLayer()
    paths = (root.ComputeAbsolutePath(name) for name in root.subLayerPaths)
    return [Path(name) for name in paths if name]


def variants_at(stage: Usd.Stage, path: str) -> Iterator[str]:
    """Yield the variants that are selected at a prim and above it, in words."""
    for prefix in Sdf.Path(path).GetPrefixes():
        sets = stage.GetPrimAtPath(prefix).GetVariantSets()
        for name in sets.GetNames():
            yield f"{name}={sets.GetVariantSelection(name) or 'none'} of {prefix}"
