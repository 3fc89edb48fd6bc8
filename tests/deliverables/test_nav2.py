"""The files for localization and navigation: whole, readable, and true to the handout."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from in_process import invoke

from lab3_usd.deliverables.nav2_templates import (
    LAUNCH_FILE,
    LIDAR_RVIZ_FILE,
    PARAMS_FILE,
    RVIZ_FILE,
    nav2_files,
)
from lab3_usd.spec.load.loader import load_lab

FILES = nav2_files(load_lab(), load_lab().ros)


def parameters(node: str) -> dict[str, Any]:
    data = quick_yaml.load(FILES[PARAMS_FILE])
    for name in node.split("/"):
        data = data[name]
    return dict(data["ros__parameters"])


def displays(file: str) -> dict[str, dict[str, Any]]:
    manager = quick_yaml.load(FILES[file])["Visualization Manager"]
    return {display["Name"]: display for display in manager["Displays"]}


def test_every_file_says_that_it_was_not_run() -> None:
    assert [name for name, text in FILES.items() if "ot run in ROS" not in text] == []


def test_no_template_leaves_a_gap() -> None:
    assert [name for name, text in FILES.items() if "{{" in text or "{%" in text] == []


def test_the_launch_file_is_python() -> None:
    tree = ast.parse(FILES[LAUNCH_FILE])
    assert "generate_launch_description" in {
        node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    }


def test_the_launch_file_includes_both_parts_and_names_its_neighbours() -> None:
    text = {
        node.value
        for node in ast.walk(ast.parse(FILES[LAUNCH_FILE]))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert {"localization_launch.py", "navigation_launch.py", PARAMS_FILE, RVIZ_FILE} <= text
    assert "~/RAS545/Lab3/maps/turtlebot3_map.yaml" in text


@pytest.mark.parametrize(
    "node",
    [
        "map_server",
        "amcl",
        "bt_navigator",
        "planner_server",
        "controller_server",
        "local_costmap/local_costmap",
        "global_costmap/global_costmap",
        "smoother_server",
        "behavior_server",
        "waypoint_follower",
        "velocity_smoother",
    ],
)
def test_every_node_uses_simulation_time(node: str) -> None:
    assert parameters(node)["use_sim_time"] is True


def test_amcl_has_the_frames_and_topics_of_the_lab() -> None:
    amcl = parameters("amcl")
    names = ("global_frame_id", "odom_frame_id", "base_frame_id", "scan_topic", "map_topic")
    assert [amcl[name] for name in names] == ["map", "odom", "base_footprint", "/scan", "/map"]
    assert amcl["robot_model_type"] == "nav2_amcl::DifferentialMotionModel"


def test_speeds_are_those_of_the_differential_controller() -> None:
    follow = parameters("controller_server")["FollowPath"]
    assert [follow[name] for name in ("max_vel_x", "max_speed_xy", "max_vel_theta")] == [
        0.22,
        0.22,
        1.0,
    ]
    assert parameters("velocity_smoother")["max_velocity"] == [0.22, 0.0, 1.0]
    assert parameters("velocity_smoother")["min_velocity"] == [-0.22, 0.0, -1.0]


def test_paths_are_checked_at_points_closer_than_the_robot_is_wide() -> None:
    follow = parameters("controller_server")["FollowPath"]
    radius = parameters("local_costmap/local_costmap")["robot_radius"]
    assert follow["linear_granularity"] <= radius / 2
    assert follow["angular_granularity"] == pytest.approx(0.025)


@pytest.mark.parametrize("name", ["local_costmap", "global_costmap"])
def test_costmaps_hear_the_scan_and_know_the_robot(name: str) -> None:
    costmap = parameters(f"{name}/{name}")
    layer = costmap["obstacle_layer"]
    assert layer[layer["observation_sources"]]["topic"] == "/scan"
    assert costmap["robot_radius"] == pytest.approx(0.1)
    assert costmap["robot_base_frame"] == "base_footprint"


def test_plugins_have_the_names_of_humble() -> None:
    assert parameters("planner_server")["GridBased"]["plugin"] == "nav2_navfn_planner/NavfnPlanner"
    behaviors = parameters("behavior_server")
    assert [behaviors[name]["plugin"] for name in behaviors["behavior_plugins"]] == [
        "nav2_behaviors/Spin",
        "nav2_behaviors/BackUp",
        "nav2_behaviors/DriveOnHeading",
        "nav2_behaviors/AssistedTeleop",
        "nav2_behaviors/Wait",
    ]


def test_velocity_commands_are_plain() -> None:
    assert "stamped" not in FILES[PARAMS_FILE].lower()


def test_rviz_has_the_displays_of_the_handout() -> None:
    shown = displays(RVIZ_FILE)
    assert {"Map", "LaserScan", "TF", "RobotModel", "Global Costmap", "Local Costmap"} <= set(shown)
    assert "Global Path" in shown
    assert shown["Map"]["Topic"]["Value"] == "/map"
    assert shown["Map"]["Topic"]["Durability Policy"] == "Transient Local"
    assert shown["LaserScan"]["Topic"]["Value"] == "/scan"


def test_rviz_looks_from_the_map_and_has_both_tools() -> None:
    manager = quick_yaml.load(FILES[RVIZ_FILE])["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    tools = {tool["Class"]: tool.get("Topic", {}).get("Value") for tool in manager["Tools"]}
    assert tools["rviz_default_plugins/SetInitialPose"] == "/initialpose"
    assert tools["rviz_default_plugins/SetGoal"] == "/goal_pose"


def test_the_lidar_alone_is_shown_as_the_handout_says() -> None:
    manager = quick_yaml.load(FILES[LIDAR_RVIZ_FILE])["Visualization Manager"]
    scan = displays(LIDAR_RVIZ_FILE)["LaserScan"]
    assert manager["Global Options"]["Fixed Frame"] == "base_scan"
    assert scan["Size (m)"] == pytest.approx(0.03)
    assert scan["Topic"]["Value"] == "/scan"
    assert "Map" not in displays(LIDAR_RVIZ_FILE)


def test_files_that_exist_are_kept(tmp_path: Path) -> None:
    (tmp_path / PARAMS_FILE).write_text("mine")
    done = invoke("nav2", "-o", tmp_path)
    assert PARAMS_FILE in done.stderr
    written = {Path(line).name for line in done.stdout.splitlines()}
    assert written == set(FILES) - {PARAMS_FILE}
    assert (tmp_path / PARAMS_FILE).read_text() == "mine"


def test_force_replaces_them(tmp_path: Path) -> None:
    (tmp_path / PARAMS_FILE).write_text("mine")
    invoke("nav2", "-o", tmp_path, "--force")
    assert (tmp_path / PARAMS_FILE).read_text() == FILES[PARAMS_FILE]


def test_the_command_writes_the_files(tmp_path: Path) -> None:
    done = invoke("nav2", "-o", tmp_path / "nav2")
    assert done.exit_code == 0
    assert {p.name: p.read_text() for p in (tmp_path / "nav2").iterdir()} == FILES


def test_the_command_says_what_it_kept(tmp_path: Path) -> None:
    for _ in range(2):
        done = invoke("nav2", "-o", tmp_path)
    assert done.exit_code == 0
    assert done.stdout == ""
    assert all(name in done.stderr for name in FILES)
