"""A stage of no checkpoint is judged by what it shows itself, whatever its robots are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest
from breaking import correct_stage
from dry_runs import BRIEFLY, FIXED, WHOLE, bad, by_name, played
from foreign_robots import (
    add_api,
    arm,
    car,
    connect,
    empty_stage,
    rover,
    truck,
    write_node,
)
from in_process import invoke
from pxr import Gf, Sdf, Usd, UsdGeom
from report_examples import dry_run_of
from robot_kinds import fleet, four_wheels, mobile, rollers

from lab3_usd.errors import UsageError
from lab3_usd.model.dry_run import Behaviour
from lab3_usd.sim.any_stage import _moves
from lab3_usd.sim.execution.recording import Held, Pose, Recording
from lab3_usd.sim.execution.world import world_of
from lab3_usd.sim.judge.expectations import Trial
from lab3_usd.sim.lidar import sweep
from lab3_usd.sim.robots import expected_of, owned_graphs, robots_of, scene_for
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

NOWHERE = "https://nowhere.invalid/thing.usd"
ROBOT, DRIVE = "/World/Rover", "/World/Drive"
MOVED = ["rest", "follows", "odometry", "moving frames", "mounted", "scan", "again"]


def box(stage: Usd.Stage, path: str, at: tuple[float, float, float], size: float) -> None:
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(size)
    cube.AddTranslateOp().Set(Gf.Vec3d(*at))
    add_api(cube.GetPrim(), "PhysicsCollisionAPI")


def walled_rover() -> Usd.Stage:
    """The rover before walls of 2 m, in centimetres: one is 3 m ahead, one 2 m to its left."""
    stage = rover()
    box(stage, "/World/Ahead", (400, 0, 100), 200)
    box(stage, "/World/Left", (0, 300, 100), 200)
    return stage


def test_a_rover_is_judged_by_its_own_topics(tmp_path: Path) -> None:
    found = played(walled_rover(), tmp_path, drive=FIXED)
    assert {name: check.verdict for name, check in by_name(found).items()} == dict.fromkeys(
        ["graphs", "topics", "stamps", "clock", "tree", *MOVED], "ok"
    )
    assert found.verdict == "ok"
    assert [(robot.prim, robot.topic) for robot in found.robots] == [
        (f"{ROBOT}/chassis", "/cmd_vel")
    ]
    assert any("a ground plane is supplied" in remark for remark in found.remarks)


def test_a_tick_with_a_frame_period_comes_less_often(tmp_path: Path) -> None:
    stage = rover()
    set_value(stage, "/World/Odometry/tick.node:type", "omni.graph.action.OnTick")
    tick = stage.GetPrimAtPath("/World/Odometry/tick")
    tick.CreateAttribute("inputs:framePeriod", Sdf.ValueTypeNames.UInt, custom=True).Set(5)
    rates = {topic.name: topic.hz for topic in played(stage, tmp_path).topics}
    assert (round(rates["/odom"]), round(rates["/clock"])) == (10, 60)


@pytest.mark.parametrize("topic", ["tf", "tf_static"])
def test_the_transform_of_a_base_that_is_sent_once_does_not_move(
    tmp_path: Path, topic: str
) -> None:
    stage = rover()
    transform = stage.GetPrimAtPath("/World/Odometry/transform")
    transform.CreateAttribute("inputs:topicName", Sdf.ValueTypeNames.String).Set(topic)
    transform.CreateAttribute("inputs:staticPublisher", Sdf.ValueTypeNames.Bool).Set(True)  # noqa: FBT003 - pxr takes it so
    assert bad(played(stage, tmp_path, drive=FIXED)) == {"moving frames"}


def test_a_render_product_whose_path_is_written_is_played(tmp_path: Path) -> None:
    stage = rover()
    product = stage.DefinePrim("/World/Product", "RenderProduct")
    product.CreateRelationship("camera").SetTargets([f"{ROBOT}/chassis/eye"])
    path = stage.GetAttributeAtPath("/World/Camera/helper.inputs:renderProductPath")
    path.ClearConnections()
    path.Set("/World/Product")
    rates = {topic.name: topic.hz for topic in played(stage, tmp_path).topics}
    assert rates["/rgb"] > 0


def test_what_runs_in_other_stages_of_the_pipeline_is_not_simulated(tmp_path: Path) -> None:
    stage = rover()
    set_value(stage, "/World/Odometry.pipelineStage", "pipelineStagePreRender")
    set_value(stage, "/World/Clock.pipelineStage", "pipelineStageOnDemand")
    write_node(stage, "/World/Clock/step", "core.OnPhysicsStep", {})
    connect(stage, "/World/Clock", "step.step", "clock.execIn")
    found = played(stage, tmp_path)
    unknown = {each.prim for each in found.not_simulated}
    assert unknown == {"/World/Odometry", "/World/Clock/tick"}
    assert bad(found) == set()
    assert by_name(found)["topics"].verdict == "not judged"
    assert found.verdict == "not judged"


def test_what_an_unknown_evaluator_does_is_not_simulated(tmp_path: Path) -> None:
    stage = rover()
    set_value(stage, "/World/Odometry.evaluator:type", "somebody_elses")
    found = played(stage, tmp_path)
    assert [unknown.prim for unknown in found.not_simulated] == ["/World/Odometry"]
    assert bad(found) == set()


def test_images_on_the_topic_of_the_scan_are_no_scans(tmp_path: Path) -> None:
    stage = walled_rover()
    set_value(stage, "/World/Lidar/helper.inputs:topicName", "rgb")
    found = by_name(played(stage, tmp_path))
    assert found["scan"].verdict == "ok"


def test_no_text_speaks_of_a_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "stage.usda"
    rover_stage = rover()
    rover_stage.GetRootLayer().Export(str(path))
    printed = invoke("sim", path, "--page", tmp_path / "sim.html").stdout
    assert "checkpoint" not in printed + (tmp_path / "sim.html").read_text(encoding="utf-8")
    document = dry_run_of(invoke("sim", path, "--format", "json").stdout)
    assert document["robots"] == [{"prim": f"{ROBOT}/chassis", "topic": "/cmd_vel", "domain": 0}]


def set_value(stage: Usd.Stage, port: str, value: object) -> None:
    stage.GetAttributeAtPath(f"{port}").Set(value)


def swap_wheels(stage: Usd.Stage) -> None:
    set_value(stage, f"{DRIVE}/left.inputs:value", "right_wheel_joint")
    set_value(stage, f"{DRIVE}/right.inputs:value", "left_wheel_joint")


def test_swapped_wheels_turn_the_wrong_way(tmp_path: Path) -> None:
    stage = rover()
    swap_wheels(stage)
    found = played(stage, tmp_path)
    assert (bad(found), by_name(found)["follows"].kind) == ({"follows"}, "wrong-turn")


def test_the_order_of_joints_that_have_no_names_is_not_judged(tmp_path: Path) -> None:
    stage = rover()
    stage.GetAttributeAtPath(f"{DRIVE}/move.inputs:jointNames").ClearConnections()
    numbers = stage.GetPrimAtPath(f"{DRIVE}/move").CreateAttribute(
        "inputs:jointIndices", Sdf.ValueTypeNames.IntArray
    )
    numbers.Set([1, 0])
    assert by_name(played(stage, tmp_path))["follows"].verdict == "not judged"


def test_a_controller_that_fails_beside_one_that_moves_the_robot_is_named(tmp_path: Path) -> None:
    stage = rover()
    move = {"targetPrim": ROBOT, "jointNames": ["left_wheel_joint"]}
    write_node(stage, f"{DRIVE}/again", "core.IsaacArticulationController", move)
    for wire in ("tick.tick -> again.execIn", "drive.velocityCommand -> again.velocityCommand"):
        connect(stage, DRIVE, *wire.split(" -> "))
    found = played(stage, tmp_path)
    assert bad(found) == {"graphs"}
    assert by_name(found)["graphs"].prim == f"{DRIVE}/again"


def test_a_radius_that_is_not_that_of_the_wheels_is_said(tmp_path: Path) -> None:
    stage = rover()
    set_value(stage, f"{DRIVE}/drive.inputs:wheelRadius", 8.0)
    found = played(stage, tmp_path, drive=FIXED)
    assert found.verdict == "ok"
    assert any(
        "wheels measure 0.1 m" in remark and "1.25 times" in remark for remark in found.sizes
    )
    set_value(stage, f"{DRIVE}/drive.inputs:wheelRadius", 5.0)
    assert bad(played(stage, tmp_path, drive=FIXED)) == {"follows", "again"}


def in_metres(stage: Usd.Stage) -> None:
    """Let the controller of the rover have metres, though its stage has centimetres."""
    linear = stage.GetAttributeAtPath(f"{DRIVE}/linear.inputs:tuple")
    linear.SetConnections([f"{DRIVE}/twist.outputs:linearVelocity"])
    for name, value in (("wheelRadius", 0.1), ("wheelDistance", 0.4), ("maxLinearSpeed", 1.5)):
        set_value(stage, f"{DRIVE}/drive.inputs:{name}", value)


def slow(stage: Usd.Stage) -> None:
    """Let the rover go 5 cm a second at most."""
    set_value(stage, f"{DRIVE}/drive.inputs:maxLinearSpeed", 5.0)


@pytest.mark.parametrize("change", [in_metres, slow])
def test_the_sizes_of_a_controller_are_in_the_unit_of_its_commands(
    tmp_path: Path, change: Callable[[Usd.Stage], None]
) -> None:
    stage = rover()
    change(stage)
    found = played(stage, tmp_path, drive=FIXED)
    assert bad(found) == set()
    assert not any("wheels measure" in remark for remark in found.sizes)


def test_a_stage_of_the_lab_under_another_name_is_all_right(tmp_path: Path) -> None:
    found = played(correct_stage("05"), tmp_path, drive=FIXED)
    assert (found.verdict, bad(found)) == ("ok", set())


def test_transforms_that_stand_still_do_not_go_with_the_robot(tmp_path: Path) -> None:
    stage = rover()
    stage.GetAttributeAtPath("/World/Odometry/transform.inputs:translation").ClearConnections()
    assert bad(played(stage, tmp_path)) == {"moving frames"}


def test_a_scan_in_the_frame_of_a_wheel_goes_through_walls(tmp_path: Path) -> None:
    stage = walled_rover()
    stage.GetPrimAtPath(f"{ROBOT}/left_wheel").GetAttribute("xformOp:translate").Set((0, 60, 10))
    joint = stage.GetPrimAtPath(f"{ROBOT}/left_wheel_joint")
    joint.GetAttribute("physics:localPos0").Set((0, 60, 0))
    set_value(stage, "/World/Lidar/helper.inputs:frameId", "left_wheel")
    assert "scan" in bad(played(stage, tmp_path))


def test_a_publisher_that_nothing_drives_is_named(tmp_path: Path) -> None:
    stage = rover()
    stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn").ClearConnections()
    found = by_name(played(stage, tmp_path))
    assert (found["topics"].kind, found["topics"].prim) == ("not-executed", "/World/Clock/clock")
    assert "clock" not in found


@pytest.mark.parametrize(
    ("node", "says"),
    [("/World/Odometry/odometry", "sends nothing"), (f"{DRIVE}/twist", "receives nothing")],
)
def test_a_profile_with_a_misspelt_word_opens_nothing(tmp_path: Path, node: str, says: str) -> None:
    stage = rover()
    profile = (
        '{"history": "keepLast", "depth": 10, "reliability": "relyable", "durability": "volatile",'
        '"deadline": 0.0, "lifespan": 0.0, "liveliness": "automatic", "leaseDuration": 0.0}'
    )
    port = stage.GetPrimAtPath(node).CreateAttribute("inputs:qosProfile", Sdf.ValueTypeNames.String)
    port.Set(profile)
    check = by_name(played(stage, tmp_path))["topics"]
    assert (check.verdict, check.message) == ("bad", f"{node} {says}")
    assert (check.prim, check.kind) == (node, "invalid-qos-profile")


def test_a_stamp_that_stands_still_is_wrong(tmp_path: Path) -> None:
    stage = rover()
    stamp = stage.GetAttributeAtPath("/World/Odometry/odometry.inputs:timeStamp")
    stamp.SetConnections(["/World/Odometry/tick.outputs:deltaSeconds"])
    check = by_name(played(stage, tmp_path))["stamps"]
    assert (check.verdict, check.kind) == ("bad", "stamp-not-advancing")
    assert check.text.endswith("stamps of /odom do not advance: 0.02 s")
    assert check.prim == "/World/Odometry/odometry"


def test_odometry_that_is_computed_twice_in_an_update_has_each_stamp_twice(tmp_path: Path) -> None:
    stage = rover()
    write_node(stage, "/World/Odometry/again", "action.OnTick", {})
    start = stage.GetAttributeAtPath("/World/Odometry/compute.inputs:execIn")
    start.AddConnection("/World/Odometry/again.outputs:tick")
    check = by_name(played(stage, tmp_path))["stamps"]
    assert (check.verdict, check.prim) == ("bad", "/World/Odometry/odometry")


def test_a_robot_whose_articulation_root_is_a_wheel_drives_the_same(tmp_path: Path) -> None:
    stage = walled_rover()
    stage.GetPrimAtPath(f"{ROBOT}/chassis").RemoveAppliedSchema("PhysicsArticulationRootAPI")
    add_api(stage.GetPrimAtPath(f"{ROBOT}/left_wheel"), "PhysicsArticulationRootAPI")
    found = by_name(played(stage, tmp_path, drive=FIXED))
    assert {found[name].verdict for name in MOVED} == {"ok"}


def test_an_inertial_message_without_what_it_measures_is_wrong(tmp_path: Path) -> None:
    stage = arm()
    velocity = stage.GetAttributeAtPath("/ActionGraph/publish_imu.inputs:angularVelocity")
    velocity.ClearConnections()
    check = by_name(played(stage, tmp_path))["graphs"]
    assert (check.verdict, check.prim) == ("bad", "/ActionGraph/publish_imu")
    assert "angularVelocity" in check.text


@pytest.mark.parametrize(("output", "verdict"), [("frame", "bad"), ("time", "ok")])
def test_a_clock_counts_seconds(tmp_path: Path, output: str, verdict: str) -> None:
    stage = rover()
    stamp = stage.GetAttributeAtPath("/World/Clock/clock.inputs:timeStamp")
    stamp.SetConnections([f"/World/Clock/tick.outputs:{output}"])
    assert by_name(played(stage, tmp_path))["clock"].verdict == verdict


@pytest.mark.parametrize(("output", "verdict"), [("once", "bad"), ("after", "ok")])
def test_a_single_signal_only_opens_a_topic(tmp_path: Path, output: str, verdict: str) -> None:
    stage, graph = rover(), "/World/Clock"
    stage.GetAttributeAtPath(f"{graph}/clock.inputs:execIn").ClearConnections()
    write_node(stage, f"{graph}/first", "action.Once", {})
    connect(stage, graph, "tick.tick", "first.execIn")
    connect(stage, graph, f"first.{output}", "clock.execIn")
    assert by_name(played(stage, tmp_path))["topics"].verdict == verdict


def test_two_nodes_that_publish_one_topic_are_a_fault(tmp_path: Path) -> None:
    stage = rover()
    nodes = "/World/Odometry/odometry", "/World/Odometry/copy"
    Sdf.CopySpec(stage.GetRootLayer(), nodes[0], stage.GetRootLayer(), nodes[1])
    check = by_name(played(stage, tmp_path))["topics"]
    assert (check.verdict, check.kind) == ("bad", "duplicate-publisher")
    assert check.text == "2 nodes publish /odom"


def test_stamps_may_be_those_of_another_clock(tmp_path: Path) -> None:
    stage = rover()
    write_node(stage, "/World/Odometry/system", "core.IsaacReadSystemTime", {})
    stamp = stage.GetAttributeAtPath("/World/Odometry/odometry.inputs:timeStamp")
    stamp.SetConnections(["/World/Odometry/system.outputs:systemTime"])
    assert by_name(played(stage, tmp_path))["stamps"].verdict == "ok"


def test_rules_are_those_of_lint(tmp_path: Path) -> None:
    stage = rover()
    stage.GetPrimAtPath("/World/Odometry/frames").GetRelationship("inputs:parentPrim").ClearTargets(
        removeSpec=True
    )
    file, page = tmp_path / "rover.usda", tmp_path / "page.html"
    stage.GetRootLayer().Export(str(file))
    said = invoke("sim", file, "--drive", BRIEFLY, "--page", page).output
    assert "(lab3 rule K53)" in said
    assert set(re.findall(r"rule ([A-Z]+)[0-9]+", said + page.read_text("utf-8"))) == {"K"}
    assert "this lab" not in page.read_text("utf-8")


def test_robots_in_two_domains_are_each_driven_by_their_own_commands(tmp_path: Path) -> None:
    rover_file = tmp_path / "rover.usda"
    single = rover()
    single.SetDefaultPrim(single.GetPrimAtPath("/World"))
    single.GetRootLayer().Export(str(rover_file))
    stage = empty_stage("Z", 0.01)
    for number, name in enumerate(("A", "B")):
        placed = UsdGeom.Xform.Define(stage, f"/{name}")
        placed.GetPrim().GetReferences().AddReference(str(rover_file))
        placed.AddTranslateOp().Set(Gf.Vec3d(0, 500 * number, 0))
    for prim in stage.Traverse():
        if prim.GetName() == "context" and prim.GetPath().HasPrefix("/B"):
            prim.CreateAttribute("inputs:domain_id", Sdf.ValueTypeNames.UChar).Set(5)
            prim.CreateAttribute("inputs:useDomainIDEnvVar", Sdf.ValueTypeNames.Bool).Set(False)  # noqa: FBT003
    found = played(stage, tmp_path)
    assert [(robot.prim, robot.domain) for robot in found.robots] == [
        ("/A/Rover/chassis", 0),
        ("/B/Rover/chassis", 5),
    ]
    assert bad(found) == set()
    follows = [check for check in found.checks if check.name == "follows"]
    assert [(check.of, check.verdict) for check in follows] == [
        ("/A/Rover/chassis", "ok"),
        ("/B/Rover/chassis", "ok"),
    ]
    assert {topic.domain for topic in found.topics if topic.name == "/odom"} == {0, 5}
    set_value(stage, "/B/Drive/left.inputs:value", "right_wheel_joint")
    set_value(stage, "/B/Drive/right.inputs:value", "left_wheel_joint")
    wrong = [check.of for check in played(stage, tmp_path).checks if check.verdict == "bad"]
    assert wrong == ["/B/Rover/chassis"]


def two_rovers() -> Usd.Stage:
    """The rover, and another beside it with a drive of its own and no transforms."""
    stage = rover()
    layer = stage.GetRootLayer()
    for path in (ROBOT, DRIVE):
        Sdf.CopySpec(layer, path, layer, f"{path}2")
    moved = stage.GetPrimAtPath(f"{DRIVE}2/move").GetRelationship("inputs:targetPrim")
    moved.SetTargets([f"{ROBOT}2"])
    set_value(stage, f"{DRIVE}2/twist.inputs:topicName", "other/cmd_vel")
    placed = UsdGeom.Xformable(stage.GetPrimAtPath(f"{ROBOT}2"))
    placed.AddTranslateOp().Set(Gf.Vec3d(0, 200, 0))
    return stage


def frames_of(found: Behaviour) -> dict[str, str]:
    return {check.of: check.verdict for check in found.checks if check.name == "moving frames"}


def test_the_transforms_of_one_robot_are_not_held_against_another(tmp_path: Path) -> None:
    stage = two_rovers()
    found = played(stage, tmp_path)
    assert [robot.prim for robot in found.robots] == [f"{ROBOT}/chassis", f"{ROBOT}2/chassis"]
    assert bad(found) == set()
    assert frames_of(found) == {f"{ROBOT}/chassis": "ok"}


def test_of_several_robots_one_is_held_against_its_transforms(tmp_path: Path) -> None:
    stage = two_rovers()
    transform = stage.GetPrimAtPath("/World/Odometry/transform")
    for port in ("translation", "rotation"):
        transform.GetAttribute(f"inputs:{port}").ClearConnections()
    found = played(stage, tmp_path)
    assert frames_of(found) == {f"{ROBOT}/chassis": "bad"}


def two_drives(*, domain: int = 0) -> Usd.Stage:
    """The rover, and a copy of its drive that listens to another topic, or in another domain."""
    stage = rover()
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, DRIVE, layer, f"{DRIVE}2")
    if domain:
        context = stage.GetPrimAtPath(f"{DRIVE}2/context")
        context.CreateAttribute("inputs:domain_id", Sdf.ValueTypeNames.UChar).Set(domain)
        context.CreateAttribute("inputs:useDomainIDEnvVar", Sdf.ValueTypeNames.Bool).Set(False)  # noqa: FBT003
    else:
        set_value(stage, f"{DRIVE}2/twist.inputs:topicName", "joy_vel")
    return stage


@pytest.mark.parametrize(
    ("domain", "other"), [(0, "/joy_vel in domain 0"), (5, "/cmd_vel in domain 5")]
)
def test_two_graphs_that_drive_one_robot_are_a_fault_of_the_stage(
    tmp_path: Path, domain: int, other: str
) -> None:
    found = played(two_drives(domain=domain), tmp_path)
    check = by_name(found)["commands"]
    assert (check.verdict, check.kind) == ("bad", "several-commands")
    assert f"{DRIVE}/twist (/cmd_vel in domain 0)" in check.message
    assert f"{DRIVE}2/twist ({other})" in check.message
    # everything else is judged
    judged = {check.name for check in found.checks if check.verdict == "ok"}
    assert {"graphs", "topics", "stamps", "clock"} <= judged
    assert len({(robot.topic, robot.domain) for robot in found.robots}) == 2


def test_a_topic_that_moves_no_robot_is_no_topic_of_commands(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="moves no robot"):
        played(two_drives(), tmp_path, "/nowhere")
    found = played(two_drives(), tmp_path, "/cmd_vel")
    assert [robot.topic for robot in found.robots] == ["/cmd_vel"]
    assert by_name(found)["commands"].verdict == "bad"


def test_a_robot_that_drives_by_one_topic_and_turns_by_another_follows_neither(
    tmp_path: Path,
) -> None:
    stage = rover()
    for name, node in (("joystick", "ros.ROS2SubscribeTwist"), ("turning", "nodes.BreakVector3")):
        write_node(stage, f"{DRIVE}/{name}", node, {})
    topic = stage.GetPrimAtPath(f"{DRIVE}/joystick").CreateAttribute(
        "inputs:topicName", Sdf.ValueTypeNames.String
    )
    topic.Set("joy_vel")
    for port, source, kind in (
        ("joystick.inputs:execIn", "tick.outputs:tick", Sdf.ValueTypeNames.UInt),
        ("turning.inputs:tuple", "joystick.outputs:angularVelocity", Sdf.ValueTypeNames.Vector3d),
    ):
        name, _, attribute = port.partition(".")
        made = stage.GetPrimAtPath(f"{DRIVE}/{name}").CreateAttribute(attribute, kind)
        made.AddConnection(f"{DRIVE}/{source}")
    stage.GetAttributeAtPath(f"{DRIVE}/drive.inputs:angularVelocity").SetConnections(
        [f"{DRIVE}/turning.outputs:z"]
    )
    found = played(stage, tmp_path)
    follows = {check.of: check.text for check in found.checks if check.name == "follows"}
    assert "degrees left, turned 0.0" in follows[f"{ROBOT}/chassis on /cmd_vel"]
    assert "commanded to go 0.09 m, went 0.00" in follows[f"{ROBOT}/chassis on /joy_vel"]


def test_a_stage_of_nothing_is_not_judged(tmp_path: Path) -> None:
    found = played(empty_stage("Z", 1.0), tmp_path)
    assert (found.verdict, found.checks) == ("not judged", ())


def test_a_stage_that_nobody_is_to_drive_has_the_verdict_of_what_it_shows(tmp_path: Path) -> None:
    stage = rover()
    stage.RemovePrim(DRIVE)
    found = played(stage, tmp_path)
    assert (found.verdict, found.missing, bad(found)) == ("ok", "", set())
    assert any("no ROS command reaches" in remark for remark in found.remarks)
    for name in ("Rover", "Odometry", "Lidar", "Camera"):
        stage.RemovePrim(f"/World/{name}")
    assert any("no robot was found" in remark for remark in played(stage, tmp_path).remarks)


def test_commands_that_reach_no_joint_are_not_all_right(tmp_path: Path) -> None:
    stage = rover()
    stage.RemovePrim(f"{DRIVE}/move")
    found = played(stage, tmp_path)
    assert found.verdict != "ok"
    assert "no ROS command reaches" in found.missing


def warehouse() -> Usd.Stage:
    """The rover in a warehouse of which the floor, the racks and a chair cannot be found."""
    stage = walled_rover()
    for name in ("Floor", "Racks", "Chair"):
        stage.DefinePrim(f"/World/{name}", "Xform").GetReferences().AddReference(NOWHERE)
    return stage


def test_missing_assets_silence_only_what_depends_on_them(tmp_path: Path) -> None:
    stage = warehouse()
    found = played(stage, tmp_path)
    assert (found.verdict, len(found.not_simulated)) == ("ok", 3)
    swap_wheels(stage)
    assert bad(played(stage, tmp_path)) == {"follows"}


def test_each_layer_that_is_missing_is_named(tmp_path: Path) -> None:
    path = tmp_path / "scene.usda"
    path.write_text('#usda 1.0\n(subLayers = [@./robot.usda@, @./hall.usda@])\ndef Xform "A" {}\n')
    shown = " ".join(invoke("sim", path).output.split())
    assert "./hall.usda, ./robot.usda cannot be found" in shown


def test_a_robot_of_an_asset_that_is_missing_is_not_judged(tmp_path: Path) -> None:
    stage = warehouse()
    for name in stage.GetPrimAtPath(ROBOT).GetChildrenNames():
        stage.RemovePrim(f"{ROBOT}/{name}")
    stage.GetPrimAtPath(ROBOT).GetReferences().AddReference(NOWHERE)
    found = played(stage, tmp_path)
    assert (found.verdict, bad(found)) == ("not judged", set())


def test_four_wheels_drive(tmp_path: Path) -> None:
    stage = four_wheels()
    found = played(stage, tmp_path, drive=FIXED, longest=WHOLE)
    assert found.verdict == "ok"
    assert any("slide in a turn" in remark for remark in found.remarks)
    ahead = next(leg for leg in found.legs if leg.name == "ahead")
    assert ahead.driven[0] == pytest.approx(0.3, rel=0.03)
    names = stage.GetAttributeAtPath("/World/Drive/rear.inputs:jointNames")
    names.Set(["rear_left_joint", "missing_joint"])
    found = played(stage, tmp_path)
    assert by_name(found)["follows"].verdict == "bad"


def test_a_car_goes_along_the_arc_that_it_is_steered_to(tmp_path: Path) -> None:
    found = played(car(), tmp_path, drive=FIXED, longest=WHOLE)
    assert (found.verdict, bad(found)) == ("ok", set())
    arc = next(leg for leg in found.legs if leg.name == "arc")
    # v tan(0.3) / 0.6 m for 4 s at 0.15 m/s
    assert arc.driven[1] == pytest.approx(math.degrees(0.6 * math.tan(0.3) / 0.6), rel=0.03)


def with_y_up(stage: Usd.Stage) -> Usd.Stage:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    return stage


@pytest.mark.parametrize("robot", [truck, lambda: with_y_up(car())], ids=["truck", "car"])
def test_with_y_up_no_drive_is_judged_and_this_is_said(
    robot: Callable[[], Usd.Stage], tmp_path: Path
) -> None:
    found = played(robot(), tmp_path)
    assert (found.verdict, bad(found)) == ("not judged", set())
    why = "not simulated: robots drive with Z up only, and the stage has Y up"
    assert {by_name(found)[name].text for name in ("rest", "follows", "again")} == {why}
    assert found.missing == why


def test_with_y_up_joints_are_judged(tmp_path: Path) -> None:
    found = played(with_y_up(arm()), tmp_path)
    assert (found.verdict, by_name(found)["joints"].verdict) == ("ok", "ok")
    assert not found.not_simulated


def test_a_truck_is_driven_in_its_domain(tmp_path: Path) -> None:
    found = played(truck(), tmp_path)
    assert ("/drive", 7) in {(robot.topic, robot.domain) for robot in found.robots}


def test_a_car_whose_axles_are_further_apart_than_told_turns_less(tmp_path: Path) -> None:
    stage = car()
    set_value(stage, "/World/Drive/ackermann.inputs:wheelBase", 0.3)
    assert by_name(played(stage, tmp_path))["follows"].kind == "wrong-arc"


@pytest.mark.parametrize(
    ("node", "names"),
    [
        ("steer", ("front_right_steer", "front_left_steer")),
        (
            "roll",
            [f"{end}_joint" for end in ("front_right", "front_left", "rear_right", "rear_left")],
        ),
    ],
)
def test_wheels_of_a_car_that_are_exchanged_are_wrong(
    tmp_path: Path, node: str, names: Sequence[str]
) -> None:
    stage = car()
    stage.GetAttributeAtPath(f"/World/Drive/{node}.inputs:jointNames").Set(list(names))
    assert by_name(played(stage, tmp_path))["follows"].kind == "wrong-arc"


def test_wheels_of_a_car_that_are_steered_by_one_angle_are_not_exchanged(tmp_path: Path) -> None:
    stage = car()
    set_value(stage, "/World/Drive/ackermann.inputs:trackWidth", 0.0)
    assert "two points" not in by_name(played(stage, tmp_path))["follows"].message


def test_a_car_that_is_steered_the_other_way_is_wrong(tmp_path: Path) -> None:
    stage = car()
    stage.GetPrimAtPath("/World/Drive/ackermann").CreateAttribute(
        "inputs:invertSteering", Sdf.ValueTypeNames.Bool
    ).Set(True)  # noqa: FBT003
    assert by_name(played(stage, tmp_path))["follows"].verdict == "bad"


def test_a_car_gets_going_and_stops_as_its_acceleration_lets_it(tmp_path: Path) -> None:
    stage = car()
    controller = stage.GetPrimAtPath("/World/Drive/ackermann")
    number = Sdf.ValueTypeNames.Double
    controller.CreateAttribute("inputs:acceleration", number).Set(0.5)
    step = controller.CreateAttribute("inputs:dt", number)
    step.AddConnection("/World/Drive/tick.outputs:deltaSeconds")
    checks = by_name(played(stage, tmp_path, drive=FIXED, longest=WHOLE))
    found = {name: checks[name].verdict for name in ("rest", "follows", "again")}
    assert set(found.values()) == {"ok"}, found


def test_a_graph_aims_at_the_only_prim_that_refers_to_it(tmp_path: Path) -> None:
    stage = rover()
    aim = stage.GetRelationshipAtPath("/World/Camera/product.inputs:cameraPrim")
    aim.SetTargets(["/World/Camera/product/_OMNI_GRAPH_TARGET"])
    assert by_name(played(stage, tmp_path))["topics"].verdict == "bad"
    eye = stage.GetPrimAtPath("/World/Rover/chassis/eye")
    eye.CreateRelationship("omniGraphs").SetTargets(["/World/Camera"])
    assert by_name(played(stage, tmp_path))["topics"].verdict == "ok"


def test_a_robot_on_rollers_goes_to_any_side(tmp_path: Path) -> None:
    found = played(rollers(), tmp_path)
    assert (by_name(found)["follows"].message, found.verdict) == ("", "ok")
    assert any("gives 0.35 m and 2.2 rad for each metre" in remark for remark in found.remarks)
    stage = rollers()
    names = stage.GetAttributeAtPath("/World/Drive/move.inputs:jointNames")
    names.ClearConnections()
    ends = ("front_right", "front_left", "rear_left", "rear_right")  # two are swapped
    names.Set([f"{end}_joint" for end in ends])
    assert by_name(played(stage, tmp_path))["follows"].verdict == "bad"


def test_a_robot_on_rollers_goes_as_far_as_the_wheels_of_its_controller(tmp_path: Path) -> None:
    stage = rollers()
    radius = stage.GetAttributeAtPath("/World/Drive/holonomic.inputs:wheelRadius")
    radius.ClearConnections()
    radius.Set([0.05] * 4)
    check = by_name(played(stage, tmp_path, drive=FIXED, longest=WHOLE))["follows"]
    assert (check.verdict, check.kind) == ("bad", "wrong-distance")
    assert "went 0.21 m ahead" in check.message
    assert "would do 0.11 m" in check.message


def test_a_turn_to_the_right_for_one_to_the_left_is_wrong(tmp_path: Path) -> None:
    stage = rollers()
    set_value(stage, "/World/Drive/holonomic.inputs:angularGain", 1.0)
    assert by_name(played(stage, tmp_path))["follows"].kind == "wrong-turn"


def test_a_turn_of_many_times_what_is_commanded_is_not_judged(tmp_path: Path) -> None:
    stage = rollers()
    set_value(stage, "/World/Drive/holonomic.inputs:angularGain", -10.0)
    assert by_name(played(stage, tmp_path))["follows"].verdict == "not judged"


@pytest.mark.parametrize("limit", ["maxWheelSpeed", "maxLinearSpeed"])
def test_a_limit_of_0_keeps_a_robot_on_rollers_where_it_is(tmp_path: Path, limit: str) -> None:
    stage = rollers()
    port = stage.GetPrimAtPath("/World/Drive/holonomic").CreateAttribute(
        f"inputs:{limit}", Sdf.ValueTypeNames.Float
    )
    port.Set(0.0)
    check = by_name(played(stage, tmp_path))["follows"]
    assert (check.verdict, check.prim) == ("bad", "/World/Drive/holonomic")
    assert f"its {limit} is 0" in check.cause


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("semantic_segmentation", "sensor_msgs/msg/Image"),
        ("bbox_2d_tight", "vision_msgs/msg/Detection2DArray"),
        ("bbox_3d", "vision_msgs/msg/Detection3DArray"),
    ],
)
def test_what_a_camera_cannot_show_here_is_a_row_and_no_fault(
    tmp_path: Path, kind: str, message: str
) -> None:
    stage = rover()
    helper = stage.GetPrimAtPath("/World/Camera/helper")
    helper.CreateAttribute("inputs:type", Sdf.ValueTypeNames.Token).Set(kind)
    found = played(stage, tmp_path)
    assert bad(found) == set()
    assert message in {topic.type for topic in found.topics}
    assert f"what camera type {kind} shows" in {each.reason for each in found.not_simulated}


def on_physics_steps(stage: Usd.Stage, rate: int) -> None:
    """Let the clock of the rover run at each physics step."""
    stage.GetPrimAtPath("/World/physicsScene").CreateAttribute(
        "physxScene:timeStepsPerSecond", Sdf.ValueTypeNames.UInt
    ).Set(rate)
    graph = stage.GetPrimAtPath("/World/Clock")
    graph.GetAttribute("pipelineStage").Set("pipelineStageOnDemand")
    write_node(stage, "/World/Clock/step", "core.OnPhysicsStep", {})
    signal = stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn")
    signal.SetConnections(["/World/Clock/step.outputs:step"])


@pytest.mark.parametrize("rate", [60, 240, 30])
def test_a_graph_on_physics_steps_runs_at_each(tmp_path: Path, rate: int) -> None:
    stage = rover()
    on_physics_steps(stage, rate)
    found = played(stage, tmp_path)
    clock = next(topic for topic in found.topics if topic.name == "/clock")
    assert clock.hz == pytest.approx(rate, rel=0.02)
    assert bad(found) == set()


def test_a_profile_from_a_node_is_that_of_the_publisher(tmp_path: Path) -> None:
    stage = rover()
    write_node(stage, "/World/Odometry/qos", "ros.ROS2QoSProfile", {"createProfile": "Sensor Data"})
    odometry = stage.GetPrimAtPath("/World/Odometry/odometry")
    port = odometry.CreateAttribute("inputs:qosProfile", Sdf.ValueTypeNames.String)
    port.SetConnections(["/World/Odometry/qos.outputs:qosProfile"])
    found = played(stage, tmp_path)
    assert (bad(found), found.not_simulated) == (set(), ())
    assert "/odom" in {topic.name for topic in found.topics}


def gated(step: int, wires: Mapping[str, str]) -> Usd.Stage:
    """The rover, with a gate in its graph of odometry that lets one of so many signals through."""
    stage = rover()
    write_node(stage, "/World/Odometry/gate", "core.IsaacSimulationGate", {"step": step})
    for name, source in wires.items():
        prim = stage.GetPrimAtPath(f"/World/Odometry/{name}")
        made = prim.CreateAttribute("inputs:execIn", Sdf.ValueTypeNames.UInt)
        made.SetConnections([f"/World/Odometry/{source}"])
    return stage


def test_odometry_and_its_transform_may_come_less_often(tmp_path: Path) -> None:
    out = "gate.outputs:execOut"
    wires = {"gate": "compute.outputs:execOut", "odometry": out, "transform": out}
    found = played(gated(6, wires), tmp_path)
    odometry = next(topic for topic in found.topics if topic.name == "/odom")
    assert (odometry.hz, bad(found)) == (pytest.approx(10, rel=0.05), set())


def test_the_transforms_of_links_may_come_less_often_than_others(tmp_path: Path) -> None:
    wires = {"gate": "tick.outputs:tick", "frames": "gate.outputs:execOut"}
    found = played(gated(40, wires), tmp_path, drive="0.15,0,2.1")
    assert bad(found) == set()


def test_rays_are_followed_only_for_scans_that_are_looked_at(tmp_path: Path) -> None:
    sweep.cache_clear()
    found = played(walled_rover(), tmp_path)
    scans = next(topic for topic in found.topics if topic.name == "/scan")
    assert scans.hz > 0
    assert by_name(found)["scan"].verdict == "ok"
    assert sweep.cache_info().misses <= 2  # of one scan, and of what TF lets expect


def test_the_play_of_a_robot_is_without_the_graphs_of_others(tmp_path: Path) -> None:
    stage = two_rovers()
    stage.GetRootLayer().Export(str(tmp_path / "two.usda"))
    scene = read_scene(Usd.Stage.Open(str(tmp_path / "two.usda")), load_platform())
    platform = load_platform()
    robots = robots_of(scene, platform)
    shown = [scene_for(each, owned_graphs(robots, scene), scene, platform) for each in robots]
    kept = [{graph.path for graph in scene.graphs} for scene in shown]
    assert kept[0] >= {DRIVE, "/World/Odometry", "/World/Lidar"}
    assert f"{DRIVE}2" not in kept[0]
    assert kept[1] == {f"{DRIVE}2"}


def test_a_robot_at_rest_moves_once_it_is_commanded() -> None:
    world = world_of(read_scene(rover(), load_platform()), load_platform(), has_ground=True)
    machine = world.machines.member[f"{ROBOT}/chassis"]
    for _ in range(3):
        world.machines.step(1 / 60)
    assert machine.is_at_rest
    machine.joints["left_wheel_joint"].target_velocity = 1.0
    world.machines.wake(machine)
    world.machines.step(1 / 60)
    assert machine.yaw != 0.0


def test_plays_of_robots_start_where_the_robots_stand(tmp_path: Path) -> None:
    found = played(fleet(3), tmp_path)
    assert (len(found.robots), bad(found)) == (3, set())
    (driven,) = {leg.driven for leg in found.legs if leg.name.endswith("ahead")}
    assert driven == pytest.approx((0.09, 0.0), rel=0.05)


def test_what_is_known_of_one_of_several_robots_has_its_name(tmp_path: Path) -> None:
    stage = fleet(2)
    set_value(stage, "/World/robot_1_ROS/drive.inputs:wheelRadius", 0.05)
    (size,) = played(stage, tmp_path).sizes
    assert size.startswith("/World/robot_1/base: the wheels measure 0.1 m")


def test_what_a_robot_publishes_is_its_own(tmp_path: Path) -> None:
    stage = two_rovers()
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, "/World/Odometry", layer, "/World/Odometry2")
    for name in ("odometry", "transform", "tree", "joints"):
        prim = stage.GetPrimAtPath(f"/World/Odometry2/{name}")
        if prim:
            kind = Sdf.ValueTypeNames.String
            prim.CreateAttribute("inputs:nodeNamespace", kind).Set("other")
    found = by_name(played(stage, tmp_path))["topics"]
    assert (found.verdict, found.kind) == ("bad", "wrong-topic")
    assert (
        f"/other/odom shows {ROBOT}/chassis, which is not part of {ROBOT}2/chassis" in found.message
    )
    for prim in stage.GetPrimAtPath("/World/Odometry2").GetChildren():
        for target in prim.GetRelationships():
            paths = [str(path).replace(ROBOT, f"{ROBOT}2") for path in target.GetTargets()]
            target.SetTargets(paths)
    assert by_name(played(stage, tmp_path))["topics"].verdict == "ok"


def test_a_clock_in_a_namespace_is_none(tmp_path: Path) -> None:
    stage = rover()
    node = stage.GetPrimAtPath("/World/Clock/clock")
    node.CreateAttribute("inputs:nodeNamespace", Sdf.ValueTypeNames.String).Set("alpha")
    check = by_name(played(stage, tmp_path))["clock"]
    assert (check.verdict, check.kind, check.prim) == ("bad", "wrong-topic", "/World/Clock/clock")
    assert "the clock is on /alpha/clock" in check.message


def test_a_wheel_whose_angle_is_missing_gets_no_command(tmp_path: Path) -> None:
    stage = rollers()
    joint = stage.GetPrimAtPath("/World/Mecanum/rear_left_joint")
    for part in ("angle", "radius"):
        joint.RemoveProperty(f"isaacmecanumwheel:{part}")
    check = by_name(played(stage, tmp_path))["follows"]
    assert (check.verdict, check.prim) == ("bad", str(joint.GetPath()))
    assert "no command reaches rear_left_joint" in check.message


def test_a_robot_is_not_at_fault_for_where_another_one_listens(tmp_path: Path) -> None:
    stage = two_rovers()
    swap_wheels(stage)
    found = played(stage, tmp_path)
    (check,) = (check for check in found.checks if check.name == "follows" and check.message)
    assert (check.kind, check.of) == ("wrong-turn", f"{ROBOT}/chassis")
    assert not check.prim.startswith(f"{DRIVE}2/")


def test_a_helper_that_is_switched_off_is_no_fault(tmp_path: Path) -> None:
    stage = rover()
    helper = stage.GetPrimAtPath("/World/Lidar/helper")
    helper.CreateAttribute("inputs:enabled", Sdf.ValueTypeNames.Bool).Set(False)  # noqa: FBT003
    assert bad(played(stage, tmp_path)) == set()


@pytest.mark.parametrize(
    ("switches", "verdict"),
    [((True, True), "ok"), ((False, False), "ok"), ((True, False), "bad")],
)
def test_an_image_and_its_camera_info_have_one_clock(
    tmp_path: Path, switches: tuple[bool, bool], verdict: str
) -> None:
    stage = mobile()
    for name, is_system in zip(("image", "info"), switches, strict=True):
        node = stage.GetPrimAtPath(f"/World/ROS/{name}")
        port = node.CreateAttribute("inputs:useSystemTime", Sdf.ValueTypeNames.Bool)
        port.Set(is_system)
    camera = by_name(played(stage, tmp_path))["camera"]
    assert camera.verdict == verdict


@pytest.mark.parametrize(("ends_at", "moves"), [(0.7855001, False), (0.7875, True)])
def test_noise_in_the_position_of_a_joint_is_no_motion(ends_at: float, *, moves: bool) -> None:
    held = [Held(0, at, {}, {"hinge": at}, {}, {}) for at in (0.7854999, ends_at)]
    recording = Recording(path=[Pose(0, 0.0, "idle", 0.0, 0.0, 0.0)], held=held)
    assert _moves(Trial(recording, (), expected_of(None))) is moves
