"""A dry run as a bag, read back by a reader that is not the writer's."""

from __future__ import annotations

import errno
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from breaking import broken
from foreign_robots import car_and_arm
from in_process import invoke
from pxr import Gf

from lab3_usd.errors import NoRoomError, UsageError
from lab3_usd.sim.bag.writer import SentCommand, Tape
from lab3_usd.sim.execution.drive import Leg

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")
reader = pytest.importorskip("mcap.reader", reason="mcap-ros2-support is not installed")
decoder = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is not installed")

SENSOR_DATA = {
    "history": "keepLast", "depth": 5, "reliability": "bestEffort", "durability": "volatile",
    "deadline": 0.0, "lifespan": 0.0, "liveliness": "automatic", "leaseDuration": 0.0,
}  # fmt: skip
RELIABLE, BEST_EFFORT, VOLATILE = 1, 2, 2  # as Humble writes them
WHEELS = 0.033 / 0.025
MOUNT, AHEAD = Gf.Vec3d(-0.032, 0.0, 0.182), Gf.Vec3d(1.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bag")
    stage = folder / "Lab3_05.usda"
    profile = ["ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:qosProfile", json.dumps(SENSOR_DATA)]
    broken("05", [{"set": profile}]).GetRootLayer().Export(str(stage))
    done = invoke("sim", stage, "--bag", folder / "run", "--format", "json")
    assert done.exit_code == 0
    (folder / "run.json").write_text(done.stdout)
    (folder / "run.err").write_text(done.stderr)
    return folder / "run"


@pytest.fixture(scope="module")
def heard(bag: Path) -> dict[str, list[tuple[float, Any]]]:
    """The messages by topic, each with its time in seconds."""
    found: dict[str, list[tuple[float, Any]]] = {}
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, message, said in made.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time / 1e9, said))
    return found


def messages_in(bag: Path) -> dict[str, list[Any]]:
    (file,) = bag.glob("*.mcap")
    found: dict[str, list[Any]] = {}
    with file.open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, _, said in made.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(said)
    return found


def test_every_robot_is_driven_in_the_bag_of_its_domain(tmp_path: Path) -> None:
    car_and_arm(5).GetRootLayer().Export(str(tmp_path / "both.usda"))
    bag = tmp_path / "run"
    done = invoke("sim", tmp_path / "both.usda", "--bag", bag, "--drive", "0.1,0,1")
    first, second = (messages_in(bag / name) for name in ("domain_0", "domain_5"))
    assert {*first} == {"/drive", "/odom"}
    assert {*second} == {"/clock", "/imu", "/joint_command", "/joint_states", "/tf"}
    assert first["/drive"][0].drive.steering_angle == pytest.approx(0.0)
    assert first["/odom"][-1].pose.pose.position.x > 0.1
    places = {name: set[float]() for name in second["/joint_states"][0].name}
    for states in second["/joint_states"]:
        for name, place in zip(states.name, states.position, strict=True):
            places[name].add(place)
    moved = {name: round(max(seen) - min(seen), 2) for name, seen in places.items()}
    assert moved == {"shoulder_joint": 0.1, "elbow_joint": 0.2, "tool_joint": 0.3}
    counts = [sum(map(len, part.values())) for part in (first, second)]
    assert [line for line in done.stdout.splitlines() if line.startswith("recorded: ")] == [
        f"recorded: {bag / 'domain_0'}: {counts[0]} messages on 2 topics",
        f"recorded: {bag / 'domain_5'}: {counts[1]} messages on 5 topics",
    ]


def test_what_the_bag_cannot_hold_is_named(bag: Path) -> None:
    assert bag.with_suffix(".err").read_text().splitlines()[1:] == [
        "  without content, so not recorded: /camera/image_raw"
    ]


def seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)


def test_the_metadata_are_those_of_humble(bag: Path, heard: dict[str, Any]) -> None:
    said = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (said["version"], said["storage_identifier"]) == (5, "mcap")
    assert "ros_distro" not in said
    assert said["custom_data"] == {"lab3_not_sent": "/camera/image_raw"}
    counts = {
        each["topic_metadata"]["name"]: each["message_count"]
        for each in said["topics_with_message_count"]
    }
    assert counts == {topic: len(messages) for topic, messages in heard.items()}
    assert sum(counts.values()) == said["message_count"]
    for each in said["topics_with_message_count"]:
        assert "type_description_hash" not in each["topic_metadata"]
    assert said["relative_file_paths"] == [each.name for each in bag.glob("*.mcap")]


def test_each_topic_is_offered_as_its_node_says(bag: Path) -> None:
    said = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    topics = [each["topic_metadata"] for each in said["topics_with_message_count"]]
    offered = {each["name"]: yaml.safe_load(each["offered_qos_profiles"])[0] for each in topics}
    told = {
        topic: (each["depth"], each["reliability"], each["durability"])
        for topic, each in offered.items()
    }
    assert told.pop("/scan") == (5, BEST_EFFORT, VOLATILE)
    assert set(told.values()) == {(10, RELIABLE, VOLATILE)}


def test_every_topic_but_the_pictures_is_there(heard: dict[str, Any]) -> None:
    assert set(heard) == {"/clock", "/cmd_vel", "/odom", "/tf", "/scan", "/camera/camera_info"}


def test_it_ends_with_the_first_stop(heard: dict[str, Any]) -> None:
    times = [time for time, _ in heard["/clock"]]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(9.07, abs=0.1)
    stamps = [seconds(said.clock) for _, said in heard["/clock"]]
    assert stamps == pytest.approx(times, abs=1e-6)


def test_a_recorded_dry_run_of_a_right_stage_passes(bag: Path) -> None:
    assert invoke("bag", bag, "--checkpoint", "05").exit_code == 0


def test_odometry_has_the_motion(heard: dict[str, Any]) -> None:
    ahead = [said for time, said in heard["/odom"] if time < 2.6][-1]
    assert ahead.header.frame_id == "odom"
    assert ahead.child_frame_id == "base_footprint"
    assert ahead.pose.pose.position.x == pytest.approx(0.3 * WHEELS, abs=0.01)
    assert ahead.pose.pose.orientation.w == pytest.approx(1.0)
    speeds = [said.twist.twist.linear.x for time, said in heard["/odom"] if 1.0 < time < 2.0]
    assert speeds == pytest.approx([0.15 * WHEELS] * len(speeds))


def test_transforms_are_those_of_odometry(heard: dict[str, Any]) -> None:
    moved = {
        transform.child_frame_id: transform
        for time, said in heard["/tf"]
        if time < 2.6
        for transform in said.transforms
    }
    assert set(moved) == {
        "base_footprint", "base_link", "base_scan", "caster_back_link",
        "wheel_left_link", "wheel_right_link", "Camera_1",
    }  # fmt: skip
    assert moved["base_footprint"].transform.translation.x == pytest.approx(0.3 * WHEELS, abs=0.01)
    scan = moved["base_scan"]
    assert scan.header.frame_id == "base_footprint"
    offset = scan.transform.translation
    assert (offset.x, offset.y, offset.z) == pytest.approx((-0.032, 0.0, 0.182), abs=1e-6)


def looked_up(said: list[Any], frame: str, root: str) -> Gf.Matrix4d:
    """Return where a frame is, by the matrices and quaternions of OpenUSD."""
    latest = {
        transform.child_frame_id: transform for message in said for transform in message.transforms
    }
    place = Gf.Matrix4d(1.0)
    while frame != root:
        each = latest[frame]
        turn, moved = each.transform.rotation, each.transform.translation
        step = Gf.Matrix4d(1.0).SetRotate(Gf.Quatd(turn.w, turn.x, turn.y, turn.z))
        place *= step.SetTranslateOnly(Gf.Vec3d(moved.x, moved.y, moved.z))
        frame = each.header.frame_id
    return place


def test_the_lidar_is_where_the_robot_went(bag: Path, heard: dict[str, list[Any]]) -> None:
    path = json.loads((bag.parent / "run.json").read_text())["path"]
    (x0, y0), turned = path[0][1:3], 0.0
    for seconds, x, y, yaw in path[3:88:5]:
        said = [said for time, said in heard["/tf"] if time < seconds + 0.004]
        place = looked_up(said, "base_scan", "odom")
        ahead = Gf.Matrix4d(1.0).SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, 1), math.degrees(yaw)))
        there = ahead.SetTranslateOnly(Gf.Vec3d(x - x0, y - y0, 0.0))
        assert Gf.IsClose(place.Transform(Gf.Vec3d(0)), there.Transform(MOUNT), 0.005)
        assert Gf.IsClose(place.TransformDir(Gf.Vec3d(1, 0, 0)), there.TransformDir(AHEAD), 0.03)
        turned = max(turned, yaw)
    assert turned > 1.5


def test_a_scan_shows_the_wall_ahead(heard: dict[str, Any]) -> None:
    said = heard["/scan"][0][1]
    assert said.header.frame_id == "base_scan"
    assert len(said.ranges) == 360
    ahead = round(-said.angle_min / said.angle_increment)
    assert said.ranges[ahead] == pytest.approx(2.35 - 1.768, abs=1e-3)
    assert said.angle_max == pytest.approx(math.pi, abs=1e-5)


def test_a_scan_takes_a_turn_of_the_lidar_and_what_returns_is_bright(heard: dict[str, Any]) -> None:
    said = heard["/scan"][0][1]
    assert said.scan_time == pytest.approx(0.1)  # of 10 turns a second
    assert said.time_increment == pytest.approx(0.1 / 360)
    assert {
        (ray > 0, bright) for ray, bright in zip(said.ranges, said.intensities, strict=True)
    } == {(True, 255.0)}


def test_camera_info_is_of_the_lens(heard: dict[str, Any]) -> None:
    said = heard["/camera/camera_info"][0][1]
    assert (said.width, said.height) == (640, 480)
    assert said.k[0] == pytest.approx(640 * 18.0 / 20.955, rel=1e-6)
    assert list(said.p[:3]) == pytest.approx([said.k[0], 0.0, said.k[2]])


def test_commands_are_as_they_were_sent(heard: dict[str, Any]) -> None:
    told = [(said.linear.x, said.angular.z) for time, said in heard["/cmd_vel"] if time < 2.5]
    assert told == [(0.15, 0.0)] * 20


def test_nothing_is_written_over(bag: Path) -> None:
    stage = bag.parent / "Lab3_05.usda"
    with pytest.raises(UsageError, match="exists already"):
        invoke("sim", stage, "--bag", bag)


def test_without_the_extra_a_line_says_what_to_install(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    stage = bag.parent / "Lab3_05.usda"
    with pytest.raises(UsageError, match=r"needs the extra sim: .* install"):
        invoke("sim", stage, "--bag", bag.parent / "other")


def test_a_full_disk_leaves_no_part_of_a_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lab3_usd.sim.bag import writer

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(writer.Writer, "write", full)
    ahead = SentCommand(0.0, 0, "/cmd_vel", Leg("ahead", 1.0, (0.1, 0.0, 0.0)))
    with pytest.raises(NoRoomError, match="run cannot be written"):
        writer.write_bags(tmp_path / "run", Tape((), (ahead,), 0))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_another_run_made_meanwhile_stays_as_it_is(tmp_path: Path) -> None:
    from lab3_usd.sim.bag import writer

    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mine.mcap").write_text("mine")
    ahead = SentCommand(0.0, 0, "/cmd_vel", Leg("ahead", 1.0, (0.1, 0.0, 0.0)))
    with pytest.raises(UsageError, match="run cannot be written"):
        writer.write_bags(tmp_path / "run", Tape((), (ahead,), 0))
    assert [path.name for path in tmp_path.rglob("*")] == ["run", "mine.mcap"]
