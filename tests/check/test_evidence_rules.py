"""Rules about saved diagnostics: each with a case that it finds and one that it leaves alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import assert_golden, numbered, problems_text
from grade_files import read_evidence
from msgspec.structs import replace
from ros_outputs import (
    ACTIVE,
    EDGES,
    IMAGE,
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
    TYPES,
    frames_gv,
    info,
    view_frames,
)
from submissions import diagnostics

from lab3_usd.check.registry import rules_of
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import EvidenceSubject
from lab3_usd.spec.load.loader import load_lab

ROS = load_lab().ros
LAB = load_lab()
RULES = {found.id: found for found in rules_of("evidence", "E")}
Files = dict[str, str]


def subject(folder: Path, files: Files) -> EvidenceSubject:
    for name, text in files.items():
        (folder / name).write_text(text)
    evidence = read_evidence(folder, root=folder.parent)
    return EvidenceSubject(ROS, LAB.frames, LAB.scene.map, evidence, tuple(LAB.checkpoints))


def problems(given: EvidenceSubject) -> dict[str, list[Problem]]:
    found = {rule_id: list(each.check(given)) for rule_id, each in RULES.items()}
    return {rule_id: each for rule_id, each in found.items() if each}


def manifest(file: str) -> Files:
    """A manifest of the collecting script in which one output stands."""
    return {"manifest.tsv": f"{file}\t124\t2026-11-20T10:00:00Z\t10.0\tros2\n"}


IMAGE_TOPIC = "/camera/image_raw"
FAULTS: list[tuple[str, Files, str | None]] = [
    ("E02", {"topic_type_scan.txt": "sensor_msgs/msg/PointCloud2\n"}, "/scan"),
    ("E02", {"topic_type_map.txt": "", **manifest("topic_type_map.txt")}, "/map"),
    ("E02", {"topic_type_odom.txt": f"{TYPES['/odom']}\n{TYPES['/scan']}\n"}, "/odom"),
    (
        "E02",
        {"list.txt": "$ ros2 topic list -t\n/camera/camera_info [sensor_msgs/msg/Image]\n"},
        "/camera/camera_info",
    ),
    (
        "E02",
        {"topic_info_odom.txt": info(TYPES["/scan"], "odometry")},
        "/odom",
    ),
    ("E03", {"topic_list.txt": TOPICS.replace("/map\n", "")}, "/map"),
    ("E04", {"topic_hz_scan.txt": NO_RATE}, "/scan"),
    ("E04", {"topic_hz_clock.txt": "", **manifest("topic_hz_clock.txt")}, "/clock"),
    ("E04", {"topic_hz_odom.txt": f"{RATE}no new messages\nno new messages\n"}, "/odom"),
    ("E05", {"topic_echo_clock.txt": "clock:\n  sec: 0\n  nanosec: 0\n---\n"}, "/clock"),
    ("E05", {"topic_echo_camera_image_raw.txt": IMAGE.replace("640", "1280")}, IMAGE_TOPIC),
    ("E05", {"topic_echo_camera_image_raw.txt": IMAGE.replace("rgb8", "32FC1")}, IMAGE_TOPIC),
    ("E05", {"topic_echo_scan.txt": SCAN.replace("- 1.25\n- .inf\n", "- -1.0\n" * 128)}, "/scan"),
    ("E05", {"topic_echo_scan.txt": f"{SCAN.partition('ranges')[0]}ranges: []\n---\n"}, "/scan"),
    ("E05", {"topic_echo_scan.txt": SCAN.replace("-3.14", "1.57")}, "/scan"),
    ("E05", {"topic_echo_scan.txt": SCAN.replace("base_scan", "sim_lidar")}, "/scan"),
    ("E05", {"topic_echo_odom.txt": ODOM.replace("base_footprint", "base_link")}, "/odom"),
    ("E05", {"topic_echo_clock.txt": NO_RATE.replace("/scan", "/clock")}, "/clock"),
    ("E06", {"topic_echo_map.txt": MAP.replace("177", "384")}, "/map"),
    ("E06", {"topic_echo_map.txt": MAP.replace("-3.32", "-10.0")}, "/map"),
    (
        "E07",
        {"topic_info_scan.txt": info(TYPES["/scan"], "lidar", durability="TRANSIENT_LOCAL")},
        "/scan",
    ),
    ("E07", {"topic_info_map.txt": info(TYPES["/map"], "map_server")}, "/map"),
    ("E08", {"lifecycle_amcl.txt": "inactive [2]\n"}, "/amcl"),
    ("E08", {"lifecycle_map_server.txt": "Node not found\n"}, "/map_server"),
    ("E09", {"node_list.txt": NODES.replace("/velocity_smoother\n", "")}, "/velocity_smoother"),
    ("E11", {"view_frames.txt": view_frames(*EDGES[1:])}, "map -> odom"),
    ("E11", {"view_frames.txt": view_frames(*EDGES[:-1])}, "base_footprint -> Camera_1"),
    ("E11", {"view_frames.txt": "frame_yaml='[]'"}, None),
    (
        "E11",
        {"view_frames.txt": view_frames(*EDGES[:-1], ("odom", "Camera_1"))},
        "base_footprint -> Camera_1",
    ),
    ("E12", {"view_frames.txt": view_frames(("odom", "base_link"), *EDGES)}, "base_link"),
    ("E13", {"tf2_echo_map_base_footprint.txt": NO_LOOKUP}, "map -> base_footprint"),
    ("E14", {"topic_info_odom.txt": info(TYPES["/odom"], "one", "two")}, "/odom"),
    ("E14", {"topic_info_scan.txt": "Unknown topic '/scan'\n"}, "/scan"),
    (
        "E14",
        {
            "cmd.txt": "$ ros2 topic info /cmd_vel\nType: geometry_msgs/msg/Twist\n"
            "Publisher count: 1\nSubscription count: 0\n"
        },
        "/cmd_vel",
    ),
    (
        "E15",
        {"node_list.txt": NODES + "/_Graph_ROS_Odometry_TFWorld2Odom\n"},
        "/_Graph_ROS_Odometry_TFWorld2Odom",
    ),
    (
        "E15",
        {
            "topic_info_tf.txt": info(
                "tf2_msgs/msg/TFMessage", "amcl", "_World_ROS_OdomTF_TFWorld2Odom"
            )
        },
        "/_World_ROS_OdomTF_TFWorld2Odom",
    ),
    (
        "E16",
        {"topic_echo_navigate_to_pose_action_status.txt": STATUS.replace("status: 4", "status: 6")},
        None,
    ),
    ("E17", {"packages.txt": PACKAGES.replace("rqt_image_view\n", "")}, "rqt_image_view"),
]


NAMES = list(numbered(rule_id for rule_id, _, _ in FAULTS))


@pytest.mark.parametrize(
    "ranges", ["- -1.0\n" * 3, "- -1.0\n" * 127 + "- 2.5\n", "- .nan\n" * 128, ""]
)
def test_a_scan_that_may_show_a_wall_is_right(tmp_path: Path, ranges: str) -> None:
    scan = SCAN.replace("- 1.25\n- .inf\n", ranges)
    assert problems(subject(tmp_path, {**diagnostics(), "topic_echo_scan.txt": scan})) == {}


def test_a_rate_after_a_pause_is_right(tmp_path: Path) -> None:
    hz = {"topic_hz_odom.txt": f"no new messages\n{RATE}"}
    assert problems(subject(tmp_path, {**diagnostics(), **hz})) == {}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[Problem]]]:
    """What is said of each fault."""
    root, said = tmp_path_factory.mktemp("faults"), {}
    for name, (_, content, _) in zip(NAMES, FAULTS, strict=True):
        folder = root / name
        folder.mkdir()
        said[name] = problems(subject(folder, {**diagnostics(), **content}))
    return said


def test_what_is_said_of_each_fault_is_as_it_was(
    found: dict[str, dict[str, list[Problem]]],
) -> None:
    shown = {name: problems_text(problems, LAB) for name, problems in found.items()}
    assert_golden("evidence-faults", shown)


def test_a_fault_gives_its_finding_and_no_other(
    found: dict[str, dict[str, list[Problem]]],
) -> None:
    for name, (rule_id, files, site) in zip(NAMES, FAULTS, strict=True):
        assert list(found[name]) == [rule_id], name
        (problem,) = found[name][rule_id]
        assert (problem.prim, problem.property) == (f"{name}/{next(iter(files))}", site)
        assert problem.handout or load_lab().handout.rules[rule_id], name


def test_every_rule_has_a_case() -> None:
    elsewhere = {"E01", "E10", "E18", "E19"}  # the last two in test_recordings_handed_in.py
    assert {rule_id for rule_id, _, _ in FAULTS} | elsewhere == set(RULES)


STATUS_FILE = "topic_echo_navigate_to_pose_action_status.txt"
ALMOST: dict[str, tuple[Files, list[str]]] = {
    "everything": ({}, []),
    "frames hang deeper below the base": (
        {"view_frames.txt": view_frames(*EDGES[:3], ("base_link", "base_scan"), *EDGES[4:])},
        [],
    ),
    "three publishers of TF": (
        {"topic_info_tf.txt": info("tf2_msgs/msg/TFMessage", "amcl", "one", "two")},
        [],
    ),
    "a field was cut away": (
        {"topic_echo_scan.txt": SCAN.replace("  frame_id: base_scan\n", "")},
        [],
    ),
    "a goal failed before one succeeded": ({"nav2.log": "[bt_navigator]: Goal failed\n"}, []),
    "nobody publishes commands": (
        {"topic_info_cmd_vel.txt": f"$ ros2 topic info /cmd_vel -v\n{info(TYPES['/cmd_vel'])}"},
        [],
    ),
    "later outputs repair earlier ones": (
        {
            "a_hz_scan.txt": f"$ ros2 topic hz /scan\n{NO_RATE}",
            "amcl first.txt": "unconfigured [1]\n",
        },
        [],
    ),
    "a list was filtered": (
        {"topic_list.txt": "$ ros2 topic list | grep scan\n/scan\n"},
        ["E01"],
    ),
    "a status without a goal": ({STATUS_FILE: "status_list: []\n---\n"}, ["E01"]),
    "active by name and not by number": (
        {"lifecycle_amcl.txt": ACTIVE.replace("3", "2")},
        ["E08"],
    ),
}


def test_a_later_output_that_contradicts_a_right_one_is_a_note(tmp_path: Path) -> None:
    files = {"topic_hz_scan.txt": RATE, "z_hz.txt": f"$ ros2 topic hz /scan\n{NO_RATE}"}
    [note] = problems(subject(tmp_path, {**diagnostics(), **files}))["E04"]
    assert (note.severity, note.unmet) == ("note", ())
    assert note.message.endswith("topic_hz_scan.txt shows it right")


@pytest.mark.parametrize(("files", "rules"), ALMOST.values(), ids=ALMOST)
def test_what_shows_enough_has_no_problem(tmp_path: Path, files: Files, rules: list[str]) -> None:
    assert list(problems(subject(tmp_path, {**diagnostics(), **files}))) == rules


def test_world_to_odom_in_a_tree_is_found(tmp_path: Path) -> None:
    files = {**diagnostics(), "view_frames.txt": view_frames(("world", "odom"), *EDGES[1:])}
    found = problems(subject(tmp_path, files))
    assert [p.property for p in found["E10"]] == ["world -> odom"]


def test_a_tree_with_world_to_odom_is_found_beside_a_good_one(tmp_path: Path) -> None:
    files = {**diagnostics(), "frames.gv": frames_gv(("world", "odom"))}
    found = problems(subject(tmp_path, files))
    assert list(found) == ["E10"]


def test_trees_that_disagree_are_a_warning(tmp_path: Path) -> None:
    files = {**diagnostics(), "frames.gv": frames_gv(("base_link", "Camera_1"))}
    found = problems(subject(tmp_path, files))
    assert [(p.property, p.severity) for p in found["E12"]] == [("Camera_1", "warning")]
    assert found["E12"][0].related == (f"{tmp_path.name}/frames.gv",)


def test_before_localization_its_evidence_is_not_asked_for(tmp_path: Path) -> None:
    files = {
        **diagnostics(),
        "view_frames.txt": view_frames(*EDGES[1:]),
        "topic_list.txt": TOPICS.replace("/map\n", ""),
        "lifecycle_amcl.txt": "Node not found\n",
    }
    given = replace(subject(tmp_path, files), reached=LAB.until("06"))
    assert problems(given) == {}


def test_what_is_missing_is_not_shown(tmp_path: Path) -> None:
    files = diagnostics()
    del files["topic_hz_scan.txt"], files["topic_hz_odom.txt"]
    (problem,) = problems(subject(tmp_path, files))["E01"]
    assert "`ros2 topic hz /odom`, `ros2 topic hz /scan`" in problem.message
    assert (problem.prim, problem.handout, problem.severity) == (tmp_path.name, "J4", "note")


def test_what_is_missing_is_an_error_where_evidence_is_required(tmp_path: Path) -> None:
    files = diagnostics()
    del files["lifecycle_amcl.txt"]
    given = replace(subject(tmp_path, files), required=True)
    assert [p.severity for p in problems(given)["E01"]] == ["error"]


def test_an_empty_folder_is_said_once(tmp_path: Path) -> None:
    found = problems(subject(tmp_path, {}))
    assert list(found) == ["E01"]
    assert [p.severity for p in found["E01"]] == ["note"]


def test_extra_commands_may_be_missing(tmp_path: Path) -> None:
    files = diagnostics()
    for command in ROS.commands:
        if command.extra:
            del files[command.file]
    assert problems(subject(tmp_path, files)) == {}


def test_a_tree_from_before_localization_is_a_note(tmp_path: Path) -> None:
    files = {**diagnostics(), "view_frames.txt": view_frames(*EDGES[1:])}
    given = subject(tmp_path, files)
    assert [p.severity for p in problems(given)["E11"]] == ["note"]
    required = problems(replace(given, required=True))
    assert [p.severity for p in required["E11"]] == ["error"]


@pytest.mark.parametrize("edges", [EDGES[:-1], (("base_link", "odom"), *EDGES[1:])])
def test_a_tree_that_lacks_a_frame_or_has_a_wrong_parent_is_an_error(
    tmp_path: Path, edges: tuple[tuple[str, str], ...]
) -> None:
    found = problems(subject(tmp_path, {**diagnostics(), "view_frames.txt": view_frames(*edges)}))
    assert [p.severity for p in found["E11"]] == [None]


def test_a_wrong_type_that_two_outputs_show_is_one_finding(tmp_path: Path) -> None:
    wrong = {
        "topic_type_scan.txt": "sensor_msgs/msg/PointCloud2\n",
        "topic_info_scan.txt": info("sensor_msgs/msg/PointCloud2", "lidar"),
    }
    (problem,) = problems(subject(tmp_path, {**diagnostics(), **wrong}))["E02"]
    assert problem.prim.endswith("topic_type_scan.txt")


def test_an_early_list_of_nodes_is_one_finding(tmp_path: Path) -> None:
    files = {**diagnostics(), "node_list.txt": "/World_ROS_Clock_ros2_publish_clock\n"}
    (problem,) = problems(subject(tmp_path, files))["E09"]
    assert problem.property is None
    assert str(problem.expected).split(", ") == [*ROS.lifecycle.nodes, *ROS.nodes]


@pytest.mark.parametrize(
    ("rule_id", "files", "words"),
    [
        ("E14", {"topic_info_map.txt": "Unknown topic '/map'\n"}, "map server"),
        ("E14", {"topic_info_scan.txt": "Unknown topic '/scan'\n"}, "press Play"),
        ("E05", {"topic_echo_scan.txt": NO_RATE}, "press Play"),
        ("E05", {"topic_echo_map.txt": NO_RATE}, "map server"),
        ("E04", {"topic_hz_scan.txt": NO_RATE}, "press Play"),
        ("E02", {"topic_type_map.txt": "", **manifest("topic_type_map.txt")}, "map server"),
        ("E02", {"topic_type_cmd_vel.txt": "", **manifest("topic_type_cmd_vel.txt")}, "subscriber"),
        ("E03", {"topic_list.txt": TOPICS.replace("/map\n", "")}, "map server"),
        # What is there and wrong is repaired as the rule says.
        ("E02", {"topic_type_map.txt": "sensor_msgs/msg/PointCloud2\n"}, None),
        ("E05", {"topic_echo_scan.txt": SCAN.replace("base_scan", "sim_lidar")}, None),
        ("E14", {"topic_info_odom.txt": info(TYPES["/odom"], "one", "two")}, None),
    ],
)
def test_the_hint_fits_what_is_shown(
    tmp_path: Path, rule_id: str, files: Files, words: str | None
) -> None:
    (problem,) = problems(subject(tmp_path, {**diagnostics(), **files}))[rule_id]
    assert words in (problem.hint or "") if words else problem.hint is None


def test_an_early_list_of_topics_is_one_finding(tmp_path: Path) -> None:
    early = "/clock\n/parameter_events\n/rosout\n"
    (problem,) = problems(subject(tmp_path, {**diagnostics(), "topic_list.txt": early}))["E03"]
    assert problem.property is None
    assert str(problem.expected).split(", ") == [
        name for name in ROS.topics if name not in {"/clock", "/tf_static"}
    ]
