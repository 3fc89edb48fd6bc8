"""A fault of a dry run is explained by what the rules find about the stage, or by nothing."""

from __future__ import annotations

from pathlib import Path

from breaking import broken
from dry_runs import BRIEFLY
from in_process import invoke
from msgspec.structs import replace

from lab3_usd.check.explanations import explaining_finding
from lab3_usd.check.registry import all_rules
from lab3_usd.features.sim.notes import with_dry_run
from lab3_usd.model.dry_run import Behaviour, Check
from lab3_usd.model.finding import Finding, Severity
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.report.behaviour.text import ONLY_SHOWN, errors_unplayed, render

CLOCK = "/World/ROS_Clock"
NODE, SOURCE, ELSEWHERE = "/World/Clock/clock", "/World/Clock/time", "/World/Drive/move"
CHECK = Check(
    "clock",
    "bad",
    "/clock stands still",
    NODE,
    "wrong-clock-rate",  # most often a missing wire, W01
    rests_on=(NODE, SOURCE, "/World/Clock"),
)


def finding(rule: str, prim: str, severity: Severity = "error", *related: str) -> Finding:
    return Finding(rule, all_rules()[rule].name, severity, prim, "it is wrong", related=related)


def explained(*findings: Finding, check: Check = CHECK) -> str:
    found = explaining_finding(check, findings)
    return found.rule if found is not None else ""


def test_what_renames_the_joint_that_a_node_misses_explains_it() -> None:
    value = finding("P01", SOURCE)
    joint = finding("S07", "/World/Bot/lft", "error", "/World/Bot/left")
    missing = replace(CHECK, kind="unknown-joint", cause="it has no joint 'left' that turns")
    assert explained(value, joint, check=missing) == "S07"
    other = replace(missing, cause="it has no joint 'right' that turns")
    assert explained(value, joint, check=other) == "P01"


def test_the_rule_that_finds_such_faults_is_named_where_the_fault_is_or_before_it() -> None:
    assert explained(finding("W01", NODE)) == "W01"
    assert explained(finding("P01", NODE), finding("W01", SOURCE)) == "W01"


def test_a_rule_that_finds_such_faults_is_not_named_for_another_place() -> None:
    assert explained(finding("W01", ELSEWHERE)) == ""
    assert explained(finding("P01", NODE), finding("W01", ELSEWHERE)) == "P01"


def test_a_missing_node_explains_a_wire_that_is_gone() -> None:
    assert explained(finding("N01", "/World/Clock"), finding("P01", NODE)) == "N01"


def test_of_another_rule_only_an_error_at_the_fault_or_before_it_is_named() -> None:
    assert explained(finding("P01", NODE)) == "P01"
    assert explained(finding("P01", SOURCE)) == "P01"
    assert explained(finding("K44", NODE, "warning")) == ""
    assert explained(finding("P01", ELSEWHERE, "error", NODE)) == ""


def test_what_lint_says_of_a_joint_or_a_body_explains_only_faults_that_it_finds() -> None:
    brake = replace(finding("K86", SOURCE), property="drive:angular:physics:stiffness")
    assert explained(brake) == ""
    assert explained(replace(finding("K22", SOURCE), property="inputs:value")) == "K22"


def test_what_lint_says_of_a_stereo_pair_explains_that_no_camera_info_is_sent() -> None:
    sizes = replace(CHECK, kind="image-info-sizes-differ")
    assert explained(finding("K79", NODE), check=sizes) == "K79"
    assert explained(finding("K79", ELSEWHERE), check=sizes) == ""


def test_what_did_not_happen_is_not_explained_by_something_else() -> None:
    unseen = replace(CHECK, verdict="not judged", prim="", rests_on=())
    assert explaining_finding(unseen, [finding("K44", NODE, "warning")]) is None
    assert explaining_finding(unseen, [finding("W01", NODE)]) is not None


def test_a_fault_without_a_place_is_explained_by_the_rule_that_finds_such_faults() -> None:
    found = finding("P01", NODE), finding("W01", ELSEWHERE, "warning")
    explaining = explaining_finding(replace(CHECK, prim="", rests_on=()), found)
    assert explaining is not None
    assert explaining.rule == "W01"


def test_a_fault_without_a_place_is_explained_by_the_only_error() -> None:
    nowhere = replace(CHECK, prim="", rests_on=())
    one, two = finding("P03", NODE), finding("R01", ELSEWHERE)
    assert explaining_finding(nowhere, [one]) is one
    assert explaining_finding(nowhere, [one, two]) is None


def test_the_nearest_is_named() -> None:
    near = [finding("N01", "/World/Clock"), finding("W01", SOURCE)]
    assert explained(*near) == "W01"


def test_what_stands_at_the_fault_is_named_before_what_only_names_its_place() -> None:
    there = finding("W01", NODE)
    assert explaining_finding(CHECK, [finding("W01", ELSEWHERE, "error", NODE), there]) is there


def test_an_error_is_named_before_a_warning_and_a_note_never() -> None:
    assert explained(finding("W01", NODE, "warning"), finding("P01", NODE)) == "P01"
    assert explained(finding("W01", NODE, "note")) == ""


def test_what_is_wrong_with_the_whole_stage_explains_what_nothing_nearer_does() -> None:
    assert explained(finding("S02", "/")) == "S02"
    assert explained(finding("S02", "/"), finding("P01", NODE)) == "P01"


def test_no_rule_is_named_for_what_no_rule_found() -> None:
    assert explained() == ""
    assert explained(finding("P01", ELSEWHERE)) == ""


def test_nothing_else_explains_that_gravity_does_not_hold_the_robot() -> None:
    heavy = replace(CHECK, kind="no-gravity")
    assert explaining_finding(heavy, [finding("K64", NODE, "warning")]) is None
    assert explaining_finding(heavy, [finding("S15", "/World/Clock")]) is not None


def test_no_rule_explains_what_was_not_judged_without_a_place() -> None:
    unjudged = replace(CHECK, verdict="not judged", prim="", kind="no-ray-returns", rests_on=())
    assert explaining_finding(unjudged, [finding("K08", NODE, "warning")]) is None
    assert explaining_finding(unjudged, [finding("L09", NODE)]) is not None


def saved(stage: object, path: Path) -> Path:
    stage.GetRootLayer().Export(str(path))  # type: ignore[attr-defined]
    return path


def test_a_dry_run_says_where_no_rule_finds_what_it_shows() -> None:
    behaviour = Behaviour("stage.usda", "", 1.0, "bad", checks=(CHECK,))
    assert f"({ONLY_SHOWN})" in render(behaviour, 80, color=False)
    said = render(behaviour, 80, [finding("P01", NODE)], color=False)
    assert ONLY_SHOWN not in said
    assert "(lab3 rule P01)" in said


def test_what_no_rule_finds_is_noted_in_a_check_under_a_rule_of_its_own(tmp_path: Path) -> None:
    stage = broken("01", [{"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"}])
    path = saved(stage, tmp_path / "Lab3_01.usda")
    found = replace(check_stage(path), findings=())
    (note,) = with_dry_run(found)[0].findings
    assert (note.rule, note.severity, note.prim) == ("F07", "note", f"{CLOCK}/ros2_publish_clock")
    assert note.message.startswith("in a dry run (topics): nothing on /clock")


def test_a_dry_run_names_the_finding_of_the_stage_that_it_plays(tmp_path: Path) -> None:
    stage = broken("05", [{"remove": "ROS_Clock/isaac_read_simulation_time"}])
    path = saved(stage, tmp_path / "Lab3_05.usda")
    assert "(lab3 rule N01)" in invoke("sim", path, "--drive", BRIEFLY).stdout
    path = saved(stage, tmp_path / "clock.usda")
    assert "(lab3 rule K20)" in invoke("sim", path, "--drive", BRIEFLY).stdout


RAN = Behaviour("stage.usda", "", 1.0, "ok", checks=(Check("clock", "ok"),))


def test_the_last_line_counts_the_errors_that_no_check_shows() -> None:
    errors = [finding("K41", NODE), finding("K93", ELSEWHERE), finding("K64", NODE, "warning")]
    assert errors_unplayed(RAN, errors) == (
        "lab3 lint has 2 errors that no check here shows: K41, K93"
    )
    assert errors_unplayed(replace(RAN, checkpoint="01"), errors[:1]).startswith(
        "lab3 check has 1 "
    )


def test_an_error_that_a_check_names_is_not_counted() -> None:
    failed = replace(RAN, verdict="bad", checks=(CHECK,))
    assert errors_unplayed(failed, [finding("W01", NODE)]) == ""
    assert errors_unplayed(RAN, [finding("K64", NODE, "warning")]) == ""
