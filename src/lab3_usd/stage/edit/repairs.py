"""Makes the edits of repairs in an open stage, and restores what the starter or the lab has."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pxr import Sdf

from lab3_usd.model import changes
from lab3_usd.model.changes import Activate, ClearValue, Edit, Restore, Retarget
from lab3_usd.stage.edit.prims import (
    activate,
    add_graph,
    add_node,
    apply_schema,
    clear_value,
    connect,
    copy_prim,
    move_prim,
    remove_prim,
    remove_schema,
    rename_property,
    set_targets,
    set_typed,
    set_value,
)
from lab3_usd.stage.edit.session import EditSession

_POSE = "xformOp"
_ORDER = "xformOpOrder"
_WHOLE = ("active", "apiSchemas")
_RESET = "!resetXformStack!"


def restore(session: EditSession, edit: Restore) -> None:
    """Make a prim or a property what it is in the reference."""
    if edit.prim == "/" and edit.property:
        _restore_metadata(session, edit.property)
    elif edit.property is None:
        _restore_prim(session, edit.prim)
    elif edit.property.startswith(_POSE):
        _restore_pose(session, edit.prim, edit.property)
    else:
        _restore_property(session, edit.prim, edit.property)


def _restore_metadata(session: EditSession, name: str) -> None:
    root = session.stage.GetRootLayer()
    session.touch(root, "/")
    root.pseudoRoot.SetInfo(name, session.reference().pseudoRoot.GetInfo(name))


def _restore_property(session: EditSession, path: str, name: str) -> None:
    found = session.reference().GetPropertyAtPath(f"{path}.{name}")
    source = path if found else _source(session, path, name)
    if source != path and session.reference().GetPrimAtPath(source):
        _restore_property(session, source, name)
    elif isinstance(found, Sdf.AttributeSpec):
        set_typed(session, path, name, str(found.typeName), found.default)
    elif found is not None:
        targets = tuple(
            str(getaddedorexplicititem)
            for getaddedorexplicititem in found.targetPathList.GetAddedOrExplicitItems()
        )
        set_targets(session, Retarget(path, name, targets))
    else:
        _erase(session, path, name)


def _source(session: EditSession, path: str, name: str) -> str:
    """Return the prim at which a property is said; where it is gone, at which it should be.

    That may be one which is referred to.
    """
    found, asked = (
        stage.GetPropertyAtPath(f"{path}.{name}")
        for stage in (session.stage, session.reference_stage())
    )
    if not asked or (found and found.IsAuthored()):
        return session.source(path, name)
    specs = (spec for spec in asked.GetPropertyStack() if spec.layer == session.reference())
    sources = (str(spec.path.GetPrimPath()) for spec in specs)
    return next(filter(session.stands, sources), path)


def _erase(session: EditSession, path: str, name: str) -> None:
    """Remove a property that no layer of the reference has at this prim.

    Over what a weaker layer says the value of the reference is written, or a block where it has
    none, unless the reference refers to something that says it.
    """
    for spec in session.specs(path):
        found = spec.properties.get(name)
        if found is not None:
            session.touch(spec.layer, path)
            spec.RemoveProperty(found)
    prim = session.stage.GetPrimAtPath(path)
    attribute = prim.GetAttribute(name)
    asked = session.reference_stage().GetAttributeAtPath(f"{path}.{name}")
    if attribute and attribute.HasAuthoredValue() and not (asked and asked.HasAuthoredValue()):
        value = asked.Get() if asked else None
        if value is None:
            clear_value(session, ClearValue(path, name))
        else:
            set_typed(session, path, name, str(asked.GetTypeName()), value)


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
    wanted = session.reference().GetPrimAtPath(path)
    prim = session.stage.GetPrimAtPath(path)
    if wanted is None or not prim:
        return
    asked = [spec.name for spec in wanted.properties if spec.name.startswith(_POSE)]
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(_POSE) and name not in asked:
            _erase(session, path, name)
    for name in asked:
        _restore_property(session, path, name)


def _restore_prim(session: EditSession, path: str) -> None:
    """Restore a prim, what is missing below it, and the prims that should name it."""
    wanted = session.reference().GetPrimAtPath(path)
    if wanted is None:
        return
    if not session.stands(path):
        copy_prim(session, session.reference(), path, path)
        return
    for each in _below(wanted, session.lab.catalog.graph.type):
        _restore_presence(session, each)
    spec_type = session.stage.GetPrimAtPath(path).GetTypeName()
    if spec_type != wanted.typeName:
        session.prim_spec(session.prim_layer(path), path).typeName = wanted.typeName
    if _is_moved(session, wanted):
        _restore_whole_pose(session, path)
    _let_go_below(session, path)
    graph = session.lab.catalog.graph.type
    for each in [*_naming(session.reference().pseudoRoot, wanted.path, graph)]:
        _restore_presence(session, each)


def _restore_presence(session: EditSession, wanted: Sdf.PrimSpec) -> None:
    path = str(wanted.path)
    if session.stands(path):
        activate(session, Activate(path))
    else:
        copy_prim(session, session.reference(), path, path)


def _let_go_below(session: EditSession, path: str) -> None:
    """Take poses and schemas off the overs below a prim that the reference says nothing of.

    They change parts of what is referred to, which is right by itself.
    """
    for spec in [*_overs(session, path)]:
        if session.reference().GetPrimAtPath(spec.path) is None:
            session.touch(spec.layer, str(spec.path))
            for name in _WHOLE:
                spec.ClearInfo(name)
            for pose in [held for held in spec.properties if held.name.startswith(_POSE)]:
                spec.RemoveProperty(pose)


def _overs(session: EditSession, path: str) -> Iterator[Sdf.PrimSpec]:
    """Yield what layers that may be edited say of prims below one without defining them."""
    waiting = [*session.specs(path)]
    while waiting:
        spec = waiting.pop()
        waiting += [*spec.nameChildren]
        if spec.specifier == Sdf.SpecifierOver:
            yield spec


def _below(prim: Sdf.PrimSpec, graph_type: str) -> Iterator[Sdf.PrimSpec]:
    """Yield a prim and those below it that are defined and belong to no graph."""
    if prim.specifier == Sdf.SpecifierDef and prim.typeName != graph_type:
        yield prim
        for child in prim.nameChildren:
            yield from _below(child, graph_type)


def _is_moved(session: EditSession, wanted: Sdf.PrimSpec) -> bool:
    """Whether the pose of a prim is written otherwise than in the reference."""
    prim = session.stage.GetPrimAtPath(wanted.path)
    poses = {
        attribute.name: attribute.default
        for attribute in wanted.attributes
        if attribute.name.startswith(_POSE)
    }
    return any(prim.GetAttribute(name).Get() != value for name, value in poses.items()) or any(
        name.startswith(_POSE) and name not in poses for name in prim.GetAuthoredPropertyNames()
    )


def _naming(prim: Sdf.PrimSpec, path: Sdf.Path, graph: str) -> Iterator[Sdf.PrimSpec]:
    """Yield the prims outside graphs that have a relationship to a prim."""
    for child in prim.nameChildren:
        if child.typeName == graph:
            continue
        named = (
            relationship.targetPathList.GetAddedOrExplicitItems()
            for relationship in child.relationships
        )
        if any(path in paths for paths in named):
            yield child
        yield from _naming(child, path, graph)


_EDITORS: Mapping[type, Callable[[EditSession, Any], None]] = {
    changes.SetValue: set_value,
    changes.ClearValue: clear_value,
    changes.Connect: connect,
    changes.Retarget: set_targets,
    changes.RenameProperty: rename_property,
    changes.ApplySchema: apply_schema,
    changes.RemoveSchema: remove_schema,
    changes.Activate: activate,
    changes.Restore: restore,
    changes.AddNode: add_node,
    changes.AddGraph: add_graph,
    changes.RemovePrim: remove_prim,
    changes.MovePrim: move_prim,
}


def apply_edit(session: EditSession, edit: Edit) -> None:
    """Make one edit; nothing is written to a file."""
    _EDITORS[type(edit)](session, edit)
