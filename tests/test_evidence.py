"""Reading saved diagnostics, of the script and saved by hand."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from ros_outputs import (
    ACTIVE,
    EDGES,
    IMAGE,
    LOOKUP,
    MAP,
    NO_LOOKUP,
    NO_RATE,
    NODES,
    ODOM,
    PACKAGES,
    RATE,
    SCAN,
    STATUS,
    TOPICS,
    frames_gv,
    frames_yaml,
    info,
    view_frames,
)

from lab3_usd.check.subjects_lab import Evidence, GoalRun, Lookup, Names
from lab3_usd.lab.evidence import read_evidence
from lab3_usd.lab.evidence_blocks import recognise
from lab3_usd.lab.evidence_message import parse_messages
from lab3_usd.lab.evidence_outputs import parse_endpoints, parse_lookup, parse_state, parse_tree
from lab3_usd.spec.load_ros import load_ros

ROS = load_ros()


def read(folder: Path, **files: str) -> Evidence:
    """Save texts under names (`topic_list__txt` is topic_list.txt) and read them."""
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)
    return read_evidence(folder)


def only(outputs: object) -> object:
    """Return the one fact of a mapping of outputs."""
    assert isinstance(outputs, dict)
    (shown,) = (shown for of in outputs.values() for shown in of)
    return shown.fact


@pytest.mark.parametrize(
    ("line", "kind", "target"),
    [
        ("ros2 topic list", "topic_list", ""),
        ("ros2 topic list -t", "topic_list", ""),
        ("ros2 topic type scan", "topic_type", "/scan"),
        ("ros2 topic hz -w 10 /scan", "topic_hz", "/scan"),
        ("ros2 topic echo --once /map", "topic_echo", "/map"),
        ("ros2 topic echo --qos-durability transient_local /map --once", "topic_echo", "/map"),
        ("ros2 topic info -v /tf", "topic_info", "/tf"),
        ("ros2 node list", "node_list", ""),
        ("ros2 lifecycle get amcl", "lifecycle", "/amcl"),
        (
            "ros2 run tf2_ros tf2_echo /map base_footprint --ros-args -p use_sim_time:=true",
            "tf2_echo",
            "map base_footprint",
        ),
        ("ros2 run tf2_tools view_frames -o tree", "view_frames", ""),
    ],
)
def test_typed_commands_are_recognised(line: str, kind: str, target: str) -> None:
    block = recognise(line, ROS.kinds)
    assert block is not None
    assert (block.kind, block.target) == (kind, target)


@pytest.mark.parametrize("line", ["ros2 bag info", "ros2 topic hz", "ros2 run tf2_ros tf2_echo a"])
def test_other_commands_are_not(line: str) -> None:
    assert recognise(line, ROS.kinds) is None


def test_a_terminal_log_is_split_at_its_commands(tmp_path: Path) -> None:
    log = (
        "ana@lab:~$ source /opt/ros/humble/setup.bash\n"
        "ana@lab:~$ ros2 topic type /scan\nsensor_msgs/msg/LaserScan\n"
        f"ana@lab:~/RAS545$ ros2 topic hz /scan\n{RATE}^C\n"
        "ana@lab:~$ ls\nros.log\n"
        "ana@lab:~$ ros2 run tf2_ros tf2_echo odom base_footprint \\\n"
        f"  --ros-args -p use_sim_time:=true\n{LOOKUP}"
    )
    evidence = read(tmp_path, session__log=log)
    assert only(evidence.topic_type) == ("sensor_msgs/msg/LaserScan",)
    assert only(evidence.topic_hz) == pytest.approx(10.002)
    assert list(evidence.tf2_echo) == ["odom base_footprint"]


def test_colours_and_line_ends_of_other_systems_do_not_matter(tmp_path: Path) -> None:
    log = f"\x1b[32mana@lab\x1b[0m:~$ ros2 lifecycle get /amcl\r\n{ACTIVE}".replace("\n", "\r\n")
    (tmp_path / "log.txt").write_bytes(log.encode("utf-16"))
    assert only(read_evidence(tmp_path).lifecycle) == "active [3]"


@pytest.mark.parametrize(
    ("name", "text", "kind", "target"),
    [
        ("hz-scan.txt", NO_RATE, "topic_hz", "/scan"),
        ("info of odom.txt", "Unknown topic '/odom'\n", "topic_info", "/odom"),
        ("lifecycle amcl.txt", "Node not found\n", "lifecycle", "/amcl"),
        ("hz of scan.txt", RATE, "topic_hz", "/scan"),
        ("camera_image_raw-hz.txt", RATE, "topic_hz", "/camera/image_raw"),
        ("info_tf.log", info("tf2_msgs/msg/TFMessage", "amcl"), "topic_info", "/tf"),
        ("J6 odom base_footprint.txt", LOOKUP, "tf2_echo", "odom base_footprint"),
        ("amcl.txt", ACTIVE, "lifecycle", "/amcl"),
        ("my map.txt", "nav_msgs/msg/OccupancyGrid\n", "topic_type", "/map"),
        ("odom once.txt", ODOM, "topic_echo", "/odom"),
        ("J1.txt", NODES, "node_list", ""),
        ("J2.txt", TOPICS, "topic_list", ""),
        ("frames_2026-11-20_10.10.10.gv", frames_gv(*EDGES), "view_frames", ""),
        ("tree.yaml", frames_yaml(*EDGES), "view_frames", ""),
    ],
)
def test_outputs_without_their_command_are_told_by_looks_and_name(
    tmp_path: Path, name: str, text: str, kind: str, target: str
) -> None:
    (tmp_path / name).write_text(text)
    assert list(getattr(read_evidence(tmp_path), kind)) == [target]


def test_a_text_that_nothing_tells_shows_nothing(tmp_path: Path) -> None:
    assert read(tmp_path, notes__txt=RATE) == Evidence(folder=".")


def test_a_folder_that_does_not_exist_shows_nothing(tmp_path: Path) -> None:
    assert read_evidence(tmp_path / "none", root=tmp_path) == Evidence(folder="none")


def test_a_filtered_list_is_no_whole_list(tmp_path: Path) -> None:
    evidence = read(tmp_path, b7__txt="$ ros2 topic list | grep clock\n/clock\n")
    assert only(evidence.topic_list) == Names(("/clock",), whole=False)


def test_a_list_with_types_names_the_topics(tmp_path: Path) -> None:
    text = "$ ros2 topic list -t\n/clock [rosgraph_msgs/msg/Clock]\n/scan [a_msgs/msg/B]\n"
    assert only(read(tmp_path, t__txt=text).topic_list) == Names(("/clock", "/scan"), whole=True)


def test_a_stream_without_messages_has_the_rate_zero(tmp_path: Path) -> None:
    assert only(read(tmp_path, topic_hz_scan__txt=NO_RATE).topic_hz) == 0


def test_a_topic_that_does_not_exist_has_no_type(tmp_path: Path) -> None:
    assert only(read(tmp_path, topic_type_map__txt="").topic_type) == ()


@pytest.mark.parametrize(
    "text",
    [
        "bash: ros2: command not found\n",
        "Package 'tf2_tools' not found\n",
        "No executable found\n",
    ],
)
def test_a_command_that_could_not_be_started_shows_nothing(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, topic_hz_scan__txt=text) == Evidence(folder=".")


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        (SCAN, "header.frame_id", "base_scan"),
        (IMAGE, "width", 640),
        (MAP, "info.origin.position.y", -3.32),
        (STATUS, "status_list.1.status", 4),
        ("WARNING: topic [/odom] lost\n" + ODOM, "child_frame_id", "base_footprint"),
    ],
)
def test_messages_are_read_by_path(text: str, path: str, value: object) -> None:
    assert parse_messages(text)[0][path] == value


def test_a_message_shortened_by_hand_is_still_read() -> None:
    text = MAP.replace("- -1\n- '...'\n", "[-1, -1 ... and so on\n").replace("---\n", "")
    (message,) = parse_messages(text)
    assert message["header.frame_id"] == "map"
    assert message["info.width"] == 177
    assert message["info.origin.position.x"] == pytest.approx(-6.2)


def test_a_value_that_is_no_yaml_is_text() -> None:
    (message,) = parse_messages("header:\n  frame_id: 'map\nwidth: 177\n")
    assert message == {"header.frame_id": "'map", "width": 177}


def test_lists_in_lists_are_left_out() -> None:
    assert parse_messages("a: [[1], {b: 2}]\n") == [{"a.1.b": 2}]


def test_a_message_nested_without_end_ends() -> None:
    assert parse_messages("a: &a {b: *a, frame_id: map}\n") == [{"a.frame_id": "map"}]


@pytest.mark.parametrize("text", ["[" * 100_000, "{a: " * 50_000, "- " * 50_000])
def test_a_message_nested_too_deep_shows_nothing(text: str) -> None:
    assert parse_messages(text) == []


def test_aliases_do_not_multiply() -> None:
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{n}: &a{n} {{p: *a{n - 1}, q: *a{n - 1}}}" for n in range(1, 60)]
    (message,) = parse_messages("\n".join(lines))
    assert message == {"a0.x": 1}


def test_no_message_is_none() -> None:
    text = "WARNING: topic [/scan] does not appear to be published yet\n"
    assert parse_messages(text) == []


def test_publishers_and_subscriptions_are_told_apart() -> None:
    endpoints = parse_endpoints(info("nav_msgs/msg/Odometry", "one", "two"))
    assert [(e.node, e.publishes) for e in endpoints] == [
        ("/one", True),
        ("/two", True),
        ("/rviz", False),
    ]


def test_policies_are_read() -> None:
    (endpoint, _) = parse_endpoints(
        info("nav_msgs/msg/OccupancyGrid", "map_server", durability="TRANSIENT_LOCAL")
    )
    assert (endpoint.reliability, endpoint.durability) == ("reliable", "transient_local")
    assert endpoint.type == "nav_msgs/msg/OccupancyGrid"


def test_publishers_are_counted_without_verbose() -> None:
    text = "Type: nav_msgs/msg/Odometry\nPublisher count: 2\nSubscription count: 1\n"
    assert [endpoint.publishes for endpoint in parse_endpoints(text)] == [True, True]


def test_an_unknown_topic_has_no_endpoint() -> None:
    assert parse_endpoints("Unknown topic '/odom'\n") == ()


@pytest.mark.parametrize(
    ("text", "state"),
    [
        (ACTIVE, "active [3]"),
        ("unconfigured [1]\n", "unconfigured [1]"),
        ("Node not found\n", "Node not found"),
        ("", "no answer"),
    ],
)
def test_states_are_read(text: str, state: str) -> None:
    assert parse_state(text) == state


def test_a_transform_is_read() -> None:
    assert parse_lookup(LOOKUP) == Lookup(found=True, translation=(0.25, 0.001, 0.0))


def test_a_transform_that_was_cut_is_found() -> None:
    assert parse_lookup("- Translation: [0.2, 0.0]\n") == Lookup(found=True)


def test_a_transform_of_words_is_found() -> None:
    found = parse_lookup("- Translation: [x, y, z]\n")
    assert found.found
    assert found.translation is not None
    assert all(math.isnan(number) for number in found.translation)


def test_a_transform_that_never_came_is_not_found() -> None:
    assert parse_lookup(NO_LOOKUP) == Lookup(found=False)


@pytest.mark.parametrize(
    "text", [view_frames(*EDGES), frames_gv(*EDGES), frames_yaml(*EDGES)], ids=["log", "gv", "yaml"]
)
def test_trees_are_read(text: str) -> None:
    assert parse_tree(text) == EDGES


def test_a_tree_without_frames_is_empty() -> None:
    assert parse_tree("Result:tf2_msgs.srv.FrameGraph_Response(frame_yaml='[]')") == ()
    assert parse_tree('digraph G { "No tf data received" }') == ()


def test_a_text_without_tree_is_none() -> None:
    assert parse_tree("[INFO] [1.0] [view_frames]: Listening to tf data for 5.0 seconds...") is None


@pytest.mark.parametrize(
    ("text", "goal"),
    [
        (f"$ ros2 topic echo /navigate_to_pose/_action/status --once\n{STATUS}", GoalRun(4)),
        ("goal status: 4\ngoal seconds: 23\n", GoalRun(4, 23.0)),
        ("goal status: 0\n", GoalRun(0)),
        # ros2/ros2cli: ros2action/ros2action/verb/send_goal.py
        ("Result:\n    result: {}\n\nGoal finished with status: ABORTED\n", GoalRun(6)),
        # ros-navigation/navigation2: nav2_bt_navigator
        ("[bt_navigator-5] [INFO] [1.2] [bt_navigator]: Goal succeeded\n", GoalRun(4)),
        ("[bt_navigator]: Goal failed\n[bt_navigator]: Goal succeeded\n", GoalRun(4)),
        ("[bt_navigator]: Goal succeeded\n[bt_navigator]: Goal canceled\n", GoalRun(5)),
    ],
)
def test_goals_are_read(tmp_path: Path, text: str, goal: GoalRun) -> None:
    assert only(read(tmp_path, nav2__txt=text).goals) == goal


def test_an_empty_list_of_goals_is_no_goal(tmp_path: Path) -> None:
    name = "topic_echo_navigate_to_pose_action_status__txt"
    assert read(tmp_path, **{name: "status_list: []\n---\n"}).goals == {}


def test_a_status_that_nobody_knows_is_no_goal(tmp_path: Path) -> None:
    assert read(tmp_path, nav2__txt="Goal finished with status: LOST\n").goals == {}


def test_a_status_that_is_no_number_is_no_goal(tmp_path: Path) -> None:
    name = "topic_echo_navigate_to_pose_action_status__txt"
    assert read(tmp_path, **{name: "status_list:\n- status: fine\n---\n"}).goals == {}


def test_packages_are_read(tmp_path: Path) -> None:
    assert "rviz2" in read(tmp_path, packages__txt=PACKAGES).packages[""][0].fact


def test_the_outputs_of_the_script_speak_before_others(tmp_path: Path) -> None:
    manifest = "file\texit\tstart\tseconds\tcommand\n"
    manifest += "topic_hz_scan.txt\t124\t2026-11-20T10:00:00Z\t10.001\tros2 topic hz /scan\n"
    evidence = read(
        tmp_path, manifest__tsv=manifest, old_hz_scan__txt=NO_RATE, topic_hz_scan__txt=RATE
    )
    assert [shown.file for shown in evidence.topic_hz["/scan"]] == ["topic_hz_scan.txt"]
    assert [(run.exit, run.seconds) for run in evidence.runs] == [(124, 10.001)]


def test_files_are_named_from_the_root(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "J"
    folder.mkdir(parents=True)
    (folder / "topic_list.txt").write_text(TOPICS)
    evidence = read_evidence(tmp_path / "results", root=tmp_path)
    assert evidence.topic_list[""][0].file == "results/J/topic_list.txt"
    assert evidence.folder == "results"


def test_several_folders_are_read(tmp_path: Path) -> None:
    for name, text in (("results", ACTIVE), ("logs", "inactive [2]\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "amcl.txt").write_text(text)
    evidence = read_evidence(tmp_path / "results", tmp_path / "logs", root=tmp_path)
    assert [s.fact for s in evidence.lifecycle["/amcl"]] == ["active [3]", "inactive [2]"]


def test_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "outside.txt").write_text(TOPICS)
    inside = tmp_path / "results"
    inside.mkdir()
    (inside / "topic_list.txt").symlink_to(tmp_path / "outside.txt")
    assert read_evidence(inside).topic_list == {}


def test_a_folder_outside_the_root_keeps_its_name(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    evidence = read_evidence(tmp_path / "results", root=tmp_path / "work")
    assert evidence.folder == (tmp_path / "results").as_posix()


def test_a_file_that_cannot_be_read_shows_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path) -> bytes:
        raise PermissionError(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert read(tmp_path, topic_list__txt=TOPICS) == Evidence(folder=".")


def test_pictures_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "topic_list.png").write_text(TOPICS)
    assert read_evidence(tmp_path).topic_list == {}
