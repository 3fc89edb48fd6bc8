"""`lab3 sim`: what people and programs see of a dry run."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from benchmark import load_benchmark
from breaking import Step, broken, correct_stage, the_lab
from click.testing import Result
from dry_runs import BRIEFLY, EXPECTED, FIXED
from in_process import invoke
from msgspec.structs import replace
from places import REPOSITORY
from pxr import Sdf, Usd
from report_examples import assert_valid, dry_run_of
from scene_stages import CAMERA, LIDAR, ROBOT, put, switch

from lab3_usd.cli import main
from lab3_usd.errors import UsageError
from lab3_usd.report.behaviour.text import PASSED
from lab3_usd.sim.execution.drive import drive_of
from lab3_usd.sim.judge.checks import CHECKS
from lab3_usd.sim.judge.topics import expected_at

EXITS = {"ok": 0, "bad": 1, "not judged": 1, "unreadable": 2}
DRIVE, CLOCK = "/turtlebot3_burger/ROS_Drive", "/World/ROS_Clock"


def saved(stage: Usd.Stage, folder: Path, name: str = "Lab3_05_odometry_tf.usda") -> Path:
    path = folder / name
    stage.GetRootLayer().Export(str(path))
    return path


def sim(path: Path, *arguments: str, drive: str | None = BRIEFLY) -> Result:
    return invoke("sim", path, *(("--drive", drive) if drive else ()), *arguments)


def check(path: Path, *arguments: str) -> Result:
    return invoke("check", path, *arguments)


def behaviour(path: Path, *arguments: str, drive: str | None = BRIEFLY) -> dict[str, Any]:
    done = sim(path, "--format", "json", *arguments, drive=drive)
    document = dry_run_of(done.stdout)
    assert done.exit_code == EXITS[document["verdict"]]
    return document


def bad(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {each["name"]: each for each in document["checks"] if each["verdict"] == "bad"}


def test_a_right_stage_is_all_right(tmp_path: Path) -> None:
    path = saved(correct_stage("05"), tmp_path)
    done = sim(path, drive=FIXED)
    assert done.exit_code == 0
    assert "not Isaac Sim" in done.stdout.splitlines()[0]
    assert "14 checks: 14 ok, 0 bad" in done.stdout
    found = behaviour(path)
    assert found["verdict"] == "ok"
    assert {each["name"]: each["type"] for each in found["topics"]} == EXPECTED.types
    rates = {each["name"]: each["hz"] for each in found["topics"]}
    assert (rates["/scan"], rates["/clock"]) == pytest.approx((10.0, 60.0), rel=0.02)
    assert {(each["parent"], each["child"]) for each in found["frames"]} == {
        ("odom", "base_footprint"),
        *(edge for edge in the_lab().frames.edges if edge[0] == "base_footprint"),
    }
    assert found["path"][0][1:] == pytest.approx([1.8, 0.0, 0.0])


def test_what_is_asked_for_is_what_the_handout_asks_for() -> None:
    lab = the_lab()
    asked = expected_at(lab, lab.checkpoints["05"])
    assert asked.profile
    assert replace(asked, profile={}, types=dict(sorted(asked.types.items()))) == replace(
        EXPECTED, types=dict(sorted(EXPECTED.types.items()))
    )


@pytest.mark.parametrize(
    ("checkpoint", "checks"),
    [
        ("01", ["graphs", "topics", "clock", "stamps"]),
        ("02", ["graphs", "topics", "rest", "follows", "limits", "clock", "stamps", "again"]),
    ],
)
def test_an_early_stage_is_asked_for_what_it_has(
    tmp_path: Path, checkpoint: str, checks: list[str]
) -> None:
    path = saved(correct_stage(checkpoint), tmp_path, f"Lab3_{checkpoint}.usda")
    found = behaviour(path, drive=FIXED)
    assert [each["name"] for each in found["checks"]] == checks
    assert found["verdict"] == "ok"


def test_before_the_first_graph_there_is_nothing_to_play_yet(tmp_path: Path) -> None:
    path = saved(correct_stage("00"), tmp_path, "Lab3_00.usda")
    found = json.loads(sim(path, "--format", "json").stdout)
    assert (found["verdict"], found["checks"]) == ("not judged", [])
    assert found["missing"] == "nothing to run yet: the graphs come with checkpoint 01"
    shown = sim(path)
    assert (shown.exit_code, shown.stdout.splitlines()[1:]) == (0, [found["missing"]])


def test_a_later_stage_that_lost_its_graphs_is_not_too_early(tmp_path: Path) -> None:
    path = saved(correct_stage("00"), tmp_path, "Lab3_01.usda")
    shown = sim(path)
    assert shown.exit_code == 1
    assert "nothing to run" not in shown.stdout


def test_no_check_is_ok_of_what_did_not_happen(tmp_path: Path) -> None:
    stage = broken("05", [{"set": ["ROS_Drive/ros2_subscribe_twist.inputs:topicName", "/x"]}])
    found = behaviour(saved(stage, tmp_path), drive=FIXED)
    unjudged = [each["name"] for each in found["checks"] if each["verdict"] == "not judged"]
    assert unjudged == ["rest", "limits", "odometry", "moving frames", "mounted", "again"]
    assert (found["verdict"], found["missing"]) == ("bad", "")


def test_a_drive_that_asks_for_nothing_is_judged_by_nothing(tmp_path: Path) -> None:
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    names = [each["name"] for each in behaviour(path, "--drive", "0,0,1")["checks"]]
    assert names == ["graphs", "topics", "rest", "clock", "stamps"]


def test_a_stage_may_be_asked_for_more_than_its_name_says(tmp_path: Path) -> None:
    path = saved(correct_stage("01"), tmp_path, "Lab3_01.usda")
    assert "/scan" in bad(behaviour(path, "--checkpoint", "3"))["topics"]["message"]
    renamed = path.rename(tmp_path / "mine.usda")
    found = behaviour(renamed)
    assert [each["name"] for each in found["checks"]] == ["graphs", "topics", "clock"]
    assert found["verdict"] == "ok"


CASES: list[tuple[Step, str, str, str]] = [
    (
        {"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"},
        "topics",
        f"{CLOCK}/ros2_publish_clock",
        "W01",
    ),
    (
        {"set": ["ROS_Clock/ros2_publish_clock.inputs:topicName", "/time"]},
        "topics",
        f"{CLOCK}/ros2_publish_clock",
        "P01",
    ),
    (
        {"set": ["ROS_Clock.pipelineStage", "pipelineStageOnDemand"]},
        "topics",
        f"{CLOCK}/on_playback_tick",
        "G03",
    ),
    (
        {"set": ["ROS_Lidar2D/isaac_create_render_product.inputs:enabled", False]},
        "topics",
        f"{LIDAR}/ROS_Lidar2D/isaac_create_render_product",
        "P01",
    ),
    (
        {"disconnect": "ROS_Drive/break_linear_velocity.inputs:tuple"},
        "follows",
        f"{DRIVE}/break_linear_velocity",
        "W01",
    ),
    (
        {"set": ["ROS_Drive/ros2_subscribe_twist.inputs:topicName", "/cmd"]},
        "follows",
        f"{DRIVE}/ros2_subscribe_twist",
        "P01",
    ),
    (
        {"targets": ["ROS_Drive/articulation_controller.inputs:targetPrim", "/World"]},
        "follows",
        f"{DRIVE}/articulation_controller",
        "R02",
    ),
    (
        {"set": ["ROS_Drive/differential_controller.inputs:maxAcceleration", 1.0]},
        "follows",
        f"{DRIVE}/differential_controller",
        "P11",
    ),
    (
        {"set": ["ROS_Drive/differential_controller.inputs:wheelRadius", 0.0]},
        "follows",
        f"{DRIVE}/differential_controller",
        "P01",
    ),
    (
        {"set": ["ROS_Drive/differential_controller.inputs:wheelRadius", 0.1]},
        "follows",
        f"{DRIVE}/differential_controller",
        "P01",
    ),
    (
        {"deactivate": "/Environment/GroundPlane/CollisionPlane"},
        "follows",
        f"{ROBOT}/base_footprint",
        "S13",
    ),
    (
        {"deactivate": "/turtlebot3_burger/joints/wheel_left_joint"},
        "follows",
        f"{DRIVE}/articulation_controller",
        "S07",
    ),
]


@pytest.mark.parametrize(
    ("step", "check", "prim", "rule"), CASES, ids=[f"{case[0]}" for case in CASES]
)
def test_a_fault_names_the_node_behind_it(
    tmp_path: Path, step: Step, check: str, prim: str, rule: str
) -> None:
    path = saved(broken("05", [step]), tmp_path)
    found = bad(behaviour(path))[check]
    assert (found["prim"], found["rule"]) == (prim, rule)


def test_the_robot_of_the_lab_is_driven_whatever_stands_beside_it(tmp_path: Path) -> None:
    beside: list[Step] = [
        {"copy": [ROBOT, "/Another"]},
        {"remove": "/Another/ROS_Drive"},
        # with a wheel more, so that it has the most joints
        {"copy": ["/Another/wheel_left_link", "/Another/wheel"]},
        {"copy": ["/Another/joints/wheel_left_joint", "/Another/joints/wheel"]},
        {"targets": ["/Another/joints/wheel.physics:body1", "/Another/wheel"]},
        {"declare": ["/Another.xformOp:translate", "double3", [3.0, 2.0, 0.0]]},
    ]
    assert not bad(behaviour(saved(broken("02", beside), tmp_path, "Lab3_02.usda")))


def test_a_second_lidar_is_behind_a_scan_that_comes_twice(tmp_path: Path) -> None:
    second: Step = {"copy": [LIDAR, "/World/Example_Rotary_2D"]}
    found = bad(behaviour(saved(broken("03", [second]), tmp_path, "Lab3_03.usda")))
    assert found["topics"]["rule"] == "L07"


def test_a_fault_that_another_domain_shows_names_the_node_behind_it(tmp_path: Path) -> None:
    step: Step = {"set": ["ROS_Clock/ros2_context.inputs:useDomainIDEnvVar", True]}
    found = bad(behaviour(saved(broken("01", [step]), tmp_path, "Lab3_01.usda"), drive=FIXED))[
        "topics"
    ]
    assert (found["prim"], found["rule"]) == (f"{CLOCK}/ros2_publish_clock", "P01")


def test_a_wheel_at_its_limit_is_behind_a_drive_that_goes_wrong(tmp_path: Path) -> None:
    stage = correct_stage("02")
    put("/turtlebot3_burger/joints/wheel_left_joint", "physics:upperLimit", 90.0)(stage)
    found = behaviour(saved(stage, tmp_path, "Lab3_02.usda"))
    assert {each["rule"] for each in bad(found).values()} == {"S07"}


def test_a_wheel_that_is_left_out_of_the_articulation_is_not_known_to_its_controller(
    tmp_path: Path,
) -> None:
    stage = correct_stage("02")
    joint = "/turtlebot3_burger/joints/wheel_left_joint"
    switch(joint, "physics:excludeFromArticulation", on=True)(stage)
    found = bad(behaviour(saved(stage, tmp_path, "Lab3_02.usda")))["follows"]
    assert found["message"].startswith("does not move")
    assert found["rule"] == "S07"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gravityMagnitude", 0.0),
        ("gravityDirection", (0.0, 0.0, 1.0)),
        ("gravityDirection", (0.0, -0.5, -1.0)),
    ],
)
def test_without_gravity_nothing_holds_the_robot(tmp_path: Path, name: str, value: object) -> None:
    stage = correct_stage("02")
    put("/physicsScene", f"physics:{name}", value)(stage)
    found = bad(behaviour(saved(stage, tmp_path, "Lab3_02.usda")))["follows"]
    assert found["rule"] == "S15"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gravityMagnitude", 9.81),
        ("gravityMagnitude", -math.inf),
        ("gravityDirection", (0.0, 0.0, -2.0)),
        ("gravityDirection", (0.0, 0.0, 0.0)),
    ],
)
def test_gravity_is_told_in_several_ways(tmp_path: Path, name: str, value: object) -> None:
    stage = correct_stage("02")
    put("/physicsScene", f"physics:{name}", value)(stage)
    assert behaviour(saved(stage, tmp_path, "Lab3_02.usda"))["verdict"] == "ok"


def test_every_check_is_put_into_words() -> None:
    assert list(PASSED) == list(CHECKS)


def test_a_drive_of_ones_own(tmp_path: Path) -> None:
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    found = behaviour(path, "--drive", "0.1,0,1 0,0.5,2 0,0,1")
    assert found["seconds"] == pytest.approx(4.5)
    _, x, y, heading = found["path"][-1]
    assert (x, y) == pytest.approx((1.8 + 0.1 * 0.033 / 0.025, 0.0), abs=0.01)
    assert heading == pytest.approx(1.0 * 0.033 / 0.025, abs=0.05)
    file = tmp_path / "drive.txt"
    file.write_text("0.1 0 1  # ahead\n\n0 0.5 2\n0 0 1\n")
    assert behaviour(path, "--drive", str(file))["path"] == found["path"]


def test_more_than_half_a_turn_is_told_as_it_was(tmp_path: Path) -> None:
    """299 frames of 0.9 rad/s, by the wheels of 0.033 m: 339 degrees."""
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    assert "left +339 degrees of +258" in sim(path, "--drive", "0,0.9,5").stdout


def test_an_arc_is_as_long_and_turns_as_far_as_told(tmp_path: Path) -> None:
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    assert behaviour(path, "--drive", "-0.1,0.5,2")["verdict"] == "ok"
    swapped: Step = {
        "swap": ["ROS_Drive/make_array.inputs:input0", "ROS_Drive/make_array.inputs:input1"]
    }
    path = saved(broken("02", [swapped]), tmp_path, "Lab3_02.usda")
    said = bad(behaviour(path, "--drive", "0.1,0.5,2"))["follows"]["message"]
    assert f"turn {math.degrees(1.0):.0f} degrees" in said


def test_a_long_drive_is_no_name_of_a_file() -> None:
    (session,) = drive_of(" ".join(["0.1,0,0.5"] * 1000), (1.0, 1.0))
    assert len(session.legs) == 1001


def test_a_file_that_is_no_text_is_wrong_use(tmp_path: Path) -> None:
    (tmp_path / "drive").write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match="is not text"):
        drive_of(str(tmp_path / "drive"), (1.0, 1.0))


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["none.usda", "--page", "x.usda"],
        ["none.usda", "--checkpoint", "99"],
        ["none.usda", "--drive", "x\0y"],
        ["none.usda", "--nope"],
    ],
)
def test_wrong_use_leaves_the_output_empty_for_programs(
    words: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["lab3", "sim", "--format", "json", *words])
    with pytest.raises(SystemExit) as left:
        main()
    printed = capsys.readouterr()
    assert (left.value.code, printed.out) == (2, "")
    assert len(printed.err.splitlines()) == 1


@pytest.mark.parametrize("drive", ["fast", "1,2", "1,2,0", "nan,0,1", "0,0,9999", "#"])
def test_what_is_no_drive_is_wrong_use(tmp_path: Path, drive: str) -> None:
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    with pytest.raises(UsageError, match="--drive"):
        sim(path, "--drive", drive)


def test_a_stage_that_cannot_be_read_says_so(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05.usda"
    path.write_text("no stage")
    found = behaviour(path)
    assert found["verdict"] == "unreadable"
    assert found["not_simulated"][0]["reason"]


def test_a_node_that_is_not_known_hides_no_fault_and_makes_none(tmp_path: Path) -> None:
    stage = broken("05", [{"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"}])
    node = stage.DefinePrim(f"{CLOCK}/mine", "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set("my.Node")
    path = saved(stage, tmp_path)
    found = behaviour(path)
    assert found["not_simulated"] == [{"prim": f"{CLOCK}/mine", "reason": "node type my.Node"}]
    assert [*bad(found)] == ["topics"]
    done = sim(path, "--drive", "0.15,0,0.2")
    assert done.exit_code == 1
    assert "not simulated: /World/ROS_Clock/mine" in done.stdout


def test_a_lidar_whose_asset_is_missing_is_assumed_and_said(tmp_path: Path) -> None:
    stage = correct_stage("05")
    lidar = stage.GetPrimAtPath("/turtlebot3_burger/base_scan/Lidar2D")
    for name in [*lidar.GetAuthoredPropertyNames()]:
        if name.startswith("omni:"):
            lidar.RemoveProperty(name)
    lidar.ClearMetadata("apiSchemas")
    lidar.GetReferences().AddReference("https://nowhere.invalid/Rotary_2D.usda")
    found = behaviour(saved(stage, tmp_path))
    assert found["verdict"] == "ok"
    assert "is assumed" in found["not_simulated"][0]["reason"]
    assert "/scan" in {each["name"] for each in found["topics"]}


def test_a_wall_in_the_way_is_no_fault_of_the_graphs(tmp_path: Path) -> None:
    stage = correct_stage("02")
    robot = stage.GetPrimAtPath("/turtlebot3_burger")
    robot.GetAttribute("xformOp:translate").Set((2.1, 0.0, 0.0))
    path = saved(stage, tmp_path, "Lab3_02.usda")
    found = {each["name"]: each for each in behaviour(path, drive="0.2,0,1")["checks"]}
    assert found["follows"]["verdict"] == "not judged"
    assert "a wall stops it" in found["follows"]["message"]
    assert "a wall stops the robot" in sim(path, drive="0.2,0,1").stdout


def test_a_check_with_a_dry_run_notes_what_goes_wrong(tmp_path: Path) -> None:
    step: Step = {"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"}
    path = saved(broken("01", [step]), tmp_path, "Lab3_01.usda")
    documents = []
    for more in ([], ["--sim"]):
        done = check(path, "--format", "json", *more)
        assert done.exit_code == 1
        documents.append(assert_valid(done.stdout)["results"][0])
    before, after = documents
    (note,) = [each for each in after["findings"] if each not in before["findings"]]
    assert (note["rule"], note["severity"]) == ("W01", "note")
    assert note["prim"] == f"{CLOCK}/ros2_publish_clock"
    assert "nothing on /clock" in note["message"]
    assert (after["verdict"], after["score"]) == (before["verdict"], before["score"])
    right = saved(correct_stage("01"), tmp_path, "Lab3_01.usda")
    done = check(right, "--format", "json", "--sim")
    assert json.loads(done.stdout)["results"][0]["findings"] == []
    (tmp_path / "Lab3_02.usda").write_text("no stage")
    done = check(tmp_path / "Lab3_02.usda", "--sim")
    assert done.exit_code == 1


ODD: list[tuple[str, Any, str]] = [
    ("/Environment/Furniture/PillarB.height", math.inf, "ok"),
    ("/Environment/Furniture/PillarB.xformOp:translate", (0.0, 0.0, -math.inf), "ok"),
    (
        "/turtlebot3_burger/joints/scan_joint.physics:localPos0",
        (1e30, math.nan, 0.0),
        "bad",
    ),
    (f"{LIDAR}.omni:sensor:Core:patternFiringRateHz", 2**32 - 1, "bad"),
    ("ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:frameSkipCount", 4000000, "bad"),
    ("ROS_Drive/make_array.inputs:arraySize", 2**31 - 1, "bad"),
    (f"{CAMERA}.focalLength", math.nan, "ok"),
    (f"{CAMERA}.horizontalAperture", 0.0, "ok"),
]


@pytest.mark.parametrize(("place", "value", "verdict"), ODD)
def test_odd_values_end_in_a_verdict(
    tmp_path: Path, place: str, value: object, verdict: str
) -> None:
    path = saved(broken("05", [{"set": [place, value]}]), tmp_path)
    page = tmp_path / "sim.html"
    found = behaviour(path, "--drive", "0.15,0,2", "--page", str(page))
    assert found["verdict"] == verdict
    assert page.stat().st_size < 1_000_000


def test_a_limit_that_is_no_number_limits_nothing(tmp_path: Path) -> None:
    step: Step = {"set": ["ROS_Drive/differential_controller.inputs:maxLinearSpeed", math.nan]}
    path = saved(broken("02", [step]), tmp_path, "Lab3_02.usda")
    assert [*bad(behaviour(path, drive=FIXED))] == ["limits"]


def test_a_value_of_another_type_counts_for_nothing(tmp_path: Path) -> None:
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    damping, place = "float drive:angular:physics:damping = 0.2", "point3f physics:localPos0 = ("
    words = path.read_text()
    path.write_text(words.replace(damping, damping.replace("float", "token").replace("0.2", '"x"')))
    assert [*bad(behaviour(path))] == ["follows"]
    path.write_text(words.replace(place, f'token physics:lowerLimit = "x"\n {place}'))
    assert behaviour(path)["verdict"] == "ok"


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("double size", 'string {} = "x"'),
        ("double height", "floot {} = 0.5"),
        ("double radius", 'string {} = "x"'),
        ("float omni:sensor:tickRate", 'string {} = "x"'),
        ("float omni:sensor:tickRate", "floot {} = 0.5"),
    ],
)
def test_a_size_or_rate_of_another_type_is_that_of_the_schema(
    tmp_path: Path, name: str, written: str
) -> None:
    path = saved(correct_stage("05"), tmp_path)
    value = re.compile(rf"{name} = .+")
    assert value.search(path.read_text())
    path.write_text(value.sub(written.format(name.split()[1]), path.read_text()))
    found = behaviour(path, "--drive", "0.15,0,0.2")  # a wheel of 1 m starts inside a wall
    assert found["verdict"] in {"ok", "bad", "not judged"}
    assert {"topics": "ok", "tree": "ok"}.items() <= {
        check["name"]: check["verdict"] for check in found["checks"]
    }.items()


def test_a_value_of_another_precision_is_read(tmp_path: Path) -> None:
    path = saved(correct_stage("02"), tmp_path, "Lab3_02.usda")
    words = path.read_text()
    assert "double inputs:wheelRadius" in words
    path.write_text(words.replace("double inputs:wheelRadius", "float inputs:wheelRadius"))
    assert behaviour(path)["verdict"] == "ok"


@pytest.mark.parametrize("unit", [0.0, -1.0, math.nan, 1e-12])
def test_a_unit_that_is_none_is_a_metre(tmp_path: Path, unit: float) -> None:
    stage = correct_stage("02")
    stage.SetMetadata("metersPerUnit", unit)
    assert behaviour(saved(stage, tmp_path, "Lab3_02.usda"))["verdict"] == "ok"


def test_the_benchmark_of_dry_runs_prints_both_figures(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["--runs", "1", "--slow", "0.1", "--robots", "2"]
    monkeypatch.setattr(sys, "argv", ["bench_sim.py", *words])
    load_benchmark("bench_sim").main()
    printed = capsys.readouterr().out
    assert re.findall(r"^(\w+ scan): [\d.]+ s played", printed, flags=re.MULTILINE) == [
        "with scan",
        "without scan",
    ]
    assert re.search(r"^2 robots: [\d.]+ s of the processor", printed, flags=re.MULTILINE)


def test_a_dry_run_names_only_rules_that_find_something(tmp_path: Path) -> None:
    inverted = correct_stage("02")
    put(f"{ROBOT}/joints/wheel_left_joint", "drive:angular:physics:damping", 0.0)(inverted)
    lab = saved(inverted, tmp_path, "Lab3_02_ros_drive.usda")
    for path, command in ((REPOSITORY / "docs/examples/carter.usda", "lint"), (lab, "check")):
        report = json.loads(invoke(command, path, "--format", "json").stdout)["results"][0]
        shown = json.loads(sim(path, "--format", "json").stdout)
        named = {each["rule"] for each in shown["checks"] if each["verdict"] == "bad"} - {""}
        assert named
        assert named <= {each["rule"] for each in report["findings"]}
