"""Edits the properties of prims: values, connections, targets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pxr import Sdf

from lab3_usd.model.repair import ClearValue, Connect, RenameProperty, Retarget, SetValue
from lab3_usd.spec.values import are_alike
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.write.author import catalog_value

_PORTS = ("inputs:", "outputs:")


def set_value(session: EditSession, edit: SetValue) -> None:
    """Give an attribute a value, and the type asked for where its own cannot hold it."""
    set_typed(session, edit.prim, edit.property, edit.type, catalog_value(edit.value, edit.type))


def set_typed(session: EditSession, prim: str, name: str, type_name: str, value: Any) -> None:  # noqa: ANN401
    """Give an attribute a value of usd-core."""
    spec = _attribute(session, prim, name, type_name)
    if spec.HasInfo("timeSamples"):
        spec.ClearInfo("timeSamples")
    spec.default = value


def _attribute(session: EditSession, path: str, name: str, type_name: str) -> Sdf.AttributeSpec:
    _remove_others(session, path, name, Sdf.AttributeSpec)
    layer = session.property_layer(path, name)
    prim = session.prim_spec(layer, path)
    found = layer.GetAttributeAtPath(f"{path}.{name}")
    if found is not None and are_alike(str(found.typeName), type_name):
        return found
    composed = session.stage.GetPrimAtPath(path).GetAttribute(name)
    if found is None and composed and are_alike(str(composed.GetTypeName()), type_name):
        type_name = str(composed.GetTypeName())
    is_custom = bool(composed.IsCustom()) if composed else name.startswith(_PORTS)
    sources, data = _kept(found)
    if found is not None:
        prim.RemoveProperty(found)
    variability = composed.GetVariability() if composed else Sdf.VariabilityVarying
    made = Sdf.AttributeSpec(
        prim, name, Sdf.ValueTypeNames.Find(type_name), variability, declaresCustom=is_custom
    )
    if data:
        made.SetInfo("customData", data)
    for source in sources:
        made.connectionPathList.prependedItems.append(source)
    return made


def _remove_others(session: EditSession, path: str, name: str, kind: type) -> None:
    """Remove what says that a property is of another kind, a relationship or an attribute."""
    for prim in session.specs(path):
        found = prim.properties.get(name)
        if found is not None and not isinstance(found, kind):
            session.touch(prim.layer, path)
            prim.RemoveProperty(found)


def _kept(found: Sdf.AttributeSpec | None) -> tuple[list[Sdf.Path], Any]:
    """Return what an attribute of the wrong type hands on: its connections and custom data."""
    if found is None:
        return [], None
    return list(found.connectionPathList.GetAddedOrExplicitItems()), found.GetInfo("customData")


def clear_value(session: EditSession, edit: ClearValue) -> None:
    """Take the value or the targets of a property away, whichever layer says them."""
    prim = session.stage.GetPrimAtPath(edit.prim)
    if prim.GetRelationship(edit.property):
        set_targets(session, Retarget(edit.prim, edit.property))
        return
    layer = session.property_layer(edit.prim, edit.property)
    spec = layer.GetAttributeAtPath(f"{edit.prim}.{edit.property}")
    if spec is not None:
        session.touch(layer, edit.prim)
        spec.ClearInfo("timeSamples")
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


def connect(session: EditSession, edit: Connect) -> None:
    """Let an input be connected to what is named, and to nothing else."""
    layer = session.property_layer(edit.prim, edit.property)
    held = layer.GetAttributeAtPath(f"{edit.prim}.{edit.property}")
    if held is None and not edit.sources:
        return
    spec = held or _attribute(session, edit.prim, edit.property, edit.type)
    session.touch(spec.layer, edit.prim)
    attribute = session.stage.GetPrimAtPath(edit.prim).GetAttribute(edit.property)
    _rewrite(spec.connectionPathList, edit.sources, explicit=False)
    if [str(each) for each in attribute.GetConnections()] != list(edit.sources):
        _rewrite(spec.connectionPathList, edit.sources, explicit=True)


def set_targets(session: EditSession, edit: Retarget) -> None:
    """Let a relationship name what is asked for, and nothing else."""
    _remove_others(session, edit.prim, edit.property, Sdf.RelationshipSpec)
    layer = session.property_layer(edit.prim, edit.property)
    prim = session.prim_spec(layer, edit.prim)
    spec = layer.GetRelationshipAtPath(f"{edit.prim}.{edit.property}")
    if spec is None:
        spec = Sdf.RelationshipSpec(prim, edit.property, custom=edit.property.startswith(_PORTS))
    relationship = session.stage.GetPrimAtPath(edit.prim).GetRelationship(edit.property)
    _rewrite(spec.targetPathList, edit.targets, explicit=bool(edit.targets))
    if [str(each) for each in relationship.GetTargets()] != list(edit.targets):
        _rewrite(spec.targetPathList, edit.targets, explicit=True)


def _rewrite(items: Any, paths: Iterable[str], *, explicit: bool) -> None:  # noqa: ANN401
    """Write a list of paths in the form that it has: explicit, or put before what is weaker."""
    found = [Sdf.Path(each) for each in paths]
    if items.isExplicit and found:
        items.explicitItems = found
    elif explicit:
        items.ClearEditsAndMakeExplicit()
        items.explicitItems = found
    elif not found:
        items.ClearEdits()
    else:
        for name in ("addedItems", "appendedItems"):
            if getattr(items, name):
                setattr(items, name, [])
        items.prependedItems = found
