"""What the frame rules say of a stage, and what they leave to other rules."""

from __future__ import annotations

from collections.abc import Mapping

import models as m
import pytest
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.lab_frames import tf_views
from lab3_usd.check.registry import rules_of
from lab3_usd.check.requirements import frame_requirements
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Problem
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import AbsentPrim, Node, PortState, StageModel, UnresolvedAsset

PLACE = m.lab().graphs[m.ODOM_TF].path
COMPUTE, RAW = f"{PLACE}/{m.COMPUTE}", f"{PLACE}/{m.RAW}"
RAW_TYPE = m.lab().graphs[m.ODOM_TF].nodes[m.RAW].type.type
TICK_TYPE = m.lab().graphs[m.ODOM_TF].nodes["on_playback_tick"].type.type
PRODUCT_TYPE = m.lab().graphs["ROS_Camera"].nodes["isaac_create_render_product"].type.type
TARGETS, PARENT = "inputs:targetPrims", "inputs:parentPrim"
FRAME_ROLES = {name: f"{m.ROBOT}/{name}" for name in m.LINKS[1:]} | {"Camera_1": m.CAMERA}

BODY, ARTICULATION = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI"

Site = tuple[str, str, str | None]


def problems(stage: StageModel, checkpoint: str = "05") -> dict[str, list[Problem]]:
    """What each frame rule says, by its id."""
    view = tf_views(m.subject(stage, checkpoint))[0]
    found = {
        rule.id: [problem for problem in rule.check(view) if problem.rests_on is None]
        for rule in rules_of("frames", "T")
    }
    return {rule_id: said for rule_id, said in found.items() if said}


def sites(stage: StageModel, checkpoint: str = "05", blamed: tuple[str, ...] = ()) -> list[Site]:
    """Rule, prim and property of everything that the frame rules say."""
    return m.left_beside(blamed, problems(stage, checkpoint))


def targets(*prims: str) -> StageModel:
    stage = m.stage()
    return m.with_node(stage, m.aimed(m.role(stage, m.COMPUTE), TARGETS, *prims))


def every_target(**changed: str) -> StageModel:
    """The required targets, with the prims of some frames replaced ('' takes one out)."""
    return targets(*filter(None, (FRAME_ROLES | changed).values()))


def raw(parent: str, child: str) -> StageModel:
    stage = m.stage()
    node = m.valued(m.role(stage, m.RAW), "inputs:parentFrameId", parent)
    return m.with_node(stage, m.valued(node, "inputs:childFrameId", child))


def sender(path: str, parent: str, child: str, *, driven: bool = True) -> Node:
    node = m.node(path, RAW_TYPE, parentFrameId=parent, childFrameId=child)
    tick = f"{path.rpartition('/')[0]}/on_playback_tick.outputs:tick"
    return m.wired(node, "inputs:execIn", tick) if driven else node


def beside(*senders: tuple[str, str], name: str = "sender", driven: bool = True) -> StageModel:
    """The complete stage and a graph below /Graph with further transform publishers."""
    nodes = [
        sender(f"/Graph/tf/{name}" if not n else f"/Graph/tf/{name}_{n:02}", *pair, driven=driven)
        for n, pair in enumerate(senders)
    ]
    return m.stage(m.graph("/Graph/tf", *nodes, m.node("/Graph/tf/on_playback_tick", TICK_TYPE)))


SENDER = "/Graph/tf/sender"


@pytest.mark.parametrize(
    "checkpoint", [name for name, each in m.lab().checkpoints.items() if each.frames]
)
def test_the_complete_stage_has_no_problem(checkpoint: str) -> None:
    assert sites(m.stage(), checkpoint) == []


def test_frames_are_judged_from_the_checkpoint_that_adds_them() -> None:
    broken = beside(("world", "odom"), ("odom", "base_link"), ("x", "y"), ("z", "z"))
    judged = {each: judge(m.lab(), m.lab().checkpoints[each], broken) for each in ("04", "05")}
    rules = {each: {found.rule for found in judged[each].findings} for each in judged}
    assert not [rule for rule in rules["04"] if rule.startswith("T")]
    assert rules["05"] >= {"T03", "T06", "T07", "T09"}


# ---- T01


@pytest.mark.parametrize("frame", FRAME_ROLES)
@pytest.mark.parametrize("instead", ["", f"{m.ROBOT}/base_scan/Lidar2D", "/nowhere", "/World"])
def test_a_target_taken_out_or_exchanged_is_one_finding(frame: str, instead: str) -> None:
    found = problems(every_target(**{frame: instead}))
    assert list(found) == ["T01"]
    (problem,) = found["T01"]
    assert (problem.prim, problem.property) == (COMPUTE, TARGETS)
    assert problem.expected == FRAME_ROLES[frame]
    assert problem.handout == "F9"


def test_two_missing_frames_are_two_findings() -> None:
    assert sites(every_target(base_scan="", Camera_1="")) == [("T01", COMPUTE, TARGETS)] * 2


def test_no_targets_at_all_are_one_finding() -> None:
    assert sites(targets()) == [("T01", COMPUTE, TARGETS)]


def test_a_target_that_does_not_exist_is_named() -> None:
    (problem,) = problems(every_target(base_scan="/nowhere"))["T01"]
    assert "/nowhere" in problem.message


@pytest.mark.parametrize("frame", FRAME_ROLES)
def test_a_name_override_is_found_at_its_prim(frame: str) -> None:
    override: Mapping[str, Value] = {"isaac:nameOverride": "other"}
    stage = m.with_prim(m.stage(), FRAME_ROLES[frame], attributes=override)
    assert sites(stage) == [("T01", FRAME_ROLES[frame], "isaac:nameOverride")]


def overridden(**names: str) -> StageModel:
    stage = m.stage()
    for frame, name in names.items():
        stage = m.with_prim(stage, FRAME_ROLES[frame], attributes={"isaac:nameOverride": name})
    return stage


@pytest.mark.parametrize(
    "names",
    [
        {"wheel_left_link": "wheel_right_link", "wheel_right_link": "wheel_left_link"},
        {"base_scan": "Camera_1", "Camera_1": "base_scan"},
        {"base_link": "base_scan", "base_scan": "Camera_1", "Camera_1": "base_link"},
    ],
)
def test_frames_that_overrides_exchange_are_found_at_their_prims(names: dict[str, str]) -> None:
    found = problems(overridden(**names))["T01"]
    assert {problem.prim for problem in found} == {FRAME_ROLES[frame] for frame in names}
    assert {problem.property for problem in found} == {"isaac:nameOverride"}


def test_an_override_that_another_prim_keeps_its_name_against_does_no_harm() -> None:
    assert sites(overridden(wheel_left_link="wheel_right_link")) == []


@pytest.mark.parametrize("frame", FRAME_ROLES)
def test_a_prim_that_is_not_in_the_scene_is_left_to_the_rules_of_the_scene(frame: str) -> None:
    assert sites(m.without_prim(m.stage(), FRAME_ROLES[frame])) == []


def asset_at(stage: StageModel, *places: str) -> StageModel:
    missing = tuple(UnresolvedAsset(place, "robot.usd", "reference") for place in places)
    return replace(stage, unresolved=missing)


def bare(stage: StageModel) -> StageModel:
    """The stage with nothing of the robot but its root, whose asset is missing."""
    prims = {path: prim for path, prim in stage.prims.items() if not path.startswith(m.ROBOT)}
    root = replace(stage.prims[m.ROBOT], apis=(), relationships={})
    return asset_at(replace(stage, prims={**prims, m.ROBOT: root}), m.ROBOT)


def with_camera(stage: StageModel) -> StageModel:
    return replace(stage, prims={**stage.prims, m.CAMERA: m.robot()[m.CAMERA]})


@pytest.mark.parametrize("prims", [(m.ROBOT,), tuple(FRAME_ROLES.values())])
def test_what_a_missing_asset_may_hold_is_not_judged(prims: tuple[str, ...]) -> None:
    stage = bare(targets(*prims))
    assert sites(stage) == []
    assert all(item.met for item in frame_requirements(m.subject(stage)))


def test_frames_that_may_be_there_below_a_wrong_parent_are_not_met() -> None:
    stage = bare(m.stage())
    stage = m.with_node(stage, m.aimed(m.role(stage, m.COMPUTE), PARENT, "/World"))
    unmet = [item.id for item in frame_requirements(m.subject(stage)) if not item.met]
    assert len(unmet) == len(FRAME_ROLES)


@pytest.mark.parametrize("frame", FRAME_ROLES)
def test_a_frame_that_no_target_names_is_missing_whatever_the_asset_holds(frame: str) -> None:
    (problem,) = problems(bare(every_target(**{frame: ""})))["T01"]
    assert problem.expected == FRAME_ROLES[frame]


def test_a_link_that_stands_elsewhere_in_the_missing_asset_is_not_judged() -> None:
    assert sites(bare(every_target(base_scan=f"{m.ROBOT}/base_link/base_scan"))) == []


def test_a_missing_robot_alone_does_not_give_the_camera_that_the_stage_itself_has() -> None:
    stage = with_camera(bare(targets(m.ROBOT)))
    assert sites(stage) == [("T10", COMPUTE, TARGETS)]
    assert sites(with_camera(bare(targets(m.ROBOT, m.CAMERA)))) == []


def test_a_bogus_asset_on_a_robot_that_is_there_changes_nothing(subtests: pytest.Subtests) -> None:
    for stage in (targets(m.ROBOT, m.CAMERA), every_target(base_scan=""), targets(m.BASE)):
        with subtests.test(stage=stage):
            assert sites(asset_at(stage, m.ROBOT)) == sites(stage)


def test_a_missing_lidar_below_the_robot_excuses_no_link() -> None:
    stage = m.with_prim(targets(m.ROBOT, m.CAMERA), f"{m.ROBOT}/base_scan", apis=(BODY,))
    assert sites(stage) == [("T01", COMPUTE, TARGETS)]
    assert sites(asset_at(stage, f"{m.ROBOT}/base_scan/Lidar2D")) == sites(stage)
    assert sites(asset_at(stage, f"{m.ROBOT}/base_scan")) == []


def test_a_tree_that_is_not_known_is_not_called_broken() -> None:
    stage = replace(beside(("imu", "imu_data")), unresolved=bare(m.stage()).unresolved)
    assert sites(replace(stage, prims=bare(m.stage()).prims)) == []


@pytest.mark.parametrize("role", sorted(m.lab().graphs[m.ODOM_TF].nodes))
def test_a_missing_node_is_left_to_the_rules_of_the_graph(role: str) -> None:
    assert sites(m.without_node(m.stage(), f"{PLACE}/{role}"), "08") == []


@pytest.mark.parametrize(
    ("role", "port"),
    [(wire.target.role, wire.target.port) for wire in m.lab().graphs[m.ODOM_TF].wires],
)
def test_a_cut_wire_is_left_to_the_rules_of_the_graph(role: str, port: str) -> None:
    stage = m.stage()
    assert sites(m.with_node(stage, m.wired(m.role(stage, role), port)), "08") == []


def test_a_graph_that_is_off_or_missing_is_left_to_the_rules_of_the_graph() -> None:
    stage = m.stage()
    others = tuple(graph for graph in stage.graphs if graph.path != PLACE)
    off = replace(next(g for g in stage.graphs if g.path == PLACE), active=False)
    assert sites(replace(stage, graphs=others), "08") == []
    assert sites(replace(stage, graphs=(*others, off)), "08") == []


# ---- T02


def test_a_parent_prim_with_an_override_is_one_finding_at_the_prim() -> None:
    stage = m.with_prim(m.stage(), m.BASE, attributes={"isaac:nameOverride": "base"})
    assert sites(stage) == [("T02", m.BASE, "isaac:nameOverride")]


def test_a_frame_below_another_parent_is_found_at_its_publisher() -> None:
    stage = beside(("base_link", "base_scan"))
    stage = m.with_node(
        stage, m.aimed(m.role(stage, m.COMPUTE), TARGETS, *list(FRAME_ROLES.values())[2:])
    )
    stage = m.with_node(stage, sender("/Graph/tf/sender_01", "base_footprint", "base_link"))
    assert sites(stage) == [("T02", SENDER, "inputs:parentFrameId")]


@pytest.mark.parametrize("parent", ["/World", m.CAMERA, f"{m.ROBOT}/base_link"])
def test_another_parent_prim_is_left_to_the_rule_of_targets(parent: str) -> None:
    stage = m.stage()
    stage = m.with_node(stage, m.aimed(m.role(stage, m.COMPUTE), PARENT, parent))
    assert sites(stage, blamed=(f"{COMPUTE}.{PARENT}",)) == []


def test_links_may_hang_deeper_where_the_robot_stands_for_them() -> None:
    assert sites(targets(m.ROBOT, m.CAMERA)) == []


@pytest.mark.parametrize(
    ("parent", "child"),
    [("world", "base_footprint"), ("odom", "base_link"), ("odom", "x"), ("map", "base_scan")],
)
def test_wrong_frame_names_are_left_to_the_rule_of_settings(parent: str, child: str) -> None:
    names = ("inputs:parentFrameId", "inputs:childFrameId")
    assert sites(raw(parent, child), "08", tuple(f"{RAW}.{name}" for name in names)) == []


# ---- T03 to T06: the tree as a whole


@pytest.mark.parametrize(
    ("pair", "rule_id"),
    [
        (("odom", "base_link"), "T03"),
        (("world", "base_footprint"), "T03"),
        (("odom", "base_footprint"), "T04"),
        (("base_footprint", "Camera_1"), "T04"),
        (("base_link", "base_footprint"), "T05"),
        (("x", "y"), "T06"),
    ],
)
def test_a_further_publisher_that_breaks_the_tree_is_one_finding(
    pair: tuple[str, str], rule_id: str
) -> None:
    assert sites(beside(pair), "05") == [(rule_id, SENDER, None)]
    assert sites(beside(pair), "08") == [(rule_id, SENDER, None)]


def test_a_further_publisher_in_the_graph_of_the_lab_is_found_as_well() -> None:
    stage = m.with_node(m.stage(), sender(f"{PLACE}/more", "odom", "base_link"))
    assert sites(stage) == [("T03", f"{PLACE}/more", None)]


def test_a_further_publisher_that_is_blamed_already_is_silent() -> None:
    stage = m.with_node(m.stage(), sender(f"{PLACE}/more", "odom", "base_link"))
    assert sites(stage, blamed=(f"{PLACE}/more",)) == []


def test_a_further_frame_of_the_tree_is_no_fault() -> None:
    assert sites(beside(("base_link", "imu"), ("imu", "imu_data"))) == []


def test_a_publisher_that_nothing_drives_breaks_nothing() -> None:
    assert sites(beside(("odom", "base_link"), ("x", "y"), driven=False)) == []


def test_one_publisher_of_several_wrong_transforms_is_one_finding() -> None:
    compute = replace(m.role(m.stage(), m.COMPUTE), path="/Graph/tf/compute")
    compute = m.wired(
        m.aimed(compute, PARENT, "/World"),
        "inputs:execIn",
        "/Graph/tf/on_playback_tick.outputs:tick",
    )
    publish = replace(m.role(m.stage(), m.PUBLISH), path="/Graph/tf/publish")
    for port in publish.ports:
        if publish.sources(port):
            out = publish.sources(port)[0].rpartition(".")[2]
            publish = m.wired(publish, port, f"/Graph/tf/compute.{out}")
    tick = m.node("/Graph/tf/on_playback_tick", TICK_TYPE)
    stage = m.stage(m.graph("/Graph/tf", compute, publish, tick))
    assert sites(stage) == [("T03", "/Graph/tf/compute", None)]


def test_the_other_publisher_is_related() -> None:
    (problem,) = problems(beside(("odom", "base_link")))["T03"]
    assert problem.related == (f"{PLACE}/{m.PUBLISH}",)


def test_a_copied_graph_is_left_to_the_rule_of_topics() -> None:
    stage = m.stage(m.graph_of(m.lab().graphs[m.ODOM_TF], "/Graph/copy"))
    (of_topics,) = (rule for rule in rules_of("stage", "Q") if rule.id == "Q01")
    repeated = list(of_topics.check(m.subject(stage, "08")))
    left = m.left_beside((), {"Q01": repeated, **problems(stage, "08")})
    assert left == [("Q01", "/Graph/copy/ros2_publish_odometry", "inputs:topicName")]


# ---- T07 and T08: odom


@pytest.mark.parametrize("parent", ["world", "x", "base_scan"])
@pytest.mark.parametrize("driven", [True, False])
def test_a_parent_of_odom_is_named_even_when_nothing_drives_it(
    parent: str, *, driven: bool
) -> None:
    stage = beside((parent, "odom"), driven=driven)
    assert sites(stage) == [("T07", SENDER, "inputs:parentFrameId")]
    (problem,) = problems(stage)["T07"]
    assert (problem.actual, problem.handout) == (f"{parent} -> odom", "8.11")
    assert ("though nothing triggers it" in problem.message) is not driven


def test_a_parent_of_odom_on_another_topic_is_not_said_to_be_undriven() -> None:
    node = m.valued(sender(SENDER, "world", "odom"), "inputs:topicName", "/debug")
    stage = m.stage(m.graph("/Graph/tf", node, m.node("/Graph/tf/on_playback_tick", TICK_TYPE)))
    (problem,) = problems(stage)["T07"]
    assert "though not on a topic of tf2" in problem.message


@pytest.mark.parametrize(
    ("parent", "port"), [("world", "inputs:parentFrameId"), ("odom", "inputs:childFrameId")]
)
def test_the_publisher_of_the_lab_that_places_odom_is_one_finding(parent: str, port: str) -> None:
    assert sites(raw(parent, "odom"), "08") == [("T07", RAW, port)]


@pytest.mark.parametrize("name", ["TFWorld2Odom", "TFWorld2Odom_01"])
def test_a_node_of_the_forbidden_name_is_named(name: str) -> None:
    stage = beside(("base_link", "imu"), name=name)
    assert sites(stage) == [("T07", f"/Graph/tf/{name}", None)]


def test_a_node_of_the_forbidden_name_that_places_odom_is_one_finding() -> None:
    stage = beside(("world", "odom"), name="TFWorld2Odom")
    assert len(sites(stage, "08")) == 1


def test_a_deactivated_publisher_of_odom_is_a_note() -> None:
    ports = sender("/Graph/tf/old", "world", "odom").ports
    gone = AbsentPrim("/Graph/tf/old", RAW_TYPE, "deactivated", ports)
    named = AbsentPrim("/Graph/tf/TFWorld2Odom", "", "deactivated")
    other = AbsentPrim("/Graph/tf/other", RAW_TYPE, "deactivated")
    over = AbsentPrim("/Graph/tf/over", RAW_TYPE, "an over without a def", ports)
    stage = m.stage(replace(m.graph("/Graph/tf"), absent=(gone, named, other, over)))
    said = problems(stage)["T07"]
    assert [(p.prim, p.severity) for p in said] == [(gone.path, "note"), (named.path, "note")]


def test_a_publisher_of_odom_in_a_deactivated_graph_is_a_note() -> None:
    graph = m.graph("/Graph/tf", sender("/Graph/tf/old", "world", "odom"), active=False)
    assert [p.severity for p in problems(m.stage(graph))["T07"]] == ["note"]


@pytest.mark.parametrize("driven", [True, False])
def test_a_publisher_of_map_to_odom_competes_with_localization(*, driven: bool) -> None:
    stage = beside(("map", "odom"), driven=driven)
    assert sites(stage, "05") == [("T08", SENDER, "inputs:parentFrameId")]
    assert sites(stage, "08") == [("T08", SENDER, "inputs:parentFrameId")]


def test_the_publisher_of_the_lab_that_competes_is_one_finding() -> None:
    assert sites(raw("map", "odom")) == [("T08", RAW, "inputs:parentFrameId")]


@pytest.mark.parametrize(("parent", "rule_id"), [("world", "T07"), ("map", "T08")])
def test_the_publisher_of_the_lab_is_to_be_set_and_not_deleted(parent: str, rule_id: str) -> None:
    (problem,) = problems(raw(parent, "odom"), "08")[rule_id]
    assert problem.expected == "odom -> base_footprint"
    assert str(problem.hint).startswith(
        "set Parent Frame ID to `odom` and Child Frame ID to `base_footprint`"
    )


@pytest.mark.parametrize(("parent", "rule_id"), [("world", "T07"), ("map", "T08")])
def test_a_publisher_beside_that_of_the_lab_is_to_be_deleted(parent: str, rule_id: str) -> None:
    (problem,) = problems(beside((parent, "odom")), "08")[rule_id]
    assert (problem.expected, problem.hint) == ("no such publisher", None)


def test_isaacs_menu_for_odometry_is_found_below_graph() -> None:
    stage = beside(("world", "odom"), ("odom", "base_link"))
    assert sites(stage) == [("T03", f"{SENDER}_01", None), ("T07", SENDER, "inputs:parentFrameId")]


# ---- T09 to T12


@pytest.mark.parametrize("apis", [(BODY,), (BODY, ARTICULATION)])
def test_the_parent_prim_among_the_targets_is_its_own_parent(apis: tuple[str, ...]) -> None:
    stage = m.with_prim(targets(*FRAME_ROLES.values(), m.BASE), m.BASE, apis=apis)
    assert sites(stage) == [("T09", COMPUTE, TARGETS)]
    (problem,) = problems(stage)["T09"]
    assert str(problem.expected).split(", ") == list(FRAME_ROLES.values())
    assert problem.hint is None


def test_the_parent_prim_in_the_place_of_a_target_is_one_finding() -> None:
    stage = every_target(base_scan=m.BASE)
    assert sites(stage) == [("T09", COMPUTE, TARGETS)]
    (problem,) = problems(stage)["T09"]
    assert set(str(problem.expected).split(", ")) == set(FRAME_ROLES.values())
    assert "'base_scan'" in problem.message
    assert str(problem.hint).endswith("and add " + FRAME_ROLES["base_scan"])


def test_the_articulation_root_and_the_camera_lose_all_links() -> None:
    stage = targets(m.BASE, m.CAMERA)
    (problem,) = problems(stage)["T09"]
    assert list(problems(stage)) == ["T09"]
    assert all(f"'{name}'" in problem.message for name in m.LINKS[1:])
    unmet = [item.id for item in frame_requirements(m.subject(stage)) if not item.met]
    assert sorted(unmet) == sorted(f"TF/frame/{child}" for child in m.LINKS[1:])


@pytest.mark.parametrize(
    ("parent", "unmet"), [("base_footprint", []), ("odom", ["TF/frame/base_scan"])]
)
def test_a_frame_hangs_deeper_below_the_frames_that_allow_it_alone(
    parent: str, unmet: list[str]
) -> None:
    subject = m.subject(targets(m.ROBOT, m.CAMERA))
    frames = replace(subject.lab.frames, edges=((parent, "base_scan"),))
    subject = replace(subject, lab=replace(subject.lab, frames=frames))
    found = [item.id for item in frame_requirements(subject) if not item.met]
    assert found == unmet


def rooted(stage: StageModel) -> StageModel:
    """The stage with the articulation root on the robot instead of its base."""
    stage = m.with_prim(stage, m.BASE, apis=(BODY, "IsaacLinkAPI"))
    return m.with_prim(stage, m.ROBOT, apis=("IsaacRobotAPI", ARTICULATION))


def test_an_articulation_root_above_the_parent_prim_gives_it_as_well_a_warning() -> None:
    stage = rooted(targets(m.ROBOT, m.CAMERA))
    assert sites(stage) == [("T09", COMPUTE, TARGETS)]
    assert problems(stage)["T09"][0].severity == "warning"
    assert all(item.met for item in frame_requirements(m.subject(stage)))
    assert sites(rooted(m.stage())) == []


def test_an_articulation_root_alone_above_the_parent_prim_is_one_finding() -> None:
    stage = rooted(targets(m.ROBOT))
    assert sites(stage) == [("T09", COMPUTE, TARGETS)]
    (problem,) = problems(stage)["T09"]
    assert "'Camera_1'" in problem.message
    assert str(problem.expected).split(", ") == list(FRAME_ROLES.values())


def test_a_link_of_a_missing_robot_that_is_parent_and_target_is_its_own_parent() -> None:
    assert sites(bare(targets(*FRAME_ROLES.values(), m.BASE))) == [("T09", COMPUTE, TARGETS)]


@pytest.mark.parametrize(
    ("listed", "expected"),
    [
        ([f"{m.ROBOT}/base_scan/Lidar2D"], ["T01"]),
        ([f"{m.ROBOT}/base_scan", f"{m.ROBOT}/base_scan/Lidar2D"], ["T04"]),
    ],
)
def test_a_target_that_another_node_publishes_in_place_of_its_own_is_one_finding(
    listed: list[str], expected: list[str]
) -> None:
    stage = beside(("base_footprint", "Lidar2D"))
    others = [prim for frame, prim in FRAME_ROLES.items() if frame != "base_scan"]
    compute = m.aimed(m.role(stage, m.COMPUTE), TARGETS, *others, *listed)
    stage = m.with_node(stage, compute)
    found = sites(replace(stage, graphs=(stage.graphs[-1], *stage.graphs[:-1])))
    assert [rule for rule, _, _ in found] == expected


def further(parent: str, *prims: str, **attributes: str) -> StageModel:
    """The complete stage and a further graph with a node that computes and sends frames."""
    home = m.graph_of(m.lab().graphs[m.ODOM_TF], "/Graph/tf")
    kept = {m.COMPUTE, m.PUBLISH, "on_playback_tick"}
    nodes = {node.name: node for node in home.nodes if node.name in kept}
    compute = m.aimed(m.aimed(nodes[m.COMPUTE], PARENT, parent), TARGETS, *prims)
    return m.stage(m.graph("/Graph/tf", *{**nodes, m.COMPUTE: compute}.values(), **attributes))


def test_a_robot_that_is_parent_and_target_of_its_own_links_is_no_frame_of_its_own() -> None:
    assert "T09" not in {rule_id for rule_id, _, _ in sites(further(m.ROBOT, m.ROBOT))}
    assert "T09" in {rule_id for rule_id, _, _ in sites(further("/World", "/World"))}


@pytest.mark.parametrize(
    ("pipeline", "severity"),
    [("pipelineStageSimulation", None), ("pipelineStagePreRender", "warning")],
)
def test_a_frame_that_may_not_be_sent_is_its_own_parent_at_a_warning(
    pipeline: str, severity: str | None
) -> None:
    found = problems(further("/World", "/World", pipelineStage=pipeline))["T09"]
    assert [problem.severity for problem in found] == [severity]


def test_two_target_prims_that_keep_one_name_are_found() -> None:
    """Isaac Sim finds no other name for a prim right below one at the root."""
    stage = targets("/World/base_scan", *FRAME_ROLES.values())
    prims = {**stage.prims, "/World/base_scan": Prim("/World/base_scan", "Xform", ())}
    (problem,) = problems(replace(stage, prims=prims))["T04"]
    assert (problem.prim, problem.severity) == (COMPUTE, None)
    assert "/World/base_scan" in str(problem.actual)


@pytest.mark.parametrize(
    ("pair", "rule"),
    [
        (("/odom", "/base_footprint"), "T04"),
        (("/caster_back_link", "/base_scan"), "T03"),
        (("/map", "/odom"), "T08"),
    ],
)
def test_a_slash_before_the_names_makes_no_other_frames(pair: tuple[str, str], rule: str) -> None:
    found = {rule_id for rule_id, _, _ in sites(beside(pair))}
    assert found == {rule_id for rule_id, _, _ in sites(beside((pair[0][1:], pair[1][1:])))}
    assert rule in found


def test_a_prim_that_is_named_twice_gives_the_same_transform() -> None:
    assert sites(targets(m.ROBOT, *FRAME_ROLES.values())) == []


def test_a_prim_that_is_named_like_the_parent_frame_is_found() -> None:
    override: Mapping[str, Value] = {"isaac:nameOverride": "base_footprint"}
    stage = m.with_prim(targets(*FRAME_ROLES.values(), "/World"), "/World", attributes=override)
    assert sites(stage) == [("T09", COMPUTE, TARGETS)]
    assert problems(stage)["T09"][0].severity is None


def test_a_named_transform_from_a_frame_to_itself_is_found() -> None:
    assert sites(beside(("x", "x"))) == [("T09", SENDER, None)]


def test_the_robot_root_alone_is_a_warning_with_the_camera_in_the_hint() -> None:
    found = problems(targets(m.ROBOT), "08")
    assert list(found) == ["T10"]
    (problem,) = found["T10"]
    assert (problem.prim, problem.property) == (COMPUTE, TARGETS)
    assert m.CAMERA in str(problem.hint)


def test_what_f9_itself_loses_costs_nothing() -> None:
    assert all(item.met for item in frame_requirements(m.subject(targets(m.ROBOT))))
    lost = [
        item.id for item in frame_requirements(m.subject(every_target(Camera_1=""))) if not item.met
    ]
    assert lost == ["TF/frame/Camera_1"]


def test_a_camera_that_is_a_site_of_the_robot_is_published() -> None:
    stage = m.with_prim(targets(m.ROBOT), m.CAMERA, apis=("IsaacSiteAPI",))
    assert sites(stage) == []


def test_the_articulation_root_alone_is_an_error() -> None:
    assert sites(targets(m.BASE)) == [("T09", COMPUTE, TARGETS)]


def test_the_robot_root_without_the_robot_api_is_an_error() -> None:
    stage = m.with_prim(targets(m.ROBOT), m.ROBOT, apis=())
    assert sites(stage) == [("T01", COMPUTE, TARGETS)]


def test_the_robot_root_without_the_robot_api_is_one_error_beside_the_camera() -> None:
    stage = m.with_prim(targets(m.ROBOT, m.CAMERA), m.ROBOT, apis=())
    (problem,) = problems(stage)["T01"]
    assert (problem.prim, problem.property) == (COMPUTE, TARGETS)
    links = {f"{m.ROBOT}/{name}" for name in m.LINKS[1:]}
    assert set(str(problem.expected).split(", ")) == links


@pytest.mark.parametrize("beside", [(), (m.CAMERA,)])
def test_a_robot_whose_link_lacks_the_schema_is_one_error(beside: tuple[str, ...]) -> None:
    stage = m.with_prim(targets(m.ROBOT, *beside), f"{m.ROBOT}/base_scan", apis=(BODY,))
    assert sites(stage) == [("T01", COMPUTE, TARGETS)]
    (problem,) = problems(stage)["T01"]
    assert "IsaacLinkAPI" in problem.message
    assert f"{m.ROBOT}/base_scan" in str(problem.expected)


def test_a_robot_without_any_link_of_the_schema_stands_for_itself() -> None:
    stage = targets(m.ROBOT, m.CAMERA)
    for name in m.LINKS:
        stage = m.with_prim(stage, f"{m.ROBOT}/{name}", apis=(BODY,))
    (problem,) = problems(stage)["T01"]
    assert "gives only its own frame" in problem.message
    assert len(str(problem.expected).split(", ")) == len(m.LINKS) - 1


def test_a_short_list_of_links_loses_none() -> None:
    stage = targets(m.ROBOT, m.CAMERA)
    related = dict(stage.prims[m.ROBOT].relationships)
    related["isaac:physics:robotLinks"] = related["isaac:physics:robotLinks"][:2]
    assert sites(m.with_prim(stage, m.ROBOT, relationships=related)) == []


def with_imu(frame: str) -> StageModel:
    imu = m.node("/Graph/imu/publish", m.IMU_TYPE, frameId=frame)
    imu = m.wired(imu, "inputs:execIn", "/Graph/imu/tick.outputs:tick")
    return m.stage(m.graph("/Graph/imu", imu, m.node("/Graph/imu/tick", TICK_TYPE)))


def test_a_further_publisher_with_a_frame_outside_the_tree_is_a_warning() -> None:
    (problem,) = problems(with_imu("imu_link"))["T11"]
    assert (problem.prim, problem.property) == ("/Graph/imu/publish", "inputs:frameId")
    assert problem.severity == "warning"
    assert sites(with_imu("base_link")) == []


def test_a_frame_id_that_differs_from_the_lab_is_left_to_the_rule_of_settings() -> None:
    stage = m.stage()
    helper = m.role(stage, "ros2_rtx_lidar_helper", "ROS_Lidar2D")
    assert sites(m.with_node(stage, m.valued(helper, "inputs:frameId", "sim_lidar"))) == []


def test_a_frame_id_that_the_lab_asks_for_must_be_in_the_tree() -> None:
    lab = m.lab()
    spec = lab.graphs["ROS_Lidar2D"]
    node = spec.nodes["ros2_rtx_lidar_helper"]
    settings = tuple(
        replace(s, value="laser") if s.port == "inputs:frameId" else s for s in node.settings
    )
    nodes = {**spec.nodes, node.role: replace(node, settings=settings)}
    changed = replace(lab, graphs={**lab.graphs, spec.name: replace(spec, nodes=nodes)})
    stage = m.stage()
    helper = m.valued(m.role(stage, node.role, spec.name), "inputs:frameId", "laser")
    subject = replace(m.subject(m.with_node(stage, helper)), lab=changed)
    (rule,) = (rule for rule in rules_of("frames", "T") if rule.id == "T11")
    found = list(rule.check(tf_views(subject)[0]))
    assert [(p.prim, p.severity) for p in found] == [(helper.path, None)]


def test_frames_that_nobody_can_know_are_a_note_and_end_the_judgement_of_frame_ids() -> None:
    generic = m.node(
        "/Graph/tf/any", m.PUBLISHER_TYPE, topicName="tf", messagePackage="tf2_msgs",
        messageName="TFMessage",
    )  # fmt: skip
    generic = m.wired(generic, "inputs:execIn", "/Graph/imu/tick.outputs:tick")
    stage = with_imu("imu_link")
    stage = replace(stage, graphs=(*stage.graphs, m.graph("/Graph/tf", generic)))
    assert sites(stage) == [("T12", "/Graph/tf/any", None)]
    assert sites(stage, blamed=("/Graph/tf/any",)) == []
    (rule,) = (rule for rule in rules_of("frames", "T") if rule.id == "T12")
    assert rule.severity == "warning"


def test_a_frame_id_is_not_judged_where_a_missing_asset_may_hold_its_frame() -> None:
    stage = with_imu("imu_link")
    stage = m.with_node(stage, m.aimed(m.role(stage, m.COMPUTE), TARGETS, m.ROBOT, m.CAMERA))
    assert [rule_id for rule_id, _, _ in sites(stage)] == ["T11"]
    assert sites(with_camera(bare(stage))) == []


def test_a_frame_name_that_a_node_computes_is_a_warning() -> None:
    product = m.node("/Graph/tf/product", PRODUCT_TYPE)
    computed = m.wired(
        sender(SENDER, "base_link", "x"),
        "inputs:childFrameId",
        f"{product.path}.outputs:renderProductPath",
    )
    tick = m.node("/Graph/tf/on_playback_tick", TICK_TYPE)
    assert sites(m.stage(m.graph("/Graph/tf", computed, product, tick))) == [("T12", SENDER, None)]


# ---- what only may be sent


def perhaps(stage: StageModel) -> StageModel:
    """The stage with an event in /Graph/tf of which nobody knows whether it fires."""
    event = m.node("/Graph/tf/on_playback_tick", "omni.graph.action.OnCustomEvent")
    return m.with_node(stage, replace(event, ports={"outputs:tick": PortState("outputs:tick")}))


@pytest.mark.parametrize(
    ("rule", "pairs"),
    [
        ("T03", [("odom", "base_link")]),
        ("T04", [("odom", "base_footprint")]),
        ("T05", [("base_link", "base_footprint")]),
        ("T06", [("a", "b")]),
        ("T09", [("a", "a")]),
    ],
)
def test_a_transform_that_may_be_sent_is_a_warning(rule: str, pairs: list[tuple[str, str]]) -> None:
    stage = beside(*pairs)
    assert [p.severity for p in problems(stage)[rule]] == [None]
    assert [p.severity for p in problems(perhaps(stage))[rule]] == ["warning"]


def test_a_dead_node_with_its_parent_among_the_targets_sends_nothing() -> None:
    compute = m.node("/Graph/tf/compute", m.role(m.stage(), m.COMPUTE).type_name)
    compute = m.aimed(m.aimed(compute, PARENT, m.CAMERA), TARGETS, m.CAMERA)
    tick = m.node("/Graph/tf/tick", TICK_TYPE)
    assert "T09" not in problems(m.stage(m.graph("/Graph/tf", compute, tick)))
    driven = m.wired(compute, "inputs:execIn", f"{tick.path}.outputs:tick")
    assert "T09" in problems(m.stage(m.graph("/Graph/tf", driven, tick)))


@pytest.mark.parametrize("kind", ["ConstantString", "ConstantToken"])
def test_a_constant_does_not_hide_a_frame(kind: str) -> None:
    constant = m.node("/Graph/tf/name", f"omni.graph.nodes.{kind}", value="odom")
    node = m.wired(
        sender(SENDER, "world", "x"), "inputs:childFrameId", f"{constant.path}.inputs:value"
    )
    tick = m.node("/Graph/tf/on_playback_tick", TICK_TYPE)
    found = sites(m.stage(m.graph("/Graph/tf", node, constant, tick)))
    assert [(rule_id, prim) for rule_id, prim, _ in found] == [("T07", SENDER)]
