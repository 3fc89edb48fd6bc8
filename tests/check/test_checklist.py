"""The handout's checklists: the lines are the handout's, and what was found decides them."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path

import pytest
from ros_outputs import EDGES, NO_RATE, view_frames
from submissions import (
    LAB,
    ROBOT,
    ROS,
    SPEC,
    Fault,
    checked,
    delete,
    edit,
    put,
    stage_name,
    write_submission,
)

from lab3_usd.check.registry import all_rules
from lab3_usd.model.finding import ChecklistItem
from lab3_usd.model.folder import Evidence
from lab3_usd.pipeline.stage import check_stage

LAST = list(LAB.checkpoints)[-1]
PEOPLE = {each.text for each in SPEC.checklist if each.person}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_submission(tmp_path / "ana")


def items(folder: Path) -> dict[tuple[str, str], ChecklistItem]:
    lines = checked(folder).submission.checklist
    return {(line.section, line.text): line for line in lines}


def item(folder: Path, text: str) -> ChecklistItem:
    (found,) = [each for (_, name), each in items(folder).items() if name == text]
    return found


# -- the lines


def test_the_completion_checklist_is_the_handouts(shared: Path) -> None:
    handout = (shared / "lab" / "handout.txt").read_text().splitlines()
    start = handout.index("Final Completion Checklist")
    wanted = [line.strip("• .\n") for line in handout[start:] if line.strip().startswith("•")]
    ours = [each.text for each in SPEC.checklist if each.section != "Lab Check-Off"]
    assert ours == wanted


def test_the_check_off_is_the_handouts(shared: Path) -> None:
    handout = (shared / "lab" / "handout.txt").read_text().splitlines()
    start = handout.index("Lab Check-Off")
    numbered = [line.strip() for line in handout[start : start + 20] if ". " in line[:6]]
    ours = [each.text for each in SPEC.checklist if each.section == "Lab Check-Off"]
    assert ours == [line.partition(". ")[2].rstrip(".") for line in numbered]


def test_everything_that_decides_a_line_exists(folder: Path) -> None:
    final = [requirement.id for requirement in check_stage(folder / stage_name(LAST)).requirements]
    for line in SPEC.checklist:
        assert set(line.rules) <= set(all_rules()), line.text
        assert set(line.deliverables) <= set(SPEC.deliverables), line.text
        for pattern in line.requirements:
            assert [each for each in final if fnmatchcase(each, pattern)], f"{line.text}: {pattern}"
        for name in line.shown:
            kind, _, target = name.partition(" ")
            commands = {(command.kind.name, command.target) for command in ROS.commands}
            assert (kind, target) in {*commands, ("goals", "")}, f"{line.text}: {name}"
            assert kind in Evidence.__struct_fields__, f"{line.text}: {name}"


# -- what decides them


def test_a_complete_submission_leaves_only_what_people_judge(folder: Path) -> None:
    states = {text: each.state for (_, text), each in items(folder).items()}
    assert {text for text, state in states.items() if state != "met"} == PEOPLE
    assert {states[text] for text in PEOPLE} == {"person"}


def test_a_line_that_is_met_gives_no_reason(folder: Path) -> None:
    assert {each.because for each in items(folder).values() if each.state == "met"} == {""}


NOT_MET: list[tuple[str, Fault, str]] = [
    (
        "ROS2 clock graph exists",
        edit(LAST, lambda s: s.RemovePrim("/World/ROS_Clock")),
        "ROS_Clock",
    ),
    (
        "Lidar sensor exists",
        edit(LAST, lambda s: s.RemovePrim(f"{ROBOT}/base_scan/Lidar2D")),
        "Lidar2D",
    ),
    (
        "Camera graph exists",
        edit(LAST, lambda s: s.RemovePrim(f"{ROBOT}/base_footprint/Camera_1/ROS_Camera")),
        "ROS_Camera",
    ),
    (
        "Robot articulation was not deleted",
        edit(
            LAST,
            lambda s: s.GetPrimAtPath(f"{ROBOT}/base_footprint").RemoveAppliedSchema(
                "PhysicsArticulationRootAPI"
            ),
        ),
        "Scene",
    ),
    (
        "Robot physics was not deleted",
        edit(
            LAST,
            lambda s: s.GetPrimAtPath(f"{ROBOT}/base_link").RemoveAppliedSchema(
                "PhysicsRigidBodyAPI"
            ),
        ),
        "Scene",
    ),
    ("Starter USD opened successfully", put(stage_name("00"), "no stage"), stage_name("00")),
    ("Stage saves successfully", put(stage_name(LAST), "no stage"), stage_name(LAST)),
    ("All USD or USDA checkpoint files submitted", delete(stage_name("04")), "Lab3_04_camera"),
    ("/scan publishes", put("results/topic_hz_scan.txt", NO_RATE), "E04"),
    ("AMCL is active", put("results/lifecycle_amcl.txt", "inactive [2]\n"), "E08"),
    (
        "The TF tree does not contain world → odom",
        put("results/view_frames.txt", view_frames(("world", "odom"), *EDGES[1:])),
        "E10",
    ),
    (
        "The TF tree contains map → odom → base_footprint",
        put("results/view_frames.txt", view_frames(EDGES[0], *EDGES[2:])),
        "E11",
    ),
    (
        "No frame has two competing parents",
        put("results/view_frames.txt", view_frames(("odom", "base_link"), *EDGES)),
        "E12",
    ),
    ("Code and configuration files submitted", delete("maps"), "M01"),
]


@pytest.mark.parametrize(
    ("text", "fault", "because"), NOT_MET, ids=[text for text, _, _ in NOT_MET]
)
def test_a_fault_decides_its_line(folder: Path, text: str, fault: Fault, because: str) -> None:
    fault(folder)
    found = item(folder, text)
    assert found.state == "not met"
    assert because in found.because


NOT_SHOWN = [
    ("/clock publishes", "results/topic_hz_clock.txt", "ros2 topic hz /clock"),
    ("/map publishes", "results/topic_echo_map.txt", "ros2 topic echo /map"),
    ("Map server is active", "results/lifecycle_map_server.txt", "ros2 lifecycle get /map_server"),
    ("odom → base_footprint exists", "results/tf2_echo_odom_base_footprint.txt", "tf2_echo"),
    ("Lab report submitted", "report.pdf", "lab report"),
    ("Screenshots included", "images/00.png", "10 found"),
    ("Video link submitted", "video.txt", "video"),
    ("Diagnostic outputs included", "results", "logs"),
]


def test_what_is_not_handed_in_is_not_shown(folder: Path) -> None:
    for _, gone, _ in NOT_SHOWN:
        delete(gone)(folder)
    found = {text: each for (_, text), each in items(folder).items()}
    assert {text: found[text].state for text, _, _ in NOT_SHOWN} == dict.fromkeys(
        (text for text, _, _ in NOT_SHOWN), "not shown"
    )
    assert [text for text, _, because in NOT_SHOWN if because not in found[text].because] == []


def test_a_tree_from_before_localization_does_not_show_the_final_one(folder: Path) -> None:
    (folder / "results" / "view_frames.txt").write_text(view_frames(*EDGES[1:]))
    found = item(folder, "The TF tree contains map → odom → base_footprint")
    assert found.state == "not shown"
    assert "E11" in found.because


def test_a_goal_that_was_not_reached_decides_both_lists(folder: Path) -> None:
    path = folder / "results" / "topic_echo_navigate_to_pose_action_status.txt"
    path.write_text(path.read_text().replace("status: 4", "status: 6"))
    found = items(folder)
    assert found["Localization", "Robot reaches a goal"].state == "not met"
    assert found["Lab Check-Off", "Nav2 reaches a goal"].state == "not met"


def test_what_a_later_part_adds_is_not_met_yet(folder: Path) -> None:
    for number in list(LAB.checkpoints)[3:]:
        delete(stage_name(number))(folder)
    found = item(folder, "Lidar graph exists")
    assert found.state == "not met"
    assert "02" in found.because
    assert item(folder, "Drive graph exists").state == "met"


def test_without_stages_the_graphs_are_not_shown(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    states = {text: each.state for (_, text), each in items(tmp_path).items()}
    assert states["ROS2 clock graph exists"] == "not shown"
    assert states["Stage saves successfully"] == "not shown"
    assert states["Robot stops at the goal"] == "person"


def test_a_fault_goes_before_what_a_person_judges(folder: Path) -> None:
    edit(LAST, lambda stage: stage.RemovePrim(f"{ROBOT}/ROS_Drive"))(folder)
    assert item(folder, "/cmd_vel controls the robot").state == "not met"
