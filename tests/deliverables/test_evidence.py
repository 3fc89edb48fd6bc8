"""Reading saved diagnostics, of the script and saved by hand."""

from __future__ import annotations

import math
import os
import re
import time
from pathlib import Path

import pytest
from grade_files import read_evidence
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

from lab3_usd.deliverables.evidence.commands import is_prompt, read_command, recognise
from lab3_usd.deliverables.evidence.outputs import (
    parse_endpoints,
    parse_lookup,
    parse_messages,
    parse_state,
    parse_tree,
)
from lab3_usd.deliverables.evidence.saved_outputs import read_listed
from lab3_usd.model.folder import Evidence, GoalRun, Lookup
from lab3_usd.spec.load.loader import load_lab

ROS = load_lab().ros


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


def understood(line: str) -> tuple[str, str] | None:
    """Return kind and target of the command that a line holds."""
    typed = read_command(line)
    block = recognise(typed, ROS.kinds) if typed else None
    return (block.kind, block.target) if block else None


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
        ("ros2 lifecycle get", "lifecycle", ""),
        (
            "ros2 run tf2_ros tf2_echo /map base_footprint --ros-args -p use_sim_time:=true",
            "tf2_echo",
            "map base_footprint",
        ),
        ("ros2 run tf2_tools view_frames -o tree", "view_frames", ""),
    ],
)
def test_typed_commands_are_recognised(line: str, kind: str, target: str) -> None:
    assert understood(line) == (kind, target)


@pytest.mark.parametrize(
    "line",
    [
        "ros2 bag info",
        "ros2 topic hz",
        "ros2 run tf2_ros tf2_echo a",
        "ros2 topic hz {topic}",
        "ros2 topic echo --field header /scan",
        "ros2 topic echo /scan --field=header.frame_id",
        "ros2 topic echo /odom --csv",
        "ros2 topic echo /scan --no-str",
        "ros2 topic hz /scan --filter 'm.range_max > 1'",
        # in a sentence
        "We ran `ros2 topic hz /scan` and saw the rate.",
        "- `ros2 topic hz /scan` measures the rate",
        "The command `ros2 topic hz /scan`",
        "Then ros2 topic hz /scan tells the rate",
        "ros2 topic hz /scan tells the rate of the scan",
        "ros2 topic list shows every topic",
        "To measure the rate of the lidar one types: ros2 topic hz /scan",
        "sudo is not needed for ros2 topic hz /scan",
        "| J4 | `ros2 topic hz /scan` | 10 Hz |",
        "`ros2 topic hz /scan` and `ros2 topic hz /odom`",
        "ros2 is installed",
    ],
)
def test_other_commands_are_not(line: str) -> None:
    assert understood(line) is None


@pytest.mark.parametrize(
    "line",
    [
        "ros2 topic hz /scan > results/hz.txt",
        "ros2 topic hz /scan >hz.txt 2>&1",
        "ros2 topic hz /scan >> results/hz.txt",
        "ros2 topic hz /scan &> hz.txt",
        "ros2 topic hz /scan | tee results/hz.txt",
        "ros2 topic hz /scan | grep average",
        "ros2 topic hz /scan &",
        "ros2 topic hz /scan && ros2 topic type /scan",
        "ros2 topic hz /scan; ros2 topic type /scan",
        "cd ~/ws && ros2 topic hz /scan",
        "ana@lab:~$ source setup.bash; ros2 topic hz /scan",
        "ana@lab:~$ echo scan | xargs ros2 topic hz",
        "docker exec ros bash -c 'source /ros.sh && ros2 topic hz /scan'",
    ],
)
def test_what_is_redirected_joined_or_filtered_is_not_shown(line: str) -> None:
    typed = read_command(line)
    assert typed is not None
    assert not typed.shown
    assert understood(line) is None


@pytest.mark.parametrize(
    "prompt",
    [
        "",
        "$ ",
        "# ",
        "> ",
        "ana@lab:~/RAS545/Lab3$ ",
        "(lab) ana@lab:~$ ",
        "[ana@lab Lab3]$ ",
        "[12:00:01] ana@lab:~$ ",
        "^Cana@lab:~$ ",
        "root@4f1c2d:/ws# ",
        "ana@mac Lab3 % ",
        "ana@lab ~/Lab3> ",
        "bash-5.1$ ",
        "➜  ~ ",
        "➜  Lab3 ",
        "➜  Lab3 git:(main) ✗ ",
        "❯ ",  # noqa: RUF001
        "~/Lab3 main ❯ ",  # noqa: RUF001
        "╰─$ ",
        "└─$ ",
        "λ ",
        "### ",
        "Terminal 2: ",
        "timeout 10 ",
        "timeout --signal=INT -k 3 10s ",
        "sudo ",
        "sudo -E -u ana ",
        "docker exec -it ros_humble ",
        "docker compose exec ros ",
        "ROS_DOMAIN_ID=0 ",
        "env ROS_DOMAIN_ID=0 ",
        "time ",
        "ana@lab:~$ sudo docker exec -it ros timeout 10 ",
        "➜  ~ timeout 10 ",
        "❯ sudo ",  # noqa: RUF001
        "/opt/ros/humble/bin/",
    ],
)
def test_prompts_and_wrappers_are_known(prompt: str) -> None:
    assert understood(f"{prompt}ros2 topic hz /scan") == ("topic_hz", "/scan")


@pytest.mark.parametrize(
    "line",
    [
        "`ros2 topic hz /scan`",
        "`$ ros2 topic hz /scan`:",
        "- `ros2 topic hz /scan`",
        "2. **`ros2 topic hz /scan`**",
        "### `ros2 topic hz /scan`",
        "ros2 topic hz /scan:",
        "ros2 topic hz /scan  # the lidar",
        "ros2 topic hz /scan 2>&1",
        "ros2 topic hz /scan 2> /dev/null </dev/null",
        'docker exec ros bash -lc "ros2 topic hz /scan"',
        "ros2 topic hz scan --window 10 --wall-time",
    ],
)
def test_a_command_that_stands_alone_is_one(line: str) -> None:
    assert understood(line) == ("topic_hz", "/scan")


@pytest.mark.parametrize(
    ("line", "target"),
    [
        ("ros2 topic echo /scan sensor_msgs/msg/LaserScan --once", "/scan"),
        ("ros2 topic echo --qos-profile sensor_data --once /scan", "/scan"),
        ("ros2 topic echo --once camera/image_raw", "/camera/image_raw"),
        ("ros2 topic echo -l 5 -f /map", "/map"),
        ("ros2 topic echo --qos-durability transient_local map", "/map"),
    ],
)
def test_values_of_options_are_no_topics(line: str, target: str) -> None:
    assert understood(line) == ("topic_echo", target)


@pytest.mark.parametrize(
    ("line", "prompt"),
    [
        ("ana@lab:~$ ls", True),
        ("ana@lab:~$", True),
        ("➜  ~ ls", True),
        ("❯ clear", True),  # noqa: RUF001
        ("$ ls", True),
        ("average rate: 9.998", False),
        ("/scan", False),
        ("- Translation: [0.250, 0.001, 0.000]", False),
        ("", False),
    ],
)
def test_prompts_end_an_output(line: str, *, prompt: bool) -> None:
    assert is_prompt(line) is prompt


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


def test_a_filtered_list_shows_nothing(tmp_path: Path) -> None:
    assert read(tmp_path, b7__txt="$ ros2 topic list | grep clock\n/clock\n").topic_list == {}


def test_a_list_with_types_names_the_topics(tmp_path: Path) -> None:
    text = "$ ros2 topic list -t\n/clock [rosgraph_msgs/msg/Clock]\n/scan [a_msgs/msg/B]\n"
    assert only(read(tmp_path, t__txt=text).topic_list) == ("/clock", "/scan")


def test_a_list_ends_where_other_text_begins(tmp_path: Path) -> None:
    text = "$ ros2 node list\nWARNING: two share a name\n/amcl\n/map_server\n\nAs shown:\n/rviz\n"
    assert only(read(tmp_path, t__txt=text).node_list) == ("/amcl", "/map_server")


def test_a_stream_without_messages_has_the_rate_zero(tmp_path: Path) -> None:
    assert only(read(tmp_path, topic_hz_scan__txt=NO_RATE).topic_hz) == 0


def test_states_of_all_nodes_are_read(tmp_path: Path) -> None:
    text = "$ ros2 lifecycle get\n/amcl: active [3]\n/map_server: inactive [2]\n"
    for name in ("all.txt", "lifecycle.txt"):
        (tmp_path / name).write_text(text if name == "all.txt" else text.partition("\n")[2])
    states = read_evidence(tmp_path).lifecycle
    assert {node: [s.fact for s in shown] for node, shown in states.items()} == {
        "/amcl": ["active [3]"] * 2,
        "/map_server": ["inactive [2]"] * 2,
    }


SILENT = {
    "topic_hz_scan.txt": "ros2 topic hz /scan",
    "topic_type_map.txt": "ros2 topic type /map",
    "topic_echo_odom.txt": "ros2 topic echo /odom --once",
    "topic_info_tf.txt": "ros2 topic info /tf --verbose",
    "lifecycle_amcl.txt": "ros2 lifecycle get /amcl",
    "tf2_echo_odom_base_footprint.txt": "ros2 run tf2_ros tf2_echo odom base_footprint",
    "view_frames.txt": "ros2 run tf2_tools view_frames",
    "topic_list.txt": "ros2 topic list",
    "node_list.txt": "ros2 node list",
    "packages.txt": "ros2 pkg list",
}
NOTHING = ["", "^C\n", "I saw nothing odd here, but forgot the screenshot.\n"]


@pytest.mark.parametrize("output", NOTHING)
@pytest.mark.parametrize("name", SILENT)
def test_a_command_without_output_shows_nothing(tmp_path: Path, name: str, output: str) -> None:
    (tmp_path / name).write_text(output)
    (tmp_path / "session.log").write_text(f"ana@lab:~$ {SILENT[name]}\n{output}ana@lab:~$ ls\n")
    assert read_evidence(tmp_path) == Evidence(folder=".")


def test_a_list_of_commands_shows_nothing(tmp_path: Path) -> None:
    lines = [command.line for command in ROS.commands]
    plain, fenced = "\n".join(lines), "\n".join(["# What to run", "```bash", *lines, "```"])
    items = "".join(f"- `{line}`\n" for line in lines)
    text = "Afterwards everything was fine.\n"
    evidence = read(tmp_path, a__txt=plain, scan_hz__md=f"{fenced}\n{text}", c__md=items + text)
    assert evidence == Evidence(folder=".")


def test_the_silence_of_the_script_says_something(tmp_path: Path) -> None:
    rows = "".join(f"{name}\t124\tnow\t9.0\t{line}\n" for name, line in SILENT.items())
    for name, line in SILENT.items():
        (tmp_path / name).write_text(f"$ {line}\n")
    evidence = read(tmp_path, manifest__tsv=rows)
    assert only(evidence.topic_hz) == 0
    assert (only(evidence.topic_type), only(evidence.topic_info)) == ((), ())
    assert (only(evidence.topic_echo), only(evidence.lifecycle)) == ({}, "no answer")
    assert only(evidence.tf2_echo) == Lookup(found=False)
    assert (evidence.view_frames, evidence.topic_list, evidence.packages) == ({}, {}, {})


@pytest.mark.parametrize("status", [126, 127])
def test_what_the_script_could_not_start_says_nothing(tmp_path: Path, status: int) -> None:
    row = f"topic_hz_scan.txt\t{status}\tnow\t0.0\tros2 topic hz /scan\n"
    assert read(tmp_path, manifest__tsv=row, topic_hz_scan__txt="").topic_hz == {}


def test_an_output_in_a_fence_ends_with_it(tmp_path: Path) -> None:
    text = (
        "I ran `ros2 topic hz /odom` as well.\n\n### `ros2 lifecycle get /amcl`\n"
        f"```\n{ACTIVE}```\ninactive [2]\n```bash\n$ ros2 topic type /scan\n"
        "sensor_msgs/msg/LaserScan\n```\nnav_msgs/msg/Odometry\n"
    )
    evidence = read(tmp_path, report__md=text)
    assert only(evidence.lifecycle) == "active [3]"
    assert only(evidence.topic_type) == ("sensor_msgs/msg/LaserScan",)
    assert evidence.topic_hz == {}


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


@pytest.mark.parametrize("text", ["[" * 100_000, "{a: " * 50_000, "- " * 50_000])
def test_a_message_nested_too_deep_shows_nothing(text: str) -> None:
    assert parse_messages(text) == []


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("a: [[1], {b: 2}]\n", [{"a.1.b": 2}]),  # a list in a list
        ("a: &a {b: *a, frame_id: map}\n", [{"a.frame_id": "map"}]),  # nested without end
        ("WARNING: topic [/scan] does not appear to be published yet\n", []),
    ],
)
def test_odd_messages_are_read(text: str, messages: list[dict[str, object]]) -> None:
    assert parse_messages(text) == messages


def test_aliases_do_not_multiply() -> None:
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{n}: &a{n} {{p: *a{n - 1}, q: *a{n - 1}}}" for n in range(1, 60)]
    (message,) = parse_messages("\n".join(lines))
    assert message == {"a0.x": 1}


def test_publishers_and_subscriptions_are_told_apart() -> None:
    endpoints = parse_endpoints(info("nav_msgs/msg/Odometry", "one", "two"))
    assert [(e.node, e.publishes) for e in endpoints or ()] == [
        ("/one", True),
        ("/two", True),
        ("/rviz", False),
    ]


def test_policies_are_read() -> None:
    text = info("nav_msgs/msg/OccupancyGrid", "map_server", durability="TRANSIENT_LOCAL")
    (endpoint, _) = parse_endpoints(text) or ()
    assert (endpoint.reliability, endpoint.durability) == ("reliable", "transient_local")
    assert endpoint.type == "nav_msgs/msg/OccupancyGrid"


def test_publishers_are_counted_without_verbose() -> None:
    text = "Type: nav_msgs/msg/Odometry\nPublisher count: 2\nSubscription count: 1\n"
    assert [endpoint.publishes for endpoint in parse_endpoints(text) or ()] == [True, True]
    assert parse_endpoints("Unknown topic '/odom'\n") == ()
    assert parse_endpoints("see the screenshot\n") is None


@pytest.mark.parametrize(
    ("text", "state"),
    [
        (ACTIVE, "active [3]"),
        ("unconfigured [1]\n", "unconfigured [1]"),
        ("Node not found\n", "Node not found"),
        ("Exception while calling service of node '/amcl': gone\n",) * 2,
        ("The state of AMCL\n", None),
        ("", None),
    ],
)
def test_states_are_read(text: str, state: str | None) -> None:
    assert parse_state(text) == (state.strip() if state else None)


@pytest.mark.parametrize(
    ("text", "lookup"),
    [
        (LOOKUP, Lookup(found=True, translation=(0.25, 0.001, 0.0))),
        ("- Translation: [0.2, 0.0]\n", Lookup(found=True)),  # cut
        (NO_LOOKUP, Lookup(found=False)),
    ],
)
def test_a_transform_is_read(text: str, lookup: Lookup) -> None:
    assert parse_lookup(text) == lookup


def test_a_transform_of_words_is_found() -> None:
    found = parse_lookup("- Translation: [x, y, z]\n")
    assert found is not None
    assert found.translation is not None
    assert all(math.isnan(number) for number in found.translation)


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


GOALS = "topic_echo_navigate_to_pose_action_status__txt"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (GOALS, "status_list: []\n---\n"),
        (GOALS, "status_list:\n- status: fine\n---\n"),
        ("nav2__txt", "Goal finished with status: LOST\n"),
        ("notes__md", "At first Nav2 said Goal failed, then it worked.\n"),
        ("notes__md", "- Goal failed: what it means\n"),
        ("notes__md", "RViz says: Goal finished with status: ABORTED when it fails\n"),
    ],
)
def test_what_tells_of_no_goal_is_none(tmp_path: Path, name: str, text: str) -> None:
    assert read(tmp_path, **{name: text}).goals == {}


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


def test_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "outside.txt").write_text(TOPICS)
    inside = tmp_path / "results"
    inside.mkdir()
    (inside / "topic_list.txt").symlink_to(tmp_path / "outside.txt")
    assert read_evidence(inside).topic_list == {}


def test_a_file_that_cannot_be_read_shows_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, _mode: str) -> bytes:
        raise PermissionError(path)

    (tmp_path / "topic_list.txt").write_text(TOPICS)
    monkeypatch.setattr(Path, "open", refuse)
    assert read_evidence(tmp_path) == Evidence(folder=".")


@pytest.mark.parametrize("name", ["manifest.tsv", "topic_list.txt"])
def test_a_pipe_is_never_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    assert read_evidence(tmp_path) == Evidence(folder=".")


def test_a_manifest_that_is_a_link_is_not_followed_out(tmp_path: Path) -> None:
    (tmp_path / "outside.tsv").write_text("topic_list.txt\t0\t12:00:00\t1.0\tros2 topic list\n")
    inside = tmp_path / "results"
    inside.mkdir()
    (inside / "manifest.tsv").symlink_to(tmp_path / "outside.tsv")
    assert read_evidence(inside).runs == ()


def test_of_a_submission_only_what_is_listed_is_read(tmp_path: Path) -> None:
    listed = ["elsewhere/topic_list.txt", "results/topic_list.txt", "logs/deep/topic_list.txt"]
    for name in (*listed, "results/more/node_list.txt"):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(TOPICS)
    evidence = read_listed(tmp_path, listed, ["results", "logs"], ROS)
    assert [shown.file for shown in evidence.topic_list[""]] == listed[1:]
    assert evidence.node_list == {}


def test_of_a_long_text_the_beginning_is_read(tmp_path: Path) -> None:
    data = "header:\n  frame_id: map\ndata:\n" + f"- {'0' * 77}\n" * 20_000
    read_ = read(tmp_path, long__txt=f"$ ros2 topic echo /map\n{data}")
    fact = dict(read_.topic_echo["/map"][0].fact)
    assert 10_000 < int(str(fact.pop("data.shown"))) < 20_000
    assert fact == {"header.frame_id": "map", "data": None, "data.above zero": 0}


# What patterns with a gap in them, and readers of YAML, may take the square of its length for.
_UNITS = [
    " ", "\t", "\n", "\\\n", "a", "a:", "/a ", "/a []", "[", "{", "`", '"a" -> ', "a:\n", "a: 1\n",
    "a:\n parent: ", "- ", "- a\n", "? a\n", "-", "---\n", "a\n---\n", "Translation: [",
    "Node name:\n", "\x1b[0;", "\x1b]a", "ros2 ", "$ ", "x@y ", "docker ", "A=",
    "goal status: 1\n", "frame_yaml='a:\\n  parent: b", "active [3]\n", "a: &a [*a]\n",
    "Package '", "https://",
]  # fmt: skip


@pytest.mark.parametrize("unit", _UNITS)
def test_nothing_that_repeats_takes_the_square_of_its_length(tmp_path: Path, unit: str) -> None:
    long = unit * (40_000 // len(unit))
    runs = [re.sub(r"\{\w+\}", "/scan", kind.run) for kind in ROS.kinds.values()]
    texts = [
        f"ros2 topic list{long}x",
        long,
        *(f"$ {run}\n{long[:20_000]}x\n$ " for run in runs),
    ]
    for text in texts:
        (tmp_path / "notes.txt").write_text(text, newline="")
        started = time.process_time()
        read_evidence(tmp_path)
        # Ten times what the slowest takes, and a fraction of what the square of its length takes.
        assert time.process_time() - started < 0.6, text[:60]


def test_pictures_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "topic_list.png").write_text(TOPICS)
    assert read_evidence(tmp_path).topic_list == {}


MANY = 40_000
LONG = {
    "blanks": "$ ros2 topic list" + " " * MANY + "x",
    "prompts": "@" * MANY + "$ " + "a@b " * (MANY // 4),
    "ticks": "`" * MANY + " ros2 topic hz /scan",
    "marks": "- " * MANY + "ros2 topic list",
    "programs": "ros2 " * (MANY // 5),
    "wrappers": "timeout " * (MANY // 8) + "ros2 topic list",
    "quotes": "$ ros2 topic hz " + "'\"" * MANY,
    "continued": "$ ros2 topic hz " + "\\\n" * MANY,
    "colours": "\x1b[" * MANY + "\x1b]" * MANY,
    "names": "/" * MANY + " [" * 1000,
    "lines": "\n" * MANY + "Node name: x" + " \n" * MANY,
    "fields": "Node name: a\nA" + " " * MANY + "b\nB: c" + " " * MANY + "d\n",
    "packages": "Package '" * (MANY // 9),
    "places": "- Translation: [" * (MANY // 16),
    "parents": "a:\n  parent: 'x" + " " * MANY + "y\n",
    "edges": '"' * MANY + "digraph ",
    "values": "header: x" + " " * MANY + "y\n[\n",
    "goals": "goal status:" + "\n" * MANY + "goal status: 4" + "\n" * MANY,
}


@pytest.mark.parametrize("kind", LONG)
def test_no_text_takes_long(tmp_path: Path, kind: str) -> None:
    """Quadratic time over these would be minutes."""
    for name in ("session.txt", "topic_info_tf.txt", "topic_echo_scan.txt", "frames.gv"):
        (tmp_path / name).write_text(LONG[kind])
    begun = time.process_time()
    read_evidence(tmp_path)
    assert time.process_time() - begun < 4
