"""`lab3 bag`: recordings of all kinds, what is wrong in them, and those made to stop a reader."""

from __future__ import annotations

import shutil
import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from in_process import invoke
from msgspec.structs import replace

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")

from recordings import (
    STORE,
    Sent,
    aimed,
    durable,
    on,
    recorded,
    rewritten,
    tied,
)
from report_examples import dry_run_of
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

from lab3_usd.errors import RecordingError, UsageError
from lab3_usd.model.dry_run import Behaviour, Frame, Topic, Unknown
from lab3_usd.report.behaviour.text import PASSED_IN_A_RECORDING, render
from lab3_usd.sim.bag.judge import CHECKS, judge_what_came
from lab3_usd.sim.bag.recording_files import Bounds, layout_at
from lab3_usd.sim.judge.checks import CHECKS as SHARED
from lab3_usd.sim.outcome import differences
from lab3_usd.spec.load.loader import load_lab

LAB = load_lab()
SECOND = 1_000_000_000  # nanoseconds


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("recording"), "Lab3_08_run")


@pytest.fixture(scope="module")
def brief(plain: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first second of the recording."""
    folder = tmp_path_factory.mktemp("brief")
    return rewritten(
        plain, folder / "Lab3_08_run", lambda sent: iter([sent] * (sent.time < SECOND))
    )


@pytest.fixture(scope="module")
def of_brief(brief: Path) -> dict[str, Any]:
    """What is told of it, wherever it lies."""
    return judged(brief) | {"recording": ""}


def bag(path: Path, *arguments: str) -> Result:
    return invoke("bag", path, *arguments)


def judged(path: Path, *arguments: str) -> dict[str, Any]:
    done = bag(path, "--format", "json", *arguments)
    document = dry_run_of(done.stdout)
    assert done.exit_code == {"ok": 0, "bad": 1, "unreadable": 2}[document["verdict"]]
    return document


def wrong(path: Path, *arguments: str) -> dict[str, str]:
    found = judged(path, *arguments)["checks"]
    return {each["name"]: each["message"] for each in found if each["verdict"] != "ok"}


def test_a_good_recording_is_all_right(plain: Path) -> None:
    assert judged(plain)["verdict"] == "ok"


def test_a_recording_of_a_dry_run_is_not_blamed_for_the_pictures_that_it_lacks(
    plain: Path,
) -> None:
    document = judged(plain.parent / "dry")
    assert document["verdict"] == "ok"
    assert [each["prim"] for each in document["not_simulated"]] == ["/camera/image_raw"]
    stage = plain.parent / "Lab3_05.usda"
    found = judged(plain.parent / "dry", "--stage", str(stage))["differences"]
    assert "/camera/image_raw" not in {each["name"] for each in found}


def test_pictures_that_a_real_recording_lacks_are_missed(plain: Path, tmp_path: Path) -> None:
    run = rewritten(plain, tmp_path / "Lab3_08_run", on("/camera/image_raw", lambda _: "drop"))
    assert wrong(run)["topics"] == "nothing on /camera/image_raw"


def test_a_lidar_that_turns_otherwise_is_told_by_its_scans(plain: Path, tmp_path: Path) -> None:
    def twice(said: Any) -> None:
        said.scan_time = 0.05

    run = rewritten(plain, tmp_path / "Lab3_08_run", on("/scan", twice))
    assert wrong(run) == {"scan": "the lidar turns 20 times a second, not 10"}


def test_the_topics_have_both_rates_and_their_qos(plain: Path) -> None:
    document = judged(plain)
    assert document["recording"] == str(plain)
    scan = next(each for each in document["topics"] if each["name"] == "/scan")
    assert scan == {
        "name": "/scan",
        "type": "sensor_msgs/msg/LaserScan",
        "hz": pytest.approx(10.0, abs=0.2),
        "frame": "base_scan",
        "arrival_hz": pytest.approx(10.0, abs=0.2),
        "qos": ["reliable, volatile"],
    }


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize(
    "packing", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE]
)
def test_all_ways_of_packing_give_the_same(
    brief: Path,
    of_brief: dict[str, Any],
    tmp_path: Path,
    storage: StoragePlugin,
    packing: CompressionMode,
) -> None:
    other = judged(rewritten(brief, tmp_path / "Lab3_08_run", storage=storage, packing=packing))
    assert {**other, "recording": ""} == of_brief


def test_a_recording_in_two_files_is_one(
    brief: Path, of_brief: dict[str, Any], tmp_path: Path
) -> None:
    folder = tmp_path / "Lab3_08_run"
    parts = [
        rewritten(
            brief,
            tmp_path / name,
            lambda sent, late=late: iter([sent] * ((sent.time > SECOND / 2) is late)),
        )
        for name, late in (("run_0", False), ("run_1", True))
    ]
    folder.mkdir()
    for part in parts:
        shutil.copy(part / f"{part.name}.mcap", folder)
    assert {**judged(folder), "recording": ""} == of_brief


def test_one_file_is_a_recording(plain: Path) -> None:
    assert judged(next(plain.glob("*.mcap")))["verdict"] == "ok"


def test_a_simulation_at_half_speed_is_judged_by_its_own_time(plain: Path, tmp_path: Path) -> None:
    slow = rewritten(
        plain, tmp_path / "Lab3_08_run", lambda sent: iter([replace(sent, time=2 * sent.time)])
    )
    document = judged(slow)
    assert document["verdict"] == "ok"
    scan = next(each for each in document["topics"] if each["name"] == "/scan")
    assert (scan["hz"], scan["arrival_hz"]) == (
        pytest.approx(10, abs=0.2),
        pytest.approx(5, abs=0.1),
    )


def turned(said: Any) -> None:
    said.linear.x = -said.linear.x


def farther(said: Any) -> None:
    said.pose.pose.position.x *= 2


def by_the_wall(said: Any) -> None:
    said.header.stamp.sec += 1_700_000_000


def slower(said: Any) -> str:
    return "drop" if said.header.stamp.nanosec % 400_000_000 > 200_000_000 else ""


def no_tie(said: Any) -> None:
    said.transforms = [
        transform for transform in said.transforms if transform.child_frame_id != "base_footprint"
    ]


def moved(said: Any) -> None:
    for transform in said.transforms:
        if transform.child_frame_id == "base_footprint":
            transform.transform.translation.x += 0.5


# Those of test_recorded_faults.py are not repeated here.
FAULTS: dict[str, tuple[str, Callable[[Any], object]]] = {
    "follows": ("/cmd_vel", turned),
    "way": ("/odom", farther),
    "stamps": ("/odom", by_the_wall),
    "scan": ("/scan", slower),
    "tree": ("/tf", no_tie),
    "moving frames": ("/tf", moved),
    "topics": ("/odom", lambda _: "drop"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_by_its_check(plain: Path, tmp_path: Path, name: str) -> None:
    assert name in wrong(rewritten(plain, tmp_path / "Lab3_08_run", on(*FAULTS[name])))


def test_localization_and_a_goal_that_is_reached_are_all_right(plain: Path, tmp_path: Path) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        for each in tied(sent, "map"):
            yield from aimed(each, 4)

    checks = judged(rewritten(plain, tmp_path / "Lab3_08_run", change))["checks"]
    verdicts = {each["name"]: each["verdict"] for each in checks}
    assert (verdicts["localization"], verdicts["goal"]) == ("ok", "ok")


def test_static_transforms_belong_to_the_tree(plain: Path, tmp_path: Path) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        if sent.topic == "/tf":
            held = [e for e in sent.said.transforms if e.child_frame_id == "base_scan"]
            sent.said.transforms = [e for e in sent.said.transforms if e not in held]
            if held and sent.time < 100_000_000:
                said = STORE.types[sent.type](held)
                yield Sent(sent.time, "/tf_static", sent.type, said, durable(sent.qos))
        yield sent

    document = judged(rewritten(plain, tmp_path / "Lab3_08_run", change))
    assert document["verdict"] == "ok"
    assert {"parent": "base_footprint", "child": "base_scan", "static": True} in document["frames"]


def test_without_commands_nothing_is_said_of_following(plain: Path, tmp_path: Path) -> None:
    quiet = rewritten(plain, tmp_path / "Lab3_08_run", on("/cmd_vel", lambda _: "drop"))
    assert not {"rest", "follows", "limits", "way"} & {e["name"] for e in judged(quiet)["checks"]}
    assert "no command was recorded" in bag(quiet).stdout


def test_another_type_is_told(plain: Path, tmp_path: Path) -> None:
    kind = "std_msgs/msg/String"
    said = STORE.types[kind]("scan")
    odd = rewritten(
        plain,
        tmp_path / "Lab3_08_run",
        lambda sent: iter([replace(sent, type=kind, held=said) if sent.topic == "/scan" else sent]),
    )
    assert "/scan is std_msgs/msg/String, not sensor_msgs/msg/LaserScan" in wrong(odd)["topics"]


def differing(path: Path, stage: Path) -> dict[str, str]:
    found = judged(path, "--stage", str(stage))["differences"]
    return {each["name"]: each["message"] for each in found}


def test_a_recording_of_the_stage_does_what_its_dry_run_does(plain: Path) -> None:
    stage = plain.parent / "Lab3_05.usda"
    assert "are those of the dry run" in bag(plain, "--stage", str(stage)).stdout


def test_what_differs_from_the_dry_run_is_told_and_no_fault(plain: Path, tmp_path: Path) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        if sent.topic == "/camera/camera_info":
            sent.said.header.frame_id = "lens"
        if sent.topic == "/tf":
            kept = [
                transform
                for transform in sent.said.transforms
                if transform.child_frame_id != "Camera_1"
            ]
            sent.said.transforms = kept
        if sent.topic != "/clock" or not sent.said.clock.nanosec // 20_000_000 % 2:
            yield sent

    other = rewritten(plain, tmp_path / "Lab3_08_run", change)
    assert set(differing(other, plain.parent / "Lab3_05.usda")) == {
        "/camera/camera_info",
        "/clock",
        "Camera_1",
    }


def test_each_difference_from_the_dry_run_is_put_into_words() -> None:
    def behaviour(topics: tuple[Topic, ...], frames: dict[str, str]) -> Behaviour:
        pairs = tuple(Frame(parent, child, static=False) for child, parent in frames.items())
        unknown = (Unknown("/not_sent", "nothing sends it"),)
        return Behaviour(
            "a.usda", "05", 9.0, "ok", topics, pairs, not_simulated=unknown if frames else ()
        )

    dry = behaviour(
        (
            Topic("/scan", "LaserScan", 10.0, "base_scan, laser"),
            Topic("/odom", "Odometry", 60.0, "odom"),
            Topic("/gone", "Image", 10.0, ""),
            Topic("/not_sent", "Image", 10.0, ""),
        ),
        {"base": "odom", "scan": "base", "wheel": "base"},
    )
    recorded = behaviour(
        (Topic("/scan", "PointCloud2", 7.9, "lens"), Topic("/odom", "Odometry", 50.0, "odom")),
        {"base": "odom", "scan": "wheel"},
    )
    assert [(found.name, found.message) for found in differences(recorded, dry)] == [
        ("/scan", "is PointCloud2, in the dry run LaserScan"),
        ("/scan", "comes at 7.9 Hz, in the dry run at 10.0"),
        ("/scan", "is in 'lens', in the dry run in 'base_scan, laser'"),
        ("/gone", "is only in the dry run"),
        ("scan", "is below wheel, in the dry run below base"),
        ("wheel", "never comes, in the dry run below base"),
    ]


def test_a_stage_that_cannot_be_read_is_one_line(plain: Path) -> None:
    with pytest.raises(UsageError, match=r"--stage none\.usda"):
        bag(plain, "--stage", "none.usda")


def test_what_comes_after_the_part_that_is_kept_is_no_part_of_the_drive(plain: Path) -> None:
    whole = bounded(plain)
    cut = bounded(plain, kept=560)  # ends while the robot is commanded to turn
    assert cut.verdict == "ok"
    assert "the first 2 s were judged message by message" in render(
        replace(cut, recording="run"), 100, color=False
    )
    assert cut.topics == whole.topics
    assert cut.frames == whole.frames


# ---- recordings that were made, or broken, to stop a reader


def bounded(path: Path, **bounds: int) -> Behaviour:
    """Judge a recording of which less is read than usual."""
    return judge_what_came(layout_at(path), Bounds(**bounds), LAB, "08")


def refused_within(path: Path, **bounds: int) -> str:
    with pytest.raises(RecordingError) as raised:
        bounded(path, **bounds)
    return str(raised.value)


def refused(path: Path) -> str:
    with pytest.raises(UsageError) as raised:
        bag(path)
    document = judged(path)
    (reason,) = document["not_simulated"]
    assert str(raised.value) == f"{path}: {reason['reason']}"
    assert "\n" not in reason["reason"]
    return str(reason["reason"])


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_a_cut_recording_is_one_line(
    plain: Path, tmp_path: Path, storage: StoragePlugin, subtests: pytest.Subtests
) -> None:
    folder = rewritten(plain, tmp_path / "Lab3_08_run", storage=storage)
    (file,) = [*folder.glob("Lab3_08_run.*")]
    whole = file.read_bytes()
    for part in (0.0, 0.01, 0.5, 0.999):
        with subtests.test(part=part):
            file.write_bytes(whole[: int(part * len(whole))])
            assert refused(folder), part


@pytest.mark.parametrize("seed", range(6))
def test_a_damaged_recording_ends_in_a_verdict(plain: Path, tmp_path: Path, seed: int) -> None:
    file = tmp_path / "run.mcap"
    data = bytearray(next(plain.glob("*.mcap")).read_bytes())
    for step in range(40):
        data[(seed * 7919 + step * 104_729) % len(data)] ^= 0xFF
    file.write_bytes(data)
    judged(file)  # which holds the exit code against the verdict


def test_what_is_not_there_is_one_line(tmp_path: Path) -> None:
    assert refused(tmp_path / "none") == "there is no such recording"
    assert refused(tmp_path) == "contains neither an .mcap nor a .db3 file"


@pytest.mark.parametrize("text", ["[", "- 1", "rosbag2_bagfile_information: 5", "a: &a [*a]"])
def test_metadata_that_are_none_end_in_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "metadata.yaml").write_text(text)
    assert refused(tmp_path)


def test_metadata_reach_no_file_outside(plain: Path, tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths: "
        f"[{next(plain.glob('*.mcap')).resolve()}]\n"
    )
    assert refused(tmp_path).endswith("is missing")


def test_very_many_topics_are_one_line(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "run.db3")) as base, base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type)")
        base.executemany("INSERT INTO topics(name) VALUES(?)", [(f"/{n}",) for n in range(5000)])
    assert refused(tmp_path) == f"has more than {Bounds().topics} topics"


def test_many_topics_of_mcap_are_one_line(plain: Path) -> None:
    assert refused_within(plain, topics=3) == "has more than 3 topics"


def test_a_message_that_unpacks_to_too_much_is_one_line(plain: Path, tmp_path: Path) -> None:
    folder = rewritten(plain, tmp_path / "Lab3_08_run", packing=CompressionMode.MESSAGE)
    assert "larger than" in refused_within(folder, message=100)


def test_a_file_that_unpacks_to_too_much_is_one_line(plain: Path, tmp_path: Path) -> None:
    folder = rewritten(plain, tmp_path / "Lab3_08_run", packing=CompressionMode.FILE)
    assert "unpacks to more than" in refused_within(folder, file=1000)


def test_a_huge_message_is_counted_and_not_read(plain: Path, tmp_path: Path) -> None:
    huge = b"\0\1\0\0" + bytes(5_000_000)
    odd = rewritten(
        plain,
        tmp_path / "Lab3_08_run",
        lambda sent: iter(
            [sent, replace(sent, held=huge)] if sent.topic == "/tf" and sent.time < 4e7 else [sent]
        ),
    )
    assert "on /tf are not tf2_msgs/msg/TFMessage" in wrong(odd)["messages"]


def test_names_and_types_that_are_none_are_left_out(tmp_path: Path) -> None:
    with Writer(tmp_path / "Lab3_08_run", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            "no name\n", "no type", msgdef="string data", rihs01="RIHS01_0"
        )
        writer.write(connection, 1, b"\0\1\0\0")
    assert judged(tmp_path / "Lab3_08_run")["topics"] == []
    assert "1 topics have an invalid name or type" in bag(tmp_path / "Lab3_08_run").stdout


def test_without_the_extra_a_line_says_what_to_install(
    plain: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(UsageError, match=r"needs the extra sim: .* install"):
        bag(plain)


def test_every_check_has_its_words() -> None:
    assert set(PASSED_IN_A_RECORDING) == {*SHARED, *CHECKS}
