"""Reads a composed stage into plain data, in one traversal."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pxr import Tf, Usd

from lab3_usd.check.model import (
    DEACTIVATED,
    OVER,
    Absent,
    Collider,
    GraphModel,
    Moving,
    Node,
    Prim,
    Script,
    StageModel,
)
from lab3_usd.spec.catalog import Value
from lab3_usd.spec.spec import Lab
from lab3_usd.stage.colliders import RIGID_BODY, find_colliders
from lab3_usd.stage.missing import find_unresolved, is_in_scene
from lab3_usd.stage.muted import find_muted
from lab3_usd.stage.opening import in_plain_words, open_stage, quiet, remembered
from lab3_usd.stage.places import Places
from lab3_usd.stage.plain import plain
from lab3_usd.stage.ports import DamagedError, property_names, read_ports
from lab3_usd.stage.read_before import Before, Entry, before
from lab3_usd.stage.samples import changes_after_start, hold_at_start

# What rules ask of prims outside the graphs; everything else on a stage is none of their business.
_ATTRIBUTES = re.compile(
    r"^(physics|drive|isaac|omni|physx\w*|visibility|focalLength|clippingRange|"
    r"horizontalAperture|verticalAperture|projection|cameraProjectionType|clippingPlanes|"
    r"kind|node|xformOpOrder|omniGraphs)(:|$)"
)
# Prims whose place matters even if they are no rigid bodies; of the others nobody asks.
_PLACED = ("Xform", "Camera", "Plane", "OmniLidar", "")
_POSITION = "ui:nodegraph:node:pos"
_NAMESPACE = "isaac:namespace"
_NODE_TYPE = "node:type"


def read_stage(path: Path | str, lab: Lab) -> StageModel:
    """Read the stage at `path` as it is composed, payloads loaded.

    Raises:
        StageError: the file cannot be opened; the line says why.
    """
    return read_model(open_stage(Path(path)), lab, str(path))


@quiet()
def read_model(stage: Usd.Stage, lab: Lab, path: str) -> StageModel:
    """Read an open stage; `path` is the name it goes by.

    Raises:
        StageError: the file is damaged in a way that shows only now.
    """
    with in_plain_words(path, Tf.ErrorException, UnicodeDecodeError, DamagedError):
        return remembered(("model", id(stage)), lambda: _read_model(stage, lab))


def _read_model(stage: Usd.Stage, lab: Lab) -> StageModel:
    hold_at_start(stage)
    unresolved = tuple(find_unresolved(stage))
    hidden = tuple(dict.fromkeys(missing.prim for missing in unresolved))
    found = _Found(Before({}, {}) if hidden else before(stage), hidden)
    places = Places()
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), everything):
        if not prim.IsPseudoRoot():
            _read_prim(prim, lab, places, found)
        if prim.IsInstance():
            found.instances.append(str(prim.GetPath()))
    return StageModel(
        up_axis=str(stage.GetMetadata("upAxis")),
        meters_per_unit=float(stage.GetMetadata("metersPerUnit")),
        kilograms_per_unit=_kilograms(stage),
        graphs=tuple(_graph(prim_path, prim, found) for prim_path, prim in found.graphs.items()),
        prims=found.prims,
        orphans=tuple(found.orphans),
        absent=tuple(found.absent),
        unresolved=unresolved,
        colliders=tuple(_colliders(found, places)),
        muted=tuple(find_muted(stage)),
        instances=tuple(found.instances),
        scripts=tuple(found.scripts),
        moving=tuple(Moving(*change) for change in changes_after_start(stage)),
    )


@dataclass(slots=True)
class _Found:
    """What the traversal has come across so far; below the `hidden` prims assets are missing."""

    before: Before
    hidden: tuple[str, ...]
    graphs: dict[str, Usd.Prim] = field(default_factory=dict)
    nodes: dict[str, list[Node]] = field(default_factory=dict)
    graph_absent: dict[str, list[Absent]] = field(default_factory=dict)
    orphans: list[Node] = field(default_factory=list)
    absent: list[Absent] = field(default_factory=list)
    prims: dict[str, Prim] = field(default_factory=dict)
    collision_prims: list[Usd.Prim] = field(default_factory=list)
    scripts: list[Script] = field(default_factory=list)
    namespaces: dict[str, str] = field(default_factory=dict)
    instances: list[str] = field(default_factory=list)


def _kilograms(stage: Usd.Stage) -> float:
    """Return the stage's mass unit; UsdPhysics says kilograms where nothing is written."""
    value = stage.GetPseudoRoot().GetMetadata("kilogramsPerUnit")
    return 1.0 if value is None else float(value)


def _read_prim(prim: Usd.Prim, lab: Lab, places: Places, found: _Found) -> None:
    path = str(prim.GetPath())
    kind = str(prim.GetTypeName())
    form = lab.catalog.graph
    if form.ignores(path):
        if prim.IsActive():
            _note_script(path, _text(prim, _NODE_TYPE), _schemas(prim), lab, found)
        return
    if kind == form.type:
        found.graphs[path] = prim
        found.nodes[path] = []
        found.graph_absent[path] = []
    graph = _graph_above(path, found)
    if kind == form.node_type:
        _read_node(prim, path, graph, lab, found)
        return
    if graph and path != graph:
        _note_absent(prim, path, graph, lab, found)
    read = _read_other(prim, path, kind, places, found)
    if read.present:
        _note_script(path, "", read.apis, lab, found)


def _read_other(prim: Usd.Prim, path: str, kind: str, places: Places, found: _Found) -> Prim:
    """Read a prim that is no node, or take it as it was read before."""
    read: Prim | None = found.before.read(path)
    if read is None:
        read = found.before.keep(path, _prim(prim, path, kind, places, found.hidden))
    elif read.world is not None:
        places.know(path, read.world)
    found.prims[path] = read
    namespace = read.attributes.get(_NAMESPACE)
    if isinstance(namespace, str) and namespace:
        found.namespaces[path] = namespace
    if "PhysicsCollisionAPI" in read.apis and read.present:
        found.collision_prims.append(prim)
    return read


def _colliders(found: _Found, places: Places) -> Iterator[Collider]:
    """Yield the boxes around shapes; those of shapes that were read before are known."""
    boxes: dict[tuple[Entry, float], tuple[Collider, ...]] = remembered("boxes", dict)
    for prim in found.collision_prims:
        entry = found.before.here.get(str(prim.GetPath()))
        if entry is None or prim.GetAllChildrenNames():
            yield from find_colliders([prim], found.prims, places)
            continue
        key = (entry, float(prim.GetStage().GetMetadata("metersPerUnit")))
        if key not in boxes:
            boxes[key] = tuple(find_colliders([prim], found.prims, places))
        yield from boxes[key]


def _graph_above(path: str, found: _Found) -> str:
    """Return the path of the graph that this prim is, or is in; '' for none."""
    while path and found.graphs:
        if path in found.graphs:
            return path
        path = path.rpartition("/")[0]
    return ""


def _read_node(prim: Usd.Prim, path: str, graph: str, lab: Lab, found: _Found) -> None:
    node = found.before.read(path)
    if node is None:
        if not (prim.IsActive() and is_in_scene(prim, found.hidden)):
            _note_absent(prim, path, graph, lab, found)
            return
        node = _node(prim, path, lab, found)
        if not node.type_name and not node.ports:
            return  # a leftover, which is no node
        found.before.keep(path, node)
    if node.own_namespace:
        found.namespaces[path] = node.own_namespace
    _note_script(path, node.type_name, _schemas(prim), lab, found)
    (found.nodes[graph] if graph else found.orphans).append(node)


def _note_absent(prim: Usd.Prim, path: str, graph: str, lab: Lab, found: _Found) -> None:
    """Keep a prim that looks like a node and is none: its own graph may miss it."""
    type_name = _text(prim, _NODE_TYPE)
    ports = read_ports(prim, lab.catalog.get(type_name))
    if not (ports or type_name):
        return
    reason = f"of {prim.GetTypeName() or 'no type'}, not {lab.catalog.graph.node_type}"
    if not prim.IsActive():
        reason = DEACTIVATED
    elif not is_in_scene(prim, found.hidden):
        reason = OVER
    absent = Absent(path, type_name, reason, ports)
    (found.graph_absent[graph] if graph else found.absent).append(absent)


def _schemas(prim: Usd.Prim) -> tuple[str, ...]:
    return tuple(prim.GetPrimTypeInfo().GetAppliedAPISchemas())


def _note_script(path: str, node_type: str, apis: tuple[str, ...], lab: Lab, found: _Found) -> None:
    carrier = lab.catalog.scripts.among(apis)
    if lab.catalog.scripts.runs(node_type):
        carrier = node_type
    if carrier is not None:
        found.scripts.append(Script(path, carrier))


def _value_of(prim: Usd.Prim, name: str) -> Any:  # noqa: ANN401
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute else None


def _text(prim: Usd.Prim, name: str) -> str:
    return str(plain(_value_of(prim, name)) or "")


def _node(prim: Usd.Prim, path: str, lab: Lab, found: _Found) -> Node:
    type_name, own = _text(prim, _NODE_TYPE), _text(prim, _NAMESPACE)
    above = _namespace_of(path, found)
    kind = lab.catalog.get(type_name)
    version = plain(_value_of(prim, "node:typeVersion"))
    position = plain(_value_of(prim, _POSITION))
    return Node(
        path=path,
        type_name=type_name,
        type=kind,
        version=version if isinstance(version, int) else None,
        ports=read_ports(prim, kind),
        position=_pair(position),
        namespace="/".join(filter(None, (above, own))),
        own_namespace=own,
    )


def _pair(value: Value | None) -> tuple[float, float] | None:
    if not isinstance(value, tuple) or len(value) != 2:  # noqa: PLR2004 - x and y
        return None
    x, y = value
    return (float(x), float(y)) if isinstance(x, float) and isinstance(y, float) else None


def _graph(path: str, prim: Usd.Prim, found: _Found) -> GraphModel:
    attributes = {}
    for attribute in prim.GetAuthoredAttributes():
        value = plain(attribute.Get())
        if value is not None:
            attributes[attribute.GetName()] = value
    return GraphModel(
        path=path,
        prim_type=str(prim.GetTypeName()),
        active=bool(prim.IsActive() and is_in_scene(prim, found.hidden)),
        attributes=attributes,
        nodes=tuple(found.nodes[path]),
        absent=tuple(found.graph_absent[path]),
        instanced=prim.IsInstanceProxy(),
    )


def _namespace_of(path: str, found: _Found) -> str:
    """Join the namespaces of the ancestors, outermost first."""
    parts = []
    while path:
        path = path.rpartition("/")[0]
        if path in found.namespaces:
            parts.append(found.namespaces[path])
    return "/".join(reversed(parts))


def _prim(prim: Usd.Prim, path: str, kind: str, places: Places, hidden: tuple[str, ...]) -> Prim:
    attributes: dict[str, Value] = {}
    relationships: dict[str, tuple[str, ...]] = {}
    for name in property_names(prim):
        if _ATTRIBUTES.match(name) is None:
            continue
        attribute = prim.GetAttribute(name)
        if not attribute:
            targets = prim.GetRelationship(name).GetTargets()
            relationships[name] = tuple(str(target) for target in targets)
            continue
        value = plain(attribute.Get())
        if value is not None:
            attributes[name] = value
    apis = _schemas(prim)
    is_placed = kind in _PLACED or RIGID_BODY in apis
    local, world = places.of(prim, path) if is_placed else (None, None)
    return Prim(
        path=path,
        type=kind,
        apis=apis,
        active=prim.IsActive(),
        defined=is_in_scene(prim, hidden),
        attributes=attributes,
        relationships=relationships,
        local=local,
        world=world,
        authored=frozenset(attributes),
    )
