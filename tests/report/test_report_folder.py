"""The report of a folder: each fault once, with its stages, and what to repair first."""

from __future__ import annotations

import json

import pytest
from msgspec.structs import replace
from report_examples import UNREADABLE, requirement

from lab3_usd.model.finding import (
    ChecklistItem,
    Finding,
    Report,
    StageResult,
    Submission,
)
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options
from lab3_usd.spec.load.loader import load_lab

RADIUS = Finding(
    "P01",
    "wrong-value",
    "error",
    "/turtlebot3_burger/ROS_Drive/differential_controller",
    "inputs:wheelRadius is 0.033, expected 0.025",
    property="inputs:wheelRadius",
    handout="C8",
)
RESET = replace(RADIUS, rule="P09", name="stamp-reset", severity="note", message="stamps restart")


def stage(checkpoint: str, *findings: Finding) -> StageResult:
    asked = tuple(requirement("ROS_Drive", name, met=name == "a") for name in "ab")
    return StageResult(f"Lab3_{checkpoint}.usda", checkpoint, findings, asked)


def told(*results: StageResult, **options: object) -> str:
    shown = render("text", Report(results), None, Options(**options))  # type: ignore[arg-type]
    return " ".join(shown.split())


def test_a_fault_that_is_carried_along_is_told_once() -> None:
    shown = told(stage("02", RADIUS), stage("03", RADIUS), stage("04", RADIUS))
    assert shown.count("error P01") == 1


@pytest.mark.parametrize(
    ("having", "where"),
    [
        (("02",), "in 02, repaired in 03"),
        (("05",), "in 05"),
        (("04", "05"), "since 04, also in 05"),
        (("02", "03", "04", "05"), "since 02, also in 03 to 05"),
        (("02", "04", "05"), "since 02, also in 04, 05"),
        (("02", "03"), "since 02, also in 03, repaired in 04"),
    ],
)
def test_a_fault_says_which_stages_have_it(having: tuple[str, ...], where: str) -> None:
    stages = [stage(each, *((RADIUS,) if each in having else ())) for each in ("02", "03", "04")]
    shown = told(*stages, stage("05", *((RADIUS,) if "05" in having else ())))
    assert f"inputs:wheelRadius is 0.033, expected 0.025 ({where}; handout C8)" in shown


def test_the_order_of_the_command_line_does_not_decide_what_came_first() -> None:
    shown = told(stage("04", RADIUS), stage("02", RADIUS), stage("03"))
    assert "since 02, also in 04" in shown


def test_a_stage_that_cannot_be_read_has_repaired_nothing() -> None:
    shown = told(stage("02", RADIUS), stage("03", UNREADABLE), stage("04"))
    assert "in 02, repaired in 04" in shown


def test_a_stage_that_does_not_ask_for_it_has_repaired_nothing() -> None:
    asked = (requirement("TF_Imu", "a", met=False),)
    extra = replace(stage("03", RADIUS), requirements=asked)
    assert "repaired" not in told(stage("02"), extra, stage("04"))


def test_what_names_the_requirement_that_it_fails_is_repaired_where_that_is_asked_for() -> None:
    asked = requirement("ROS_Drive", "a", met=False)
    fault, other = replace(RADIUS, unmet=(asked.id,)), requirement("TF_Imu", "a", met=True)
    extra = replace(stage("03", fault), requirements=(asked, other))
    assert "in 03, repaired in 04" in told(stage("02"), extra, stage("04"))


def test_stages_of_one_checkpoint_are_told_each_by_itself() -> None:
    other = replace(stage("02", RADIUS), path="other/Lab3_02.usda")
    assert told(stage("02", RADIUS), other).count("error P01") == 2


def test_each_asks_for_every_file_by_itself() -> None:
    assert told(stage("02", RADIUS), stage("03", RADIUS), each=True).count("error P01") == 2


def test_a_note_of_every_stage_is_told_once_and_after_the_errors() -> None:
    shown = told(stage("02", RESET, RADIUS), stage("03", RESET, RADIUS))
    assert shown.count("stamps restart") == 1
    assert shown.index("error P01") < shown.index("note P09")


def fault(number: int, handout: str) -> Finding:
    return replace(RADIUS, prim=f"/node{number}", handout=handout)


def test_what_blocks_most_checkpoints_is_to_be_repaired_first() -> None:
    early, late = fault(1, "B4"), fault(4, "D8")
    alone = [fault(2, "B5"), fault(3, "B6")]
    shown = told(stage("01", early, *alone), stage("03", late), stage("04", late))
    first = shown[shown.index("Repair these first") : shown.index("error P01")]
    assert first.index("/node4") < first.index("/node1")
    assert "/node3" not in first


def test_points_decide_between_faults_of_as_many_checkpoints() -> None:
    faults = [fault(number, "B4") for number in range(3)]
    shown = told(stage("01", *faults), stage("02", fault(4, "C8")), points={"01": 5, "02": 15})
    assert "Repair these first 1. P01 /node4" in shown


def test_few_errors_need_no_list_of_what_comes_first() -> None:
    faults = [fault(number, "B4") for number in range(3)]
    assert "Repair these first" not in told(stage("01", *faults), stage("02"))


def test_errors_of_the_same_stages_need_no_list_of_what_comes_first() -> None:
    faults = [fault(number, "B4") for number in range(5)]
    assert "Repair these first" not in told(stage("01"), stage("02", *faults))


def told_of_a_folder(*to_come: str, results: tuple[StageResult, ...], **options: object) -> str:
    item = ChecklistItem("Isaac Sim", "Drive graph exists", "not met")
    folder = Submission("work", checklist=(item,), handed_in=False, to_come=to_come)
    inside = tuple(replace(result, path=f"work/{result.path}") for result in results)
    report = Report(inside, (folder,))
    shown = render("text", report, None, Options(**options))  # type: ignore[arg-type]
    return " ".join(shown.split())


TO_COME = tuple(load_lab().checkpoints)[3:]
AHEAD = f"03 to {TO_COME[-1]}"
BEGUN = (stage("00"), stage("01"), stage("02"))


def test_what_is_not_begun_is_one_line_and_the_next_part_another() -> None:
    shown = told_of_a_folder(*TO_COME, results=BEGUN)
    assert f"{AHEAD}: not begun" in shown
    assert "next Part D of the handout" in shown
    assert "ROS_Lidar2D" in shown
    assert "save the stage as Lab3_03_lidar.usda" in shown


def test_errors_are_to_be_repaired_before_the_next_part() -> None:
    results = (*BEGUN[:2], stage("02", RADIUS))
    shown = told_of_a_folder(*TO_COME, results=results)
    assert "next repair the errors; then Part D" in shown


def test_a_stage_that_was_skipped_is_named() -> None:
    shown = told_of_a_folder("01", *TO_COME, results=(BEGUN[0], BEGUN[2]))
    assert f"01: no stage; {AHEAD}: not begun" in shown


def test_after_the_last_checkpoint_handing_in_comes_next() -> None:
    results = tuple(stage(f"0{number}") for number in range(9))
    assert "next lab3 check work --submission" in told_of_a_folder(results=results)


@pytest.mark.parametrize(("verbosity", "listed"), [("normal", False), ("verbose", True)])
def test_the_checklist_of_a_folder_that_is_worked_on_is_for_the_verbose(
    verbosity: str, *, listed: bool
) -> None:
    shown = told_of_a_folder("03", results=BEGUN, verbosity=verbosity)
    assert ("Drive graph exists" in shown) == listed


def test_equal_faults_share_an_id_in_json_wherever_they_stand() -> None:
    moved = replace(RADIUS, layer="Lab3_03.usda", line=7)
    other = replace(RADIUS, message="inputs:wheelRadius is 0.05, expected 0.025")
    report = Report((stage("02", RADIUS), stage("03", moved), stage("04", other)))
    results = json.loads(render("json", report))["results"]
    first, second, third = (result["findings"][0]["fault"] for result in results)
    assert first == second != third


@pytest.mark.parametrize("form", ["html", "markdown"])
def test_a_report_of_a_folder_that_is_worked_on_has_no_checklist(form: str) -> None:
    item = ChecklistItem("Isaac Sim", "Drive graph exists", "not met")
    folder = Submission("work", checklist=(item,), handed_in=False, to_come=TO_COME)
    inside = tuple(replace(result, path=f"work/{result.path}") for result in BEGUN)
    shown = render(form, Report(inside, (folder,)))
    assert "Drive graph exists" not in shown
    assert "Checklist" not in shown
    assert AHEAD in shown
    assert "not begun" in shown
    assert ("<b>Next</b> Part D of the handout" in shown) == (form == "html")
    handed_in = replace(folder, handed_in=True, to_come=())
    assert "Drive graph exists" in render(form, Report(inside, (handed_in,)))
