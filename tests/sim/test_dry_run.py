"""The built stage drives as it is told, and single faults show in the checks they should."""

from __future__ import annotations

from pathlib import Path

import pytest
from breaking import Step, broken, correct_stage, the_lab
from dry_runs import DRIVE, SHORT, TO_THE_WALL, driven, faults
from fault_stages import MOTION
from layerings import one_text_file
from pxr import Gf, Sdf, Usd, UsdGeom
from scene_stages import CAMERA, ROBOT, put
from second_author import Style

from lab3_usd.sim.execution.drive import Session, drive_of
from lab3_usd.sim.execution.recording import Odometry, Recording
from lab3_usd.sim.judge.checks import CHECKS, judge
from lab3_usd.sim.judge.expectations import Expected, Trial
from lab3_usd.sim.judge.sensors import camera
from lab3_usd.sim.judge.topics import expected_at
from lab3_usd.sim.outcome import Judged, behaviour_of
from lab3_usd.stage.write.builder import build_checkpoint

DRIVING = expected_at(the_lab(), the_lab().checkpoints["02"])  # of a stage that only drives
WHEELS = 0.033 / 0.025  # the wheel of the model by that of the controller


@pytest.fixture(scope="module")
def right() -> Trial:
    """The built stage, driven."""
    return driven(correct_stage("05"))


def test_the_built_stage_behaves(right: Trial) -> None:
    verdicts = judge(right, CHECKS)
    assert [verdict for verdict in verdicts if verdict.verdict != "ok"] == []
    assert [verdict.name for verdict in verdicts] == list(CHECKS)
    assert right.recording.not_simulated == {}


def test_each_remark_says_of_which_robot_it_is() -> None:
    told = {"robot": "a wall stops the robot", "/Second": "/Second2/wall stops the robot"}
    judged = [
        Judged(name, Trial(Recording(remarks=[text]), (Session(()),), Expected()), ())
        for name, text in {**told, "/Third": "/Third: its wheels stand"}.items()
    ]
    assert behaviour_of(judged).remarks == (
        "robot: a wall stops the robot",
        "/Second: /Second2/wall stops the robot",
        "/Third: its wheels stand",
    )


def test_it_goes_as_far_as_its_wheels_say(right: Trial) -> None:
    _, before, poses = next(right.stretches("ahead"))
    moved = (len(poses) - 1) / 60  # a command reaches the wheels in the next frame
    assert poses[-1].x - before.x == pytest.approx(0.15 * moved * WHEELS, rel=1e-6)
    assert poses[-1].y - before.y == pytest.approx(0.0, abs=1e-6)
    _, before, poses = next(right.stretches("left"))
    assert poses[-1].heading == pytest.approx(0.8 * (len(poses) - 1) / 60 * WHEELS, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "number", "checks"),
    [
        ("wheelRadius", 0.05, ["follows", "limits", "again"]),
        ("wheelRadius", 0.027, ["follows", "limits", "again"]),
        ("wheelDistance", 0.12, ["follows", "limits"]),
        ("maxLinearSpeed", 0.11, ["follows", "limits", "again"]),
        ("maxLinearSpeed", 0.2, ["limits"]),
        ("maxAngularSpeed", 0.9, ["limits"]),
        ("wheelRadius", 0.0252, []),  # 1 % less
    ],
)
def test_a_dry_run_is_held_to_five_percent(name: str, number: float, checks: list[str]) -> None:
    step = {"set": [f"ROS_Drive/differential_controller.inputs:{name}", number]}
    found = faults(driven(broken("02", [step]), wanted=DRIVING))
    assert [each.name for each in found] == checks


def test_a_robot_whose_wheels_are_as_the_handout_says_is_held_to_what_it_is_told() -> None:
    """Wheels of 0.025 m, as an instructor's starter may have: no factor."""
    stage = correct_stage("02")
    for side in ("left", "right"):
        tyre = f"{ROBOT}/wheel_{side}_link/collisions/tyre"
        stage.GetPrimAtPath(tyre).GetAttribute("radius").Set(0.025)
    low = stage.GetPrimAtPath(f"{ROBOT}/caster_back_link/collisions/ball")
    low.GetAttribute("physics:collisionEnabled").Set(False)  # noqa: FBT003
    trial = driven(stage)
    assert trial.factor == pytest.approx(1.0)
    assert [each.name for each in faults(trial) if each.name in MOTION] == []


def test_rates_and_frames_are_those_of_the_lab(right: Trial) -> None:
    recording = right.recording
    seconds = sum(leg.seconds for leg in DRIVE[0].legs)
    assert len(recording.topic("/scan", 0)) == pytest.approx(10 * seconds, abs=1)
    assert len(recording.topic("/clock", 0)) == pytest.approx(60 * seconds, abs=2)
    assert {each.frame for each in recording.topic("/scan")} == {"base_scan"}
    assert {each.frame for each in recording.topic("/camera/image_raw")} == {"Camera_1"}
    last = recording.topic("/odom", 1)[-1]
    assert isinstance(last.data, Odometry)
    assert last.data.child == "base_footprint"


# Those of test_faults.py, which name the kind of fault as well, are not repeated here.
CASES: list[tuple[Step, str]] = [
    ({"disconnect": "ROS_OdomTF/ros2_publish_transform_tree.inputs:context"}, "tree"),
    ({"set": ["ROS_Drive/ros2_context.inputs:useDomainIDEnvVar", True]}, "again"),
    (
        {"swap": ["ROS_Drive/make_array.inputs:input0", "ROS_Drive/make_array.inputs:input1"]},
        "follows",
    ),
    ({"set": ["ROS_Drive.pipelineStage", "pipelineStageOnDemand"]}, "follows"),
    (
        {
            "connect": [
                "ROS_OdomTF/ros2_publish_odometry.inputs:linearVelocity",
                "ROS_OdomTF/isaac_compute_odometry.outputs:globalLinearVelocity",
            ]
        },
        "odometry",
    ),
    ({"set": ["ROS_OdomTF/ros2_publish_raw_transform_tree.inputs:childFrameId", "x"]}, "tree"),
    (
        {
            "set": [
                "/turtlebot3_burger/joints/wheel_left_joint.drive:angular:physics:stiffness",
                1e3,
            ]
        },
        "follows",
    ),
]


@pytest.mark.parametrize(("step", "check"), CASES, ids=[str(each) for each, _ in CASES])
def test_a_fault_shows_where_it_should(step: Step, check: str) -> None:
    found = faults(driven(broken("05", [step])))
    assert check in {each.name for each in found}


@pytest.mark.parametrize(
    ("turn", "kinds"),
    [(Gf.Quatd(0.5, 0.5, -0.5, -0.5), []), (Gf.Quatd(0.5, 0.5, 0.5, 0.5), ["camera-not-ahead"])],
)
def test_a_camera_shows_where_it_looks_before_there_is_a_tree(
    turn: Gf.Quatd, kinds: list[str]
) -> None:
    trial = driven(broken("04", [{"set": [f"{CAMERA}.xformOp:orient", turn]}]), SHORT)
    assert [fault.kind for fault in camera(trial)] == kinds


RAW, AGAIN = "ROS_OdomTF/ros2_publish_raw_transform_tree", "ROS_OdomTF/again"


def kept(publisher: str) -> list[Step]:
    """Have a publisher send its transform once, for those who come late."""
    return [
        {"set": [f"{publisher}.inputs:topicName", "tf_static"]},
        {"set": [f"{publisher}.inputs:staticPublisher", True]},
    ]


def fixed(parent: str, child: str) -> list[Step]:
    """A second publisher, which sends a static transform."""
    return [
        {"copy": [RAW, AGAIN]},
        {"disconnect": f"{AGAIN}.inputs:translation"},
        {"disconnect": f"{AGAIN}.inputs:rotation"},
        {"set": [f"{AGAIN}.inputs:parentFrameId", parent]},
        {"set": [f"{AGAIN}.inputs:childFrameId", child]},
        *kept(AGAIN),
    ]


def test_what_is_sent_once_never_moves() -> None:
    found = faults(driven(broken("05", kept(RAW)), SHORT))
    assert "moving frames" in {each.name for each in found}


def test_tf2_takes_no_static_transform_that_is_not_kept() -> None:
    (found, *_) = faults(driven(broken("05", kept(RAW)[:1]), SHORT))
    assert (found.name, found.kind) == ("tree", "disconnected-frame")


@pytest.mark.parametrize(
    ("parent", "child", "kinds"),
    [
        ("caster_back_link", "base_scan", ["several-parents"]),
        ("/caster_back_link", "/base_scan", ["several-parents"]),  # tf2 takes the slash off
        ("base_link", "imu_link", []),
        ("/base_link", "imu_link", []),
    ],
)
def test_a_static_transform_is_one_of_the_tree(parent: str, child: str, kinds: list[str]) -> None:
    found = faults(driven(broken("05", fixed(parent, child)), SHORT))
    assert [each.kind for each in found] == kinds


DRIVES: list[Step] = [
    {"set": ["ROS_Clock/ros2_publish_clock.inputs:topicName", "clock"]},
    {"set": ["ROS_Drive/ros2_subscribe_twist.inputs:topicName", "//cmd_vel/"]},
    {"targets": ["ROS_Drive/articulation_controller.inputs:targetPrim", "/turtlebot3_burger"]},
    {
        "connect": [
            "ROS_Drive/differential_controller.inputs:dt",
            "ROS_Drive/on_playback_tick.outputs:deltaSeconds",
        ]
    },
    # every node of a push graph computes, and ROS_Clock has nothing that must not
    {"set": ["ROS_Clock.evaluator:type", "push"]},
    {"clear": "ROS_Drive/ros2_subscribe_twist.inputs:queueSize"},
]

TARGETS = "ROS_OdomTF/isaac_compute_transform_tree.inputs:targetPrims"


@pytest.mark.parametrize("step", DRIVES, ids=map(str, DRIVES))
def test_what_drives_is_not_faulted(step: Step) -> None:
    assert faults(driven(broken("02", [step]), wanted=DRIVING)) == []


# of a link that is found twice the last target says below what it hangs
@pytest.mark.parametrize("targets", [(ROBOT, CAMERA), (ROBOT, f"{ROBOT}/base_scan", CAMERA)])
def test_targets_of_the_tree_may_be_named_otherwise(targets: tuple[str, ...]) -> None:
    assert faults(driven(broken("05", [{"targets": [TARGETS, *targets]}]), SHORT)) == []


def crate(stage: Usd.Stage, ahead: float, size: float) -> None:
    cube = UsdGeom.Cube.Define(stage, "/World/Crate")
    cube.CreateSizeAttr(size)
    cube.AddTranslateOp().Set(Gf.Vec3d(1.8 + ahead, 0, size / 2))
    cube.GetPrim().AddAppliedSchema("PhysicsCollisionAPI")


@pytest.mark.parametrize(
    ("ahead", "size", "reason"),
    [(0.16, 0.1, "a wall stops it"), (0.0, 0.5, "inside /World/Crate")],
    ids=["ahead", "around it"],
)
def test_what_stops_the_robot_is_no_fault_of_its_controller(
    ahead: float, size: float, reason: str
) -> None:
    stage = correct_stage("02")
    crate(stage, ahead, size)
    found = faults(driven(stage, TO_THE_WALL, DRIVING))
    assert {each.verdict for each in found} == {"not judged"}
    assert all(reason in each.message for each in found)


def test_a_wall_hides_no_fault_of_what_comes_after_it() -> None:
    stage = broken(
        "02", [{"set": ["ROS_Drive/differential_controller.inputs:maxLinearSpeed", 0.1]}]
    )
    crate(stage, 0.16, 0.1)
    assert "limits" in {each.name for each in faults(driven(stage)) if each.verdict == "bad"}


# What another author writes, whose reading of the handout is not the builder's, drives as well.
AUTHORS = {
    "made by Isaac's menus": Style(names="menu", values="all", editor_api=False),
    "only wrong defaults written": Style(names="editor", values="needed", list_edits=True),
    "ports and versions of 4.5": Style(declare="used", old_versions=True, wired_dt=True),
}


@pytest.mark.parametrize("style", AUTHORS.values(), ids=AUTHORS)
def test_another_author_s_stage_behaves(tmp_path: Path, style: Style) -> None:
    starter = build_checkpoint(None, "00", tmp_path / "Lab3_00.usda")
    stage = Usd.Stage.Open(str(one_text_file(tmp_path, starter, "05", style)))
    assert faults(driven(stage)) == []


def ramped(limit: float) -> Usd.Stage:
    """Return a stage whose controller has acceleration limits, and the time step for them."""
    stage, graph = correct_stage("02"), f"{ROBOT}/ROS_Drive"
    controller = stage.GetPrimAtPath(f"{graph}/differential_controller")
    for name in ("maxAcceleration", "maxDeceleration", "maxAngularAcceleration"):
        controller.CreateAttribute(f"inputs:{name}", Sdf.ValueTypeNames.Double).Set(limit)
    tick = stage.GetPrimAtPath(f"{graph}/on_playback_tick")
    seconds = tick.CreateAttribute("outputs:deltaSeconds", Sdf.ValueTypeNames.Double)
    step = controller.CreateAttribute("inputs:dt", Sdf.ValueTypeNames.Double)
    step.SetConnections([seconds.GetPath()])
    return stage


@pytest.mark.parametrize("limit", [0.1, 0.5])
def test_a_robot_with_acceleration_limits_gets_going_and_stops_as_these_let_it(
    limit: float,
) -> None:
    assert faults(driven(ramped(limit), wanted=DRIVING)) == []


def test_acceleration_limits_hide_no_turn_to_the_wrong_side_right_after_a_way() -> None:
    stage = ramped(0.5)
    array = stage.GetPrimAtPath(f"{ROBOT}/ROS_Drive/make_array")
    first, second = (array.GetAttribute(f"inputs:input{number}") for number in (0, 1))
    sources = first.GetConnections(), second.GetConnections()
    first.SetConnections(sources[1])
    second.SetConnections(sources[0])
    found = driven(stage, drive_of("0.1,0,1 0,0.8,2", DRIVING.limits), DRIVING)
    assert "follows" in {each.name for each in faults(found) if each.verdict == "bad"}


def test_acceleration_limits_hide_no_wrong_size() -> None:
    stage = ramped(0.5)
    put(f"{ROBOT}/ROS_Drive/differential_controller", "inputs:wheelRadius", 0.05)(stage)
    assert "follows" in {each.name for each in faults(driven(stage)) if each.verdict == "bad"}
