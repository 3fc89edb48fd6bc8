"""Rules about Nav2 parameter files: each with a case it finds and one it leaves alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from lab3_usd.check.finding import Problem
from lab3_usd.check.registry import rules_of, run_rule
from lab3_usd.check.subjects_lab import NavigationSubject
from lab3_usd.lab.nav2 import PARAMS_FILE, nav2_files
from lab3_usd.lab.params import read_params
from lab3_usd.spec.load_ros import load_ros
from lab3_usd.spec.loader import load_lab

ROS = load_ros()
LAB = load_lab()
RULES = {found.id: found for found in rules_of("navigation", "V")}
GOOD = nav2_files(LAB, ROS)[PARAMS_FILE]


def read(folder: Path, text: str) -> NavigationSubject:
    (folder / PARAMS_FILE).write_text(text)
    return read_params(folder / PARAMS_FILE, ROS, LAB.frames)


def problems(subject: NavigationSubject) -> dict[str, list[Problem]]:
    found = {rule_id: run_rule(each, subject) for rule_id, each in RULES.items()}
    return {rule_id: each for rule_id, each in found.items() if each}


def changed(old: str, new: str) -> str:
    """Change the first occurrence in our own file."""
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_our_own_parameters_have_no_problem(tmp_path: Path) -> None:
    assert problems(read(tmp_path, GOOD)) == {}


@pytest.mark.parametrize("frame", ["base_link", "base_scan", "Camera_1"])
def test_any_frame_of_the_robot_may_be_its_base(tmp_path: Path, frame: str) -> None:
    assert (
        problems(
            read(tmp_path, changed("base_frame_id: base_footprint", f"base_frame_id: {frame}"))
        )
        == {}
    )


@pytest.mark.parametrize("text", ["scan_topic: scan", "scan_topic: '/scan'"])
def test_the_scan_topic_may_be_relative(tmp_path: Path, text: str) -> None:
    assert problems(read(tmp_path, changed("scan_topic: /scan", text))) == {}


def test_a_wildcard_may_set_the_simulation_time(tmp_path: Path) -> None:
    text = "/**: {ros__parameters: {use_sim_time: true}}\namcl: {ros__parameters: {alpha1: 0.2}}\n"
    assert problems(read(tmp_path, text)) == {}


FAULTS = [
    ("V01", "amcl:\n\tros__parameters:\n", None),
    ("V01", "amcl: {}\n", None),
    ("V01", "- just\n- a list\n", None),
    ("V02", changed("use_sim_time: true", "use_sim_time: false"), "map_server.use_sim_time"),
    ("V02", changed("use_sim_time: true", "use_sim_time: 'true'"), "map_server.use_sim_time"),
    ("V02", changed("    use_sim_time: true\n", ""), "map_server.use_sim_time"),
    ("V03", changed("base_frame_id: base_footprint", "base_frame_id: base"), "amcl.base_frame_id"),
    (
        "V03",
        changed("robot_base_frame: base_footprint", "robot_base_frame: odom"),
        "bt_navigator.robot_base_frame",
    ),
    ("V04", changed("odom_frame_id: odom", "odom_frame_id: world"), "amcl.odom_frame_id"),
    ("V04", changed("global_frame_id: map", "global_frame_id: world"), "amcl.global_frame_id"),
    (
        "V04",
        changed("      global_frame: odom", "      global_frame: map"),
        "local_costmap.local_costmap.global_frame",
    ),
    ("V05", changed("scan_topic: /scan", "scan_topic: scan_fixed"), "amcl.scan_topic"),
    (
        "V05",
        changed("          topic: /scan", "          topic: /scan_fixed"),
        "local_costmap.local_costmap.obstacle_layer.scan.topic",
    ),
    ("V06", changed("map_topic: /map", "map_topic: /my_map"), "amcl.map_topic"),
    (
        "V07",
        changed("max_vel_x: 0.22", "max_vel_x: 0.26"),
        "controller_server.FollowPath.max_vel_x",
    ),
    (
        "V07",
        changed("max_velocity: [0.22", "max_velocity: [0.5"),
        "velocity_smoother.max_velocity",
    ),
    (
        "V07",
        changed("max_rotational_vel: 1.0", "max_rotational_vel: 2.0"),
        "behavior_server.max_rotational_vel",
    ),
    (
        "V08",
        changed(
            "    smoothing_frequency", "    enable_stamped_cmd_vel: true\n    smoothing_frequency"
        ),
        "velocity_smoother.enable_stamped_cmd_vel",
    ),
    (
        "V09",
        changed("nav2_navfn_planner/NavfnPlanner", "nav2_navfn_planner::NavfnPlanner"),
        "planner_server.GridBased.plugin",
    ),
]


@pytest.mark.parametrize(("rule_id", "text", "site"), FAULTS)
def test_a_fault_gives_its_finding_and_no_other(
    tmp_path: Path, rule_id: str, text: str, site: str | None
) -> None:
    found = problems(read(tmp_path, text))
    assert list(found) == [rule_id]
    (problem,) = found[rule_id]
    assert (problem.prim, problem.property) == (PARAMS_FILE, site)


def test_every_rule_has_a_case() -> None:
    assert {rule_id for rule_id, _, _ in FAULTS} == set(RULES)


def test_a_fault_names_its_line(tmp_path: Path) -> None:
    text = changed("scan_topic: /scan", "scan_topic: scan_fixed")
    line = text.splitlines().index("    scan_topic: scan_fixed") + 1
    (problem,) = problems(read(tmp_path, text))["V05"]
    assert problem.message.startswith(f"line {line}: ")
    assert "forbids" in problem.message


def test_a_time_that_is_absent_is_a_warning(tmp_path: Path) -> None:
    (problem,) = problems(read(tmp_path, changed("    use_sim_time: true\n", "")))["V02"]
    assert problem.severity == "warning"


def test_other_speeds_are_a_note() -> None:
    assert RULES["V07"].severity == "note"


def test_a_source_that_is_no_laser_may_have_its_topic(tmp_path: Path) -> None:
    text = changed(
        "          topic: /scan\n          data_type: LaserScan",
        "          topic: /points\n          data_type: PointCloud2",
    )
    assert problems(read(tmp_path, text)) == {}


def test_a_file_outside_the_submission_keeps_its_path(tmp_path: Path) -> None:
    path = tmp_path / PARAMS_FILE
    assert read_params(path, ROS, LAB.frames, root=tmp_path / "work").file == path.as_posix()


def test_a_limit_that_is_no_list_is_noted(tmp_path: Path) -> None:
    text = changed("max_velocity: [0.22, 0.0, 1.0]", "max_velocity: 0.22")
    assert list(problems(read(tmp_path, text))) == ["V07"]


def test_a_file_that_does_not_exist_is_unreadable(tmp_path: Path) -> None:
    subject = read_params(tmp_path / "none.yaml", ROS, LAB.frames)
    assert list(problems(subject)) == ["V01"]


def test_a_file_that_repeats_itself_by_aliases_is_not_followed(tmp_path: Path) -> None:
    lines = ["a0: &a0 {ros__parameters: {x: 1}}"]
    lines += [f"a{n}: &a{n} {{p: *a{n - 1}, q: *a{n - 1}}}" for n in range(1, 40)]
    assert list(problems(read(tmp_path, "\n".join(lines)))) == ["V01"]


def test_a_file_that_is_nested_too_deep_is_unreadable(tmp_path: Path) -> None:
    assert list(problems(read(tmp_path, "[" * 100_000))) == ["V01"]


def test_the_makers_parameters_for_a_newer_release_are_recognised(shared: Path) -> None:
    path = shared / "turtlebot3" / "nav2_burger.yaml"
    found = problems(read_params(path, ROS, LAB.frames))
    assert {"V02", "V08", "V09"} <= set(found)
    assert not {"V01", "V03", "V04", "V05", "V06"} & set(found)
