"""Writes an Action Graph into a layer as Isaac Sim 6.0.1 saves it."""

from __future__ import annotations

from pxr import Sdf

from lab3_usd.spec.catalog import Catalog, Dynamic, Port, Value
from lab3_usd.spec.spec import GraphSpec, NodeSpec
from lab3_usd.stage.typed import usd_value, value_type

# How Kit marks ports (isaac facts: serialization, sections 4, 5 and 7).
_EXECUTION = {"isExecution": True}
_TARGET = {"omni": {"graph": {"relType": "target"}}}
_POSITION = "ui:nodegraph:node:pos"
_EXPANSION = "ui:nodegraph:node:expansionState"


def author_graph(layer: Sdf.Layer, spec: GraphSpec, catalog: Catalog) -> None:
    """Define the graph with all its nodes, ports, values, targets and wires.

    Ancestors that the layer does not hold become `over`s. Values are authored where the handout
    names one, and nowhere else.
    """
    prim = define_prim(layer, spec.path, catalog.graph.type)
    for attribute in catalog.graph.attributes:
        _declare(prim, attribute.name, attribute.usd_type, attribute.value, custom=False)
    for node in spec.nodes.values():
        _author_node(layer, spec, node, catalog)
    for wire in spec.wires:
        target = Sdf.Path(f"{spec.path}/{wire.target.role}").AppendProperty(wire.target.port)
        source = Sdf.Path(f"{spec.path}/{wire.source.role}").AppendProperty(wire.source.port)
        layer.GetAttributeAtPath(target).connectionPathList.prependedItems.append(source)


def define_prim(layer: Sdf.Layer, path: str, type_name: str) -> Sdf.PrimSpec:
    """Return a `def` of this type at `path`, made anew or out of an `over`."""
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = type_name
    return prim


def prepend_apis(prim: Sdf.PrimSpec, apis: list[str]) -> None:
    """Write `prepend apiSchemas = [...]`."""
    prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=apis))


def _author_node(layer: Sdf.Layer, spec: GraphSpec, node: NodeSpec, catalog: Catalog) -> None:
    prim = define_prim(layer, f"{spec.path}/{node.role}", catalog.graph.node_type)
    prepend_apis(prim, [catalog.graph.gui_api])
    _declare(prim, "node:type", "token", node.type.type, custom=False)
    _declare(prim, "node:typeVersion", "int", node.type.version, custom=False)
    values = {setting.port: setting.value for setting in node.settings}
    targets = {target.port: target.prims for target in node.targets}
    for port in node.type.ports.values():
        _author_port(prim, port, values.get(port.name), targets.get(port.name, ()))
    for name in node.grown:
        grown = node.type.port(name)
        if grown is not None and node.type.dynamic is not None:
            _author_port(prim, grown, None, ())
            _mark_dynamic(prim.attributes[name], node.type.dynamic)
    _declare_uniform(prim, _EXPANSION, "token", "open")
    _declare_uniform(prim, _POSITION, "float2", node.at)


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


def _mark_dynamic(attribute: Sdf.AttributeSpec, dynamic: Dynamic) -> None:
    """Say of a port added by hand which types it takes, as the editor does."""
    attribute.SetInfo(
        "customData",
        {
            "ExtendedAttributeType": dynamic.metadata,
            "omni": {"graph": {"attrType": dynamic.metadata}},
        },
    )


def _declare(
    prim: Sdf.PrimSpec, name: str, usd_type: str, value: Value | None, *, custom: bool
) -> Sdf.AttributeSpec:
    attribute = Sdf.AttributeSpec(
        prim, name, value_type(usd_type), Sdf.VariabilityVarying, declaresCustom=custom
    )
    if value is not None:
        attribute.default = usd_value(value, usd_type)
    return attribute


def _declare_uniform(prim: Sdf.PrimSpec, name: str, usd_type: str, value: Value) -> None:
    attribute = Sdf.AttributeSpec(prim, name, value_type(usd_type), Sdf.VariabilityUniform)
    attribute.default = usd_value(value, usd_type)
