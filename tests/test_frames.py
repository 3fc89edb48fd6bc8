"""Which transforms a stage publishes, as hand-made stages show and as the built ones confirm."""

from __future__ import annotations

from pathlib import Path

import models as m
import pytest
from msgspec.structs import replace

from lab3_usd.check.frames import Edge, published_edges, tree, unknown_publishers
from lab3_usd.check.model import GraphModel, PortState, Prim, StageModel, Unresolved
from lab3_usd.stage.builder import build_checkpoint
from lab3_usd.stage.reader import read_stage

RAW_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.RAW].type.type
TICK_TYPE = m.lab().graphs[m.ODOM_TF].nodes["on_playback_tick"].type.type
COMPUTE_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.COMPUTE].type.type
PUBLISH_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.PUBLISH].type.type
PRODUCT_TYPE = m.lab().graphs["ROS_Camera"].nodes["isaac_create_render_product"].type.type
CONSTANT_TYPE = m.lab().graphs["ROS_Drive"].nodes["constant_left_joint"].type.type
GENERIC_TYPE = m.PUBLISHER_TYPE
STAR = {("base_footprint", child) for child in (*m.LINKS[1:], "Camera_1")}


def edges(stage: StageModel) -> tuple[Edge, ...]:
    return published_edges(stage, m.lab())


def pairs(stage: StageModel) -> list[tuple[str, str]]:
    return [(edge.parent, edge.child) for edge in edges(stage)]


def raw_graph(place: str = "/Graph/tf", **inputs: str | bool) -> GraphModel:
    """A graph that publishes one transform with every frame of the simulation."""
    sender = m.node(f"{place}/sender", RAW_TYPE, **inputs)
    sender = m.wired(sender, "inputs:execIn", f"{place}/tick.outputs:tick")
    return m.graph(place, sender, m.node(f"{place}/tick", TICK_TYPE))


def retargeted(*targets: str) -> StageModel:
    stage = m.stage()
    return m.with_node(stage, m.aimed(m.role(stage, m.COMPUTE), "inputs:targetPrims", *targets))


def test_the_lab_publishes_its_tree() -> None:
    assert set(pairs(m.stage())) == {("odom", "base_footprint"), *STAR}


def test_every_edge_says_who_sends_it_and_who_made_it() -> None:
    place = m.lab().graphs[m.ODOM_TF].path
    assert edges(m.stage())[-1] == Edge(
        "base_footprint",
        "Camera_1",
        publisher=f"{place}/{m.PUBLISH}",
        cause=f"{place}/{m.COMPUTE}",
        topic="/tf",
        target=m.CAMERA,
        prim=m.CAMERA,
    )


def test_a_name_left_alone_is_the_default() -> None:
    assert pairs(m.only(raw_graph())) == [("odom", "base_link")]


def test_a_static_publisher_says_so() -> None:
    (edge,) = edges(m.only(raw_graph(staticPublisher=True, topicName="/tf_static")))
    assert (edge.static, edge.topic) == (True, "/tf_static")


@pytest.mark.parametrize("topic", ["tf", "/tf", "~/tf_", "//tf/", "tf_static"])
def test_topics_of_the_tree_count_however_they_are_written(topic: str) -> None:
    assert len(edges(m.only(raw_graph(topicName=topic)))) == 1


@pytest.mark.parametrize("inputs", [{"topicName": "tf2"}, {"nodeNamespace": "ns"}])
def test_other_topics_do_not_count(inputs: dict[str, str]) -> None:
    assert edges(m.only(raw_graph(**inputs))) == ()


def test_a_namespace_on_a_prim_above_moves_the_topic() -> None:
    graph = raw_graph()
    moved = replace(graph, nodes=tuple(replace(n, namespace="ns") for n in graph.nodes))
    assert edges(m.only(moved)) == ()


def test_a_name_wired_from_a_constant_is_that_constant() -> None:
    graph = raw_graph()
    constant = m.node("/Graph/tf/name", CONSTANT_TYPE, value="laser")
    sender = m.wired(graph.nodes[0], "inputs:childFrameId", "/Graph/tf/name.inputs:value")
    changed = m.graph("/Graph/tf", sender, graph.nodes[1], constant)
    assert pairs(m.only(changed)) == [("odom", "laser")]


def test_a_dead_wire_into_a_name_is_dropped() -> None:
    graph = raw_graph(childFrameId="laser")
    sender = m.wired(graph.nodes[0], "inputs:childFrameId", "/Graph/tf/gone.inputs:value")
    assert pairs(m.only(m.graph("/Graph/tf", sender, graph.nodes[1]))) == [("odom", "laser")]


def test_a_wire_from_a_port_that_the_type_does_not_have_is_dropped() -> None:
    graph = raw_graph(childFrameId="laser")
    constant = m.node("/Graph/tf/name", CONSTANT_TYPE, value="other")
    sender = m.wired(graph.nodes[0], "inputs:childFrameId", "/Graph/tf/name.outputs:value")
    changed = m.graph("/Graph/tf", sender, graph.nodes[1], constant)
    assert pairs(m.only(changed)) == [("odom", "laser")]


def test_a_name_wired_from_two_constants_is_unknown() -> None:
    graph = raw_graph()
    one = m.node("/Graph/tf/one", CONSTANT_TYPE, value="laser")
    two = m.node("/Graph/tf/two", CONSTANT_TYPE, value="other")
    ends = (f"{node.path}.inputs:value" for node in (one, two))
    sender = m.wired(graph.nodes[0], "inputs:childFrameId", *ends)
    stage = m.only(m.graph("/Graph/tf", sender, graph.nodes[1], one, two))
    assert unknown_publishers(stage, m.lab()) == ("/Graph/tf/sender",)


def test_a_computed_name_is_unknown() -> None:
    graph = raw_graph()
    product = m.node("/Graph/tf/product", PRODUCT_TYPE)
    source = "/Graph/tf/product.outputs:renderProductPath"
    sender = m.wired(graph.nodes[0], "inputs:childFrameId", source)
    stage = m.only(m.graph("/Graph/tf", sender, graph.nodes[1], product))
    assert edges(stage) == ()
    assert unknown_publishers(stage, m.lab()) == ("/Graph/tf/sender",)


def test_a_generic_publisher_of_transforms_is_unknown() -> None:
    generic = m.node(
        "/Graph/tf/any", GENERIC_TYPE, topicName="tf", messagePackage="tf2_msgs",
        messageName="TFMessage",
    )  # fmt: skip
    generic = m.wired(generic, "inputs:execIn", "/Graph/tf/tick.outputs:tick")
    graph = m.graph("/Graph/tf", generic, m.node("/Graph/tf/tick", TICK_TYPE))
    assert unknown_publishers(m.only(graph), m.lab()) == ("/Graph/tf/any",)
    other = m.valued(generic, "inputs:messageName", "String")
    assert unknown_publishers(m.only(m.graph("/Graph/tf", other, graph.nodes[1])), m.lab()) == ()


# ---- what runs


def test_what_no_event_reaches_publishes_nothing() -> None:
    stage = m.stage()
    cut = m.wired(m.role(stage, "isaac_compute_odometry"), "inputs:execIn")
    assert edges(m.with_node(stage, cut)) == edges(stage)[1:]


@pytest.mark.parametrize(
    "changes",
    [
        {"active": False},
        {"pipelineStage": "pipelineStageOnDemand"},
        {"evaluationMode": "Instanced"},
    ],
)
def test_a_graph_that_is_not_evaluated_publishes_nothing(changes: dict[str, object]) -> None:
    graph = m.graph("/Graph/tf", *raw_graph().nodes, **changes)  # type: ignore[arg-type]
    assert edges(m.only(graph)) == ()


def test_graphs_that_the_application_makes_do_not_count() -> None:
    assert edges(m.only(raw_graph("/Replicator/tf"))) == ()
    assert len(edges(m.only(raw_graph("/Replicators/tf")))) == 1


def test_a_ring_of_execution_wires_starts_nothing() -> None:
    place = "/Graph/tf"
    one = m.wired(
        m.node(f"{place}/one", COMPUTE_TYPE), "inputs:execIn", f"{place}/two.outputs:execOut"
    )
    two = m.wired(
        m.node(f"{place}/two", COMPUTE_TYPE), "inputs:execIn", f"{place}/one.outputs:execOut"
    )
    sender = m.wired(raw_graph().nodes[0], "inputs:execIn", f"{place}/one.outputs:execOut")
    assert edges(m.only(m.graph(place, one, two, sender))) == ()


def test_a_node_of_an_unknown_type_passes_the_signal_on() -> None:
    graph = raw_graph()
    branch = m.wired(
        m.node("/Graph/tf/if", "some.Branch"), "inputs:execIn", "/Graph/tf/tick.outputs:tick"
    )
    branch = replace(
        branch, ports={**branch.ports, "outputs:yes": PortState("outputs:yes", "uint")}
    )
    sender = m.wired(graph.nodes[0], "inputs:execIn", "/Graph/tf/if.outputs:yes")
    assert len(edges(m.only(m.graph("/Graph/tf", sender, branch, graph.nodes[1])))) == 1


@pytest.mark.parametrize(("enabled", "count"), [(True, 1), (False, 0)])
def test_a_node_that_is_switched_off_passes_no_signal_on(count: int, *, enabled: bool) -> None:
    graph = raw_graph()
    product = m.node("/Graph/tf/product", PRODUCT_TYPE, enabled=enabled)
    product = m.wired(product, "inputs:execIn", "/Graph/tf/tick.outputs:tick")
    sender = m.wired(graph.nodes[0], "inputs:execIn", "/Graph/tf/product.outputs:execOut")
    stage = m.only(m.graph("/Graph/tf", sender, product, graph.nodes[1]))
    assert len(edges(stage)) == count


def test_a_long_chain_of_execution_is_followed() -> None:
    place, nodes = "/Graph/tf", [m.node("/Graph/tf/tick", TICK_TYPE)]
    for number in range(3000):
        before = "tick.outputs:tick" if not number else f"n{number - 1}.outputs:execOut"
        made = m.node(f"{place}/n{number}", COMPUTE_TYPE)
        nodes.append(m.wired(made, "inputs:execIn", f"{place}/{before}"))
    sender = m.wired(raw_graph().nodes[0], "inputs:execIn", f"{place}/n2999.outputs:execOut")
    assert len(edges(m.only(m.graph(place, *nodes, sender)))) == 1


def test_arrays_from_a_node_that_is_not_known_to_compute_frames_are_unknown() -> None:
    stage = m.stage()
    place = m.lab().graphs[m.ODOM_TF].path
    array = m.node(f"{place}/array", m.lab().graphs["ROS_Drive"].nodes["make_array"].type.type)
    publish = m.role(stage, m.PUBLISH)
    for port in ("parentFrames", "childFrames"):
        publish = m.wired(publish, f"inputs:{port}", f"{array.path}.outputs:array")
    stage = m.with_node(m.with_node(stage, array), publish)
    assert unknown_publishers(stage, m.lab()) == (publish.path,)


# ---- from prims to frames


def test_a_target_prim_is_a_frame_below_the_parent_prim() -> None:
    assert pairs(retargeted(m.CAMERA))[1:] == [("base_footprint", "Camera_1")]


def test_without_a_parent_prim_frames_hang_below_world() -> None:
    stage = retargeted(m.CAMERA)
    compute = m.aimed(m.role(stage, m.COMPUTE), "inputs:parentPrim")
    assert pairs(m.with_node(stage, compute))[1:] == [("world", "Camera_1")]


def test_a_name_override_names_the_frame() -> None:
    stage = m.with_prim(retargeted(m.CAMERA), m.CAMERA, attributes={"isaac:nameOverride": "eye"})
    assert pairs(stage)[1:] == [("base_footprint", "eye")]


def test_a_name_override_names_the_parent() -> None:
    stage = m.with_prim(retargeted(m.CAMERA), m.BASE, attributes={"isaac:nameOverride": "base"})
    assert pairs(stage)[1:] == [("base", "Camera_1")]


def test_an_empty_name_override_is_none() -> None:
    stage = m.with_prim(retargeted(m.CAMERA), m.CAMERA, attributes={"isaac:nameOverride": ""})
    assert pairs(stage)[1:] == [("base_footprint", "Camera_1")]


def test_a_target_that_is_not_there_is_left_out() -> None:
    assert pairs(retargeted("/nowhere", m.CAMERA))[1:] == [("base_footprint", "Camera_1")]


def test_a_target_that_is_deactivated_is_left_out() -> None:
    stage = m.with_prim(retargeted(f"{m.ROBOT}/base_scan", m.CAMERA), m.CAMERA, active=False)
    assert pairs(stage)[1:] == [("base_footprint", "base_scan")]


def test_a_target_in_a_missing_asset_is_taken_at_its_name() -> None:
    stage = m.without_prim(retargeted(m.CAMERA), m.CAMERA)
    stage = replace(stage, unresolved=(Unresolved(m.BASE, "robot.usd", "reference"),))
    assert pairs(stage)[1:] == [("base_footprint", "Camera_1")]


def test_the_robot_root_stands_for_its_links() -> None:
    found = edges(retargeted(m.ROBOT))[1:]
    assert [(edge.parent, edge.child) for edge in found] == [
        ("base_footprint", "base_link"),
        ("base_link", "base_scan"),
        ("base_link", "caster_back_link"),
        ("base_link", "wheel_left_link"),
        ("base_link", "wheel_right_link"),
    ]
    assert all(edge.expanded and edge.target == m.ROBOT for edge in found)


def test_an_articulation_root_stands_for_its_links() -> None:
    assert pairs(retargeted(m.BASE)) == pairs(retargeted(m.ROBOT))


def test_an_articulation_root_above_the_links_stands_for_them_too() -> None:
    stage = m.with_prim(retargeted(m.ROBOT), m.BASE, apis=("PhysicsRigidBodyAPI",))
    stage = m.with_prim(stage, m.ROBOT, apis=("PhysicsArticulationRootAPI",))
    assert sorted(pairs(stage)) == sorted(pairs(retargeted(m.ROBOT)))


def test_the_root_link_of_a_robot_hangs_below_the_parent_prim() -> None:
    stage = retargeted(m.ROBOT)
    compute = m.aimed(m.role(stage, m.COMPUTE), "inputs:parentPrim", "/World")
    assert ("World", "base_footprint") in pairs(m.with_node(stage, compute))


def test_links_without_joints_hang_below_the_parent_prim() -> None:
    stage = retargeted(m.ROBOT)
    links = stage.prims[m.ROBOT].relationships["isaac:physics:robotLinks"]
    stage = m.with_prim(stage, m.ROBOT, relationships={"isaac:physics:robotLinks": links})
    assert set(pairs(stage)[1:]) == {("base_footprint", child) for child in m.LINKS[1:]}


def test_a_joint_that_is_deactivated_ties_nothing() -> None:
    stage = m.with_prim(retargeted(m.ROBOT), f"{m.ROBOT}/joints/scan_joint", active=False)
    assert ("base_footprint", "base_scan") in pairs(stage)


def test_a_link_whose_joint_is_deactivated_is_no_part_of_the_articulation() -> None:
    stage = m.with_prim(retargeted(m.BASE), f"{m.ROBOT}/joints/scan_joint", active=False)
    assert "base_scan" not in [child for _, child in pairs(stage)]


def test_joints_in_a_ring_do_not_hang_the_computation() -> None:
    back = {"physics:body0": (f"{m.ROBOT}/base_scan",), "physics:body1": (m.BASE,)}
    stage = m.with_prim(retargeted(m.BASE), m.BASE)
    extra = Prim(f"{m.ROBOT}/joints/back", "PhysicsFixedJoint", (), relationships=back)
    stage = replace(stage, prims={**stage.prims, extra.path: extra})
    assert ("base_link", "base_scan") in pairs(stage)


def test_without_the_robot_api_the_root_is_one_frame() -> None:
    stage = m.with_prim(retargeted(m.ROBOT), m.ROBOT, apis=())
    assert pairs(stage)[1:] == [("base_footprint", "turtlebot3_burger")]


def test_the_parent_prim_as_a_target_is_its_own_parent_where_it_does_not_expand() -> None:
    stage = m.with_prim(retargeted(m.BASE), m.BASE, apis=("PhysicsRigidBodyAPI",))
    assert pairs(stage)[1:] == [("base_footprint", "base_footprint")]


def test_of_two_prims_with_one_name_the_deeper_keeps_it() -> None:
    prims = {**m.robot(), "/World/base_scan": Prim("/World/base_scan", "Xform", ())}
    stage = replace(retargeted("/World/base_scan", f"{m.ROBOT}/base_scan"), prims=prims)
    assert [child for _, child in pairs(stage)[1:]] == ["World_base_scan", "base_scan"]


def test_the_loser_of_an_override_goes_by_its_prim_name() -> None:
    stage = retargeted(f"{m.ROBOT}/base_link", f"{m.ROBOT}/base_scan")
    stage = m.with_prim(
        stage, f"{m.ROBOT}/base_link", attributes={"isaac:nameOverride": "base_scan"}
    )
    assert [child for _, child in pairs(stage)[1:]] == ["base_scan", "turtlebot3_burger_base_scan"]


# ---- from the computing node to the publisher


def test_the_publisher_sends_nothing_when_an_array_is_not_wired() -> None:
    stage = m.stage()
    publish = m.wired(m.role(stage, m.PUBLISH), "inputs:orientations")
    assert pairs(m.with_node(stage, publish)) == [("odom", "base_footprint")]


def test_the_publisher_sends_nothing_when_the_frames_are_not_computed() -> None:
    stage = m.stage()
    compute = m.wired(m.role(stage, m.COMPUTE), "inputs:execIn")
    assert pairs(m.with_node(stage, compute)) == [("odom", "base_footprint")]


def test_crossed_arrays_cross_parents_and_children() -> None:
    stage = retargeted(m.CAMERA)
    place = m.lab().graphs[m.ODOM_TF].path
    publish = m.wired(
        m.role(stage, m.PUBLISH), "inputs:parentFrames", f"{place}/{m.COMPUTE}.outputs:childFrames"
    )
    publish = m.wired(publish, "inputs:childFrames", f"{place}/{m.COMPUTE}.outputs:parentFrames")
    assert pairs(m.with_node(stage, publish))[1:] == [("Camera_1", "base_footprint")]


def own_targets(*targets: str) -> StageModel:
    """A publisher with target prims of its own, as before 6.0."""
    place = "/Graph/tf"
    sender = m.wired(
        m.node(f"{place}/sender", PUBLISH_TYPE), "inputs:execIn", f"{place}/tick.outputs:tick"
    )
    sender = m.aimed(m.aimed(sender, "inputs:parentPrim", m.BASE), "inputs:targetPrims", *targets)
    return m.only(m.graph(place, sender, m.node(f"{place}/tick", TICK_TYPE)))


def test_a_publisher_may_have_targets_of_its_own() -> None:
    (edge,) = edges(own_targets(m.CAMERA))
    assert (edge.parent, edge.child, edge.cause) == (
        "base_footprint",
        "Camera_1",
        "/Graph/tf/sender",
    )


def test_a_publisher_with_a_target_of_its_own_that_is_not_there_sends_nothing() -> None:
    assert edges(own_targets(m.CAMERA, "/nowhere")) == ()


def test_arrays_win_over_targets_of_its_own() -> None:
    stage = m.stage()
    publish = m.aimed(m.role(stage, m.PUBLISH), "inputs:targetPrims", m.ROBOT)
    assert edges(m.with_node(stage, publish)) == edges(stage)


# ---- the graph of frames, and the stages that the builder writes


def test_the_tree_carries_the_publishers() -> None:
    copy = m.graph_of(m.lab().graphs[m.ODOM_TF], "/Graph/copy")
    found = tree(edges(m.stage(copy)))
    assert sorted(found.edges) == sorted({("odom", "base_footprint"), *STAR})
    both = found.edges["odom", "base_footprint"]["edges"]
    assert [edge.publisher for edge in both] == [
        f"{m.ROBOT}/{m.ODOM_TF}/{m.RAW}",
        f"/Graph/copy/{m.RAW}",
    ]
    assert found.edges["odom", "base_footprint"]["publisher"] == both[0].publisher


def test_a_built_stage_publishes_what_the_hand_made_one_does(tmp_path: Path) -> None:
    built = build_checkpoint(None, "05", tmp_path / "stage.usda")
    assert edges(read_stage(built, m.lab())) == edges(m.stage())
