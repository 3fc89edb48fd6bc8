"""Edits prims and their properties: adds, removes, moves, renames, sets values and wires."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pxr import Pcp, Sdf, Usd

from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.values import are_alike
from lab3_usd.model.changes import (
    Activate,
    AddGraph,
    AddNode,
    ApplySchema,
    ClearValue,
    Connect,
    DropPrim,
    MovePrim,
    RemovePrim,
    RemoveSchema,
    RenameProperty,
    Retarget,
    SetType,
    SetValue,
)
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.write.graphs import (
    PARENT,
    author_graph,
    author_node,
    catalog_value,
    define_parents,
    take_out,
)

_CUSTOM = ("inputs:", "outputs:", VARIABLE)  # how the custom properties of OmniGraph begin
MARK = "lab3:added"  # custom data of what was added, with the kind of its recipe
_SCHEMAS = "apiSchemas"
_VARYING = ("timeSamples", "spline")  # which beat the default value of the same layer
_LISTS = ("explicitItems", "prependedItems", "appendedItems", "addedItems")


def set_attribute(session: EditSession, edit: SetValue) -> None:
    """Give an attribute a value, and the type asked for where its own cannot hold it."""
    set_typed(session, edit.prim, edit.property, edit.type, catalog_value(edit.value, edit.type))


def set_typed(session: EditSession, prim: str, name: str, type_name: str, value: Any) -> None:
    """Give an attribute a value of usd-core."""
    spec = _attribute(session, prim, name, type_name)
    for varying in filter(spec.HasInfo, _VARYING):
        spec.ClearInfo(varying)
    spec.default = value


def _attribute(session: EditSession, path: str, name: str, type_name: str) -> Sdf.AttributeSpec:
    _remove_other_kinds(session, path, name, Sdf.AttributeSpec)
    layer = session.property_layer(path, name)
    prim = session.prim_spec(layer, path)
    old = layer.GetAttributeAtPath(f"{path}.{name}")
    if old is not None and are_alike(str(old.typeName), type_name):
        return old
    composed = session.stage.GetPrimAtPath(path).GetAttribute(name)
    if old is None and composed and are_alike(str(composed.GetTypeName()), type_name):
        type_name = str(composed.GetTypeName())
    is_custom = bool(composed.IsCustom()) if composed else name.startswith(_CUSTOM)
    sources: list[Sdf.Path] = []
    data = None
    if old is not None:  # one of the wrong type hands on its connections and custom data
        sources = [*old.connectionPathList.GetAddedOrExplicitItems()]
        data = old.GetInfo("customData")
        prim.RemoveProperty(old)
    variability = composed.GetVariability() if composed else Sdf.VariabilityVarying
    new = Sdf.AttributeSpec(
        prim, name, Sdf.ValueTypeNames.Find(type_name), variability, declaresCustom=is_custom
    )
    if data:
        new.SetInfo("customData", data)
    for source in sources:
        new.connectionPathList.prependedItems.append(source)
    return new


def _remove_other_kinds(session: EditSession, path: str, name: str, kind: type) -> None:
    """Remove the specs of a property that are not of this kind, attribute or relationship."""
    for prim in session.specs(path):
        spec = prim.properties.get(name)
        if spec is not None and not isinstance(spec, kind):
            session.touch(prim.layer, path)
            prim.RemoveProperty(spec)


def clear_value(session: EditSession, edit: ClearValue) -> None:
    """Take the value or the targets of a property away, whichever layer holds them."""
    prim = session.stage.GetPrimAtPath(edit.prim)
    if prim.GetRelationship(edit.property):
        set_targets(session, Retarget(edit.prim, edit.property))
        return
    layer = session.property_layer(edit.prim, edit.property)
    spec = layer.GetAttributeAtPath(f"{edit.prim}.{edit.property}")
    if spec is not None:
        session.touch(layer, edit.prim)
        for varying in _VARYING:
            spec.ClearInfo(varying)
        spec.ClearDefaultValue()
    attribute = prim.GetAttribute(edit.property)
    if attribute.HasAuthoredValue():  # a weaker layer says one
        kind = str(attribute.GetTypeName())
        _attribute(session, edit.prim, edit.property, kind).default = Sdf.ValueBlock()


def rename_property(session: EditSession, edit: RenameProperty) -> None:
    """Give a property another name in every layer that may be edited and has no such property."""
    for prim in [*session.specs(edit.prim)]:
        if edit.property in prim.properties and edit.to not in prim.properties:
            layer = prim.layer
            session.touch(layer, edit.prim)
            session.begin(layer).renames.append((edit.prim, edit.property, edit.to))
            old = f"{edit.prim}.{edit.property}"
            Sdf.CopySpec(layer, old, layer, f"{edit.prim}.{edit.to}")
            prim.RemoveProperty(prim.properties[edit.property])


def connect_input(session: EditSession, edit: Connect) -> None:
    """Let an input be connected to what is named, and to nothing else."""
    layer = session.property_layer(edit.prim, edit.property)
    held = layer.GetAttributeAtPath(f"{edit.prim}.{edit.property}")
    attribute = session.stage.GetPrimAtPath(edit.prim).GetAttribute(edit.property)
    if held is None and not (edit.sources or (attribute and attribute.GetConnections())):
        return
    spec = held or _attribute(session, edit.prim, edit.property, edit.type)
    session.touch(spec.layer, edit.prim)
    attribute = session.stage.GetPrimAtPath(edit.prim).GetAttribute(edit.property)
    _rewrite(spec.connectionPathList, edit.sources, explicit=False)
    if [*map(str, attribute.GetConnections())] != list(edit.sources):
        _rewrite(spec.connectionPathList, edit.sources, explicit=True)


def set_targets(session: EditSession, edit: Retarget) -> None:
    """Let a relationship name what is asked for, and nothing else."""
    _remove_other_kinds(session, edit.prim, edit.property, Sdf.RelationshipSpec)
    layer = session.property_layer(edit.prim, edit.property)
    prim = session.prim_spec(layer, edit.prim)
    spec = layer.GetRelationshipAtPath(f"{edit.prim}.{edit.property}")
    if spec is None:
        spec = Sdf.RelationshipSpec(prim, edit.property, custom=edit.property.startswith(_CUSTOM))
    relationship = session.stage.GetPrimAtPath(edit.prim).GetRelationship(edit.property)
    _rewrite(spec.targetPathList, edit.targets, explicit=bool(edit.targets))
    if [*map(str, relationship.GetTargets())] != list(edit.targets):
        _rewrite(spec.targetPathList, edit.targets, explicit=True)


def _rewrite(items: Any, paths: Iterable[str], *, explicit: bool) -> None:
    """Write a list of paths in the form that it has: explicit, or put before what is weaker."""
    new = [Sdf.Path(path) for path in paths]
    if items.isExplicit and new:
        items.explicitItems = new
    elif explicit:
        items.ClearEditsAndMakeExplicit()
        items.explicitItems = new
    elif not new:
        items.ClearEdits()
    else:
        for name in ("addedItems", "appendedItems"):
            if getattr(items, name):
                setattr(items, name, [])
        items.prependedItems = new


def apply_schema(session: EditSession, edit: ApplySchema) -> None:
    """Apply an API schema where the prim does not have it."""
    if edit.schema in _applied(session, edit.prim):
        return
    specs = (spec for spec in session.specs(edit.prim) if spec.HasInfo(_SCHEMAS))
    spec = next(specs, None) or session.prim_spec(session.prim_layer(edit.prim), edit.prim)
    session.touch(spec.layer, edit.prim)
    items = _schema_items(spec)
    kind = "explicitItems" if items.isExplicit else "prependedItems"
    items.deletedItems = [name for name in items.deletedItems if name != edit.schema]
    setattr(items, kind, [*getattr(items, kind), edit.schema])
    spec.SetInfo(_SCHEMAS, items)


def remove_schema(session: EditSession, edit: RemoveSchema) -> None:
    """Take an API schema off a prim, in every layer that applies it."""
    for spec in session.specs(edit.prim):
        items = _schema_items(spec)
        if edit.schema not in items.GetAppliedItems():
            continue
        session.touch(spec.layer, edit.prim)
        for kind in _LISTS:
            names = getattr(items, kind)
            if edit.schema in names:
                setattr(items, kind, [name for name in names if name != edit.schema])
        if items.GetAppliedItems() or items.deletedItems:
            spec.SetInfo(_SCHEMAS, items)
        else:
            spec.ClearInfo(_SCHEMAS)
    if edit.schema in _applied(session, edit.prim):
        spec = session.prim_spec(session.stage.GetRootLayer(), edit.prim)
        items = _schema_items(spec)
        items.deletedItems = [*items.deletedItems, edit.schema]
        spec.SetInfo(_SCHEMAS, items)


def _schema_items(spec: Sdf.PrimSpec) -> Sdf.TokenListOp:
    return spec.GetInfo(_SCHEMAS) if spec.HasInfo(_SCHEMAS) else Sdf.TokenListOp()


def _applied(session: EditSession, path: str) -> list[str]:
    prim = session.stage.GetPrimAtPath(path)
    return list(prim.GetPrimTypeInfo().GetAppliedAPISchemas()) if prim else []


def set_type(session: EditSession, edit: SetType) -> None:
    """Give a prim a type in the layer that says the most of it."""
    session.prim_spec(session.prim_layer(edit.prim), edit.prim).typeName = edit.type


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
    """Add an Action Graph with all that is in it and the parents that it lacks.

    What a recipe brings says so in its custom data, so that it can be removed.
    """
    source = Sdf.Layer.CreateAnonymous(".usda")
    author_graph(source, edit, session.platform)
    _mark(source.GetPrimAtPath(edit.prim), edit.kind)
    above = list(Sdf.Path(edit.prim).GetParentPath().GetPrefixes())
    missing = [path for path in above if not session.stage.GetPrimAtPath(path)]
    copy_prim(session, source, edit.prim, edit.prim)
    for node in edit.nodes:  # which may stand where nodes stood that were removed
        session.touch(session.prim_layer(edit.prim), node.prim)
    for path in missing:
        for layer in session.layers():
            spec = layer.GetPrimAtPath(path)
            if spec is not None and spec.typeName == PARENT:
                _mark(spec, edit.kind)


def add_node(session: EditSession, edit: AddNode) -> None:
    """Add a node to a graph that is there."""
    source = Sdf.Layer.CreateAnonymous(".usda")
    author_node(source, edit, session.platform)
    _mark(source.GetPrimAtPath(edit.prim), edit.kind)
    copy_prim(session, source, edit.prim, edit.prim)


def _mark(spec: Sdf.PrimSpec, kind: str) -> None:
    if kind:
        spec.SetInfo("customData", {MARK: kind})


def copy_prim(session: EditSession, source: Sdf.Layer, path: str, to: str) -> None:
    """Copy a prim with all that is below it to where no prim stands."""
    if session.stands(to):
        return
    parent = to.rpartition("/")[0] or "/"
    layer = session.prim_layer(parent) if parent != "/" else session.stage.GetRootLayer()
    session.touch(layer, to)
    if parent != "/":
        define_parents(layer, session.stage, to)
        Sdf.CreatePrimInLayer(layer, parent)
    Sdf.CopySpec(source, path, layer, to)


def remove_prim(session: EditSession, edit: RemovePrim) -> None:
    """Remove a prim from every layer that may be edited; what remains of it is deactivated."""
    for spec in [*session.specs(edit.prim)]:
        session.touch(spec.layer, edit.prim)
        take_out(spec)
    if session.stands(edit.prim):
        session.prim_spec(session.stage.GetRootLayer(), edit.prim).active = False


def drop_prim(session: EditSession, edit: DropPrim) -> None:
    """Take out what the root layer says of a prim, and of all below it."""
    layer = session.stage.GetRootLayer()
    spec = layer.GetPrimAtPath(edit.prim)
    if spec is not None:
        session.touch(layer, edit.prim)
        take_out(spec)


def move_prim(session: EditSession, edit: MovePrim) -> None:
    """Move a prim to where none stands, in every layer that may be edited.

    Nothing is moved where something stood there before, or where the new parent is missing or below
    the prim itself.
    """
    parent = edit.to.rpartition("/")[0] or "/"
    is_free = not session.stands(edit.to) and (parent == "/" or session.stands(parent))
    if not session.stands(edit.prim) or not is_free or Sdf.Path(edit.to).HasPrefix(edit.prim):
        return
    if not _is_within_reach(session, edit.prim):
        _move_copy(session, edit)
        return
    layers = session.layers()
    for edited in map(session.begin, layers):  # has something stood there before this repair?
        if edited.before.GetPrimAtPath(edit.to) or any(edit.to in move for move in edited.moves):
            return
    for layer in layers:
        if layer.GetPrimAtPath(edit.prim) is not None or f"<{edit.prim}" in layer.ExportToString():
            session.begin(layer).moves.append((edit.prim, edit.to))
            _move(layer, Sdf.Path(edit.prim), Sdf.Path(edit.to))


def _is_within_reach(session: EditSession, path: str) -> bool:
    """Whether a prim comes from layers that may be edited, and not by an arc of a prim above it.

    A reference of its own moves with it.
    """
    layers, root = session.layers(), Pcp.ArcTypeRoot
    arcs = Usd.PrimCompositionQuery(session.stage.GetPrimAtPath(path)).GetCompositionArcs()
    own = {spec.layer for spec in session.opinions(path) if str(spec.path) == path}
    stack = set(session.stage.GetLayerStack(includeSessionLayers=False))
    return own & stack <= set(layers) and not any(
        arc.IsAncestral() for arc in arcs if arc.GetArcType() != root and arc.HasSpecs()
    )


def _move_copy(session: EditSession, edit: MovePrim) -> None:
    """Copy a prim as it is composed, deactivate it where it was, and let what names it follow.

    Nothing is done where it holds instances, or names of files, which are relative to its layer.
    """
    old, new = Sdf.Path(edit.prim), Sdf.Path(edit.to)
    prims = Usd.PrimRange(session.stage.GetPrimAtPath(old), Usd.PrimAllPrimsPredicate)
    if any(prim.IsInstance() or _names_files(prim) for prim in prims):
        return
    mask = Usd.StagePopulationMask([old])
    source = Usd.Stage.OpenMasked(session.stage.GetRootLayer(), mask).Flatten()
    _move(source, old, new)
    copy_prim(session, source, edit.to, edit.to)
    remove_prim(session, RemovePrim(edit.prim))
    for prim in session.stage.TraverseAll():
        path = str(prim.GetPath())
        for relationship in prim.GetAuthoredRelationships():
            targets = relationship.GetTargets()
            if any(target.HasPrefix(old) for target in targets):
                moved = tuple(str(target.ReplacePrefix(old, new)) for target in targets)
                set_targets(session, Retarget(path, relationship.GetName(), moved))
        for attribute in prim.GetAuthoredAttributes():
            sources = attribute.GetConnections()
            if any(source.HasPrefix(old) for source in sources):
                name, kind = attribute.GetName(), str(attribute.GetTypeName())
                moved = tuple(str(source.ReplacePrefix(old, new)) for source in sources)
                connect_input(session, Connect(path, name, kind, moved))


def _names_files(prim: Usd.Prim) -> bool:
    """Whether a prim refers to a file, by an arc of its own or by an attribute."""
    kinds = (attribute.GetTypeName().scalarType for attribute in prim.GetAuthoredAttributes())
    arcs = (
        arc
        for spec in prim.GetPrimStack()
        for listed in (spec.referenceList, spec.payloadList)
        for arc in listed.GetAddedOrExplicitItems()
    )
    return Sdf.ValueTypeNames.Asset in kinds or any(arc.assetPath for arc in arcs)


def _move(layer: Sdf.Layer, path: Sdf.Path, to: Sdf.Path) -> None:
    spec = layer.GetPrimAtPath(path)
    if spec is not None:
        Sdf.CreatePrimInLayer(layer, to.GetParentPath())
        Sdf.CopySpec(layer, path, layer, to)
        take_out(spec)

    def moved_path(item: Sdf.Path) -> Sdf.Path:
        return item.ReplacePrefix(path, to)

    def moved_arc(arc: Any) -> Any:
        """Return a reference or payload; one into another file stays."""
        if arc.assetPath:
            return arc
        return type(arc)("", moved_path(arc.primPath), arc.layerOffset)

    def follow(name: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(name)
        if isinstance(spec, Sdf.AttributeSpec):
            spec.connectionPathList.ModifyItemEdits(moved_path)
        elif isinstance(spec, Sdf.RelationshipSpec):
            spec.targetPathList.ModifyItemEdits(moved_path)
        elif isinstance(spec, Sdf.PrimSpec):
            for paths in (spec.inheritPathList, spec.specializesList):
                paths.ModifyItemEdits(moved_path)
            for arcs in (spec.referenceList, spec.payloadList):
                arcs.ModifyItemEdits(moved_arc)

    layer.Traverse(Sdf.Path.absoluteRootPath, follow)
