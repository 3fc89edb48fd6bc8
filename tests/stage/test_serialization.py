"""The form of what is written: graphs, nodes and ports as Isaac Sim 6.0.1 saves them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from handout_table import GRAPHS, ROS_DRIVE, SENSORS
from pxr import Sdf, Usd, UsdUtils

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files

GRAPH_ATTRIBUTES = {
    "evaluationMode": ("token", "Automatic"),
    "evaluator:type": ("token", "execution"),
    "fabricCacheBacking": ("token", "StageWithoutHistory"),
    "fileFormatVersion": ("int2", (1, 9)),
    "pipelineStage": ("token", "pipelineStageSimulation"),
}
EDITOR = {
    "ui:nodegraph:node:expansionState": "token",
    "ui:nodegraph:node:pos": "float2",
}
OWN = {"node:type": "token", "node:typeVersion": "int", **EDITOR}
TARGET = {"omni": {"graph": {"relType": "target"}}}
GROWN = ("make_array", "inputs:input1")
Facts = Mapping[str, Any]
Pairs = list[tuple[Sdf.PrimSpec, Sdf.PrimSpec]]


@pytest.fixture(scope="module", params=["usda", "usdc"])
def layer(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Sdf.Layer:
    """The last checkpoint, read back from its file: once as text, once as binary."""
    lab = load_lab()
    plan = plan_files(
        lab, tmp_path_factory.mktemp(request.param), [*lab.checkpoints][-1:], request.param
    )
    (file,) = build_files(lab, None, plan, BuildOptions(request.param))
    return Sdf.Layer.OpenAsAnonymous(str(file))


@pytest.fixture(scope="module")
def graphs(layer: Sdf.Layer) -> list[Sdf.PrimSpec]:
    return [layer.GetPrimAtPath(graph.path) for graph in GRAPHS]


@pytest.fixture(scope="module")
def nodes(graphs: list[Sdf.PrimSpec]) -> list[Sdf.PrimSpec]:
    return [node for graph in graphs for node in graph.nameChildren]


@pytest.fixture(scope="module")
def facts(shared: Path) -> Facts:
    data: Facts = json.loads((shared / "isaac" / "nodes-6.0.1.json").read_text())["nodes"]
    return data


def node_type(node: Sdf.PrimSpec) -> str:
    return str(node.attributes["node:type"].default)


def port_attributes(node: Sdf.PrimSpec) -> list[Sdf.AttributeSpec]:
    return [attribute for attribute in node.attributes if attribute.name not in OWN]


def attributes(nodes: list[Sdf.PrimSpec]) -> list[Sdf.AttributeSpec]:
    return [attribute for node in nodes for attribute in port_attributes(node)]


def relationships(nodes: list[Sdf.PrimSpec]) -> list[Sdf.RelationshipSpec]:
    return [relationship for node in nodes for relationship in node.relationships]


def known_ports(facts: Facts, node: Sdf.PrimSpec) -> dict[str, Facts]:
    fact = facts[node_type(node)]
    return {**fact["inputs"], **fact["outputs"]}


def is_grown(attribute: Sdf.AttributeSpec) -> bool:
    return (attribute.owner.name, attribute.name) == GROWN


def sources(attribute: Sdf.AttributeSpec) -> list[Sdf.Path]:
    return list(attribute.connectionPathList.GetAddedOrExplicitItems())


def test_a_graph_is_defined_as_an_omnigraph(graphs: list[Sdf.PrimSpec]) -> None:
    for graph in graphs:
        assert graph.specifier == Sdf.SpecifierDef
        assert graph.typeName == "OmniGraph"
        assert sorted(graph.ListInfoKeys()) == ["specifier", "typeName"]


def test_a_graph_has_the_five_attributes_of_an_action_graph(graphs: list[Sdf.PrimSpec]) -> None:
    for graph in graphs:
        found = {each.name: (str(each.typeName), each.default) for each in graph.properties}
        assert found == GRAPH_ATTRIBUTES


def test_graph_attributes_are_not_custom_and_not_uniform(graphs: list[Sdf.PrimSpec]) -> None:
    for attribute in (each for graph in graphs for each in graph.attributes):
        assert not attribute.custom
        assert attribute.variability == Sdf.VariabilityVarying


def test_a_node_is_defined_as_an_omnigraphnode_of_the_editor(nodes: list[Sdf.PrimSpec]) -> None:
    for node in nodes:
        assert node.specifier == Sdf.SpecifierDef
        assert node.typeName == "OmniGraphNode"
        schemas = node.GetInfo("apiSchemas")
        assert schemas.prependedItems == ["NodeGraphNodeAPI"]
        assert list(schemas.GetAddedOrExplicitItems()) == schemas.prependedItems
        assert not node.nameChildren


def test_type_and_version_are_not_custom_and_not_uniform(nodes: list[Sdf.PrimSpec]) -> None:
    for node in nodes:
        for name, usd_type in (("node:type", "token"), ("node:typeVersion", "int")):
            attribute = node.attributes[name]
            assert str(attribute.typeName) == usd_type
            assert not attribute.custom
            assert attribute.variability == Sdf.VariabilityVarying


def test_versions_are_those_of_6_0_1(nodes: list[Sdf.PrimSpec], facts: Facts) -> None:
    for node in nodes:
        version = node.attributes["node:typeVersion"].default
        assert version == facts[node_type(node)]["type_version"]


def test_the_place_in_the_editor_is_uniform_and_not_custom(nodes: list[Sdf.PrimSpec]) -> None:
    for node in nodes:
        for name, usd_type in EDITOR.items():
            attribute = node.attributes[name]
            assert str(attribute.typeName) == usd_type
            assert attribute.variability == Sdf.VariabilityUniform
            assert not attribute.custom
        assert node.attributes["ui:nodegraph:node:expansionState"].default == "open"


def test_every_port_of_a_node_is_declared_and_nothing_else(
    nodes: list[Sdf.PrimSpec], facts: Facts
) -> None:
    for node in nodes:
        grown = {GROWN[1]} if node.name == GROWN[0] else set()
        declared = {each.name for each in node.properties}
        assert declared == {*known_ports(facts, node), *OWN, *grown}


def test_ports_are_custom_and_not_uniform(nodes: list[Sdf.PrimSpec]) -> None:
    for attribute in attributes(nodes):
        assert attribute.custom
        assert attribute.variability == Sdf.VariabilityVarying
    assert all(relationship.custom for relationship in relationships(nodes))


def test_ports_have_their_usd_types(nodes: list[Sdf.PrimSpec], facts: Facts) -> None:
    for node in nodes:
        known = known_ports(facts, node)
        for attribute in port_attributes(node):
            wanted = "token" if is_grown(attribute) else known[attribute.name]["usd_type"]
            assert str(attribute.typeName) == wanted
        for relationship in node.relationships:
            assert known[relationship.name]["usd_type"] == "relationship"


def test_execution_ports_are_marked_and_no_others(nodes: list[Sdf.PrimSpec], facts: Facts) -> None:
    for node in nodes:
        known = known_ports(facts, node)
        for attribute in port_attributes(node):
            if is_grown(attribute):
                continue
            execution = known[attribute.name]["kind"] == "execution"
            assert dict(attribute.customData) == ({"isExecution": True} if execution else {})


def test_both_sides_have_execution_ports(nodes: list[Sdf.PrimSpec]) -> None:
    marked = {
        attribute.name for attribute in attributes(nodes) if "isExecution" in attribute.customData
    }
    assert marked == {"inputs:execIn", "outputs:tick", "outputs:step", "outputs:execOut"}


def test_relationships_are_marked_as_targets(nodes: list[Sdf.PrimSpec]) -> None:
    assert relationships(nodes)
    for relationship in relationships(nodes):
        assert dict(relationship.customData) == TARGET


def test_targets_are_a_plain_list_and_an_empty_relationship_is_bare(
    nodes: list[Sdf.PrimSpec],
) -> None:
    for relationship in relationships(nodes):
        paths = relationship.targetPathList
        assert paths.isExplicit is bool(paths.explicitItems)
        assert list(paths.GetAddedOrExplicitItems()) == list(paths.explicitItems)


def test_allowed_tokens_are_written_where_the_type_has_some(
    nodes: list[Sdf.PrimSpec], facts: Facts
) -> None:
    seen = 0
    for node in nodes:
        known = known_ports(facts, node)
        for attribute in port_attributes(node):
            allowed = known.get(attribute.name, {}).get("allowed_tokens")
            assert list(attribute.allowedTokens or ()) == (allowed or [])
            seen += allowed is not None
    assert seen == 4


def test_connections_stand_prepended_on_the_destination(nodes: list[Sdf.PrimSpec]) -> None:
    wires = 0
    for attribute in attributes(nodes):
        paths = attribute.connectionPathList
        assert sources(attribute) == list(paths.prependedItems)
        assert attribute.name.startswith("inputs:") or not sources(attribute)
        assert len(sources(attribute)) <= 1
        assert all(
            path.IsAbsolutePath() and path.IsPrimPropertyPath() for path in sources(attribute)
        )
        wires += len(sources(attribute))
    assert wires == sum(len(graph.wires) for graph in GRAPHS)


def test_wired_inputs_and_all_outputs_have_no_value(nodes: list[Sdf.PrimSpec]) -> None:
    for attribute in attributes(nodes):
        if sources(attribute) or attribute.name.startswith("outputs:"):
            assert not attribute.HasDefaultValue()


def test_a_port_carries_nothing_but_what_isaac_sim_writes(nodes: list[Sdf.PrimSpec]) -> None:
    expected = {
        *("custom", "typeName", "variability", "default"),
        *("customData", "allowedTokens", "connectionPaths", "targetPaths"),
    }
    for node in nodes:
        for each in node.properties:
            assert set(each.ListInfoKeys()) <= expected


def test_the_second_element_of_the_array_says_which_types_it_takes(
    layer: Sdf.Layer, facts: Facts
) -> None:
    attribute = layer.GetAttributeAtPath(f"{ROS_DRIVE.path}/{GROWN[0]}.{GROWN[1]}")
    marks = facts["omni.graph.nodes.ConstructArray"]["dynamic_inputs"]["custom_data_on_gui_created"]
    assert attribute.customData["ExtendedAttributeType"] == marks["ExtendedAttributeType"]
    assert attribute.customData["omni"]["graph"] == {"attrType": marks["omni:graph:attrType"]}
    assert set(attribute.customData) == {"ExtendedAttributeType", "omni"}


def test_the_first_element_of_the_array_is_of_the_type_itself(layer: Sdf.Layer) -> None:
    attribute = layer.GetAttributeAtPath(f"{ROS_DRIVE.path}/make_array.inputs:input0")
    assert dict(attribute.customData) == {}


def test_properties_stand_in_alphabetical_order_in_text(layer: Sdf.Layer) -> None:
    text = Sdf.Layer.CreateAnonymous(".usda")
    text.ImportFromString(layer.ExportToString())
    for graph in GRAPHS:
        for prim in (text.GetPrimAtPath(graph.path), *text.GetPrimAtPath(graph.path).nameChildren):
            names = [each.name for each in prim.properties]
            assert names == sorted(names, key=str.lower)


def test_sensor_attributes_are_those_of_schemas(
    layer: Sdf.Layer, subtests: pytest.Subtests
) -> None:
    for sensor in SENSORS:
        with subtests.test(sensor=sensor):
            prim = layer.GetPrimAtPath(sensor.path)
            assert prim.specifier == Sdf.SpecifierDef
            assert not any(attribute.custom for attribute in prim.attributes)


def test_sensors_apply_the_schemas_that_isaac_sim_asks_for(layer: Sdf.Layer) -> None:
    lidar, camera = (layer.GetPrimAtPath(sensor.path) for sensor in SENSORS)
    assert lidar.GetInfo("apiSchemas").prependedItems == [
        "OmniSensorGenericLidarCoreAPI",
        "OmniSensorGenericLidarCoreEmitterStateAPI:s001",
    ]
    assert camera.GetInfo("apiSchemas").prependedItems == ["OmniSensorAPI"]


@pytest.mark.parametrize("name", ["focalLength", "clippingRange", "xformOpOrder"])
def test_the_camera_declares_what_usd_declares(name: str, layer: Sdf.Layer) -> None:
    schema = Usd.SchemaRegistry().FindConcretePrimDefinition("Camera")
    written = layer.GetAttributeAtPath(f"{SENSORS[1].path}.{name}")
    declared = schema.GetSchemaAttributeSpec(name)
    assert written.typeName == declared.typeName
    assert written.variability == declared.variability


def test_the_lidars_own_figures_agree_with_each_other(layer: Sdf.Layer) -> None:
    prim = layer.GetPrimAtPath(SENSORS[0].path)
    value = {attribute.name.rpartition(":")[2]: attribute.default for attribute in prim.attributes}
    assert value["tickRate"] == value["scanRateBaseHz"]
    assert value["patternFiringRateHz"] % value["scanRateBaseHz"] == 0
    assert 0 < value["minDistBetweenEchosM"] < value["nearRangeM"] < value["farRangeM"]
    emitter = ("azimuthDeg", "elevationDeg", "channelId", "fireTimeNs")
    assert {len(value[name]) for name in emitter} == {value["numberOfEmitters"]}
    assert list(value["channelId"]) == [1]
    assert sum(value["numRaysPerLine"]) == value["numberOfChannels"]


def test_no_file_outside_is_referred_to(layer: Sdf.Layer) -> None:
    assert not any(layer.GetCompositionAssetDependencies())  # '' is the layer itself
    found: list[str] = []
    UsdUtils.ModifyAssetPaths(layer, lambda path: found.append(path) or path)
    assert found == []


# ---- against stages that Isaac Sim saved


def nodes_in(layer: Sdf.Layer) -> list[Sdf.PrimSpec]:
    found: list[Sdf.PrimSpec] = []

    def collect(path: Sdf.Path) -> None:
        prim = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if prim is not None and prim.typeName == "OmniGraphNode":
            found.append(prim)

    layer.Traverse("/", collect)
    return found


@pytest.fixture(scope="module")
def saved(shared: Path, nodes: list[Sdf.PrimSpec]) -> Iterator[Pairs]:
    """Pairs of a node that a public project saved with 4.5 or later, and ours of that type."""
    ours = {node_type(node): node for node in nodes}
    files = sorted((shared / "corpus" / "stages").iterdir())
    layers = [Sdf.Layer.FindOrOpen(str(file)) for file in files]  # keeps the specs alive
    found = [node for layer in layers for node in nodes_in(layer)]
    pairs = [(node, ours[node_type(node)]) for node in found if node_type(node) in ours]
    assert len({node_type(node) for node, _ in pairs}) >= 10
    yield pairs
    del layers


def shared_attributes(pairs: Pairs) -> list[tuple[Sdf.AttributeSpec, Sdf.AttributeSpec]]:
    """Attributes that both nodes declare; scripts type added elements as they like."""
    return [
        (theirs, node.attributes[theirs.name])
        for saved_node, node in pairs
        for theirs in saved_node.attributes
        if theirs.name in node.attributes and theirs.name != GROWN[1]
    ]


def test_declared_as_in_saved_stages(saved: Pairs) -> None:
    for theirs, ours in shared_attributes(saved):
        assert str(ours.typeName) == str(theirs.typeName)
        assert (ours.custom, ours.variability) == (theirs.custom, theirs.variability)


def test_marked_as_in_saved_stages(saved: Pairs) -> None:
    for theirs, ours in shared_attributes(saved):
        assert ours.customData.get("isExecution") == theirs.customData.get("isExecution")
        assert bool(ours.allowedTokens) is bool(theirs.allowedTokens)


def test_relationships_as_in_saved_stages(saved: Pairs) -> None:
    compared = 0
    for saved_node, node in saved:
        for theirs in saved_node.relationships:
            ours = node.relationships[theirs.name]
            assert (ours.custom, dict(ours.customData)) == (theirs.custom, dict(theirs.customData))
            compared += 1
    assert compared


def test_editor_schema_as_in_saved_stages(saved: Pairs) -> None:
    placed = [node for node, _ in saved if "ui:nodegraph:node:pos" in node.attributes]
    assert placed
    for saved_node, node in saved:
        if "ui:nodegraph:node:pos" in saved_node.attributes:
            assert saved_node.GetInfo("apiSchemas") == node.GetInfo("apiSchemas")


def test_added_array_elements_are_marked_as_in_saved_stages(saved: Pairs) -> None:
    both = [pair for pair in saved if all(GROWN[1] in node.attributes for node in pair)]
    theirs = [node.attributes[GROWN[1]].customData for node, _ in both]
    ours = both[0][1].attributes[GROWN[1]].customData
    alike = [
        marks
        for marks in theirs
        if marks.get("ExtendedAttributeType") == ours["ExtendedAttributeType"]
    ]
    assert alike
    for marks in alike:
        assert marks["omni"]["graph"]["attrType"] == ours["omni"]["graph"]["attrType"]
