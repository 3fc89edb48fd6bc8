"""What time samples and splines make of a stage: what plays when the timeline starts counts."""

from __future__ import annotations

import weakref
from pathlib import Path

import pytest
from breaking import broken, correct_stage, judged, place, the_lab
from pxr import Sdf, Ts, Usd

from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import against_starter, open_starter
from lab3_usd.stage.compare.stages import compare_starter
from lab3_usd.stage.read import opening
from lab3_usd.stage.read.properties import changes_after_start, hold_start_values
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import build_starter

LIDAR = "/turtlebot3_burger/base_scan/Lidar2D"
CAMERA = "/turtlebot3_burger/base_footprint/Camera_1"
MASS = "/turtlebot3_burger/base_link.physics:mass"
RADIUS = "ROS_Drive/differential_controller.inputs:wheelRadius"
TOPIC = "ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:topicName"


def errors(*steps: dict[str, object]) -> list[tuple[str, str]]:
    findings = judged(broken("04", list(steps)), "04").findings
    return [(finding.rule, finding.severity) for finding in findings if finding.severity != "note"]


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([{"sample": [f"{LIDAR}.xformOp:translate", 0, [9, 9, 9]]}], [("L04", "error")]),
        ([{"sample": [f"{LIDAR}.xformOp:translate", 7, [9, 9, 9]]}], [("L04", "error")]),
        ([{"sample": [TOPIC, 0, "scan1"]}], [("P01", "error")]),
        ([{"clear": TOPIC}, {"sample": [TOPIC, 0, "/scan"]}], []),
        ([{"set": [TOPIC, "scan1"]}, {"sample": [TOPIC, 0, "/scan"]}], []),
        ([{"sample": [f"{LIDAR}.omni:sensor:tickRate", 0, 20.0]}], [("L05", "error")]),
        (
            [{"begin": 10}, {"sample": [TOPIC, 0, "scan1"]}, {"sample": [TOPIC, 10, "/scan"]}],
            [],
        ),
        (
            [{"begin": 10}, {"sample": [TOPIC, 0, "/scan"]}, {"sample": [TOPIC, 10, "scan1"]}],
            [("P01", "error")],
        ),
        (
            [{"sample": [TOPIC, 0, "/scan"]}, {"sample": [TOPIC, 9, "scan1"]}],
            [("S30", "warning")],
        ),
        (
            [
                {"sample": [f"{LIDAR}.xformOp:translate", 0, [0, 0, 0]]},
                {"sample": [f"{LIDAR}.xformOp:translate", 9, [0, 0, 2]]},
            ],
            [("S30", "error")],
        ),
        (
            [
                {"sample": [f"{LIDAR}.omni:sensor:tickRate", 0, 10.0]},
                {"sample": [f"{LIDAR}.omni:sensor:tickRate", 9, 1.0]},
            ],
            [("S30", "error")],
        ),
        ([{"spline": [f"{CAMERA}.focalLength", (0, 24.0)]}], [("C06", "error")]),
        (
            [{"clear": f"{CAMERA}.focalLength"}, {"spline": [f"{CAMERA}.focalLength", (0, 18.0)]}],
            [],
        ),
        ([{"spline": [f"{LIDAR}.omni:sensor:tickRate", (5, 20.0)]}], [("L05", "error")]),
        ([{"spline": [RADIUS, (0, 0.05)]}], [("P01", "error")]),
        ([{"spline": [RADIUS, (0, 0.05)]}, {"sample": [RADIUS, 0, 0.025]}], []),
        ([{"spline": [RADIUS, (0, 0.025), (9, 0.05)]}], [("S30", "warning")]),
        ([{"begin": 9}, {"spline": [MASS, (0, 5.0), (9, 0.825735)]}], []),
        ([{"spline": [MASS, (0, 5.0), (9, 0.825735)]}], [("S04", "error"), ("S30", "warning")]),
    ],
)
def test_what_plays_at_the_start_counts(
    steps: list[dict[str, object]], found: list[tuple[str, str]]
) -> None:
    assert errors(*steps) == found


def test_a_finding_is_placed_where_the_samples_are_written(tmp_path: Path) -> None:
    path = build_checkpoint(None, "05", tmp_path / "Lab3_05.usda")
    layer = Sdf.Layer.FindOrOpen(str(path))
    layer.SetTimeSample(f"{LIDAR}.xformOp:translate", 0, (9, 9, 9))
    layer.Save()
    (found,) = [
        finding for finding in check_stage(path, "05").findings if finding.severity == "error"
    ]
    assert found.layer == str(path)
    lines = path.read_text().splitlines()
    assert "xformOp:translate" in lines[(found.line or 0) - 1]


def wall(stage: Usd.Stage) -> Usd.Attribute:
    """Where the first thing of the room that collides stands."""
    for prim in stage.Traverse():
        inside = str(prim.GetPath()).startswith("/turtlebot3_burger")
        attribute = prim.GetAttribute("xformOp:translate")
        if "PhysicsCollisionAPI" in prim.GetAppliedSchemas() and attribute and not inside:
            return attribute
    raise AssertionError("the room has no walls")


@pytest.mark.parametrize("time", [0.0, 30.0])
def test_a_wall_that_is_moved_at_the_start_differs_from_the_starter(time: float) -> None:
    starter, stage = correct_stage("00"), correct_stage("05")
    wall(stage).Set((3.0, 3.0, 0.0), time)
    hold_start_values(stage)
    changes = compare_starter(starter, stage, the_lab(), "05").changes
    assert [change.prim for change in changes] == [str(wall(stage).GetPrim().GetPath())]


def test_a_wall_that_moves_later_is_a_warning() -> None:
    stage = correct_stage("05")
    attribute = wall(stage)
    attribute.Set(attribute.Get(), 0)
    attribute.Set((3.0, 3.0, 0.0), 30)
    found = [(f.rule, f.prim) for f in judged(stage, "05").findings if f.severity == "warning"]
    assert found == [("S30", str(attribute.GetPrim().GetPath()))]


@pytest.mark.parametrize(
    ("checkpoint", "place", "first", "then"),
    [
        ("05", "/turtlebot3_burger.xformOp:translate", (1.8, 0, 0), (0, 0, 0)),
        ("03", "/turtlebot3_burger/base_scan.xformOp:translate", (-0.032, 0, 0.182), (0, 0, 3)),
        ("00", "/turtlebot3_burger/base_link.physics:mass", 0.825735, 3.0),
    ],
)
def test_samples_of_the_given_starter_are_nobodys_fault(
    tmp_path: Path, checkpoint: str, place: str, first: object, then: object
) -> None:
    starter = tmp_path / "starter.usda"
    build_starter(starter)
    layer = Sdf.Layer.FindOrOpen(str(starter))
    layer.SetTimeSample(place, 0, first)
    layer.SetTimeSample(place, 50, then)
    layer.Save()
    path = build_checkpoint(starter, checkpoint, tmp_path / f"Lab3_{checkpoint}.usda")
    assert against(starter, path, checkpoint) == []
    stage = Sdf.Layer.FindOrOpen(str(path))
    stage.SetTimeSample(place, 50, first)
    stage.SetTimeSample(place, 60, (7, 7, 7) if isinstance(then, tuple) else 9.0)
    stage.Save()
    assert "S30" in against(starter, path, checkpoint)


def against(starter: Path, path: Path, checkpoint: str) -> list[str]:
    result = check_stage(path, checkpoint)
    found = against_starter(result, open_starter(starter, the_lab()), the_lab()).findings
    return [each.rule for each in found if each.severity != "note"]


def test_a_stage_without_samples_is_left_alone() -> None:
    stage = correct_stage("05")
    hold_start_values(stage)
    assert stage.GetSessionLayer().empty
    assert changes_after_start(stage) == ()


def test_a_spline_that_rises_behind_its_last_knot_changes() -> None:
    stage = correct_stage("05")
    stage.SetEndTimeCode(100)
    spline = Ts.Spline("float")
    spline.SetKnot(Ts.Knot("float", time=0, value=18.0))
    after = Ts.Extrapolation(Ts.ExtrapSloped)
    after.slope = 0.5
    spline.SetPostExtrapolation(after)
    stage.GetAttributeAtPath(f"{CAMERA}.focalLength").SetSpline(spline)
    found = [(each.rule, each.severity) for each in judged(stage, "05").findings]
    assert ("S30", "warning") in found


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_splines_are_seen_in_files_and_in_memory(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"Lab3_05.{ending}"
    stage = broken("05", [{"spline": [MASS, (0, 5.0)]}])
    stage.GetRootLayer().Export(str(path))
    for varying in (stage, Usd.Stage.Open(str(path))):
        hold_start_values(varying)
        assert varying.GetAttributeAtPath(MASS).Get() == 5.0


def test_a_stage_is_held_once() -> None:
    stage = correct_stage("05")
    path = place(TOPIC)
    stage.GetAttributeAtPath(path).Set("/scan", 0)
    stage.GetAttributeAtPath(path).Set("scan1", 3)
    for _ in range(2):
        hold_start_values(stage)
        assert [(each.property, each.time) for each in changes_after_start(stage)] == [
            ("inputs:topicName", 3.0)
        ]


def test_a_stage_that_stays_open_is_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at: list[Usd.Stage] = []
    monkeypatch.setattr(opening, "hold_start_values", looked_at.append)
    stage = correct_stage("05")
    for _ in range(2):
        read_model(stage, the_lab().platform, "x")
    assert len(looked_at) == 2  # it may have been edited in the meantime
    with opening.kept_open():
        opening.held(stage)
        read_model(stage, the_lab().platform, "x")
    assert len(looked_at) == 3


def test_no_other_stage_is_taken_for_one_that_was_held() -> None:
    with opening.kept_open():
        known = weakref.ref(opening.held(correct_stage("05")))
        assert known() is not None  # else the next stage may be where it was
    assert known() is None


def test_a_value_that_is_blocked_at_the_start_is_none() -> None:
    stage = correct_stage("05")
    attribute = stage.GetAttributeAtPath(place(TOPIC))
    attribute.Set(Sdf.ValueBlock(), 0)
    hold_start_values(stage)
    assert attribute.Get() is None


def test_what_is_nowhere_in_the_scene_or_never_asked_for_may_change() -> None:
    gone = {"define": ["/World/Gone", "Xform"]}
    steps = [
        gone,
        {"declare": ["/World/Gone.physics:mass", "float"]},
        {"sample": ["/World/Gone.physics:mass", 0, 1.0]},
        {"sample": ["/World/Gone.physics:mass", 9, 2.0]},
        {"deactivate": "/World/Gone"},
        {"declare": ["/turtlebot3_burger.userProperties:note", "string"]},
        {"sample": ["/turtlebot3_burger.userProperties:note", 0, "a"]},
        {"sample": ["/turtlebot3_burger.userProperties:note", 9, "b"]},
    ]
    assert errors(*steps) == []


def test_a_transform_that_no_order_uses_may_change() -> None:
    steps = [
        {"declare": [f"{LIDAR}.xformOp:translate:unused", "double3"]},
        {"sample": [f"{LIDAR}.xformOp:translate:unused", 0, [0, 0, 0]]},
        {"sample": [f"{LIDAR}.xformOp:translate:unused", 9, [9, 9, 9]]},
    ]
    assert errors(*steps) == []


ROBOT, CAMERA = "/turtlebot3_burger", "/turtlebot3_burger/base_footprint/Camera_1"


@pytest.mark.parametrize(
    ("where", "first", "then", "severity"),
    [
        (f"{ROBOT}.xformOp:translate", [1.8, 0, 0], [0, 0, 0], "error"),
        (f"{CAMERA}.xformOp:translate", [0.1, 0, 0.2], [0.1, 0, 1.2], "error"),
        (f"{CAMERA}.omni:sensor:tickRate", 10.0, 30.0, "error"),
        (f"{CAMERA}.focalLength", 18.0, 50.0, "warning"),
        ("ROS_Drive/differential_controller.inputs:wheelRadius", 0.025, 0.033, "warning"),
    ],
)
def test_what_changes_later_is_said_where_it_is(
    where: str, first: object, then: object, severity: str
) -> None:
    found = judged(
        broken("04", [{"sample": [where, 0, first]}, {"sample": [where, 9, then]}]), "04"
    ).findings
    prim, name = place(where).split(".")
    assert [(f.rule, f.prim, f.property, f.severity) for f in found if f.severity != "note"] == [
        ("S30", prim, name, severity)
    ]


def test_samples_that_agree_or_lie_before_the_start_or_matter_to_nothing_are_silent() -> None:
    flag = "/World/Flag.xformOp:translate"
    steps = [
        {"begin": 20},
        {"sample": [f"{LIDAR}.xformOp:translate", 20, [0, 0, 0]]},
        {"sample": [f"{LIDAR}.xformOp:translate", 50, [0, 0, 1e-9]]},
        {"sample": [TOPIC, 10, "scan1"]},
        {"sample": [TOPIC, 20, "/scan"]},
        {"define": ["/World/Flag", "Xform"]},
        {"declare": [flag, "double3"]},
        {"declare": ["/World/Flag.xformOpOrder", "token[]", ["xformOp:translate"]]},
        {"sample": [flag, 20, [0, 0, 0]]},
        {"sample": [flag, 30, [0, 0, 1]]},
        {"sample": ["ROS_Drive/ros2_context.ui:nodegraph:node:pos", 30, [0, 0]]},
    ]
    assert errors(*steps) == []
