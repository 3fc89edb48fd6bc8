"""Reads a composed stage for a dry run, with the values of the time at which playing starts.

Methods of usd-core are called by their classes: asked of an object, one takes much longer.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from struct import Struct
from typing import Any, TypeVar

from msgspec.structs import replace
from pxr import Sdf, Usd, UsdGeom

from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.names import OtherName
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.compounds import opened_scene_nodes
from lab3_usd.model.dry_run import (
    HERE,
    RENDER_PRODUCT,
    Affine,
    Input,
    Scene,
    SceneGraph,
    SceneNode,
    ScenePrim,
    bounded,
)
from lab3_usd.model.physics import BODY_API
from lab3_usd.stage.read.assets import find_unresolved
from lab3_usd.stage.read.prim_transforms import ORDER, is_placeless
from lab3_usd.stage.read.properties import CENTIMETRES, compounds_in, stage_number, targets_of

_Value = TypeVar("_Value")
UNSEEN = ("guide",)
LEAST_UNIT = 1e-4
NO_TIME = Usd.TimeCode.Default()
_SIXTEEN = Struct("16d")
TIMELESS = ("physics", "drive:", "isaac:")  # what is parsed once, without a time
SHAPES = ("Cube", "Sphere", "Cylinder", "Capsule", "Cone", "Mesh", "Plane")
_SIZES = {
    "Cube": ("size",),
    "Sphere": ("radius",),
    "Cylinder": ("radius", "height", "axis"),
    "Capsule": ("radius", "height", "axis"),
    "Cone": ("radius", "height", "axis"),
    "Mesh": ("points", "faceVertexCounts", "faceVertexIndices"),
    "Plane": ("axis", "width", "length"),
    "Camera": ("focalLength", "horizontalAperture", "verticalAperture", "clippingRange"),
}


def read_scene(stage: Usd.Stage, platform: Platform) -> Scene:
    """Read a stage as it is composed; types and ports of nodes have their names of the platform."""
    time, form = Usd.TimeCode(stage.GetStartTimeCode()), platform.graph
    graphs: dict[str, Usd.Prim] = {}
    nodes: dict[str, list[SceneNode]] = {}
    prims: dict[str, ScenePrim] = {}
    assets: dict[str, dict[str, None]] = {}
    for unresolved in find_unresolved(stage):
        assets.setdefault(unresolved.prim, {})[unresolved.asset] = None
    missing = {prim: ", ".join(several) for prim, several in assets.items()}
    everything = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), everything):
        path, kind = str(Usd.Prim.GetPath(prim)), str(Usd.Prim.GetTypeName(prim))
        # A node may name a product, wherever that is.
        if path == "/" or (form.ignores(path) and kind != RENDER_PRODUCT):
            continue
        if kind == form.type:
            graphs[path], nodes[path] = prim, []
        if kind == form.node_type:
            parent = path.rpartition("/")[0]
            while parent and parent not in nodes:
                parent = parent.rpartition("/")[0]
            if parent:
                nodes[parent].append(_node(prim, path, time, platform))
        else:
            prims[path] = _prim(prim, path, kind, time, prims, missing)
    users = _only_users(prims, platform)
    types = {node.path: node.type for members in nodes.values() for node in members}
    nodes = {
        graph: [_used_by(node, users.get(graph), platform) for node in members]
        for graph, members in nodes.items()
    }
    compounds = compounds_in(stage, graphs, types, platform.building.compound)
    opened = opened_scene_nodes((node for members in nodes.values() for node in members), compounds)
    by_path = {node.path: node for node in opened}
    compounds.move(nodes)
    # Only now do wires out of compounds come from the nodes in them.
    port_names = {path: platform.other_ports(kind) for path, kind in types.items()}
    nodes = {
        graph: [_named(by_path[node.path], port_names) for node in members if node.path in by_path]
        for graph, members in nodes.items()
    }
    named = (
        paths for members in nodes.values() for node in members for paths in node.targets.values()
    )
    targets = {path for paths in named for path in paths}
    for path in platform.application_prims:
        if path in targets and path not in prims:
            # A camera that the application makes is as its schema has it.
            beside = Usd.Stage.CreateInMemory()
            made = UsdGeom.Camera.Define(beside, path).GetPrim()
            prims[path] = _prim(made, path, str(made.GetTypeName()), NO_TIME, {}, {})
    unit = stage_number(stage.GetMetadata("metersPerUnit"), CENTIMETRES)
    return Scene(
        # A unit too small to see a room in is a metre, as is one too large.
        unit if LEAST_UNIT <= unit <= 1.0 / LEAST_UNIT else 1.0,
        str(stage.GetMetadata("upAxis")),
        tuple(
            SceneGraph(
                path,
                str(_value(prim, "evaluator:type") or platform.graph.value("evaluator:type")),
                str(_value(prim, "pipelineStage") or "pipelineStageSimulation"),
                str(_value(prim, "evaluationMode") or "Automatic"),
                tuple(nodes[path]),
                {
                    str(name).removeprefix(VARIABLE): _value(prim, str(name))
                    for name in prim.GetAuthoredPropertyNames()
                    if str(name).startswith(VARIABLE)
                },
                prim.IsInstanceProxy(),
                compounds.within(path, nodes),
            )
            for path, prim in graphs.items()
            if path in nodes
        ),
        prims,
        missing,
    )


def _only_users(prims: Mapping[str, ScenePrim], platform: Platform) -> dict[str, str]:
    """Return the prims that refer to graphs, by the graph, where one alone does."""
    users: dict[str, list[str]] = {}
    for prim in prims.values():
        for graph in prim.targets.get(platform.graph.evaluation.reference, ()):
            users.setdefault(graph, []).append(prim.path)
    return {graph: paths[0] for graph, paths in users.items() if len(paths) == 1}


def _used_by(node: SceneNode, user: str | None, platform: Platform) -> SceneNode:
    """Return a node with the user of its graph as target, in place of the placeholder for it."""
    if user is None:
        return node
    placeholder = platform.graph.evaluation.placeholder
    targets = {
        name: tuple(user if path.rpartition("/")[2] == placeholder else path for path in paths)
        for name, paths in node.targets.items()
    }
    return replace(node, targets=targets)


def _named(node: SceneNode, port_names: Mapping[str, Mapping[str, OtherName]]) -> SceneNode:
    """Return a node whose ports, and those that feed it, have their names of the platform."""
    own_names = port_names.get(node.path, {})

    def own(names: Mapping[str, _Value]) -> dict[str, _Value]:
        renamed = {
            own_names[name].name: value for name, value in names.items() if name in own_names
        }
        kept = {name: value for name, value in names.items() if name not in own_names}
        return {**renamed, **kept}

    def source(path: str) -> str:
        prim, _, port = path.rpartition(".")
        other = port_names.get(prim, {}).get(port)
        return path if other is None else f"{prim}.{other.name}"

    inputs = {
        name: replace(state, sources=tuple(map(source, state.sources)))
        for name, state in own(node.inputs).items()
    }
    return replace(node, inputs=inputs, targets=own(node.targets))


def _node(prim: Usd.Prim, path: str, time: Usd.TimeCode, platform: Platform) -> SceneNode:
    inputs, targets = {}, {}
    for name in map(str, Usd.Prim.GetAuthoredPropertyNames(prim)):
        if not name.startswith("inputs:"):
            continue
        attribute = Usd.Prim.GetAttribute(prim, name)
        if attribute:
            inputs[name] = _input(attribute, time)
        else:
            targets[name] = tuple(map(str, targets_of(prim.GetRelationship(name))))
    version = _value(prim, "node:typeVersion")
    return SceneNode(
        path,
        platform.type_name(str(_value(prim, "node:type") or "")),
        version if isinstance(version, int) else 0,
        inputs,
        targets,
        str(_value(prim, "isaac:namespace") or ""),
    )


def _input(attribute: Usd.Attribute, time: Usd.TimeCode) -> Input:
    sources: tuple[str, ...] = ()
    if Usd.Attribute.HasAuthoredConnections(attribute):
        sources = tuple(map(str, Usd.Attribute.GetConnections(attribute)))
    literal = None
    if Usd.Attribute.HasAuthoredCustomDataKey(attribute, "omni"):
        literal = python_value(Usd.Attribute.GetCustomDataByKey(attribute, "omni:graph:attrValue"))
    kind, value = Usd.Attribute.GetTypeName(attribute), Usd.Attribute.Get(attribute, time)
    return Input(str(kind), python_value(value), literal, sources)


def _value(prim: Usd.Prim, name: str, time: Usd.TimeCode = NO_TIME) -> Any:
    attribute = Usd.Prim.GetAttribute(prim, name)
    return python_value(Usd.Attribute.Get(attribute, time)) if attribute else None


def _is_readable(attribute: Usd.Attribute, value: Any) -> bool:
    """Whether a value has the type of its attribute; any other no simulation can read."""
    return type(value) is _class_of(Usd.Attribute.GetTypeName(attribute))


@lru_cache(maxsize=256)
def _class_of(kind: Sdf.ValueTypeName) -> type | None:
    """Return the class of the values of a type, None for one that USD does not know."""
    declared = kind.defaultValue
    return None if declared is None else type(declared)


def _size(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> Any:
    """Return a size of a shape or a camera, the schema's own where the file has none to read."""
    attribute = Usd.Prim.GetAttribute(prim, name)
    value = Usd.Attribute.Get(attribute, time)
    if not _is_readable(attribute, value):
        value = prim.GetPrimDefinition().GetAttributeFallbackValue(name)
    is_array = value is not None and Usd.Attribute.GetTypeName(attribute).isArray
    return memoryview(value) if is_array else python_value(value)


def _prim(
    prim: Usd.Prim,
    path: str,
    kind: str,
    time: Usd.TimeCode,
    before: dict[str, ScenePrim],
    missing: Mapping[str, str],
) -> ScenePrim:
    values, targets = {}, {}
    has_sizes, is_placed = kind in SHAPES or kind == "Camera", False
    for authored in Usd.Prim.GetAuthoredProperties(prim):
        name = str(Usd.Property.GetName(authored))
        if name.startswith(("xformOp", "primvars", "ui:")):
            is_placed = is_placed or name == ORDER
            continue
        if isinstance(authored, Usd.Attribute):
            if ":" not in name and Usd.Attribute.GetTypeName(authored).isArray:
                continue  # geometry, of which only what a ray meets is read, below
            at = NO_TIME if name.startswith(TIMELESS) else time
            value = Usd.Attribute.Get(authored, at)
            if _is_readable(authored, value):
                values[name] = python_value(value)
        else:
            targets[name] = tuple(map(str, targets_of(authored)))
    if has_sizes:  # by the schema where nothing is authored
        values.update((name, _size(prim, name, time)) for name in _SIZES[kind])
    image = UsdGeom.Imageable(prim) if has_sizes else None
    is_seen = (
        image is not None
        and image.ComputePurpose() not in UNSEEN
        and image.ComputeVisibility(time) != "invisible"
    )
    parent = before.get(path.rpartition("/")[0])
    local, is_loose = HERE, False
    apis, no_place = (
        Usd.Prim.GetPrimTypeInfo(prim).GetAppliedAPISchemas(),
        is_placeless(kind, path, missing),
    )
    if is_placed and not no_place:
        xform = UsdGeom.Xformable(prim)
        numbers = tuple(map(bounded, _SIXTEEN.unpack(xform.GetLocalTransformation(time))))
        rows = (numbers[:11:4], numbers[1:11:4], numbers[2:11:4])  # USD multiplies from the left
        local, is_loose = Affine(rows, numbers[12:15]), xform.GetResetXformStack()  # type: ignore[arg-type]
    above = parent.world if parent and not is_loose else HERE
    return ScenePrim(
        path,
        kind,
        # UsdPhysics makes no body of what has no place.
        frozenset(apis) - {BODY_API} if no_place else frozenset(apis),
        above.then(local),
        values,
        targets,
        is_seen,
        is_loose,
    )


def python_value(value: Any) -> Any:
    """Return a value of USD as Python's own; a quaternion comes as (w, x, y, z)."""
    if isinstance(value, float):
        return bounded(value)
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if hasattr(value, "GetReal"):
        return tuple(bounded(float(part)) for part in (value.GetReal(), *value.GetImaginary()))
    if hasattr(value, "__len__"):
        return tuple(python_value(item) for item in value)
    return str(value)
