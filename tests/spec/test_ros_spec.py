"""`ros.yaml`: what it says is read whole, and a slip in it is one line."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec.load.lab import _ros_data, _ros_spec
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.ros import RosSpec, file_word

ROS = load_lab().ros


def changed(folder: Path, old: str, new: str) -> RosSpec:
    text = (data_folder("graphs") / "ros.yaml").read_text()
    assert old in text
    (folder / "ros.yaml").write_text(text.replace(old, new, 1))
    return _ros_spec(_ros_data(folder))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("topics:\n  # type", "subjects:\n  # type", "'subjects' is not known"),
        ("kind: packages", "kind: parcels", "parcels"),
        ("seconds: 10", "seconds: soon", "seconds"),
        ("linear_speed: 0.22", "linear_speed: fast", "linear_speed"),
        ("  domain: 0\n", "", "domain"),
        ("state: active [3]", "state: [active, 3]", "state"),
        ("succeeded: 4\n", "succeeded: 4\n  reached: 4\n", "reached"),
        ("publishers: 1\n", "publisher: 1\n", "publisher"),
        ("extra: true}", "extra: maybe}", "extra"),
        ("ros2 topic hz {of}", "ros2 topic hz {topic}", "'{topic}' is not a placeholder"),
        ("ros2 topic hz {of}", "ros2 topic hz {of", "expected '}'"),
    ],
)
def test_a_slip_is_one_line_that_names_it(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(SpecError, match=re.escape(said)) as error:
        changed(tmp_path, old, new)
    assert "ros.yaml" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_folder_without_it_is_a_course_without_ros(tmp_path: Path) -> None:
    assert _ros_spec(_ros_data(tmp_path)).topics == {}
    assert _ros_spec(_ros_data(tmp_path)).commands == ()


def test_a_copy_elsewhere_says_the_same(tmp_path: Path) -> None:
    shutil.copy(data_folder("graphs") / "ros.yaml", tmp_path)
    assert _ros_spec(_ros_data(tmp_path)) == ROS


def test_every_output_has_a_name_of_its_own() -> None:
    files = [command.file for command in ROS.commands]
    assert len(files) == len(set(files))


def test_the_commands_are_those_of_the_handout() -> None:
    lines = [command.line for command in ROS.commands]
    assert "ros2 topic echo /scan --once" in lines
    assert "ros2 topic info /tf --verbose" in lines
    assert "ros2 run tf2_ros tf2_echo map base_footprint --ros-args -p use_sim_time:=true" in lines


def test_every_type_rate_and_policy_of_the_spec_is_collected() -> None:
    of = {(command.kind.name, command.of) for command in ROS.commands}
    for name, topic in ROS.topics.items():
        if topic.rate:
            assert ("topic_hz", name) in of
        if topic.durability:
            assert ("topic_info", name) in of
        if topic.fields:
            assert ("topic_echo", name) in of


def test_frames_of_the_commands_and_messages_are_in_the_tree() -> None:
    tree = {frame for edge in load_lab().frames.edges for frame in edge} | {"map"}
    asked = {frame for c in ROS.commands if c.to for frame in (c.of, c.to)}
    fields = {frame for t in ROS.topics.values() for frame in (t.fields or {}).values()}
    assert asked | fields <= tree


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("/camera/image_raw", "camera_image_raw"),
        ("odom base_footprint", "odom_base_footprint"),
        ("/navigate_to_pose/_action/status", "navigate_to_pose_action_status"),
    ],
)
def test_names_become_parts_of_file_names(name: str, word: str) -> None:
    assert file_word(name) == word
