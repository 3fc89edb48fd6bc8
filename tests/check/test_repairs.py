"""Repairs as data: which findings have one, how reports show it, and that grading ignores it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from breaking import Step, broken, correct_stage, judged
from foreign_robots import TICK, write_graph
from in_process import invoke
from msgspec.structs import replace
from pxr import Gf, Usd, UsdGeom

from lab3_usd.grade.intake.staging import StagedSubmission
from lab3_usd.grade.workers.submission_grading import _completed
from lab3_usd.model.changes import (
    Edit,
    MovePrim,
    RemovePrim,
    RemoveSchema,
)
from lab3_usd.model.finding import Submission
from lab3_usd.pipeline.folder import FolderResult
from lab3_usd.pipeline.stage import check_stage

CLOCK = "/World/ROS_Clock"
DRIVE = "/turtlebot3_burger/ROS_Drive"
CONTROLLER = f"{DRIVE}/differential_controller"
WRONG_RADIUS: Step = {"set": [f"{CONTROLLER}.inputs:wheelRadius", 0.033]}

# Beside the repairs in the goldens of all cases.
CASES: dict[str, tuple[Step, tuple[Edit, ...], bool]] = {
    "a ground that falls is not a rigid body any more": (
        {"schema": ["/Environment/GroundPlane", "PhysicsRigidBodyAPI"]},
        (RemoveSchema("/Environment/GroundPlane", "PhysicsRigidBodyAPI"),),
        True,
    ),
    "a room that was dragged below the robot is moved back when asked for": (
        {"move": ["/Environment", "/turtlebot3_burger/Environment"]},
        (MovePrim("/turtlebot3_burger/Environment", "/Environment"),),
        False,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_finding_has_the_edits_that_settle_it(case: str) -> None:
    step, edits, is_safe = CASES[case]
    findings = [finding for finding in judged(broken("02", [step]), "02").findings if finding.fix]
    assert [(finding.fix.edits, finding.fix.safe) for finding in findings if finding.fix] == [
        (edits, is_safe)
    ]


ANOTHER = "/Graph/ROS_Odometry"


def second_odom(stage: Usd.Stage) -> str:
    """A publisher of `world -> odom` as Isaac Sim's menu makes it."""
    values = {"parentFrameId": "world", "childFrameId": "odom"}
    kind = "ros.ROS2PublishRawTransformTree"
    nodes = {"Tick": TICK, "TFWorld2Odom": (kind, {**values, "topicName": "/tf"})}
    write_graph(stage, ANOTHER, nodes, ["Tick.tick -> TFWorld2Odom.execIn"])
    return f"{ANOTHER}/TFWorld2Odom"


def second_clock(stage: Usd.Stage, *more: str) -> str:
    """A second publisher of the clock, in a graph with publishers of these topics."""
    nodes = {"Tick": TICK, "Clock": ("ros.ROS2PublishClock", {"topicName": "/clock"})}
    nodes |= {name: ("ros.ROS2PublishClock", {"topicName": name}) for name in more}
    wires = [f"Tick.tick -> {name}.execIn" for name in ("Clock", *more)]
    write_graph(stage, "/Graph/ROS_Clock", nodes, wires)
    return "/Graph/ROS_Clock"


def removed(stage: Usd.Stage, checkpoint: str) -> dict[str, list[str]]:
    """Which prims the findings would remove, by their rules."""
    findings = judged(stage, checkpoint).findings
    return {
        found.rule: [edit.prim for edit in found.fix.edits if isinstance(edit, RemovePrim)]
        for found in findings
        if found.fix
    }


def test_a_publisher_of_a_forbidden_frame_in_a_graph_of_its_own_is_removed() -> None:
    stage = correct_stage("05")
    node = second_odom(stage)
    assert removed(stage, "05") == {"T07": [node]}


def test_a_graph_that_only_repeats_is_removed_as_a_whole() -> None:
    stage = correct_stage("02")
    graph = second_clock(stage)
    assert removed(stage, "02") == {"Q01": [graph]}


def test_of_a_graph_that_publishes_more_only_the_publisher_is_removed() -> None:
    stage = correct_stage("02")
    graph = second_clock(stage, "chatter")
    assert removed(stage, "02") == {"Q01": [f"{graph}/Clock"]}


def test_which_of_two_publishers_is_too_many_on_a_topic_of_ones_own_is_left_open() -> None:
    stage = correct_stage("02")
    nodes = {"Tick": TICK}
    nodes |= {name: ("ros.ROS2PublishClock", {"topicName": "chatter"}) for name in ("One", "Other")}
    wires = [f"Tick.tick -> {name}.execIn" for name in ("One", "Other")]
    write_graph(stage, "/Graph/Own", nodes, wires)
    assert offers(stage, "02") == [("Q01", False)]


def offers(stage: Usd.Stage, checkpoint: str) -> list[tuple[str, bool]]:
    found = judged(stage, checkpoint).findings
    return [(each.rule, each.fix is not None) for each in found if each.severity != "note"]


def test_the_frame_of_a_joint_that_was_turned_round_is_not_restored() -> None:
    steps: list[Step] = []
    for side in ("left", "right"):
        joint = f"/turtlebot3_burger/joints/wheel_{side}_joint"
        ends = ("base_link", f"wheel_{side}_link")
        steps += [
            {"targets": [f"{joint}.physics:body{number}", f"/turtlebot3_burger/{ends[1 - number]}"]}
            for number in (0, 1)
        ]
        steps += [
            {"swap": [f"{joint}.physics:local{name}0", f"{joint}.physics:local{name}1"]}
            for name in ("Pos", "Rot")
        ]
    assert offers(broken("02", steps), "02") == [("S09", False), ("S09", False)]


def test_an_asset_that_is_not_here_is_not_restored() -> None:
    stage = broken("03", [])
    lidar = stage.GetPrimAtPath("/turtlebot3_burger/base_scan/Lidar2D")
    lidar.GetReferences().AddReference("elsewhere/Example_Rotary.usda")
    assert ("L11", False) in offers(stage, "03")


@pytest.mark.parametrize("lowered", ["", "/GroundPlane", "/GroundPlane/CollisionPlane"])
def test_a_ground_is_restored_where_it_or_a_prim_above_it_was_moved(lowered: str) -> None:
    stage = correct_stage("02")
    moved = UsdGeom.Xformable(stage.GetPrimAtPath(f"/Environment{lowered}"))
    moved.MakeMatrixXform().Set(Gf.Matrix4d().SetTranslate((0.0, 0.0, -0.1)))
    assert offers(stage, "02") == [("S19", True)]


def test_notes_have_no_repair() -> None:
    stage = broken("02", [{"set": [f"{CLOCK}/ros2_publish_clock.inputs:topicName", "clock"]}])
    found = judged(stage, "02").findings
    assert [(each.rule, each.fix) for each in found] == [("P08", None)]


@pytest.fixture
def wrong(tmp_path: Path) -> Path:
    path = tmp_path / "Lab3_02_ros_drive.usda"
    broken("02", [WRONG_RADIUS]).GetRootLayer().Export(str(path))
    return path


def report(path: Path, form: str) -> str:
    return invoke("check", path, "--format", form).stdout


def test_json_holds_the_edits(wrong: Path) -> None:
    (finding,) = json.loads(report(wrong, "json"))["results"][0]["findings"]
    assert finding["fix"]["edits"] == [
        {
            "edit": "set",
            "prim": CONTROLLER,
            "property": "inputs:wheelRadius",
            "type": "double",
            "value": 0.025,
        }
    ]


@pytest.mark.parametrize("comment", ["", "# a\fb", "# a\u2028b\u0085c"])
def test_sarif_holds_the_lines(wrong: Path, comment: str) -> None:
    wrong.write_text(wrong.read_text().replace("\n", f"  {comment}\n", 1))
    (result,) = json.loads(report(wrong, "sarif"))["runs"][0]["results"]
    (change,) = result["fixes"][0]["artifactChanges"]
    text = wrong.read_text()
    right = text.replace("wheelRadius = 0.033", "wheelRadius = 0.025")
    assert apply(text, change["replacements"]) == right


def apply(text: str, replacements: list[dict[str, Any]]) -> str:
    lines = text.split("\n")
    for replacement in reversed(replacements):
        region = replacement["deletedRegion"]
        new = replacement["insertedContent"]["text"].split("\n")[:-1]
        lines[region["startLine"] - 1 : region["endLine"] - 1] = new
    return "\n".join(lines)


def test_text_marks_what_can_be_repaired(wrong: Path) -> None:
    lines = report(wrong, "text").splitlines()
    assert any(line.startswith("error P01 [*] wrong-value") for line in lines)
    assert lines[-1] == f"[*] 1 finding can be repaired: lab3 fix {wrong}"


def test_text_marks_nothing_that_needs_unsafe(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_02_ros_drive.usda"
    broken("02", [{"remove": [f"{CLOCK}/ros2_context"]}]).GetRootLayer().Export(str(path))
    assert "[*]" not in report(path, "text")


def test_checking_leaves_the_stage_as_it_was(wrong: Path) -> None:
    old = wrong.read_bytes()
    report(wrong, "sarif")
    assert (wrong.read_bytes(), check_stage(wrong).verdict) == (old, "fail")


def test_reports_of_grading_hold_no_repairs(wrong: Path) -> None:
    result = check_stage(wrong)
    judged = FolderResult((result,), Submission("."))
    found = _completed(judged, "jane", StagedSubmission(Path(), "", (), {}), (), {})
    bare = tuple(replace(finding, fix=None) for finding in result.findings)
    assert found.results[0].findings == bare != result.findings
