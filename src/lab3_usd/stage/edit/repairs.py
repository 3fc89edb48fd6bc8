"""Applies repairs to an open stage, and restores parts of the starter or the lab."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pxr import Sdf, Usd

from lab3_usd.errors import StageError
from lab3_usd.model import changes
from lab3_usd.model.changes import Activate, ApplySchema, ClearValue, Edit, Restore, Retarget
from lab3_usd.stage.edit.prim_edits import (
    activate,
    add_graph,
    add_node,
    apply_schema,
    clear_value,
    connect_input,
    copy_prim,
    drop_prim,
    move_prim,
    remove_prim,
    remove_schema,
    rename_property,
    set_attribute,
    set_targets,
    set_type,
    set_typed,
)
from lab3_usd.stage.edit.session import NEEDS_STARTER, EditSession

_POSE = "xformOp"
_ORDER = "xformOpOrder"
_WHOLE = ("active", "apiSchemas")
_RESET = "!resetXformStack!"


def restore(session: EditSession, edit: Restore) -> None:
    """Make a prim or a property what it is in the reference.

    Raises:
        StageError: only a starter says that, and there is none.
    """
    if not (session.has_starter or _is_described(session, edit)):
        raise StageError(NEEDS_STARTER)
    if edit.prim == "/" and edit.property:
        root = session.stage.GetRootLayer()
        session.touch(root, "/")
        value = session.reference().pseudoRoot.GetInfo(edit.property)
        root.pseudoRoot.SetInfo(edit.property, value)
    elif edit.property is None:
        _restore_prim(session, edit.prim)
    elif edit.property.startswith(_POSE):
        _restore_pose(session, edit.prim, edit.property)
    else:
        _restore_property(session, edit.prim, edit.property)


def _is_described(session: EditSession, edit: Restore) -> bool:
    """Whether the lab itself says what a prim or a property is to be."""
    reference = session.reference()
    prim = reference.GetPrimAtPath(edit.prim)
    is_whole = prim is not None and prim.specifier == Sdf.SpecifierDef
    if edit.property is None or is_whole:
        return is_whole
    if edit.property.startswith(_POSE):
        return prim is not None and _ORDER in prim.properties
    return edit.prim == "/" or edit.property in (() if prim is None else prim.properties)


def _restore_property(session: EditSession, path: str, name: str) -> None:
    expected = session.reference().GetPropertyAtPath(f"{path}.{name}")
    source = path if expected else _source(session, path, name)
    if source != path and session.reference().GetPrimAtPath(source):
        _restore_property(session, source, name)
    elif isinstance(expected, Sdf.AttributeSpec):
        set_typed(session, path, name, str(expected.typeName), expected.default)
    elif expected is not None:
        targets = tuple(map(str, expected.targetPathList.GetAddedOrExplicitItems()))
        set_targets(session, Retarget(path, name, targets))
    else:
        _erase(session, path, name)


def _source(session: EditSession, path: str, name: str) -> str:
    """Return the prim at which a property is authored; where it is gone, at which it should be.

    That may be one which is referred to.
    """
    actual, expected = (
        stage.GetPropertyAtPath(f"{path}.{name}")
        for stage in (session.stage, session.reference_stage())
    )
    if not expected or (actual and actual.IsAuthored()):
        return session.source(path, name)
    specs = (spec for spec in expected.GetPropertyStack() if spec.layer == session.reference())
    sources = (str(spec.path.GetPrimPath()) for spec in specs)
    return next(filter(session.stands, sources), path)


def _erase(session: EditSession, path: str, name: str) -> None:
    """Remove a property that no layer of the reference has at this prim.

    If a weaker layer has an opinion, the value of the reference overrides it, or a block if the
    reference has no value; unless the reference itself refers to that opinion.
    """
    for spec in session.specs(path):
        authored = spec.properties.get(name)
        if authored is not None:
            session.touch(spec.layer, path)
            spec.RemoveProperty(authored)
    actual = session.stage.GetPrimAtPath(path).GetAttribute(name)
    expected = session.reference_stage().GetAttributeAtPath(f"{path}.{name}")
    if actual and actual.HasAuthoredValue() and not (expected and expected.HasAuthoredValue()):
        value = expected.Get() if expected else None
        if value is None:
            clear_value(session, ClearValue(path, name))
        else:
            set_typed(session, path, name, str(expected.GetTypeName()), value)


def _restore_pose(session: EditSession, path: str, name: str) -> None:
    """Restore one operation of a pose where it is one of the prim's, else the whole pose."""
    order = session.stage.GetPrimAtPath(path).GetAttribute(_ORDER)
    own = [*(order.Get() or ())] if order else []
    if name == _ORDER and _RESET in own:
        kept = [name for name in own if name != _RESET]
        set_typed(session, path, _ORDER, "token[]", kept)
    elif name in own and session.reference().GetPropertyAtPath(f"{path}.{name}"):
        _restore_property(session, path, name)
    else:
        _restore_whole_pose(session, path)


def _restore_whole_pose(session: EditSession, path: str) -> None:
    expected = session.reference().GetPrimAtPath(path)
    prim = session.stage.GetPrimAtPath(path)
    if expected is None or not prim:
        return
    names = [spec.name for spec in expected.properties if spec.name.startswith(_POSE)]
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(_POSE) and name not in names:
            _erase(session, path, name)
    for name in names:
        _restore_property(session, path, name)


def _restore_prim(session: EditSession, path: str) -> None:
    """Restore a prim, what is missing below it, and the prims that should name it."""
    expected, graph_type = session.reference().GetPrimAtPath(path), session.platform.graph.type
    if expected is None:
        return
    if not session.stands(path):
        copy_prim(session, session.reference(), path, path)
        return
    for spec in _below(expected, graph_type):
        _restore_presence(session, spec)
    if session.stage.GetPrimAtPath(path).GetTypeName() != expected.typeName:
        session.prim_spec(session.prim_layer(path), path).typeName = expected.typeName
    if _is_moved(session, expected):
        _restore_whole_pose(session, path)
    _clear_overs_below(session, path)
    for spec in [*_naming(session.reference().pseudoRoot, expected.path, graph_type)]:
        _restore_presence(session, spec)


def _restore_presence(session: EditSession, expected: Sdf.PrimSpec) -> None:
    path = str(expected.path)
    if session.stands(path):
        activate(session, Activate(path))
    else:
        copy_prim(session, session.reference(), path, path)


def _clear_overs_below(session: EditSession, path: str) -> None:
    """Remove poses and schemas from the overs below a prim without a spec in the reference.

    They change parts of what is referred to, which is right by itself. Schemas that are still
    missing there are applied.
    """
    waiting = [*session.specs(path)]
    overs: list[Sdf.PrimSpec] = []
    while waiting:
        spec = waiting.pop()
        waiting += [*spec.nameChildren]
        if spec.specifier == Sdf.SpecifierOver:
            overs.append(spec)
    for spec in overs:
        if session.reference().GetPrimAtPath(spec.path) is None:
            session.touch(spec.layer, str(spec.path))
            for name in _WHOLE:
                spec.ClearInfo(name)
            for pose in [held for held in spec.properties if held.name.startswith(_POSE)]:
                spec.RemoveProperty(pose)
    expected = session.reference_stage().GetPrimAtPath(path)
    for prim in Usd.PrimRange(expected) if expected else ():  # what layers out of reach take off
        there = session.stage.GetPrimAtPath(prim.GetPath())
        if there and session.reference().GetPrimAtPath(prim.GetPath()) is None:
            for schema in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
                apply_schema(session, ApplySchema(str(prim.GetPath()), schema))


def _below(prim: Sdf.PrimSpec, graph_type: str) -> Iterator[Sdf.PrimSpec]:
    """Yield a prim and those below it that are defined and belong to no graph."""
    if prim.specifier == Sdf.SpecifierDef and prim.typeName != graph_type:
        yield prim
        for child in prim.nameChildren:
            yield from _below(child, graph_type)


def _is_moved(session: EditSession, expected: Sdf.PrimSpec) -> bool:
    """Whether the pose of a prim differs from the one in the reference."""
    prim = session.stage.GetPrimAtPath(expected.path)
    poses = {
        attribute.name: attribute.default
        for attribute in expected.attributes
        if attribute.name.startswith(_POSE)
    }
    return any(prim.GetAttribute(name).Get() != value for name, value in poses.items()) or any(
        name.startswith(_POSE) and name not in poses for name in prim.GetAuthoredPropertyNames()
    )


def _naming(prim: Sdf.PrimSpec, path: Sdf.Path, graph_type: str) -> Iterator[Sdf.PrimSpec]:
    """Yield the prims outside graphs that have a relationship to a prim."""
    for child in prim.nameChildren:
        if child.typeName == graph_type:
            continue
        targets = (
            relationship.targetPathList.GetAddedOrExplicitItems()
            for relationship in child.relationships
        )
        if any(path in paths for paths in targets):
            yield child
        yield from _naming(child, path, graph_type)


_EDITORS: Mapping[type, Callable[[EditSession, Any], None]] = {
    changes.SetValue: set_attribute,
    changes.ClearValue: clear_value,
    changes.Connect: connect_input,
    changes.Retarget: set_targets,
    changes.RenameProperty: rename_property,
    changes.ApplySchema: apply_schema,
    changes.RemoveSchema: remove_schema,
    changes.Activate: activate,
    changes.SetType: set_type,
    changes.Restore: restore,
    changes.AddNode: add_node,
    changes.AddGraph: add_graph,
    changes.RemovePrim: remove_prim,
    changes.DropPrim: drop_prim,
    changes.MovePrim: move_prim,
}


def apply_edit(session: EditSession, edit: Edit) -> None:
    """Make one edit; nothing is written to a file."""
    _EDITORS[type(edit)](session, edit)
