"""Recordings in a submission are evidence: what they show is judged, and what they lack is not."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from breaking import correct_stage
from grade_files import submission
from msgspec.structs import replace
from submissions import LAB

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")

from recordings import Sent, durable, recorded, rewritten
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

from lab3_usd.check.registry import rules_of
from lab3_usd.deliverables.maps import opens_all
from lab3_usd.deliverables.submission_files import entries_below
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers import worker_main
from lab3_usd.grade.workers.submission_grading import grade_submission
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task
from lab3_usd.model.dry_run import Check
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import (
    GOAL,
    Evidence,
    EvidenceSubject,
    GoalRun,
    Observation,
    RecordingShown,
)
from lab3_usd.pipeline.folder import check_folder
from lab3_usd.pipeline.stage import JudgeSettings
from lab3_usd.sim.bag.recording_files import Bounds
from lab3_usd.sim.bag.submitted import MOST, OF_EACH, read_recordings

BRIEF = 1_200_000_000  # ns
RULES = {rule.id: rule for rule in rules_of("evidence", "E")}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("recording"))


@pytest.fixture(scope="module")
def brief(plain: Path) -> Path:
    """The beginning of it, where it is of no importance what the robot does."""
    change = lambda sent: iter([sent] if sent.time < BRIEF else [])  # noqa: E731
    return rewritten(plain, plain.with_name("brief") / "run", change)


@pytest.fixture
def handed_in(tmp_path: Path) -> Path:
    folder = tmp_path / "ada"
    (folder / "results").mkdir(parents=True)
    return folder


def put(plain: Path, folder: Path, name: str = "run") -> Path:
    return Path(shutil.copytree(plain, folder / "results" / name))


def shown(folder: Path, bounds: Bounds = OF_EACH) -> tuple[RecordingShown, ...]:
    entries = sorted(entries_below(folder), key=lambda each: each.path)
    return tuple(read_recordings(folder, entries, (LAB, LAB.last), opens_all, bounds))


def problems(recordings: tuple[RecordingShown, ...], *, required: bool = False) -> list[Problem]:
    evidence = Evidence("results", recordings=recordings)
    facts, reached = LAB.scene.map, tuple(LAB.checkpoints)
    given = EvidenceSubject(LAB.ros, LAB.frames, facts, evidence, reached, required)
    return [each for name in ("E18", "E19") for each in RULES[name].check(given)]


def unread(folder: Path, **bounds: int) -> str:
    (one,) = shown(folder, replace(OF_EACH, **bounds))
    (problem,) = problems((one,))
    assert problem.message == f"the recording {one.unread}"
    assert str(folder) not in one.unread
    return one.unread


def test_a_good_recording_shows_no_fault(plain: Path, handed_in: Path) -> None:
    put(plain, handed_in)
    (one,) = shown(handed_in)
    assert one.file == "results/run/run.mcap"
    assert {check.verdict for check in one.checks} == {"ok"}
    assert problems((one,)) == []


def test_what_was_not_recorded_is_no_fault(plain: Path, handed_in: Path) -> None:
    def few(sent: Sent) -> Iterator[Sent]:
        if sent.topic in {"/clock", "/scan"}:
            yield sent

    rewritten(plain, handed_in / "results" / "run", few)
    (one,) = shown(handed_in)
    assert one.topics == {"/clock", "/scan"}
    assert problems((one,)) == []


def test_a_fault_of_the_system_is_an_error_and_one_of_measure_a_warning(
    plain: Path, handed_in: Path
) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        if sent.topic == "/cmd_vel":
            sent.said.linear.x *= -1
        yield replace(sent, qos=durable(sent.qos)) if sent.topic == "/odom" else sent

    rewritten(plain, handed_in / "results" / "run", change)
    found = {problem.property: problem for problem in problems(shown(handed_in))}
    assert found["QoS"].severity == "error"
    assert "/odom is offered transient_local" in found["QoS"].message
    assert "E07" in (found["QoS"].hint or "")
    assert found["follows"].severity == "warning"


def test_what_a_second_recording_shows_repaired_is_no_fault(brief: Path, handed_in: Path) -> None:
    change = lambda sent: iter([replace(sent, qos=durable(sent.qos))])  # noqa: E731
    rewritten(brief, handed_in / "results" / "early", change)
    assert [problem.property for problem in problems(shown(handed_in))] == ["QoS"]
    put(brief, handed_in, "late")
    assert problems(shown(handed_in)) == []


def test_what_comes_once_in_a_short_recording_is_no_fault(plain: Path, handed_in: Path) -> None:
    def until(end: float, sent: Sent) -> Iterator[Sent]:
        if sent.time < end and (sent.topic != "/scan" or 3e8 <= sent.time < 4e8):
            yield sent

    rewritten(plain, handed_in / "results" / "long", lambda sent: until(4e9, sent))
    assert "/scan is received only once" in {
        problem.message for problem in problems(shown(handed_in))
    }
    shutil.rmtree(handed_in / "results" / "long")
    rewritten(plain, handed_in / "results" / "short", lambda sent: until(1e9, sent))
    assert problems(shown(handed_in)) == []


def test_a_goal_that_a_saved_output_shows_reached_is_no_fault() -> None:
    aborted = Check(GOAL, "bad", "the last of 1 goals is aborted", kind="goal-not-reached")
    recording = RecordingShown("results/run.mcap", checks=(aborted,))
    evidence = Evidence("results", recordings=(recording,))
    facts, reached = LAB.scene.map, tuple(LAB.checkpoints)
    given = EvidenceSubject(LAB.ros, LAB.frames, facts, evidence, reached)
    assert [each.severity for each in RULES["E18"].check(given)] == ["error"]
    later = replace(evidence, goals={"": (Observation(GoalRun(4), "results/goal.txt"),)})
    assert list(RULES["E18"].check(replace(given, evidence=later))) == []


def test_a_recording_shows_what_commands_would_print(brief: Path, handed_in: Path) -> None:
    put(brief, handed_in)
    evidence = Evidence("results", recordings=shown(handed_in))
    facts, reached = LAB.scene.map, tuple(LAB.checkpoints)[:6]
    given = EvidenceSubject(LAB.ros, LAB.frames, facts, evidence, reached)

    def missing(given: EvidenceSubject) -> str:
        return " ".join(each.message for each in RULES["E01"].check(given))

    assert "ros2 topic hz /odom" not in missing(given)
    assert "ros2 node list" in missing(given)
    alone = replace(given, evidence=Evidence("results"))
    assert missing(alone) == "no output of a diagnostic command was found"


def test_without_the_extra_one_note_says_so(
    brief: Path, handed_in: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(brief, handed_in, "one")
    put(brief, handed_in, "other")
    monkeypatch.setitem(sys.modules, "rosbags", None)
    (note,) = problems(shown(handed_in))
    assert (note.severity, note.message[:12]) == ("note", "2 recordings")
    assert "lab3-usd[sim]" in note.message


# ---- recordings that were made, or broken, to stop a reader


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_a_cut_recording_is_not_read(brief: Path, handed_in: Path, storage: StoragePlugin) -> None:
    folder = rewritten(brief, handed_in / "results" / "run", storage=storage)
    (file,) = folder.glob("run.*")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert unread(handed_in)


def test_a_file_of_it_that_is_missing_is_named(brief: Path, handed_in: Path) -> None:
    folder = put(brief, handed_in)
    shutil.copy(folder / "run.mcap", folder / "other.mcap")
    (folder / "run.mcap").unlink()
    assert unread(handed_in) == "run.mcap is missing"


def test_a_link_out_of_the_submission_is_not_opened(brief: Path, handed_in: Path) -> None:
    (handed_in / "results" / "run.mcap").symlink_to(next(brief.glob("*.mcap")))
    assert "leads out of the submission" in unread(handed_in)


def test_metadata_reach_no_file_elsewhere(brief: Path, handed_in: Path) -> None:
    shutil.copy(next(brief.glob("*.mcap")), handed_in / "secret.mcap")
    folder = put(brief, handed_in)
    (folder / "run.mcap").rename(folder / "mine.mcap")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("- run.mcap", "- ../../secret.mcap"))
    inside = [each for each in shown(handed_in) if each.file.startswith("results")]
    assert [each.unread for each in inside] == ["secret.mcap is missing"]


def test_a_name_that_is_an_address_for_sqlite_is_not_opened(brief: Path, handed_in: Path) -> None:
    folder = rewritten(brief, handed_in / "run", storage=StoragePlugin.SQLITE3)
    hidden = handed_in / "results" / "%2e%2e%2frun%2frun.db3"
    hidden.write_bytes((folder / "run.db3").read_bytes())
    assert "rename it" in next(each.unread for each in shown(handed_in) if "%" in each.file)


def test_a_database_that_computes_for_ever_is_not_opened(handed_in: Path) -> None:
    with closing(sqlite3.connect(handed_in / "results" / "run.db3")) as base, base:
        endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n"
        base.execute("CREATE TABLE messages(id, topic_id, timestamp, data)")
        base.execute(f"CREATE VIEW topics(id) AS {endless}")
    assert "computed columns" in unread(handed_in)


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE messages SET timestamp = 'soon' WHERE id = 2",
        "UPDATE messages SET timestamp = x'00' WHERE id = 2",
        "UPDATE messages SET data = 'text' WHERE id = 2",
        "UPDATE messages SET data = 5 WHERE id = 2",
        "UPDATE topics SET name = x'2f78'",
        "UPDATE topics SET type = x'2f78'",
        "UPDATE topics SET offered_qos_profiles = 7",
    ],
)
def test_columns_of_other_types_are_damage(brief: Path, handed_in: Path, change: str) -> None:
    rewritten(brief, handed_in / "run", storage=StoragePlugin.SQLITE3)
    file = (handed_in / "run" / "run.db3").rename(handed_in / "results" / "run.db3")
    with closing(sqlite3.connect(file)) as base, base:
        base.execute(change)
    assert "is damaged" in unread(handed_in)


def test_a_million_topics_are_not_read(handed_in: Path) -> None:
    with Writer(handed_in / "results" / "run", version=8, storage_plugin=StoragePlugin.MCAP) as bag:
        for number in range(60):
            bag.add_connection(
                f"/t{number}", "std_msgs/msg/String", msgdef="string data", rihs01="RIHS01_0"
            )
    assert unread(handed_in, topics=50) == "has more than 50 topics"


def test_an_index_without_end_is_not_read(plain: Path, handed_in: Path) -> None:
    put(plain, handed_in)
    assert unread(handed_in, records=5) == "run.mcap has an index of more than 5 records"


def test_a_part_that_the_index_names_again_and_again_counts_each_time(
    brief: Path, handed_in: Path
) -> None:
    folder = put(brief, handed_in)
    data = (folder / "run.mcap").read_bytes()
    (start,) = struct.unpack_from("<Q", data, len(data) - 28)
    first = data.index(b"\x08", start)
    while struct.unpack_from("<Q", data, first + 1)[0] > 1000:  # not yet the index of a chunk
        first = data.index(b"\x08", first + 1)
    end = first + 9 + struct.unpack_from("<Q", data, first + 1)[0]
    (folder / "run.mcap").write_bytes(data[:first] + 3 * data[first:end] + data[first:])
    assert [each.unread for each in shown(handed_in)] == [""]
    assert "unpacks to more than" in unread(handed_in, parts=2 * len(data))


def test_more_messages_than_are_read_are_said(brief: Path, handed_in: Path) -> None:
    put(brief, handed_in)
    assert unread(handed_in, messages=100) == "has more than 100 messages"


def test_more_transforms_than_are_read_are_said(brief: Path, handed_in: Path) -> None:
    put(brief, handed_in)
    assert unread(handed_in, listed=200) == "has more than 200 transforms and goals"


def test_a_message_of_very_many_transforms_is_not_read(brief: Path, handed_in: Path) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        if sent.topic == "/tf" and sent.time < 5e7:
            sent.said.transforms = sent.said.transforms * 2000
        yield sent

    rewritten(brief, handed_in / "results" / "run", change)
    found = {problem.property: problem.message for problem in problems(shown(handed_in))}
    assert "on /tf are not tf2_msgs/msg/TFMessage" in found["messages"]


@pytest.mark.parametrize("packing_mode", [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_what_unpacks_to_too_much_is_not_read(
    brief: Path, handed_in: Path, packing_mode: CompressionMode
) -> None:
    rewritten(brief, handed_in / "results" / "run", packing=packing_mode)
    limit = "parts" if packing_mode is CompressionMode.MESSAGE else "file"
    assert [each.unread for each in shown(handed_in)] == [""]
    assert unread(handed_in, **{limit: 200_000}) == "unpacks to more than 0 MB"


def test_more_recordings_than_are_read_are_said(brief: Path, handed_in: Path) -> None:
    put(brief, handed_in, "a")
    for number in range(MOST + 1):
        (handed_in / "results" / f"b{number:02}.mcap").touch()
    *others, last = [each.unread for each in shown(handed_in)]
    assert len(others) == MOST
    assert not others[0]
    assert last == f"no more than {MOST} recordings of 512 MB in all are read"


def test_numbers_without_sense_end_in_a_verdict(plain: Path, handed_in: Path) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        if sent.time > 3e9:
            return
        if sent.topic == "/odom":
            pose = sent.said.pose.pose
            pose.position.x = 1e308 if sent.time % 2 else -1e308
            pose.orientation.w = pose.orientation.z = 0.0
        if sent.topic == "/clock" and sent.time > 2e9:
            sent.said.clock.sec = 2_000_000_000
        if sent.topic == "/tf":
            for transform in sent.said.transforms:
                transform.header.frame_id = "x" * 10_000
                transform.transform.rotation.w = 0.0
        yield sent

    rewritten(plain, handed_in / "results" / "run", change)
    (one,) = shown(handed_in)
    assert one.checks
    assert all(len(problem.message) < 2000 for problem in problems((one,)))
    assert all(len(frame) <= 200 for frame in one.frames)


def test_time_that_only_others_tell_is_not_driven(brief: Path, handed_in: Path) -> None:
    def change(sent: Sent) -> Iterator[Sent]:
        if sent.topic in {"/odom", "/cmd_vel"}:
            yield sent
            yield Sent(2**61, "/other", "std_msgs/msg/String", b"\0\1\0\0\1\0\0\0\0")

    rewritten(brief, handed_in / "results" / "run", change)
    assert shown(handed_in)[0].checks


def test_a_folder_is_checked_with_its_recordings(brief: Path, handed_in: Path) -> None:
    change = lambda sent: iter([replace(sent, qos=durable(sent.qos))])  # noqa: E731
    rewritten(brief, handed_in / "results" / "run", change)
    stage = handed_in / "work" / f"{LAB.checkpoints['05'].file}.usda"
    stage.parent.mkdir()
    correct_stage("05").GetRootLayer().Export(str(stage))
    asked = []

    def refuse(name: str) -> str:
        asked.append(name)
        return "ended a worker"

    assert "E18" in {
        finding.rule for finding in check_folder(handed_in, JudgeSettings()).submission.findings
    }
    found = check_folder(handed_in, JudgeSettings(), may_open=refuse).submission.findings
    assert [each.message for each in found if each.rule == "E19"] == [
        "the recording ended a worker"
    ]
    assert asked == ["results/run/run.mcap"]


def test_grading_announces_a_recording_and_leaves_out_one_that_ended_a_worker(
    brief: Path, tmp_path: Path
) -> None:
    student = submission(tmp_path / "ada", "05")
    change = lambda sent: iter([replace(sent, qos=durable(sent.qos))])  # noqa: E731
    rewritten(brief, student / "results" / "run", change)
    setup = worker_main.load_setup(PoolSettings(None, None, Limits()))
    name, announced = "results/run/run.mcap", list[str]()

    def report(scratch: Path, broken: dict[str, str]) -> str:
        scratch.mkdir()
        task = Task("ada", "ada", (Source(student),), broken=broken)
        return str(grade_submission(setup, task, scratch, announced.append)["reports"])

    assert "E18" in report(tmp_path / "one", {})
    assert announced[-1] == name
    again = report(tmp_path / "two", {name: "ran out of time (20 s)"})
    assert "E18" not in again
    assert "the recording ran out of time" in again
