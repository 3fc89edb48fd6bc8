"""Writes Action Graphs and sensors into a layer as Isaac Sim 6.0.1 saves them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pxr import Gf, Sdf, Usd

from lab3_usd.isaac.messages import with_message
from lab3_usd.isaac.node_types import Port
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value
from lab3_usd.model.changes import AddGraph, AddNode
from lab3_usd.spec.load.starter import PoseSpec as StarterPose
from lab3_usd.spec.scene import PoseSpec, SensorSpec

# How Kit marks ports (isaac facts: serialization, sections 4, 5 and 7).
_EXECUTION = {"isExecution": True}
_TARGET = {"omni": {"graph": {"relType": "target"}}}
_POSITION = "ui:nodegraph:node:pos"
_EXPANSION = "ui:nodegraph:node:expansionState"
_QUATERNION = "quatd"
PARENT = "Scope"
_DIGITS = 12  # sines differ in the last bits between machines, and that of 180 degrees is not 0


def author_graph(layer: Sdf.Layer, graph: AddGraph, platform: Platform) -> None:
    """Define the graph with all its nodes, ports, values, targets and wires.

    Ancestors that the layer does not hold become `over`s. Values are authored where the graph has
    one, and nowhere else.
    """
    prim = _define_prim(layer, graph.prim, platform.graph.type)
    for attribute in platform.graph.attributes:
        _declare(prim, attribute.name, attribute.usd_type, attribute.value, custom=False)
    for variable in graph.variables:
        declared = _declare(
            prim, variable.attribute, variable.usd_type, variable.value, custom=True
        )
        declared.displayName = variable.name
    for node in graph.nodes:
        author_node(layer, node, platform)
    for wire in graph.wires:
        fed = layer.GetAttributeAtPath(f"{wire.prim}.{wire.property}")
        for source in wire.sources:
            fed.connectionPathList.prependedItems.append(Sdf.Path(source))


def define_parents(layer: Sdf.Layer, stage: Usd.Stage, path: str) -> None:
    """Define each prim above a path that neither the stage nor the layer has."""
    for above in Sdf.Path(path).GetParentPath().GetPrefixes():
        if not stage.GetPrimAtPath(above) and layer.GetPrimAtPath(above) is None:
            _define_prim(layer, str(above), PARENT)


def author_sensor(
    layer: Sdf.Layer, spec: SensorSpec, metres: float, asset: str | None = None
) -> None:
    """Define the sensor of `scene.yaml` with its pose and attributes.

    `metres` is the length of one unit of the stage.
    With `asset`, the prim references the vendor's file as the Create menu does, and only what
    the handout sets is authored over it; without, the prim describes itself.
    """
    prim = _define_prim(layer, spec.path, spec.type)
    if asset is None:
        _prepend_apis(prim, list(spec.apis))
    else:
        prim.referenceList.prependedItems.append(Sdf.Reference(asset))
    for name, entry in (spec.attributes if asset is None else spec.required).items():
        _declare(prim, name, entry.type, entry.value, custom=False)
    author_pose(prim, spec.pose, metres)


def _define_prim(layer: Sdf.Layer, path: str, type_name: str) -> Sdf.PrimSpec:
    """Return a `def` of this type at `path`, made anew or out of an `over`."""
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = type_name
    return prim


def _prepend_apis(prim: Sdf.PrimSpec, apis: list[str]) -> None:
    """Write `prepend apiSchemas = [...]`."""
    prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=apis))


def author_node(layer: Sdf.Layer, node: AddNode, platform: Platform) -> None:
    """Define a node with its ports, values and targets, below whatever stands at its graph."""
    values, targets = dict(node.values), dict(node.targets)
    kind = with_message(platform.types[node.type], values)
    prim = _define_prim(layer, node.prim, platform.graph.node_type)
    _prepend_apis(prim, [platform.graph.gui_api])
    _declare(prim, "node:type", "token", platform.written_name(kind.type), custom=False)
    _declare(prim, "node:typeVersion", "int", kind.version, custom=False)
    for port in kind.ports.values():
        _author_port(prim, port, values.get(port.name), targets.get(port.name, ()))
    for name in node.added:
        added = kind.port(name)
        if added is not None and kind.dynamic is not None:
            _author_port(prim, added, None, ())
            # A port added by hand says which types it takes, as the editor has it.
            types = kind.dynamic.metadata
            data = {"ExtendedAttributeType": types, "omni": {"graph": {"attrType": types}}}
            prim.attributes[name].SetInfo("customData", data)
    _declare(prim, _EXPANSION, "token", "open", custom=False, uniform=True)
    _declare(prim, _POSITION, "float2", node.place, custom=False, uniform=True)


def _author_port(
    prim: Sdf.PrimSpec, port: Port, value: Value | None, targets: tuple[str, ...]
) -> None:
    if port.is_target:
        relationship = Sdf.RelationshipSpec(prim, port.name, custom=True)
        relationship.SetInfo("customData", _TARGET)
        if targets:
            relationship.targetPathList.explicitItems = [Sdf.Path(path) for path in targets]
        return
    attribute = _declare(prim, port.name, port.usd_type, value, custom=True)
    if port.is_execution:
        attribute.SetInfo("customData", _EXECUTION)
    if port.allowed:
        attribute.allowedTokens = list(port.allowed)


def _declare(
    prim: Sdf.PrimSpec,
    name: str,
    usd_type: str,
    value: Value | None,
    *,
    custom: bool,
    uniform: bool = False,
) -> Sdf.AttributeSpec:
    variability = Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying
    attribute = Sdf.AttributeSpec(
        prim, name, Sdf.ValueTypeNames.Find(usd_type), variability, declaresCustom=custom
    )
    if value is not None:
        attribute.default = catalog_value(value, usd_type)
    return attribute


def take_out(spec: Sdf.PrimSpec) -> None:
    """Take a prim with all below it out of its layer."""
    parent = spec.nameParent or spec.layer.pseudoRoot
    del parent.nameChildren[spec.name]


def author_pose(prim: Sdf.PrimSpec, pose: PoseSpec | StarterPose, metres: float) -> None:
    """Write translate, orient and scale in double precision, as the Property panel does.

    `pose` holds metres, degrees about X, then Y, then Z, and factors.
    """
    types = Sdf.ValueTypeNames
    ops = (
        ("xformOp:translate", types.Double3, Gf.Vec3d(*pose.translate) / metres),
        ("xformOp:orient", types.Quatd, quaternion(pose.rotate)),
        ("xformOp:scale", types.Double3, Gf.Vec3d(*pose.scale)),
    )
    for name, value_type, value in ops:
        Sdf.AttributeSpec(prim, name, value_type).default = value
    order = Sdf.AttributeSpec(prim, "xformOpOrder", types.TokenArray, Sdf.VariabilityUniform)
    order.default = [name for name, _, _ in ops]


def quaternion(rotate: Sequence[float]) -> Gf.Quatd:
    """Return the rotation about X, then Y, then Z, in degrees, the same to the bit everywhere."""
    rotation = Gf.Rotation(Gf.Vec3d.XAxis(), 0.0)
    for axis, angle in zip(
        (Gf.Vec3d.XAxis(), Gf.Vec3d.YAxis(), Gf.Vec3d.ZAxis()), rotate, strict=True
    ):
        rotation *= Gf.Rotation(axis, angle)
    exact = rotation.GetQuat()
    numbers = (exact.GetReal(), *exact.GetImaginary())
    # Adding 0.0 turns -0.0 into 0.0.
    return Gf.Quatd(*(round(number, _DIGITS) + 0.0 for number in numbers))


def usd_value(value: Any, value_type: Sdf.ValueTypeName) -> Any:
    """Turn lists and tuples into the vector or array of a type; other values stay as they are."""
    if not isinstance(value, (list, tuple)):
        return value
    make = value_type.type.pythonClass
    if value_type.isArray:
        return make([tuple(item) if isinstance(item, list) else item for item in value])
    return make(*value)


def catalog_value(value: Value, usd_type: str) -> Any:
    """Return a value of the platform, whose quaternions are x, y, z, w."""
    if usd_type == _QUATERNION and isinstance(value, tuple):
        value = (value[3], *value[:3])
    return usd_value(value, Sdf.ValueTypeNames.Find(usd_type))
