"""Joints and their states, against cases worked out by hand from the source named at each node."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from dry_runs import FIXED, WHOLE, bad, by_name, played
from foreign_robots import (
    CONTEXT,
    TICK,
    arm,
    body,
    empty_stage,
    revolute,
    rover,
    write_graph,
)
from in_process import invoke
from lone_nodes import node
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from lab3_usd.physics.machine import Machine
from lab3_usd.sim.execution.recording import JointStates
from lab3_usd.sim.execution.world import RosEndpoint, World, world_of
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

SENSORS, ROS = "isaacsim.sensors.physics.", "isaacsim.ros2.bridge."
CORE = "isaacsim.core.nodes."
NAMES = ("shoulder_joint", "elbow_joint", "tool_joint")


@pytest.fixture
def stage() -> World:
    return world_of(read_scene(arm(), load_platform()), load_platform())


def machine_of(world: World, path: str = "/arm") -> Machine:
    machine = world.machines.articulation(path)
    assert machine is not None
    return machine


def bent(world: World, **positions: float) -> Machine:
    """Turn joints by hand."""
    machine = machine_of(world)
    for name, position in positions.items():
        machine.joints[f"{name}_joint"].position = position
    world.machines.step(0.0)
    return machine


def test_links_go_with_the_joints_above_them(stage: World) -> None:
    # all axes are Z through the common origin, so that the angles add up
    bent(stage, shoulder=0.3, elbow=0.2, tool=math.pi / 2 - 0.5)
    x, y, _ = stage.machines.place("/arm/tool").turn((1.0, 0.0, 0.0))
    assert (x, y) == pytest.approx((0.0, 1.0))
    x, y, _ = stage.machines.place("/arm/elbow").turn((1.0, 0.0, 0.0))
    assert (x, y) == pytest.approx((math.cos(0.5), math.sin(0.5)))


def sliding() -> Usd.Stage:
    """A slide along X in centimetres, and a hand that turns on it, 10 cm further out."""
    made = empty_stage("Z", 0.01)
    base = body(made, "/arm/base", (0, 0, 0))
    base.AddAppliedSchema("PhysicsArticulationRootAPI")
    body(made, "/arm/slide", (0, 0, 0))
    body(made, "/arm/hand", (10, 0, 0))
    joint = UsdPhysics.PrismaticJoint.Define(made, "/arm/slide_joint")
    joint.CreateBody0Rel().SetTargets(["/arm/base"])
    joint.CreateBody1Rel().SetTargets(["/arm/slide"])
    joint.CreateAxisAttr("X")
    drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "linear")
    drive.CreateStiffnessAttr(100.0)
    drive.CreateDampingAttr(10.0)
    hinge = revolute(made, "/arm/hand_joint", "/arm/slide", "/arm/hand", (10, 0, 0), "Z")
    UsdPhysics.DriveAPI(hinge, "angular").GetStiffnessAttr().Set(1000.0)
    return made


def test_a_slide_moves_along_its_axis() -> None:
    world = world_of(read_scene(sliding(), load_platform()), load_platform())
    bent(world, slide=5.0, hand=math.pi / 2)
    assert world.machines.place("/arm/hand").origin == pytest.approx((15.0, 0.0, 0.0))


def test_joint_states_are_read(stage: World) -> None:
    bent(stage, shoulder=0.25)
    read = node(f"{SENSORS}IsaacReadJointState", prim="/arm")
    assert read.compute(stage)
    assert read.enabled == ["execOut"]
    assert read.outputs["jointNames"] == NAMES
    assert read.outputs["jointPositions"] == (0.25, 0.0, 0.0)
    assert read.outputs["jointDofTypes"] == (0, 0, 0)
    assert not node(f"{SENSORS}IsaacReadJointState", prim="/World").compute(stage)


def test_the_state_of_an_articulation_is_that_of_the_joints_named(stage: World) -> None:
    bent(stage, elbow=0.5)
    state = node(f"{CORE}IsaacArticulationState", {"jointNames": NAMES[1:2]}, targetPrim="/arm")
    assert state.compute(stage)
    assert (state.outputs["jointNames"], state.outputs["jointPositions"]) == (NAMES[1:2], (0.5,))
    state.values["jointNames"] = ("none",)
    assert not state.compute(stage)


def published(world: World, values: dict[str, Any], **targets: str) -> JointStates:
    publisher = node(f"{ROS}ROS2PublishJointState", values, **targets)
    assert publisher.compute(world)  # the first compute publishes
    data = world.network.sent[-1].data
    assert isinstance(data, JointStates)
    return data


def test_joint_states_are_published_to_four_digits(stage: World) -> None:
    bent(stage, shoulder=0.123456)
    assert published(stage, {}, targetPrim="/arm").positions == (0.1235, 0.0, 0.0)


def test_what_reaches_a_publisher_is_published(stage: World) -> None:
    values = {
        "jointNames": ("a",),
        "jointPositions": (1.0,),
        "jointVelocities": (2.0,),
        "jointEfforts": (3.0,),
        "jointDofTypes": (0,),
        "stageMetersPerUnit": 1.0,
        "sensorTime": 7.0,
    }
    assert published(stage, values) == JointStates(("a",), (1.0,), (2.0,), (3.0,))
    assert stage.network.sent[-1].stamp == 7.0
    publisher = node(f"{ROS}ROS2PublishJointState", {**values, "jointEfforts": ()})
    assert not publisher.compute(stage)
    assert publisher.failure is not None
    assert publisher.failure.kind == "unequal-joint-arrays"
    publisher = node(f"{ROS}ROS2PublishJointState", {**values, "stageMetersPerUnit": 0.0})
    assert not publisher.compute(stage)


def test_lengths_are_published_divided_by_the_unit_of_the_stage() -> None:
    world = world_of(read_scene(sliding(), load_platform()), load_platform())
    bent(world, slide=5.0)
    assert published(world, {}, targetPrim="/arm/base").positions == (500.0, 0.0)


@pytest.mark.parametrize("part", ["base", "hand", "slide_joint"])
def test_an_articulation_is_read_by_each_of_its_parts(part: str) -> None:
    world = world_of(read_scene(sliding(), load_platform()), load_platform())
    machine = world.machines.viewed(f"/arm/{part}")
    assert machine is not None
    assert [*machine.joints] == ["slide_joint", "hand_joint"]


def test_what_is_no_part_of_an_articulation_reads_none() -> None:
    made = sliding()
    body(made, "/crate", (0, 0, 0))
    world = world_of(read_scene(made, load_platform()), load_platform())
    assert world.machines.viewed("/crate") is None


def heard(world: World, command: JointStates) -> Any:
    world.network.commands = RosEndpoint(0, "/joint_command")
    subscriber = node(f"{ROS}ROS2SubscribeJointState")
    assert subscriber.compute(world)  # opens
    world.network.tell(command)
    subscriber.compute(world)
    return subscriber


def test_what_a_command_leaves_out_is_no_number(stage: World) -> None:
    subscriber = heard(stage, JointStates(("a", "b"), (0.1, 0.2)))
    assert subscriber.enabled == ["execOut"]
    assert subscriber.outputs["positionCommand"] == (0.1, 0.2)
    assert all(map(math.isnan, subscriber.outputs["velocityCommand"]))
    assert heard(stage, JointStates(("a", "b"), (0.1,))).enabled == []


def commanded(world: World, **values: Any) -> Machine:
    controller = node(f"{CORE}IsaacArticulationController", values, targetPrim="/arm")
    assert controller.compute(world)
    return machine_of(world)


def test_what_is_no_number_leaves_the_target_of_a_joint(stage: World) -> None:
    commanded(stage, positionCommand=(0.1, 0.2, 0.3))
    machine = commanded(stage, positionCommand=(math.nan, 0.5, math.nan))
    assert [joint.target_position for joint in machine.joints.values()] == [0.1, 0.5, 0.3]


def test_an_effort_moves_a_joint_as_fast_as_its_damping_lets_it(stage: World) -> None:
    machine = commanded(stage, effortCommand=(0.1 * math.degrees(1000.0), 0.0, 0.0))
    joint = machine.joints["shoulder_joint"]
    joint.stiffness = 0.0
    assert joint.speed(1 / 60) == pytest.approx(0.1)
    joint.damping = 0.0
    commanded(stage, effortCommand=(1.0, 0.0, 0.0))
    assert "moved by an effort" in next(iter(stage.not_simulated.values()))


def test_a_spring_without_damping_holds_its_target(stage: World) -> None:
    joint = machine_of(stage).joints["shoulder_joint"]
    joint.damping, joint.target_position = 0.0, 0.3
    assert joint.speed(0.5) == pytest.approx(0.6)


def test_an_arm_goes_where_it_is_told_and_tf_follows(tmp_path: Path) -> None:
    found = played(arm(), tmp_path)
    assert found.verdict == "ok"
    assert [check.name for check in found.checks if check.verdict == "ok"] == [
        "graphs",
        "topics",
        "stamps",
        "clock",
        "tree",
        "joints",
        "links",
        "joint states",
        "again",
    ]


def arm_that_hears(*kinds: str) -> Usd.Stage:
    """The arm, whose controller takes nothing but these of the commands that come."""
    stage = arm()
    for kind in {"position", "velocity", "effort"} - {*kinds}:
        port = f"/ActionGraph/controller.inputs:{kind}Command"
        stage.GetAttributeAtPath(port).ClearConnections()
    return stage


def without_springs(stage: Usd.Stage) -> Usd.Stage:
    for name in NAMES:
        drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath(f"/arm/{name}"), "angular")
        drive.GetStiffnessAttr().Set(0.0)
    return stage


def test_what_efforts_do_to_an_arm_is_not_judged(tmp_path: Path) -> None:
    found = played(arm_that_hears("velocity", "effort"), tmp_path)
    assert (found.verdict, bad(found)) == ("not judged", set())
    assert "effort" in by_name(found)["joints"].message


def test_a_joint_that_no_effort_moves_is_named(tmp_path: Path) -> None:
    stage = arm_that_hears("effort")
    without_way(stage)
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.verdict, check.kind, check.prim) == ("bad", "limited-joint", ELBOW)


@pytest.mark.parametrize("kinds", [("velocity",), ("position", "velocity", "effort")])
def test_an_arm_without_springs_moves_as_fast_as_it_is_told(
    tmp_path: Path, kinds: tuple[str, ...]
) -> None:
    found = played(without_springs(arm_that_hears(*kinds)), tmp_path)
    assert (found.verdict, by_name(found)["joints"].verdict) == ("ok", "ok")


def test_a_joint_with_a_spring_keeps_no_speed(tmp_path: Path) -> None:
    stage = without_springs(arm_that_hears("velocity"))
    UsdPhysics.DriveAPI(joint_of(stage), "angular").GetStiffnessAttr().Set(800.0)
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.verdict, check.kind, check.prim) == ("bad", "no-velocity-drive", ELBOW)
    assert check.cause == "it has a drive with stiffness 800"


@pytest.mark.parametrize(("degrees", "cause"), [(0.0, ""), (30.0, "keeps it +0.052 from")])
def test_a_target_velocity_that_keeps_a_joint_from_its_targets_is_named(
    tmp_path: Path, degrees: float, cause: str
) -> None:
    stage = arm()
    drive = UsdPhysics.DriveAPI(joint_of(stage), "angular")
    drive.CreateStiffnessAttr().Set(1000.0)
    drive.CreateDampingAttr().Set(100.0)
    drive.CreateTargetVelocityAttr().Set(degrees)
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.prim, cause in check.cause) == (ELBOW if cause else "", True)


def test_speeds_that_go_to_other_joints_are_named(tmp_path: Path) -> None:
    stage = without_springs(arm_that_hears("velocity"))
    names = stage.GetAttributeAtPath("/ActionGraph/controller.inputs:jointNames")
    names.ClearConnections()
    names.Set(["elbow_joint", "shoulder_joint", "tool_joint"])
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.verdict, check.kind) == ("bad", "joint-off-target")
    assert "moves at" in check.message


def test_transforms_that_are_sent_once_do_not_follow_an_arm(tmp_path: Path) -> None:
    stage = arm()
    tf = stage.GetPrimAtPath("/ActionGraph/tf")
    tf.CreateAttribute("inputs:staticPublisher", Sdf.ValueTypeNames.Bool).Set(True)  # noqa: FBT003
    tf.CreateAttribute("inputs:topicName", Sdf.ValueTypeNames.String).Set("tf")
    found = played(stage, tmp_path)
    assert (bad(found), by_name(found)["links"].kind) == ({"links"}, "link-off-frame")


def test_joint_states_that_are_velocities_are_none(tmp_path: Path) -> None:
    stage = arm()
    states = stage.GetPrimAtPath("/ActionGraph/joint_states")
    states.GetAttribute("inputs:jointPositions").SetConnections(
        ["/ActionGraph/read_joints.outputs:jointVelocities"]
    )
    found = played(stage, tmp_path)
    assert (bad(found), by_name(found)["joint states"].kind) == (
        {"joint states"},
        "wrong-joint-state",
    )


def test_a_run_of_an_arm_is_a_bag(tmp_path: Path) -> None:
    arm_stage = arm()
    arm_stage.GetRootLayer().Export(str(tmp_path / "arm.usda"))
    invoke("sim", tmp_path / "arm.usda", "--bag", tmp_path / "bag")
    metadata = (tmp_path / "bag" / "metadata.yaml").read_text(encoding="utf-8")
    assert {"/joint_command", "/joint_states"} <= set(re.findall(r"name: (/\w+)", metadata))


def test_joints_stay_within_their_limits(tmp_path: Path) -> None:
    stage = arm()
    joint = UsdPhysics.RevoluteJoint(stage.GetPrimAtPath("/arm/elbow_joint"))
    joint.CreateLowerLimitAttr(-90.0)
    joint.CreateUpperLimitAttr(math.degrees(0.1))
    found = played(stage, tmp_path)
    assert found.verdict == "ok"


ELBOW = "/arm/elbow_joint"


def joint_of(stage: Usd.Stage) -> Usd.Prim:
    return stage.GetPrimAtPath(ELBOW)


def without_spring(stage: Usd.Stage) -> None:
    UsdPhysics.DriveAPI(joint_of(stage), "angular").GetStiffnessAttr().Set(0.0)


def without_drive(stage: Usd.Stage) -> None:
    joint_of(stage).RemoveAPI(UsdPhysics.DriveAPI, "angular")


def without_force(stage: Usd.Stage) -> None:
    UsdPhysics.DriveAPI(joint_of(stage), "angular").CreateMaxForceAttr(0.0)


def with_a_linear_drive(stage: Usd.Stage) -> None:
    without_drive(stage)
    UsdPhysics.DriveAPI.Apply(joint_of(stage), "linear").CreateStiffnessAttr(800.0)


def without_way(stage: Usd.Stage) -> None:
    joint = UsdPhysics.RevoluteJoint(joint_of(stage))
    joint.CreateLowerLimitAttr(0.0)
    joint.CreateUpperLimitAttr(0.0)


@pytest.mark.parametrize(
    ("change", "kind", "cause"),
    [
        (without_spring, "no-position-drive", "it has a drive without stiffness"),
        (without_drive, "no-position-drive", "it has no drive"),
        (without_force, "no-position-drive", "it has a drive without force"),
        (with_a_linear_drive, "no-position-drive", "it has a drive:linear"),
        (without_way, "limited-joint", "it has limits that leave it no way: 0 to 0"),
    ],
)
def test_a_joint_that_cannot_follow_is_named(
    tmp_path: Path, change: Callable[[Usd.Stage], None], kind: str, cause: str
) -> None:
    stage = arm()
    change(stage)
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.verdict, check.kind, check.prim) == ("bad", kind, ELBOW)
    assert check.message == "elbow_joint does not follow its commands"
    assert check.cause.startswith(cause)


def test_each_joint_that_cannot_follow_is_named(tmp_path: Path) -> None:
    stage = arm()
    without_spring(stage)
    UsdPhysics.DriveAPI(stage.GetPrimAtPath("/arm/tool_joint"), "angular").CreateMaxForceAttr(0.0)
    message = by_name(played(stage, tmp_path))["joints"].message
    assert message.count("does not follow its commands") == 2


@pytest.mark.parametrize("held", ["/arm/shoulder", "/arm/base"])
def test_a_joint_that_another_one_holds_is_named(tmp_path: Path, held: str) -> None:
    """Also where the way by that one, as of a transport lock, is the shorter one."""
    stage = arm()
    lock = UsdPhysics.FixedJoint.Define(stage, "/arm/lock")
    lock.CreateBody0Rel().SetTargets([held])
    lock.CreateBody1Rel().SetTargets(["/arm/elbow"])
    lock.CreateExcludeFromArticulationAttr(held.endswith("base"))
    joints = by_name(played(stage, tmp_path))["joints"]
    assert (joints.verdict, joints.kind) == ("bad", "locked-joint")
    assert joints.message.count("is at 0.000") == (1 if held.endswith("shoulder") else 2)


@pytest.mark.parametrize(
    ("attribute", "value", "kind"),
    [
        ("physics:excludeFromArticulation", True, "excluded-joint"),
        ("physics:jointEnabled", False, "unknown-joint"),
    ],
)
def test_a_joint_that_the_articulation_lacks_stops_all_joints(
    tmp_path: Path,
    attribute: str,
    value: bool,  # noqa: FBT001
    kind: str,
) -> None:
    stage = arm()
    joint_of(stage).CreateAttribute(attribute, Sdf.ValueTypeNames.Bool).Set(value)
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.verdict, check.kind) == ("bad", kind)
    assert "'elbow_joint'" in check.cause
    assert check.message.startswith("shoulder_joint is commanded")


def test_a_joint_whose_limits_leave_out_0_goes_to_places_inside_them(tmp_path: Path) -> None:
    stage = arm()
    joint = UsdPhysics.RevoluteJoint(joint_of(stage))
    joint.CreateLowerLimitAttr(-176.0)
    joint.CreateUpperLimitAttr(-4.0)
    found = played(stage, tmp_path, drive=FIXED, longest=WHOLE)
    assert (found.verdict, bad(found)) == ("ok", set())


@pytest.mark.parametrize(
    ("names", "verdict"), [(NAMES, "ok"), (NAMES[::-1], "bad"), (NAMES[1:], "ok")]
)
def test_joints_that_are_named_in_another_order_go_where_others_should(
    tmp_path: Path, names: tuple[str, ...], verdict: str
) -> None:
    stage = arm()
    port = stage.GetAttributeAtPath("/ActionGraph/controller.inputs:jointNames")
    port.ClearConnections()
    port.Set(names)
    check = by_name(played(stage, tmp_path))["joints"]
    assert (check.verdict, check.kind) == (
        verdict,
        "joint-off-target" if verdict == "bad" else None,
    )


def two_arms() -> Usd.Stage:
    """Two arms, 2 m apart, each with its own graph and topics."""
    stage = arm()
    layer = stage.GetRootLayer()
    for path in ("/arm", "/ActionGraph"):
        Sdf.CopySpec(layer, path, layer, f"{path}2")
    UsdGeom.Xformable(stage.GetPrimAtPath("/arm2")).AddTranslateOp().Set(Gf.Vec3d(2, 0, 0))
    for prim in stage.GetPrimAtPath("/ActionGraph2").GetChildren():
        for target in prim.GetRelationships():
            paths = [str(path) for path in target.GetTargets()]
            target.SetTargets([path.replace("/arm/", "/arm2/") for path in paths])
            if paths == ["/arm"]:
                target.SetTargets(["/arm2"])
        for port in prim.GetAttributes():
            if port.HasAuthoredConnections():
                port.SetConnections(
                    [
                        str(path).replace("/ActionGraph/", "/ActionGraph2/")
                        for path in port.GetConnections()
                    ]
                )
        if prim.GetAttribute("node:type").Get().startswith("isaacsim.ros2"):
            prim.CreateAttribute("inputs:nodeNamespace", Sdf.ValueTypeNames.String).Set("second")
    return stage


def test_the_states_of_one_arm_are_not_held_against_another(tmp_path: Path) -> None:
    found = played(two_arms(), tmp_path)
    assert [robot.topic for robot in found.robots] == ["/joint_command", "/second/joint_command"]
    assert bad(found) == set()
    judged = [check.of for check in found.checks if check.name == "joint states"]
    assert judged == ["/arm/base", "/arm2/base"]


def test_the_arm_on_a_base_is_commanded_beside_it(tmp_path: Path) -> None:
    stage = rover()
    chassis, root = "/World/Rover/chassis", "/World/Rover"
    for number, name in enumerate(("upper", "lower")):
        body(stage, f"{root}/{name}", (0, 0, 30.0 + 20 * number))
    for name, below, height in (("upper", chassis, 20.0), ("lower", f"{root}/upper", 20.0)):
        joint = revolute(
            stage, f"{root}/{name}_joint", below, f"{root}/{name}", (0, 0, height), "Z"
        )
        UsdPhysics.DriveAPI(joint, "angular").GetStiffnessAttr().Set(3000.0)
    write_graph(
        stage,
        "/World/Arm",
        {
            "tick": TICK,
            "context": CONTEXT,
            "command": ("ros.ROS2SubscribeJointState", {}),
            "controller": ("core.IsaacArticulationController", {"targetPrim": root}),
        },
        [
            *(f"tick.tick -> {each}.execIn" for each in ("command", "controller")),
            "context.context -> command.context",
            "command.positionCommand -> controller.positionCommand",
            "command.jointNames -> controller.jointNames",
        ],
    )
    found = played(stage, tmp_path)
    assert bad(found) == set()
    assert [robot.topic for robot in found.robots] == ["/cmd_vel", "/joint_command"]
    joints = next(check for check in found.checks if check.name == "joints")
    assert joints.verdict == "ok"
    assert any("left_wheel_joint (another controller names it)" in text for text in found.remarks)
    lower = stage.GetPrimAtPath(f"{root}/lower_joint")
    UsdPhysics.DriveAPI(lower, "angular").GetStiffnessAttr().Set(0.0)
    assert bad(played(stage, tmp_path)) == {"joints", "again"}


def test_an_arm_whose_states_come_as_commands_hears_itself(tmp_path: Path) -> None:
    stage = arm()
    states = stage.GetPrimAtPath("/ActionGraph/joint_states")
    states.CreateAttribute("inputs:topicName", Sdf.ValueTypeNames.String).Set("joint_command")
    check = by_name(played(stage, tmp_path))["topics"]
    assert (check.verdict, check.prim) == ("bad", "/ActionGraph/joint_states")
    assert "on which /ActionGraph/command reads them as commands" in check.message


def test_joints_that_come_by_message_are_not_those_of_numbers_beside_them(tmp_path: Path) -> None:
    layer = arm().Flatten()
    Sdf.CopySpec(layer, "/ActionGraph", layer, "/Second")
    stage = Usd.Stage.Open(layer)
    for graph in ("/ActionGraph", "/Second"):
        controller = stage.GetPrimAtPath(f"{graph}/controller")
        controller.CreateAttribute("inputs:jointIndices", Sdf.ValueTypeNames.IntArray).Set([1])
    command = stage.GetPrimAtPath("/Second/command")
    command.CreateAttribute("inputs:topicName", Sdf.ValueTypeNames.String).Set("other_command")
    assert "commands" not in by_name(played(stage, tmp_path))


def test_legs_are_no_wheels() -> None:
    stage = empty_stage("Z", 1.0)
    body(stage, "/dog/trunk", (0, 0, 0.5)).AddAppliedSchema("PhysicsArticulationRootAPI")
    for number, (x, y) in enumerate(((0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2))):
        leg = f"/dog/leg_{number}"
        body(stage, leg, (x, y, 0.1))
        foot = UsdGeom.Sphere.Define(stage, f"{leg}/foot")
        foot.CreateRadiusAttr(0.1)
        UsdPhysics.CollisionAPI.Apply(foot.GetPrim())
        joint = revolute(stage, f"/dog/knee_{number}", "/dog/trunk", leg, (x, y, -0.2), "Y")
        UsdPhysics.DriveAPI(joint, "angular").GetStiffnessAttr().Set(800.0)
        UsdPhysics.RevoluteJoint(joint).CreateLowerLimitAttr(-60.0)
        UsdPhysics.RevoluteJoint(joint).CreateUpperLimitAttr(60.0)
    machines = world_of(
        read_scene(stage, load_platform()), load_platform(), has_ground=True
    ).machines
    dog = machines.member["/dog/trunk"]
    assert dog.wheels == []
    for joint in dog.joints.values():
        joint.target_position = 0.3
    for _ in range(300):
        machines.step(1 / 60)
    assert all(joint.position > 0.2 for joint in dog.joints.values())
    assert (dog.x, dog.y) == (0.0, 0.0)
