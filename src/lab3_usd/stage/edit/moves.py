"""Moves and renames prims; what names them follows."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from lab3_usd.model.repair import MovePrim
from lab3_usd.stage.edit.session import EditedLayer, EditSession

_PATHS = ("inheritPathList", "specializesList")
_ARCS = ("referenceList", "payloadList")


def move_prim(session: EditSession, edit: MovePrim) -> None:
    """Move a prim to where none stands, in every layer that may be edited.

    Nothing is moved where another layer says something of the prim, or where the new parent is
    missing or below the prim itself.
    """
    parent = edit.to.rpartition("/")[0] or "/"
    is_free = not session.stands(edit.to) and (parent == "/" or session.stands(parent))
    if not session.stands(edit.prim) or not is_free or Sdf.Path(edit.to).HasPrefix(edit.prim):
        return
    layers = session.layers()
    if any(each.layer not in layers for each in session.opinions(edit.prim)):
        return
    if any(_is_taken(session.begin(layer), edit.to) for layer in layers):
        return
    for layer in layers:
        if _names(layer, edit.prim):
            session.begin(layer).moves.append((edit.prim, edit.to))
            _move(layer, Sdf.Path(edit.prim), Sdf.Path(edit.to))


def _is_taken(edited: EditedLayer, path: str) -> bool:
    """Whether something stood at a path before this repair, and has been removed or moved."""
    return edited.before.GetPrimAtPath(path) is not None or any(
        path in move for move in edited.moves
    )


def _names(layer: Sdf.Layer, path: str) -> bool:
    """Whether a prim stands or is named in a layer."""
    return layer.GetPrimAtPath(path) is not None or f"<{path}" in layer.ExportToString()


def _move(layer: Sdf.Layer, path: Sdf.Path, to: Sdf.Path) -> None:
    spec = layer.GetPrimAtPath(path)
    if spec is not None:
        Sdf.CreatePrimInLayer(layer, to.GetParentPath())
        Sdf.CopySpec(layer, path, layer, to)
        parent = spec.nameParent or layer.pseudoRoot
        del parent.nameChildren[spec.name]

    def follow(name: Sdf.Path) -> None:
        found = layer.GetObjectAtPath(name)
        if isinstance(found, Sdf.AttributeSpec):
            _rename(found.connectionPathList, path, to)
        elif isinstance(found, Sdf.RelationshipSpec):
            _rename(found.targetPathList, path, to)
        elif isinstance(found, Sdf.PrimSpec):
            _rename_arcs(found, path, to)

    layer.Traverse(Sdf.Path.absoluteRootPath, follow)


def _rename(items: Any, path: Sdf.Path, to: Sdf.Path) -> None:  # noqa: ANN401 - pxr has no types
    items.ModifyItemEdits(lambda each: each.ReplacePrefix(path, to))


def _rename_arcs(prim: Sdf.PrimSpec, path: Sdf.Path, to: Sdf.Path) -> None:
    for name in _PATHS:
        _rename(getattr(prim, name), path, to)
    for name in _ARCS:
        getattr(prim, name).ModifyItemEdits(lambda each: _renamed_arc(each, path, to))


def _renamed_arc(arc: Any, path: Sdf.Path, to: Sdf.Path) -> Any:  # noqa: ANN401
    """Return a reference or payload; one into another file stays."""
    if arc.assetPath:
        return arc
    return type(arc)("", arc.primPath.ReplacePrefix(path, to), arc.layerOffset)
