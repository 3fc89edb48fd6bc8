"""Edits prims: adds, removes and activates them, and their schemas."""

from __future__ import annotations

from msgspec.structs import replace
from pxr import Sdf

from lab3_usd.model.repair import (
    Activate,
    AddGraph,
    AddNode,
    ApplySchema,
    RemovePrim,
    RemoveSchema,
)
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.write.author import author_graph

_SCHEMAS = "apiSchemas"
_LISTS = ("explicitItems", "prependedItems", "appendedItems", "addedItems")


def apply_schema(session: EditSession, edit: ApplySchema) -> None:
    """Apply an API schema where the prim does not have it."""
    if edit.schema in _applied(session, edit.prim):
        return
    spec = next(
        (each for each in session.specs(edit.prim) if each.HasInfo(_SCHEMAS)),
        None,
    ) or session.prim_spec(session.prim_layer(edit.prim), edit.prim)
    session.touch(spec.layer, edit.prim)
    items = spec.GetInfo(_SCHEMAS) if spec.HasInfo(_SCHEMAS) else Sdf.TokenListOp()
    kind = "explicitItems" if items.isExplicit else "prependedItems"
    items.deletedItems = [each for each in items.deletedItems if each != edit.schema]
    setattr(items, kind, [*getattr(items, kind), edit.schema])
    spec.SetInfo(_SCHEMAS, items)


def remove_schema(session: EditSession, edit: RemoveSchema) -> None:
    """Take an API schema off a prim, in every layer that applies it."""
    for spec in session.specs(edit.prim):
        items = spec.GetInfo(_SCHEMAS) if spec.HasInfo(_SCHEMAS) else Sdf.TokenListOp()
        if edit.schema in items.GetAppliedItems():
            session.touch(spec.layer, edit.prim)
            _drop(spec, items, edit.schema)
    if edit.schema in _applied(session, edit.prim):
        spec = session.prim_spec(session.stage.GetRootLayer(), edit.prim)
        items = spec.GetInfo(_SCHEMAS) if spec.HasInfo(_SCHEMAS) else Sdf.TokenListOp()
        items.deletedItems = [*items.deletedItems, edit.schema]
        spec.SetInfo(_SCHEMAS, items)


def _drop(spec: Sdf.PrimSpec, items: Sdf.TokenListOp, schema: str) -> None:
    for kind in _LISTS:
        held = getattr(items, kind)
        if schema in held:
            setattr(items, kind, [each for each in held if each != schema])
    if items.GetAppliedItems() or items.deletedItems:
        spec.SetInfo(_SCHEMAS, items)
    else:
        spec.ClearInfo(_SCHEMAS)


def _applied(session: EditSession, path: str) -> list[str]:
    prim = session.stage.GetPrimAtPath(path)
    return list(prim.GetPrimTypeInfo().GetAppliedAPISchemas()) if prim else []


def activate(session: EditSession, edit: Activate) -> None:
    """Let a prim be active and defined."""
    for spec in session.specs(edit.prim):
        if spec.HasInfo("active") and not spec.active:
            session.touch(spec.layer, edit.prim)
            spec.ClearInfo("active")
    prim = session.stage.GetPrimAtPath(edit.prim)
    if prim and not prim.IsActive():
        session.prim_spec(session.stage.GetRootLayer(), edit.prim).active = True
    if prim and not prim.HasDefiningSpecifier():
        session.prim_spec(session.prim_layer(edit.prim), edit.prim).specifier = Sdf.SpecifierDef


def add_graph(session: EditSession, edit: AddGraph) -> None:
    """Add a graph of the lab with everything in it."""
    spec = replace(session.lab.graphs[edit.graph], path=edit.prim)
    source = Sdf.Layer.CreateAnonymous(".usda")
    author_graph(source, spec, session.lab.catalog)
    copy_prim(session, source, edit.prim, edit.prim)


def add_node(session: EditSession, edit: AddNode) -> None:
    """Add a node of a graph of the lab with its values and targets, and no connections."""
    spec = session.lab.graphs[edit.graph]
    source = Sdf.Layer.CreateAnonymous(".usda")
    author_graph(source, spec, session.lab.catalog)
    made = f"{spec.path}/{edit.role}"
    for attribute in source.GetPrimAtPath(made).attributes:
        attribute.connectionPathList.ClearEdits()
    copy_prim(session, source, made, edit.prim)


def copy_prim(session: EditSession, source: Sdf.Layer, path: str, to: str) -> None:
    """Copy a prim with all that is below it to where no prim stands."""
    if session.stands(to):
        return
    parent = to.rpartition("/")[0] or "/"
    layer = session.prim_layer(parent) if parent != "/" else session.stage.GetRootLayer()
    session.touch(layer, to)
    if parent != "/":
        Sdf.CreatePrimInLayer(layer, parent)
    Sdf.CopySpec(source, path, layer, to)


def remove_prim(session: EditSession, edit: RemovePrim) -> None:
    """Remove a prim from every layer that may be edited; what remains of it is deactivated."""
    for spec in [*session.specs(edit.prim)]:
        session.touch(spec.layer, edit.prim)
        parent = spec.nameParent or spec.layer.pseudoRoot
        del parent.nameChildren[spec.name]
    if session.stands(edit.prim):
        session.prim_spec(session.stage.GetRootLayer(), edit.prim).active = False
