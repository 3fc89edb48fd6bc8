"""The catalog of node types, held value by value against facts read off Isaac Sim 6.0.1.

A type that the facts do not name, as that of a new checkpoint, is held against the public source in
`test_isaac_types.py`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lab3_usd.isaac.node_types import NodeType, Port
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value
from lab3_usd.spec.load.loader import load_lab

CATALOG = load_lab().platform
Facts = Mapping[str, Any]

# What the generic publisher sends is a setting, so the catalog knows no TF ports of it.
GENERIC_PUBLISHER = "isaacsim.ros2.bridge.ROS2Publisher"

# What a node publishes although its menu does not offer it.
NOT_OFFERED = {
    "isaacsim.ros2.bridge.ROS2CameraHelper": {"distance_to_image_plane": "sensor_msgs/msg/Image"}
}


# Answers for a server node, and so has neither a service of its own nor a topic.
ANSWERS = "isaacsim.ros2.bridge.OgnROS2ServiceServerResponse"
# Has one type of message only, whose name in the facts no input chooses.
OF_ONE_TYPE = "isaacsim.ros2.bridge.ROS2RtxRadarHelper"


@pytest.fixture(scope="module")
def facts(shared: Path) -> Facts:
    data: Facts = json.loads((shared / "isaac" / "nodes-6.0.1.json").read_text())
    return data


@pytest.fixture(scope="module")
def known(facts: Facts) -> Facts:
    return {**facts["nodes"], **facts["other_ros2_nodes"]}


@pytest.fixture(scope="module")
def catalog() -> Platform:
    return CATALOG


def exactly(value: Any, usd_type: str = "") -> Any:
    """Make values comparable without True being 1, and with every real number a float."""
    if isinstance(value, (list, tuple)):
        return [exactly(each, usd_type) for each in value]
    real = usd_type.startswith(("float", "double", "vector", "quat", "point"))
    return float(value) if real and value is not None else (type(value).__name__, value)


def union_members(port: Facts) -> tuple[str, ...]:
    return tuple(port["ogn_type"]) if isinstance(port["ogn_type"], list) else ()


def expected_port(name: str, fact: Facts) -> dict[str, Any]:
    union = fact["kind"] == "union"
    usd_type = "rel" if fact["usd_type"] == "relationship" else fact["usd_type"]
    return {
        "name": name,
        "ogn_type": "union" if union else fact["ogn_type"],
        "usd_type": usd_type,
        "default": exactly(fact["default"], usd_type),
        "allowed": tuple(fact.get("allowed_tokens", ())),
        "accepts": union_members(fact),
        "output_only": "outputOnly" in fact,
        "deprecated": fact.get("deprecated", False),
        "execution": fact["kind"] == "execution",
        "target": fact["kind"] == "target",
        "union": union,
    }


def actual_port(port: Port) -> dict[str, Any]:
    return {
        "name": port.name,
        "ogn_type": port.ogn_type,
        "usd_type": port.usd_type,
        "default": exactly(port.default, port.usd_type),
        "allowed": port.allowed,
        "accepts": port.accepts,
        "output_only": port.output_only,
        "deprecated": port.deprecated,
        "execution": port.is_execution,
        "target": port.is_target,
        "union": port.is_union,
    }


def port_facts(fact: Facts) -> dict[str, Facts]:
    return {**fact["inputs"], **fact["outputs"]}


def default_of(node_type: NodeType, name: str) -> Value | None:
    return node_type.ports[name].default


def test_catalog_holds_every_known_type(known: Facts, catalog: Platform) -> None:
    assert len(known) == 46
    assert set(known) - set(catalog.types) == set()


def test_what_else_the_catalog_holds_is_public(
    known: Facts, catalog: Platform, shared: Path
) -> None:
    public = json.loads((shared / "isaac" / "nodes-all-6.0.1.json").read_text())["nodes"]
    kit = json.loads((shared / "isaac" / "kit-nodes.json").read_text())["types"]
    physics = json.loads((shared / "isaac" / "nodes-6.1-6.2.json").read_text())
    others = {*public, *kit, *physics["physx_graph_types_of_6.0.1"]}
    assert set(catalog.types) - set(known) - others == set()


def test_the_lab_uses_21_types_under_the_names_of_the_handout(
    facts: Facts, catalog: Platform
) -> None:
    lab = {fact["type"]: fact["handout_name"] for fact in facts["lab_nodes"]}
    assert len(lab) == 21
    assert {name: catalog.types[name].handout_name for name in lab} == lab


def test_versions(known: Facts, catalog: Platform) -> None:
    assert {name: catalog.types[name].version for name in known} == {
        name: fact["type_version"] for name, fact in known.items()
    }


def test_names_in_the_editor(known: Facts, catalog: Platform) -> None:
    types = catalog.types
    assert {name: (types[name].ui_name, types[name].prim_name) for name in known} == {
        name: (fact["ui_name"], fact["gui_prim_name"]) for name, fact in known.items()
    }


def test_ports_are_all_there_in_order(known: Facts, catalog: Platform) -> None:
    assert {name: list(catalog.types[name].ports) for name in known} == {
        name: list(port_facts(fact)) for name, fact in known.items()
    }


def test_every_port_is_as_known(known: Facts, catalog: Platform, subtests: pytest.Subtests) -> None:
    for name, fact in known.items():
        with subtests.test(name=name):
            ports = {port: actual_port(p) for port, p in catalog.types[name].ports.items()}
            assert ports == {
                port: expected_port(port, port_fact) for port, port_fact in port_facts(fact).items()
            }, name


def test_roles_and_topic_ports_are_those_of_the_source(
    known: Facts, facts: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    silent = {"role": "", "topic_inputs": {}, "service_inputs": {}, "frame_inputs": {}}
    for name in known:
        with subtests.test(name=name):
            node_type = catalog.types[name]
            topics = facts["topic_nodes"].get(name, silent)
            assert node_type.role == ("service" if name == ANSWERS else topics["role"]), name
            for ports, key in (
                (node_type.topics, "topic_inputs"),
                (node_type.services, "service_inputs"),
                (node_type.frames, "frame_inputs"),
            ):
                assert {port: default_of(node_type, port) for port in ports} == topics[key], name


def test_message_types_are_those_of_the_source(
    known: Facts, facts: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    for name in known:
        with subtests.test(name=name):
            topics = facts["topic_nodes"].get(name, {"message": None})
            single = {} if topics["message"] is None else {"": topics["message"]}
            asked = {**topics.get("message_by_type", single), **NOT_OFFERED.get(name, {})}
            if name == OF_ONE_TYPE:
                asked = dict.fromkeys([""], *asked.values())
            assert catalog.types[name].message == asked, name


def test_names_before_4_5_lead_to_the_type(
    known: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    for name, fact in known.items():
        with subtests.test(name=name):
            for alias in fact["aliases"]:
                assert catalog.names.modern(alias) == name
                assert catalog.get(alias) is catalog.types[name]
            assert catalog.names.modern(name) == name


def test_quaternion_defaults_stand_in_the_order_x_y_z_w(
    known: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    seen = 0
    for name, fact in known.items():
        with subtests.test(name=name):
            for port_name, port in port_facts(fact).items():
                if "usda_default" in port:
                    w, x, y, z = port["usda_default"]
                    assert default_of(catalog.types[name], port_name) == (x, y, z, w)
                    seen += 1
    assert seen == 4


def test_tf_publishers_and_what_their_edges_come_from(facts: Facts, catalog: Platform) -> None:
    publishers = dict(facts["tf_publishers"])
    del publishers[GENERIC_PUBLISHER]
    found = {}
    for name, node_type in catalog.types.items():
        if node_type.tf is None or not node_type.topics:
            continue
        pairs = (node_type.tf.names, node_type.tf.arrays, node_type.tf.prims)
        found[name] = {
            "topic_input": node_type.topics[0],
            "default_topic": default_of(node_type, node_type.topics[0]),
            "static_input": node_type.tf.static,
            "edges_from": sorted("+".join(pair) for pair in pairs if pair),
        }
    assert found == {
        name: {**fact, "edges_from": sorted(fact["edges_from"])}
        for name, fact in publishers.items()
    }


def test_frames_computed_by_one_type_leave_it_as_parents_and_children(catalog: Platform) -> None:
    giving = {name: t.tf for name, t in catalog.types.items() if t.tf is not None and t.tf.gives}
    assert list(giving) == ["isaacsim.core.nodes.IsaacComputeTransformTree"]
    (tf,) = giving.values()
    assert tf.prims == ("inputs:parentPrim", "inputs:targetPrims")
    assert tf.gives == ("outputs:parentFrames", "outputs:childFrames")


def test_old_prefixes_are_known(facts: Facts, catalog: Platform) -> None:
    old = {fact["old"]: fact["new"] for fact in facts["type_prefix_aliases"]}
    assert old.items() <= catalog.names.prefixes.items()


def test_old_names_that_do_not_follow_their_prefix_are_known(
    facts: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    old = {fact["old"]: fact["new"] for fact in facts["type_alias_exceptions"]}
    assert old.items() <= catalog.names.renamed.items()
    for old, new in catalog.names.renamed.items():
        with subtests.test(old=old):
            assert catalog.names.modern(old) == new


def test_lookalikes_are_known_and_mean_a_type_of_the_lab(facts: Facts, catalog: Platform) -> None:
    others = {**catalog.lookalikes, **catalog.deprecated}
    assert list(others) == facts["lookalike_types_not_registered"]
    lab = {fact["type"] for fact in facts["lab_nodes"]}
    assert set(others.values()) <= lab
    assert not set(catalog.lookalikes) & set(catalog.types)


def test_the_deprecated_array_maker_means_the_one_the_handout_wants(
    known: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    for name, fact in known.items():
        with subtests.test(name=name):
            for lookalike in fact.get("deprecated_lookalikes", ()):
                assert catalog.deprecated[lookalike] == name


def test_types_that_start_an_execution_are_those_of_the_source(
    facts: Facts, catalog: Platform, shared: Path
) -> None:
    kit = facts["kit_execution_sources_not_in_isaac_repo"]
    library = json.loads((shared / "isaac" / "kit-nodes.json").read_text())["types"]
    documented = {name for name, fact in library.items() if fact["event_source"]}
    assert set(catalog.events) == {*facts["execution_sources"], *kit, *documented}


def test_the_ports_that_an_array_grows_are_those_of_the_source(
    known: Facts, catalog: Platform, subtests: pytest.Subtests
) -> None:
    for name, fact in known.items():
        with subtests.test(name=name):
            dynamic = catalog.types[name].dynamic
            if "dynamic_inputs" not in fact:
                assert dynamic is None
                continue
            assert dynamic is not None
            marks = fact["dynamic_inputs"]["custom_data_on_gui_created"]
            assert set(marks.values()) == {dynamic.metadata}
            grown = catalog.types[name].port("inputs:input12")
            assert grown is not None
            assert grown.usd_type == fact["dynamic_inputs"]["usd_type"]


@pytest.mark.parametrize("wrong", ["inputs:input", "inputs:inputX", "inputs:other1", "input1"])
def test_an_array_grows_numbered_ports_only(wrong: str, catalog: Platform) -> None:
    assert catalog.types["omni.graph.nodes.ConstructArray"].port(wrong) is None


def test_a_type_without_dynamic_ports_grows_none(catalog: Platform) -> None:
    assert catalog.types["omni.graph.nodes.ConstantToken"].port("inputs:value1") is None


def test_a_constant_is_left_by_its_input(catalog: Platform) -> None:
    constant = catalog.types["omni.graph.nodes.ConstantToken"]
    source = constant.source("value")
    assert source is not None
    assert source.name == "inputs:value"
    assert source.is_source


def test_graph_prim_attributes(facts: Facts, catalog: Platform) -> None:
    assert catalog.graph.type == facts["graph_prim"]["type"]
    assert catalog.graph.node_type == facts["node_prim"]["type"]
    assert [catalog.graph.gui_api] == facts["node_prim"]["gui_api_schemas"]
    wanted = facts["graph_prim"]["attributes"]
    written = {attribute.name: attribute for attribute in catalog.graph.attributes}
    assert {name: each.usd_type for name, each in written.items()} == {
        name: fact["usd_type"] for name, fact in wanted.items()
    }
    assert written["evaluator:type"].value == wanted["evaluator:type"]["action_graph"]
    assert written["pipelineStage"].value == wanted["pipelineStage"]["action_graph"]
    assert written["evaluationMode"].value == wanted["evaluationMode"]["default"]
    assert written["fileFormatVersion"].value == tuple(wanted["fileFormatVersion"]["value"])
    backing = written["fabricCacheBacking"]
    assert set(backing.accepted) == set(wanted["fabricCacheBacking"]["values_seen"])
    assert backing.value in backing.accepted


def test_values_that_no_graph_of_the_lab_may_have_are_not_accepted(
    facts: Facts, catalog: Platform
) -> None:
    wanted = facts["graph_prim"]["attributes"]
    as_good = {"Standalone"}  # evaluates a graph as it stands, as Automatic does
    for attribute in catalog.graph.attributes:
        others = wanted[attribute.name].get("other_values", [])
        assert not set(others) & set(attribute.accepted) - as_good
