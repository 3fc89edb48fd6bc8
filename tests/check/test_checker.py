"""One stage is judged at one checkpoint: what is read, what counts, and what a crash means."""

from __future__ import annotations

from pathlib import Path

import pytest
from breaking import STEPS, broken, correct_stage, judged, place, the_lab
from linting import add_failing_rule
from msgspec.structs import replace
from pxr import Usd

from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import finding_of
from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Finding, Problem, ordered
from lab3_usd.pipeline.stage import check_stage, checkpoint_of
from lab3_usd.stage.write.builder import build_checkpoint


def saved(stage: Usd.Stage, path: Path) -> Path:
    stage.GetRootLayer().Export(str(path))
    return path


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("Lab3_03_lidar.usda", "03"),
        ("Lab3_00_student_start.usd", "00"),
        ("Lab3_08.usdc", "08"),
        ("Lab3_031.usda", None),
        ("Lab3_99_more.usda", None),
        ("my_Lab3_03_lidar.usda", None),
        ("stage.usda", None),
    ],
)
def test_a_file_name_says_which_checkpoint_it_is(name: str, number: str | None) -> None:
    assert checkpoint_of(name, the_lab()) == number


def test_the_checkpoint_given_rules_over_the_file_name(tmp_path: Path) -> None:
    path = build_checkpoint(None, "02", tmp_path / "Lab3_01_ros_clock.usda")
    assert check_stage(path, "02").checkpoint == "02"
    result = check_stage(path)
    assert result.checkpoint == "01"
    assert [finding.rule for finding in result.findings if finding.severity != "note"] == ["G04"]


def test_a_file_without_a_number_needs_a_checkpoint(tmp_path: Path) -> None:
    path = build_checkpoint(None, "01", tmp_path / "stage.usda")
    with pytest.raises(UsageError, match="--checkpoint"):
        check_stage(path)


def test_a_checkpoint_that_does_not_exist_is_wrong_use(tmp_path: Path) -> None:
    path = build_checkpoint(None, "01", tmp_path / "stage.usda")
    with pytest.raises(UsageError, match="'11'"):
        check_stage(path, "11")


@pytest.mark.parametrize("checkpoint", the_lab().checkpoints)
def test_what_is_built_passes_with_every_requirement_met(tmp_path: Path, checkpoint: str) -> None:
    result = check_stage(build_checkpoint(None, checkpoint, tmp_path / "stage.usd"), checkpoint)
    assert result.verdict == "pass"
    assert [finding for finding in result.findings if finding.severity != "note"] == []
    assert [requirement.id for requirement in result.requirements if not requirement.met] == []
    assert result.score.earned == result.score.possible == len(result.requirements)


def test_a_file_that_cannot_be_read_is_a_result(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_01_ros_clock.usda"
    path.write_text("#usda 1.0\ndef Xform {")
    result = check_stage(path)
    assert (result.verdict, result.score.possible) == ("unreadable", 0.0)
    assert [(finding.rule, finding.severity, finding.prim) for finding in result.findings] == [
        ("F01", "error", "/")
    ]


def test_a_warning_alone_lets_a_stage_pass(tmp_path: Path) -> None:
    steps = [{"copy": ["ROS_Clock/ros2_context", "ROS_Clock/ros2_context_01"]}]
    result = check_stage(saved(broken("01", steps), tmp_path / "Lab3_01.usda"))
    assert [finding.severity for finding in result.findings] == ["warning"]
    assert result.verdict == "pass"


def test_an_error_fails_a_stage_and_lowers_its_score(tmp_path: Path) -> None:
    steps = [{"disconnect": "ROS_Clock/ros2_publish_clock.inputs:timeStamp"}]
    result = check_stage(saved(broken("01", steps), tmp_path / "Lab3_01.usda"))
    assert result.verdict == "fail"
    unmet = [requirement.id for requirement in result.requirements if not requirement.met]
    assert unmet == ["ROS_Clock/wire/ros2_publish_clock.timeStamp"]
    assert result.score.earned == result.score.possible - 1


TARGETS = "ROS_OdomTF/isaac_compute_transform_tree.inputs:targetPrims"
LINKS = ["base_link", "base_scan", "caster_back_link", "wheel_left_link", "wheel_right_link"]


@pytest.mark.parametrize(
    ("targets", "unmet"),
    [
        ([f"/turtlebot3_burger/{link}" for link in LINKS], {"TF/frame/Camera_1"}),
        # The joint tree of the robot hangs some frames deeper under base_footprint.
        (["/turtlebot3_burger", "/turtlebot3_burger/base_footprint/Camera_1"], set()),
        # What F9's single target loses is warned of, and costs nothing.
        (["/turtlebot3_burger"], set()),
        ([], {f"TF/frame/{frame}" for frame in [*LINKS, "Camera_1"]}),
    ],
)
def test_each_frame_that_is_published_counts(targets: list[str], unmet: set[str]) -> None:
    requirements = judged(broken("05", [{"targets": [TARGETS, *targets]}]), "05").requirements
    assert {requirement.id for requirement in requirements if not requirement.met} == unmet


def test_frames_below_another_parent_do_not_count() -> None:
    parent = TARGETS.replace("targetPrims", "parentPrim")
    requirements = judged(broken("05", [{"targets": [parent, "/World"]}]), "05").requirements
    unmet = {requirement.id for requirement in requirements if not requirement.met}
    frames = {f"TF/frame/{frame}" for frame in [*LINKS, "Camera_1"]}
    assert unmet == {"ROS_OdomTF/target/isaac_compute_transform_tree.parentPrim"} | frames


def test_a_stand_in_meets_the_requirement_of_its_wire() -> None:
    steps: list[dict[str, object]] = [
        {"copy": ["ROS_Clock/ros2_context", "ROS_Clock/again"]},
        {
            "connect": [
                "ROS_Clock/ros2_publish_clock.inputs:context",
                "ROS_Clock/again.outputs:context",
            ]
        },
    ]
    assert all(requirement.met for requirement in judged(broken("01", steps), "01").requirements)


def test_requirements_are_named_once_and_the_same_in_every_stage() -> None:
    whole = [requirement.id for requirement in judged(correct_stage("05"), "05").requirements]
    assert len(set(whole)) == len(whole)
    bare = [requirement.id for requirement in judged(correct_stage("00"), "05").requirements]
    assert bare == whole


def test_a_text_stage_says_the_line_of_the_fault_and_a_binary_one_none(tmp_path: Path) -> None:
    stage = broken("01", [{"set": ["ROS_Clock/ros2_publish_clock.inputs:topicName", "/time"]}])
    path = saved(stage, tmp_path / "Lab3_01.usda")
    (finding,) = check_stage(path).findings
    assert finding.layer == str(path)
    assert finding.line is not None
    assert 'inputs:topicName = "/time"' in path.read_text().splitlines()[finding.line - 1]
    (finding,) = check_stage(saved(stage, tmp_path / "Lab3_01.usd")).findings
    assert (finding.line, finding.column) == (None, None)


# A rule that fails itself.


@pytest.mark.usefixtures("own_rules")
def test_a_rule_that_crashes_is_never_a_pass(tmp_path: Path) -> None:
    add_failing_rule("W99", "graph", KeyError, "no such thing")
    path = saved(correct_stage("01"), tmp_path / "Lab3_01.usda")
    result = check_stage(path)
    (crash,) = result.crashes
    assert crash.rule == "W99"
    assert crash.error.startswith("KeyError: 'no such thing', at linting.py:")
    assert result.verdict == "fail"


# Findings.


def test_a_problem_takes_severity_and_hint_from_its_rule() -> None:
    found = all_rules()["N02"]
    finding = finding_of(found, Problem("/World/a", "what is wrong"), None)
    assert (finding.rule, finding.name, finding.severity) == ("N02", "extra-node", "warning")
    assert finding.hint == found.hint
    own = Problem("/World/a", "what is wrong", severity="error", hint="do this")
    finding = finding_of(found, own, None)
    assert (finding.severity, finding.hint) == ("error", "do this")
    assert finding_of(found, Problem("", "what is wrong"), None).prim == "/"


def test_findings_are_sorted_by_place_and_rule() -> None:
    first = Finding("W01", "a", "error", "/a", "x", "inputs:a")
    places = [
        replace(first, prim="/b"),
        replace(first, property="inputs:b"),
        replace(first, rule="W02"),
        first,
        replace(first, property=None),
        replace(first, message="y"),
    ]
    assert list(ordered(places)) == [places[4], first, places[5], places[2], places[1], places[0]]
    assert ordered(places) == ordered(places[::-1])


WRONG = [
    {"remove": "ROS_Clock/ros2_context"},
    {"disconnect": "ROS_Drive/make_array.inputs:input0"},
    {"targets": ["ROS_OdomTF/isaac_compute_transform_tree.inputs:targetPrims"]},
    {"copy": ["ROS_Camera/ros2_camera_helper", "ROS_Camera/again"]},
]


def test_checking_changes_no_file(tmp_path: Path) -> None:
    path = saved(broken("05", WRONG), tmp_path / "Lab3_05.usda")
    before = path.read_bytes()
    check_stage(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_steps_of_case_files_change_the_stage() -> None:
    """A step that did nothing would make a clearing case worthless."""
    assert place("ROS_Clock/a") == "/World/ROS_Clock/a"
    for name, arguments in {
        "set": ["ROS_Clock/ros2_context.inputs:domain_id", 3],
        "clear": ["ROS_Clock/ros2_context.inputs:domain_id"],
        "connect": ["ROS_Clock/ros2_context.inputs:domain_id", "ROS_Clock/x.outputs:y"],
        "disconnect": ["ROS_Clock/ros2_publish_clock.inputs:context"],
        "remove": ["ROS_Clock"],
        "over": ["ROS_Clock"],
        "deactivate": ["ROS_Clock"],
        "move": ["ROS_Clock", "/World/Other"],
    }.items():
        stage = correct_stage("01")
        before = stage.GetRootLayer().ExportToString()
        STEPS[name](stage, *arguments)
        assert stage.GetRootLayer().ExportToString() != before
