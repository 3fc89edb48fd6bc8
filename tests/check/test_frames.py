"""Which transforms a stage publishes, as hand-made stages show and as the built ones confirm."""

from __future__ import annotations

from pathlib import Path

import models as m
import pytest
from msgspec.structs import replace

from lab3_usd.facts.domains import Domain
from lab3_usd.facts.frames import (
    Edge,
    published_edges,
    unknown_publishers,
    unresolved_frames,
)
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import GraphModel, PortState, StageModel, UnresolvedAsset
from lab3_usd.stage.read.stage_reader import read_stage
from lab3_usd.stage.write.builder import build_checkpoint

TF = ("/tf", "/tf_static")
RAW_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.RAW].type.type
TICK_TYPE = m.lab().graphs[m.ODOM_TF].nodes["on_playback_tick"].type.type
COMPUTE_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.COMPUTE].type.type
PUBLISH_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.PUBLISH].type.type
PRODUCT_TYPE = m.lab().graphs["ROS_Camera"].nodes["isaac_create_render_product"].type.type
CONSTANT_TYPE = m.lab().graphs["ROS_Drive"].nodes["constant_left_joint"].type.type
GENERIC_TYPE = m.PUBLISHER_TYPE
BODY, ARTICULATION = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI"
ROBOT_JOINTS = "isaac:physics:robotJoints"
STAR = {("base_footprint", child) for child in (*m.LINKS[1:], "Camera_1")}


def edges(stage: StageModel) -> tuple[Edge, ...]:
    return published_edges(stage)


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
        domain=Domain("0", from_environment=False),
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
    moved = replace(graph, nodes=tuple(replace(n, namespaces=("ns",)) for n in graph.nodes))
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
    assert unknown_publishers(TF, stage) == ("/Graph/tf/sender",)


def test_a_computed_name_is_unknown() -> None:
    graph = raw_graph()
    product = m.node("/Graph/tf/product", PRODUCT_TYPE)
    source = "/Graph/tf/product.outputs:renderProductPath"
    sender = m.wired(graph.nodes[0], "inputs:childFrameId", source)
    stage = m.only(m.graph("/Graph/tf", sender, graph.nodes[1], product))
    assert edges(stage) == ()
    assert unknown_publishers(TF, stage) == ("/Graph/tf/sender",)


def test_a_generic_publisher_of_transforms_is_unknown() -> None:
    generic = m.node(
        "/Graph/tf/any", GENERIC_TYPE, topicName="tf", messagePackage="tf2_msgs",
        messageName="TFMessage",
    )  # fmt: skip
    generic = m.wired(generic, "inputs:execIn", "/Graph/tf/tick.outputs:tick")
    graph = m.graph("/Graph/tf", generic, m.node("/Graph/tf/tick", TICK_TYPE))
    assert unknown_publishers(TF, m.only(graph)) == ("/Graph/tf/any",)
    other = m.valued(generic, "inputs:messageName", "String")
    assert unknown_publishers(TF, m.only(m.graph("/Graph/tf", other, graph.nodes[1]))) == ()


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


def test_a_transform_that_is_signalled_once_is_not_sent() -> None:
    graph = raw_graph()
    (raw,) = (node for node in graph.nodes if node.type and node.type.tf)
    tick = raw.sources("inputs:execIn")[0]
    once = m.node("/Graph/tf/once", "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame")
    others = [node for node in graph.nodes if node is not raw]
    nodes = (
        m.wired(raw, "inputs:execIn", f"{once.path}.outputs:step"),
        m.wired(once, "inputs:execIn", tick),
        *others,
    )
    assert edges(m.only(graph)) != ()
    assert edges(m.only(replace(graph, nodes=nodes))) == ()


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
    product = m.aimed(product, "inputs:cameraPrim", "/OmniverseKit_Persp")
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
    assert unknown_publishers(TF, stage) == (publish.path,)


def with_written_frames(*places: tuple[float, float, float]) -> StageModel:
    publish = m.role(m.stage(), m.PUBLISH)
    written = {
        "parentFrames": ("base_footprint", "mast"),
        "childFrames": ("mast", "lamp"),
        "translations": places,
    }
    for name, value in written.items():
        publish = m.valued(m.wired(publish, f"inputs:{name}"), f"inputs:{name}", value)
    return m.with_node(m.stage(), publish)


def test_frames_that_are_written_into_a_publisher_are_its_transforms() -> None:
    stage = with_written_frames((0.0, 0.0, 1.0), (0.0, 0.0, 2.0))
    assert pairs(stage)[1:] == [("base_footprint", "mast"), ("mast", "lamp")]
    assert unknown_publishers(TF, stage) == ()


def test_written_arrays_of_different_lengths_send_nothing() -> None:
    assert pairs(with_written_frames((0.0, 0.0, 1.0))) == [("odom", "base_footprint")]


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


# ---- what a missing asset could tell


def asset_at(stage: StageModel, *places: str) -> StageModel:
    missing = tuple(UnresolvedAsset(place, "robot.usd", "reference") for place in places)
    return replace(stage, unresolved=missing)


def hidden(stage: StageModel) -> list[tuple[str, str]]:
    return [(frame.what, frame.parent) for frame in unresolved_frames(TF, stage)]


def test_a_target_that_a_missing_asset_could_hold_is_unknown() -> None:
    stage = asset_at(m.without_prim(retargeted(m.CAMERA), m.CAMERA), m.BASE)
    assert pairs(stage)[1:] == []
    assert hidden(stage) == [(f"frame of {m.CAMERA}", "base_footprint")]


def test_a_robot_whose_asset_is_missing_has_unknown_links() -> None:
    bare = Prim(m.ROBOT, "Xform", ())
    stage = asset_at(replace(retargeted(m.ROBOT), prims={m.ROBOT: bare}), m.ROBOT)
    assert pairs(stage)[1:] == []
    assert hidden(stage) == [(f"links of {m.ROBOT}", "base_footprint")]


def test_what_the_stage_itself_says_of_a_robot_is_known_beside_a_missing_asset() -> None:
    stage = asset_at(retargeted(m.ROBOT), m.ROBOT)
    assert pairs(stage) == pairs(retargeted(m.ROBOT))
    assert hidden(stage) == [(f"links of {m.ROBOT}", "base_footprint")]


def test_prims_that_the_stage_defines_below_a_missing_asset_are_known() -> None:
    stage = asset_at(m.stage(), m.ROBOT)
    assert pairs(stage) == pairs(m.stage())
    assert hidden(stage) == []


@pytest.mark.parametrize("prim", [f"{m.ROBOT}/base_scan", m.CAMERA])
def test_a_link_or_a_sensor_with_a_missing_asset_of_its_own_is_known(prim: str) -> None:
    stage = asset_at(retargeted(prim), prim)
    assert len(pairs(stage)) == 2
    assert hidden(stage) == []


def test_an_asset_that_is_missing_below_a_robot_could_hold_further_links() -> None:
    lidar = f"{m.ROBOT}/base_scan/Lidar2D"
    stage = asset_at(retargeted(m.ROBOT), lidar)
    assert pairs(stage) == pairs(retargeted(m.ROBOT))
    assert hidden(stage) == [(f"links of {lidar}", "base_footprint")]


def test_an_asset_that_is_missing_below_a_single_target_hides_no_frame() -> None:
    stage = asset_at(m.stage(), f"{m.ROBOT}/base_scan/Lidar2D", "/World")
    assert hidden(stage) == []


def test_a_target_that_is_deactivated_is_left_out_whatever_an_asset_holds() -> None:
    stage = m.with_prim(retargeted(m.CAMERA), m.CAMERA, active=False)
    assert hidden(asset_at(stage, m.BASE)) == []


def test_frames_that_are_not_sent_are_not_unknown_either() -> None:
    stage = asset_at(m.without_prim(retargeted(m.CAMERA), m.CAMERA), m.BASE)
    publish = m.wired(m.role(stage, m.PUBLISH), "inputs:orientations")
    assert hidden(m.with_node(stage, publish)) == []


# ---- what a target stands for


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


def test_an_articulation_root_stands_for_the_bodies_at_and_below_it() -> None:
    assert pairs(retargeted(m.BASE))[1:] == [("base_footprint", "base_footprint")]


def test_an_articulation_root_above_the_links_gives_the_parent_prim_as_well() -> None:
    stage = m.with_prim(retargeted(m.ROBOT), m.BASE, apis=("PhysicsRigidBodyAPI",))
    stage = m.with_prim(stage, m.ROBOT, apis=("IsaacRobotAPI", "PhysicsArticulationRootAPI"))
    assert pairs(stage)[1:] == [("base_footprint", link) for link in m.LINKS]


def test_bodies_of_an_articulation_hang_below_the_nearest_body_above_them() -> None:
    nested = {
        f"{m.ROBOT}/base_link/arm": ("IsaacLinkAPI",),
        f"{m.ROBOT}/base_link/arm/hand": ("PhysicsRigidBodyAPI",),
    }
    prims = {**m.robot(), **{path: Prim(path, "Xform", apis) for path, apis in nested.items()}}
    stage = m.with_prim(replace(retargeted(m.ROBOT), prims=prims), m.ROBOT, apis=(ARTICULATION,))
    assert ("base_link", "hand") in pairs(stage)
    assert "arm" not in [child for _, child in pairs(stage)]


def test_an_articulation_root_without_bodies_stands_for_its_links_or_itself() -> None:
    prims = {path: replace(prim, apis=tuple(api for api in prim.apis if api != BODY))
             for path, prim in m.robot().items()}  # fmt: skip
    stage = m.with_prim(
        replace(retargeted(m.ROBOT), prims=prims), m.ROBOT, apis=("IsaacRobotAPI", ARTICULATION)
    )
    odometry = {("odom", "base_footprint")}  # which has no body to follow here
    assert set(pairs(stage)) == set(pairs(retargeted(m.ROBOT))) - odometry
    stage = m.with_prim(stage, m.ROBOT, apis=(ARTICULATION,))
    assert pairs(stage) == [("base_footprint", "turtlebot3_burger")]


@pytest.mark.parametrize("listed", [(), m.LINKS[:2]])
def test_what_a_robot_lists_as_its_links_plays_no_part(listed: tuple[str, ...]) -> None:
    stage = retargeted(m.ROBOT)
    related = dict(stage.prims[m.ROBOT].relationships)
    related["isaac:physics:robotLinks"] = tuple(f"{m.ROBOT}/{name}" for name in listed)
    assert pairs(m.with_prim(stage, m.ROBOT, relationships=related)) == pairs(stage)


def test_a_link_without_the_link_schema_is_no_frame_of_the_robot() -> None:
    stage = m.with_prim(retargeted(m.ROBOT), f"{m.ROBOT}/base_scan", apis=(BODY,))
    assert "base_scan" not in [child for _, child in pairs(stage)]


@pytest.mark.parametrize("api", ["IsaacSiteAPI", "IsaacReferencePointAPI"])
def test_sites_and_reference_points_of_a_robot_hang_below_the_link_above_them(api: str) -> None:
    path = f"{m.ROBOT}/base_scan/Lidar2D"
    stage = m.with_prim(retargeted(m.ROBOT), path, apis=(api,))
    stage = m.with_prim(stage, m.CAMERA, apis=(api,))
    assert {("base_scan", "Lidar2D"), ("base_footprint", "Camera_1")} < set(pairs(stage))


@pytest.mark.parametrize(
    "apis", [("IsaacLinkAPI", "IsaacJointAPI"), ("IsaacRobotAPI", "IsaacLinkAPI")]
)
def test_joints_and_robots_in_a_robot_are_no_frames(apis: tuple[str, ...]) -> None:
    stage = m.with_prim(retargeted(m.ROBOT), f"{m.ROBOT}/base_scan", apis=apis)
    assert "base_scan" not in [child for _, child in pairs(stage)]


def test_a_robot_without_any_link_is_one_frame() -> None:
    prims = {path: replace(prim, apis=tuple(api for api in prim.apis if api != "IsaacLinkAPI"))
             for path, prim in m.robot().items()}  # fmt: skip
    stage = replace(retargeted(m.ROBOT), prims=prims)
    assert pairs(stage)[1:] == [("base_footprint", "turtlebot3_burger")]


def test_a_robot_whose_only_link_is_the_parent_prim_gives_no_frame() -> None:
    prims = m.robot()
    stage = replace(retargeted(m.ROBOT), prims={path: prims[path] for path in (m.ROBOT, m.BASE)})
    assert pairs(stage)[1:] == []


def test_a_link_may_hang_below_a_body_that_is_no_frame_itself() -> None:
    """A prim without a body is found by the body above it, which the node then knows."""
    site = Prim(f"{m.ROBOT}/base_link/site", "Xform", ("IsaacSiteAPI",))
    prims = {**m.robot(), site.path: site}
    stage = m.with_prim(
        replace(retargeted(m.ROBOT), prims=prims), f"{m.ROBOT}/base_link", apis=(BODY,)
    )
    assert set(pairs(stage)[1:]) == {
        ("base_footprint", "site"),
        *(("base_link", child) for child in m.LINKS[2:]),
    }
    without = m.without_prim(stage, site.path)
    assert set(pairs(without)[1:]) == {("base_footprint", child) for child in m.LINKS[2:]}


def test_the_last_joint_of_a_link_counts() -> None:
    path = f"{m.ROBOT}/joints/second"
    ends = {"physics:body0": (f"{m.ROBOT}/base_scan",), "physics:body1": (f"{m.ROBOT}/base_link",)}
    joint = Prim(path, "PhysicsFixedJoint", (), relationships=ends)
    stage = retargeted(m.ROBOT)
    stage = replace(stage, prims={**stage.prims, path: joint})
    assert ("base_scan", "base_link") not in pairs(stage)
    related = dict(stage.prims[m.ROBOT].relationships)
    related[ROBOT_JOINTS] = (*related[ROBOT_JOINTS], path)
    assert ("base_scan", "base_link") in pairs(m.with_prim(stage, m.ROBOT, relationships=related))


def test_the_root_link_of_a_robot_hangs_below_the_parent_prim() -> None:
    stage = retargeted(m.ROBOT)
    compute = m.aimed(m.role(stage, m.COMPUTE), "inputs:parentPrim", "/World")
    assert ("World", "base_footprint") in pairs(m.with_node(stage, compute))


def test_links_without_joints_hang_below_the_parent_prim() -> None:
    stage = retargeted(m.ROBOT)
    links = stage.prims[m.ROBOT].relationships["isaac:physics:robotLinks"]
    stage = m.with_prim(stage, m.ROBOT, relationships={"isaac:physics:robotLinks": links})
    assert set(pairs(stage)[1:]) == {("base_footprint", child) for child in m.LINKS[1:]}


@pytest.mark.parametrize(
    ("changes", "parent"),
    [
        ({"active": False}, "base_link"),
        ({"attributes": {"physics:excludeFromArticulation": True}}, "base_footprint"),
        ({"type": "Xform"}, "base_footprint"),
        ({"relationships": {}}, "base_footprint"),
    ],
)
def test_what_a_joint_of_the_robot_says_of_a_link(changes: dict[str, object], parent: str) -> None:
    stage = m.with_prim(retargeted(m.ROBOT), f"{m.ROBOT}/joints/scan_joint", **changes)
    assert (parent, "base_scan") in pairs(stage)


def test_without_the_robot_api_the_root_is_one_frame() -> None:
    stage = m.with_prim(retargeted(m.ROBOT), m.ROBOT, apis=())
    assert pairs(stage)[1:] == [("base_footprint", "turtlebot3_burger")]


@pytest.mark.parametrize("apis", [(BODY,), (BODY, ARTICULATION), ()])
def test_the_parent_prim_as_a_target_is_its_own_parent(apis: tuple[str, ...]) -> None:
    stage = m.with_prim(retargeted(m.BASE), m.BASE, apis=apis)
    own = [pair for pair in pairs(stage) if pair != ("odom", "base_footprint")]
    assert own == [("base_footprint", "base_footprint")]


def named(*paths: str, **overrides: str) -> list[str]:
    """The frames of these targets, of which some prims have name overrides."""
    stage = retargeted(*paths)
    prims = {path: Prim(path, "Xform", ()) for path in paths}
    for path in paths:
        override = overrides.get(path.rpartition("/")[2])
        if override:
            prims[path] = replace(prims[path], attributes={"isaac:nameOverride": override})
    return [child for _, child in pairs(replace(stage, prims={**prims, **m.robot()}))[1:]]


def test_of_two_prims_with_one_name_the_longer_path_keeps_it() -> None:
    assert named("/World/a/x", "/World/ab/x") == ["a_x", "x"]
    assert named("/World/ab/x", "/World/a/x") == ["x", "a_x"]


def test_an_ancestor_whose_name_is_taken_as_well_is_passed_over() -> None:
    assert named("/World/a/x", "/World/a/b/x", "/World/abc/def/x") == ["a_x", "b_x", "x"]


def test_of_two_paths_of_one_length_the_first_keeps_the_name() -> None:
    assert named("/World/a/x", "/World/b/x") == ["x", "b_x"]


def test_the_loser_of_an_override_goes_by_its_prim_name() -> None:
    assert named("/World/a/mount", "/World/a/mount/eye", mount="eye") == ["mount", "eye"]


def test_a_prim_right_below_the_root_prim_keeps_a_name_that_is_taken() -> None:
    """Isaac Sim looks for another name in the ancestors below the root prim: there are none."""
    assert named("/World/x", "/World/abc/x") == ["x", "x"]


def test_the_name_of_the_root_prim_counts_where_the_first_path_begins_with_a_shorter_one() -> None:
    assert named("/A/much/longer/x", "/World/x") == ["x", "World_x"]


def test_the_same_prim_twice_is_one_name() -> None:
    assert named("/World/x", "/World/x") == ["x", "x"]


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


def test_an_articulation_root_that_a_publisher_looks_at_stands_for_what_its_joints_tie() -> None:
    assert pairs(own_targets(m.BASE)) == [
        ("base_footprint", "base_link"),
        *(("base_link", child) for child in m.LINKS[2:]),
    ]


def test_joints_that_are_deactivated_tie_nothing_to_an_articulation() -> None:
    stage = m.with_prim(own_targets(m.BASE), f"{m.ROBOT}/joints/scan_joint", active=False)
    assert "base_scan" not in [child for _, child in pairs(stage)]


def test_a_joint_to_the_world_ties_nothing_to_an_articulation() -> None:
    ends = {"physics:body1": (f"{m.ROBOT}/base_scan",)}
    path = f"{m.ROBOT}/joints/scan_joint"
    stage = m.with_prim(own_targets(m.BASE), path, relationships=ends)
    assert "base_scan" not in [child for _, child in pairs(stage)]


def test_joints_in_a_ring_do_not_hang_the_computation() -> None:
    back = {"physics:body0": (f"{m.ROBOT}/base_scan",), "physics:body1": (m.BASE,)}
    extra = Prim(f"{m.ROBOT}/joints/back", "PhysicsFixedJoint", (), relationships=back)
    stage = own_targets(m.BASE)
    stage = replace(stage, prims={**stage.prims, extra.path: extra})
    assert ("base_link", "base_scan") in pairs(stage)


def test_a_robot_that_a_publisher_looks_at_is_one_frame() -> None:
    assert pairs(own_targets(m.ROBOT)) == [("base_footprint", "turtlebot3_burger")]


def test_a_publisher_that_looks_at_two_prims_of_one_name_calls_the_second_by_its_path() -> None:
    prims = {**m.robot(), "/World/base_scan": Prim("/World/base_scan", "Xform", ())}
    stage = replace(own_targets(f"{m.ROBOT}/base_scan", "/World/base_scan"), prims=prims)
    assert [child for _, child in pairs(stage)] == ["base_scan", "World_base_scan"]


def test_a_publisher_with_a_target_of_its_own_that_is_not_there_sends_nothing() -> None:
    assert edges(own_targets(m.CAMERA, "/nowhere")) == ()


def test_arrays_win_over_targets_of_its_own() -> None:
    stage = m.stage()
    publish = m.aimed(m.role(stage, m.PUBLISH), "inputs:targetPrims", m.ROBOT)
    assert edges(m.with_node(stage, publish)) == edges(stage)


# ---- the stages that the builder writes


def test_a_built_stage_publishes_what_the_hand_made_one_does(tmp_path: Path) -> None:
    built = build_checkpoint(None, "05", tmp_path / "stage.usda")
    assert edges(read_stage(built, m.lab().platform)) == edges(m.stage())
