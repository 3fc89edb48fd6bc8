"""Rules about Nav2 parameter files: each with a case it finds and one it leaves alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import assert_golden, numbered, problems_text

from lab3_usd.check.registry import rules_of
from lab3_usd.deliverables.nav2_parameters import read_params
from lab3_usd.deliverables.nav2_templates import PARAMS_FILE, nav2_files
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import NavigationSubject
from lab3_usd.spec.load.loader import load_lab

ROS = load_lab().ros
LAB = load_lab()
RULES = {found.id: found for found in rules_of("navigation", "V")}
GOOD = nav2_files(LAB, ROS)[PARAMS_FILE]


def read(folder: Path, text: str) -> NavigationSubject:
    (folder / PARAMS_FILE).write_text(text)
    return read_params(folder / PARAMS_FILE, ROS, LAB.frames)


def problems(subject: NavigationSubject) -> dict[str, list[Problem]]:
    found = {rule_id: list(each.check(subject)) for rule_id, each in RULES.items()}
    return {rule_id: each for rule_id, each in found.items() if each}


def changed(old: str, new: str) -> str:
    """Change the first occurrence in our own file."""
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_our_own_parameters_have_no_problem(tmp_path: Path) -> None:
    assert problems(read(tmp_path, GOOD)) == {}


@pytest.mark.parametrize(
    ("radius", "other"),
    [("0.0", 'footprint: "[[0.1, 0.1], [0.1, -0.1], [-0.1, 0.0]]"'), ("-0.1", 'footprint: "[]"')],
)
def test_a_radius_that_does_not_count_or_makes_the_same_circle_is_right(
    tmp_path: Path, radius: str, other: str
) -> None:
    text = changed("      robot_radius: 0.1\n", f"      robot_radius: {radius}\n      {other}\n")
    assert "V13" not in problems(read(tmp_path, text))


def test_the_types_of_a_list_that_is_longer_than_the_own_one_are_not_known(tmp_path: Path) -> None:
    listed = "spin, backup, drive_on_heading, wait"
    text = f"behavior_server:\n  ros__parameters:\n    behavior_plugins: [{listed}]\n"
    assert "V12" not in problems(read(tmp_path, text))
    assert "V12" in problems(read(tmp_path, text.replace("wait]", "assisted_teleop, wait]")))


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
    ("V02", changed("use_sim_time: true", "use_sim_time:"), "map_server.use_sim_time"),
    ("V02", changed("    use_sim_time: true\n", ""), "map_server.use_sim_time"),
    (
        "V02",
        changed("      use_sim_time: true\n", ""),
        "local_costmap.local_costmap.use_sim_time",
    ),
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
    (
        "V09",
        changed("nav2_controller::SimpleGoalChecker", "nav2_controller/SimpleGoalChecker"),
        "controller_server.goal_checker.plugin",
    ),
    (
        "V09",
        changed("nav2_amcl::DifferentialMotionModel", "nav2_amcl/DifferentialMotionModel"),
        "amcl.robot_model_type",
    ),
    ("V09", changed("nav2_amcl::DifferentialMotionModel", "diff"), "amcl.robot_model_type"),
    (
        "V09",
        changed("nav2_costmap_2d::InflationLayer", "InflationLayer"),
        "local_costmap.local_costmap.inflation_layer.plugin",
    ),
    # The names of Galactic: nav2_amcl/src/amcl_node.cpp:177, nav2_recoveries/recovery_plugin.xml.
    ("V09", changed("nav2_amcl::DifferentialMotionModel", "differential"), "amcl.robot_model_type"),
    (
        "V09",
        changed("nav2_amcl::DifferentialMotionModel", "omnidirectional"),
        "amcl.robot_model_type",
    ),
    (
        "V09",
        changed("nav2_behaviors/Spin", "nav2_recoveries/Spin"),
        "behavior_server.spin.plugin",
    ),
    (
        "V09",
        changed("nav2_controller::SimpleGoalChecker", "nav2_controller::GoalChecker"),
        "controller_server.goal_checker.plugin",
    ),
    (
        "V10",
        changed("max_velocity: [0.22, 0.0, 1.0]", "max_velocity: [0.22, 0, 1.0]"),
        "velocity_smoother.max_velocity",
    ),
    ("V10", changed("[GridBased]", "[GridBased, 1]"), "planner_server.planner_plugins"),
    ("V10", changed("[GridBased]", "[[GridBased]]"), "planner_server.planner_plugins"),
    ("V10", changed("max_beams: 60", "max_beams:"), "amcl.max_beams"),
    ("V10", changed("max_beams: 60", "max_beams: ~"), "amcl.max_beams"),
    ("V10", changed("ros__parameters", "ros_parameters"), "map_server.ros_parameters"),
    ("V10", changed("ros__parameters", "ros__params"), "map_server.ros__params"),
    ("V10", GOOD + "\nnote: mine\n", "note"),
    ("V10", GOOD + "\nmap_saver:\n", "map_saver"),
    ("V10", GOOD + "\nmap_saver:\n  ros__parameters:\n", "map_saver.ros__parameters"),
    ("V10", GOOD + "\nros__parameters: {a: 1}\n", "ros__parameters"),
    (
        "V11",
        changed("robot_radius: 0.1", "robot_radius: 1"),
        "local_costmap.local_costmap.robot_radius",
    ),
    ("V11", changed("update_min_d: 0.1", "update_min_d: '0.1'"), "amcl.update_min_d"),
    ("V11", changed("max_beams: 60", "max_beams: 60.0"), "amcl.max_beams"),
    (
        "V11",
        changed("use_astar: false", "use_astar: 0"),
        "planner_server.GridBased.use_astar",
    ),
    (
        "V11",
        changed("max_velocity: [0.22, 0.0, 1.0]", "max_velocity: 0.22"),
        "velocity_smoother.max_velocity",
    ),
    (
        "V11",
        changed("deadband_velocity: [0.0, 0.0, 0.0]", "deadband_velocity: [0, 0, 0]"),
        "velocity_smoother.deadband_velocity",
    ),
    (
        "V11",
        changed("      max_vel_x: 0.22", "      max_vel_x: slow"),
        "controller_server.FollowPath.max_vel_x",
    ),
    ("V12", changed("[GridBased]", "[GridBased, Fast]"), "planner_server.planner_plugins"),
    ("V12", changed("[FollowPath]", "[Drive]"), "controller_server.controller_plugins"),
    (
        "V12",
        changed("progress_checker_plugin: progress_checker", "progress_checker_plugin: mine"),
        "controller_server.progress_checker_plugin",
    ),
    (
        "V12",
        changed(
            "plugins: [obstacle_layer, inflation_layer]",
            "plugins: [voxel_layer, obstacle_layer, inflation_layer]",
        ),
        "local_costmap.local_costmap.plugins",
    ),
    ("V13", changed("tf_broadcast: true", "tf_broadcast: false"), "amcl.tf_broadcast"),
    ("V13", changed("topic_name: map", "topic_name: my_map"), "map_server.topic_name"),
    ("V04", changed("frame_id: map", "frame_id: world"), "map_server.frame_id"),
    ("V13", changed("odom_topic: /odom", "odom_topic: /odometry"), "bt_navigator.odom_topic"),
    (
        "V13",
        changed("rolling_window: true", "rolling_window: false"),
        "local_costmap.local_costmap.rolling_window",
    ),
    (
        "V13",
        changed("      rolling_window: true\n", ""),
        "local_costmap.local_costmap.rolling_window",
    ),
    *(
        (
            "V13",
            changed("robot_radius: 0.1", f"robot_radius: {radius}"),
            "local_costmap.local_costmap.robot_radius",
        )
        for radius in ("2.0", "0.0")
    ),
    (
        "V13",
        changed("map_subscribe_transient_local: true", "map_subscribe_transient_local: false"),
        "global_costmap.global_costmap.static_layer.map_subscribe_transient_local",
    ),
    (
        "V13",
        changed("controller_frequency: 10.0", "controller_frequency: 0.0"),
        "controller_server.controller_frequency",
    ),
    (
        "V13",
        changed("update_frequency: 5.0", "update_frequency: 0.0"),
        "local_costmap.local_costmap.update_frequency",
    ),
    (
        "V13",
        changed("max_speed_xy: 0.22", "max_speed_xy: 0.0"),
        "controller_server.FollowPath.max_speed_xy",
    ),
    (
        "V13",
        changed("max_vel_theta: 1.0", "max_vel_theta: -1.0"),
        "controller_server.FollowPath.max_vel_theta",
    ),
    (
        "V13",
        changed("max_decel: [-2.5, 0.0, -3.2]", "max_decel: [2.5, 0.0, 3.2]"),
        "velocity_smoother.max_decel",
    ),
    (
        "V13",
        changed("max_accel: [2.5, 0.0, 3.2]", "max_accel: [-2.5, 0.0, 3.2]"),
        "velocity_smoother.max_accel",
    ),
    (
        "V13",
        changed("max_velocity: [0.22, 0.0, 1.0]", "max_velocity: [0.22, 0.0, 0.0]"),
        "velocity_smoother.max_velocity",
    ),
    (
        "V13",
        changed("min_velocity: [-0.22, 0.0, -1.0]", "min_velocity: [0.5, 0.0, -1.0]"),
        "velocity_smoother.min_velocity",
    ),
    (
        "V14",
        changed("observation_sources: scan\n", "observation_sources: scan more\n"),
        "local_costmap.local_costmap.obstacle_layer.observation_sources",
    ),
    (
        "V14",
        changed("data_type: LaserScan", "data_type: PointCloud2"),
        "local_costmap.local_costmap.obstacle_layer.scan.data_type",
    ),
    (
        "V14",
        changed("max_obstacle_height: 2.0", "max_obstacle_height: 0.1"),
        "local_costmap.local_costmap.obstacle_layer.scan.max_obstacle_height",
    ),
    (
        "V14",
        changed("          max_obstacle_height: 2.0      # metres, as the ranges\n", ""),
        "local_costmap.local_costmap.obstacle_layer.observation_sources",
    ),
    (
        "V14",
        changed("marking: true", "marking: false"),
        "local_costmap.local_costmap.obstacle_layer.scan.marking",
    ),
]

RIGHT = [
    # Nav2 knows the types of its own lists.
    changed("    GridBased:\n      plugin: nav2_navfn_planner/NavfnPlanner\n", "    GridBased:\n"),
    changed("max_speed_xy: 0.22", "max_speed_xy: 0.22\n      max_vel_y: 0.0"),
    changed("min_velocity: [-0.22, 0.0, -1.0]", "min_velocity: [0.0, 0.0, -1.0]"),
    changed("max_decel: [-2.5, 0.0, -3.2]", "max_decel: [-2.5, 0.0, 0.0]"),
    changed("observation_sources: scan\n", "observation_sources: ''\n"),
    changed("topic_name: map", "topic_name: /map"),
    # One source clears what another one marks.
    changed(
        "        observation_sources: scan\n",
        "        observation_sources: scan clear\n        clear: {topic: /scan, marking: false, "
        "clearing: true, data_type: LaserScan, max_obstacle_height: 2.0}\n",
    ),
    changed("scan:\n          topic: /scan\n", "scan:\n          topic: scan\n"),
]


@pytest.mark.parametrize("number", range(len(RIGHT)))
def test_what_nav2_takes_has_no_problem(tmp_path: Path, number: int) -> None:
    assert problems(read(tmp_path, RIGHT[number])) == {}


NAMES = list(numbered(rule_id for rule_id, _, _ in FAULTS))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[Problem]]]:
    """What is said of each fault."""
    root, said = tmp_path_factory.mktemp("faults"), {}
    for name, (_, content, _) in zip(NAMES, FAULTS, strict=True):
        folder = root / name
        folder.mkdir()
        said[name] = problems(read(folder, content))
    return said


def test_what_is_said_of_each_fault_is_as_it_was(
    found: dict[str, dict[str, list[Problem]]],
) -> None:
    shown = {name: problems_text(problems, LAB) for name, problems in found.items()}
    assert_golden("navigation-faults", shown)


def test_a_fault_gives_its_finding_and_no_other(
    found: dict[str, dict[str, list[Problem]]],
) -> None:
    sites = {
        name: {rule: [(each.prim, each.property) for each in of] for rule, of in rules.items()}
        for name, rules in found.items()
    }
    assert sites == {
        name: {rule: [(PARAMS_FILE, site)]}
        for name, (rule, _, site) in zip(NAMES, FAULTS, strict=True)
    }


def test_every_rule_has_a_case() -> None:
    assert {rule_id for rule_id, _, _ in FAULTS} == set(RULES)


def test_a_fault_names_its_line(tmp_path: Path) -> None:
    text = changed("scan_topic: /scan", "scan_topic: scan_fixed")
    line = text.splitlines().index("    scan_topic: scan_fixed") + 1
    (problem,) = problems(read(tmp_path, text))["V05"]
    assert problem.message.startswith(f"line {line}: ")
    assert "forbids" in problem.message


def test_a_time_that_is_absent_is_the_fault_and_one_that_is_replaced_a_note(
    tmp_path: Path,
) -> None:
    (absent,) = problems(read(tmp_path, changed("    use_sim_time: true\n", "")))["V02"]
    assert absent.severity is None
    (replaced,) = problems(read(tmp_path, GOOD.replace("time: true", "time: False")))["V02"]
    assert replaced.severity == "note"
    assert "in 13 nodes" in replaced.message


def test_a_quoted_true_is_called_a_text(tmp_path: Path) -> None:
    text = changed("use_sim_time: true", "use_sim_time: 'true'")
    (problem,) = problems(read(tmp_path, text))["V02"]
    assert "the text true" in problem.message


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('yaml_filename: ""', "yaml_filename:"),
        ("tolerance: 1.0e-10", "tolerance: 1e-10"),
        ("max_velocity: [0.22, 0.0, 1.0]", "max_velocity: [22e-2, 0.0, 1.0]"),
        ("robot_radius: 0.1", "robot_radius: $(var radius)"),
        ("alpha1: 0.2", "my_own: 1"),
        ("[GridBased]", "[]"),
        ("nav2_smoother::SimpleSmoother", "my_smoother/Mine"),
    ],
)
def test_what_humble_takes_has_no_problem(tmp_path: Path, old: str, new: str) -> None:
    assert problems(read(tmp_path, changed(old, new))) == {}


def test_values_below_a_slip_are_judged_all_the_same(tmp_path: Path) -> None:
    text = "amcl: {ros_parameters: {use_sim_time: true, scan_topic: /scan_fixed}}\n"
    assert list(problems(read(tmp_path, text))) == ["V05", "V10"]


def test_the_makers_parameters_for_humble_are_no_fault(tmp_path: Path) -> None:
    """As ROBOTIS-GIT/turtlebot3 has them: no clock is the simulation's, the launch sets it."""
    text = GOOD.replace("use_sim_time: true", "use_sim_time: False")
    assert [p.severity for found in problems(read(tmp_path, text)).values() for p in found] == [
        "note"
    ]


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
