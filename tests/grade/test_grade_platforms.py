"""Whose a file is, by the names that learning platforms write."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import pytest
from mini_lab import stage, starter, submission
from msgspec.structs import replace
from workers_here import graded_here

from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.intake.platforms import FileOwner, file_owners, is_platform_name
from lab3_usd.grade.intake.submissions import find_submissions


def students(*names: str) -> dict[str, list[str]]:
    """The files of each student, by the student's number."""
    found: dict[str, list[str]] = {}
    for owner in file_owners(names).values():
        found.setdefault(owner.student, []).append(owner.file)
    return found


@pytest.mark.parametrize(
    ("name", "owner"),
    [
        (
            "doejane_12345_678901_Lab3.zip",
            FileOwner("12345", "doejane", "Lab3.zip", upload=678901),
        ),
        (
            "smithali_LATE_23456_678903_Lab3-2.zip",
            FileOwner("23456", "smithali", "Lab3.zip", late=True, upload=678903),
        ),
        (
            "team_alpha_1030_5050_Lab3_05_odometry_tf.usda",
            FileOwner("1030", "team_alpha", "Lab3_05_odometry_tf.usda", upload=5050),
        ),
        (
            "the_a_team_LATE_1030_5050_work.tar.gz",
            FileOwner("1030", "the_a_team", "work.tar.gz", late=True, upload=5050),
        ),
        (
            "anon_aB3xQ_60100_Lab3_01_ros_clock.usda",
            FileOwner("anon_aB3xQ", "anon_aB3xQ", "Lab3_01_ros_clock.usda", upload=60100),
        ),
        (
            "LATE_anon_Zz9Qp_60101_Lab3.zip",
            FileOwner("anon_Zz9Qp", "anon_Zz9Qp", "Lab3.zip", late=True, upload=60101),
        ),
        ("müllerzoë_77_88_Lab3.zip", FileOwner("77", "müllerzoë", "Lab3.zip", upload=88)),
        ("doejane_12345_text.html", FileOwner("12345", "doejane", "text.html")),
        ("doejane_LATE_12345_link.html", FileOwner("12345", "doejane", "link.html", late=True)),
        ("anon_aB3xQ_text.html", FileOwner("anon_aB3xQ", "anon_aB3xQ", "text.html")),
        (
            "Jane Doe_1234567_assignsubmission_file_Lab3.zip",
            FileOwner("1234567", "Jane Doe", "Lab3.zip"),
        ),
        (
            "Participant_77_assignsubmission_onlinetext",
            FileOwner("77", "Participant"),
        ),
        (
            "Default group_assignsubmission_file_Lab3.zip",
            FileOwner("Default group", "Default group", "Lab3.zip"),
        ),
        (
            "39786-640693 - Aiden Rodriguez - Oct 10, 2025 1022 AM - Lab3.zip",
            FileOwner("640693", "Aiden Rodriguez", "Lab3.zip", upload=202510101022),
        ),
        (
            "39786-640693 - Zoë Smith-Lee - Nov 2, 2025 905 PM",
            FileOwner("640693", "Zoë Smith-Lee", upload=202511022105),
        ),
        (
            "Coursework submission_ln220_attempt_2021-12-10-22-29-43_alu.v",
            FileOwner("ln220", "ln220", "alu.v", upload=20211210222943),
        ),
    ],
)
def test_a_name_tells_whose_a_file_is(name: str, owner: FileOwner) -> None:
    assert is_platform_name(name)
    (found,) = file_owners([name]).items()
    assert found == (name, replace(owner, when=found[1].when))


@pytest.mark.parametrize(
    "name",
    [
        "jane.zip",
        "jane_Lab3_05_odometry_tf.usda",
        "Lab3_05_odometry_tf.usda",
        "lab3-octocat",
        "notes_12.txt",
        "readme_1_2",
        "2024_11_notes.txt",
        "a" * 5000 + "_1_2_x",
    ],
)
def test_other_names_are_no_platforms(name: str) -> None:
    assert file_owners([name]) == {}


def test_every_file_of_a_group_with_underscores_is_of_one_student() -> None:
    names = [f"team_alpha_1030_{5050 + n}_Lab3_0{n}_x.usda" for n in range(9)]
    assert list(students(*names)) == ["1030"]


def test_a_group_whose_name_ends_in_a_number_is_told_by_its_uploads() -> None:
    found = students("team_1_5050_6060_a.zip", "team_1_5050_6061_b.zip", "doe_7_8_c.zip")
    assert found == {"5050": ["a.zip", "b.zip"], "7": ["c.zip"]}


def test_a_file_whose_name_begins_with_a_number_is_told_by_the_others_of_the_student() -> None:
    found = students("doe_5050_6060_1_a.usda", "doe_5050_6061_work.zip")
    assert found == {"5050": ["1_a.usda", "work.zip"]}


def test_uploads_never_repeat_and_so_tell_a_number_at_the_beginning_of_a_file() -> None:
    assert list(students("doe_5050_6060_1_a.usda", "doe_5050_6061_1_b.usda")) == ["5050"]


def test_a_name_that_stays_ambiguous_is_said_and_not_split(tmp_path: Path) -> None:
    for name in ("doe_5050_6060_1_a.usda", "doe_5050_6061_2_b.usda"):
        (tmp_path / name).touch()
    said: list[str] = []
    assert [
        find_submission.student for find_submission in find_submissions(tmp_path, said.append)
    ] == ["5050"]
    assert said == [
        "doe_5050_6060_1_a.usda: taken as of doe (5050); may be of doe_5050 (6060)",
        "doe_5050_6061_2_b.usda: taken as of doe (5050); may be of doe_5050 (6061)",
    ]


def test_blackboards_users_are_told_apart_where_they_hold_underscores() -> None:
    date = "attempt_2026-11-20-10-22-33"
    found = file_owners([f"Lab_3_{user}_{date}.txt" for user in ("jane_doe", "jim_doe", "bo")])
    assert sorted(each.student for each in found.values()) == ["bo", "jane_doe", "jim_doe"]


def test_the_last_attempt_counts_on_blackboard(tmp_path: Path) -> None:
    for day in ("19", "20"):
        (tmp_path / f"Lab3_jd_attempt_2026-11-{day}-10-22-33_Lab3_00_student_start.usda").touch()
    (found,) = find_submissions(tmp_path)
    assert [source.path.name.split("-")[2] for source in found.sources] == ["20", "19"]


@pytest.mark.parametrize("folder", ["second", "first"])
def test_the_number_that_differs_is_the_students_on_brightspace(folder: str) -> None:
    names = [
        f"{one}-7 - {name} - Oct 10, 2025 {time} AM"
        for one, name, time in (("11", "Jo Lee", "922"), ("12", "Jo Lee", "1022"))
    ]
    if folder == "first":
        names = [f"7-{name[:2]}{name[4:]}" for name in names]
    assert len(students(*names)) == 2


def test_two_attempts_on_brightspace_are_of_one_student(tmp_path: Path) -> None:
    for time in ("Oct 10, 2025 1022 AM", "Oct 9, 2025 1122 PM"):
        (tmp_path / f"11-7 - Jo Lee - {time}").mkdir()
    (tmp_path / "12-7 - Al Fox - Oct 10, 2025 1022 AM").mkdir()
    (tmp_path / "index.html").touch()
    jo, al = find_submissions(tmp_path)
    assert (jo.name, al.name) == ("Jo Lee", "Al Fox")
    assert [source.path.name[-20:] for source in jo.sources] == [
        "Oct 10, 2025 1022 AM", " Oct 9, 2025 1122 PM",
    ]  # fmt: skip


def test_clones_of_github_classroom_are_folders(tmp_path: Path) -> None:
    for name in ("lab3-octocat", "lab3-hubot"):
        submission(tmp_path / name, "00")
        (tmp_path / name / ".git").mkdir()
    assert [find_submission.student for find_submission in find_submissions(tmp_path)] == [
        "lab3-hubot",
        "lab3-octocat",
    ]


def graded(tmp_path: Path) -> dict[str, dict[str, str]]:
    out = tmp_path / "book"
    graded_here(ClassSettings(tmp_path / "class", starter(), out))
    return {
        row["student"]: row for row in json.loads((out / "grades.json").read_text())["students"]
    }


def test_a_text_or_link_in_canvas_has_a_row_with_a_status(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "zoe", "00")
    (tmp_path / "class" / "doejane_12345_text.html").write_text("<p>I could not upload</p>")
    (tmp_path / "class" / "LATE_anon_aB3xQ_link.html").write_text("<a href='x'>x</a>")
    rows = graded(tmp_path)
    assert {student: row["status"] for student, row in rows.items()} == {
        "12345": "empty", "anon_aB3xQ": "empty", "zoe": "graded",
    }  # fmt: skip


def test_flat_files_of_a_group_are_one_row_with_full_points(tmp_path: Path) -> None:
    (tmp_path / "class").mkdir()
    for order, number in enumerate(("00", "01")):
        name = f"team_alpha_1030_{5050 + order}_{stage(number).name}"
        (tmp_path / "class" / name).write_bytes(stage(number).read_bytes())
    (row,) = graded(tmp_path).values()
    assert (row["status"], row["name"]) == ("graded", "team_alpha")


def zipped(*entries: tuple[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in entries:
            packed.writestr(name, content)
    return data.getvalue()


def test_an_archive_in_a_students_archive_is_opened(tmp_path: Path) -> None:
    inner = zipped((f"work/{stage('00').name}", stage("00").read_bytes()))
    (tmp_path / "class").mkdir()
    (tmp_path / "class" / "jane.zip").write_bytes(
        zipped(("Lab3/all.zip", inner), ("Lab3/a.pdf", b""))
    )
    assert graded(tmp_path)["jane"]["status"] == "graded"


def test_an_archive_three_levels_down_is_named_and_not_opened(tmp_path: Path) -> None:
    inner = zipped((stage("00").name, stage("00").read_bytes()))
    deep = zipped(("b.zip", zipped(("c.zip", inner))))
    (tmp_path / "class").mkdir()
    (tmp_path / "class" / "jane.zip").write_bytes(deep)
    row = graded(tmp_path)["jane"]
    assert (row["status"], row["reason"].split(":")[0]) == ("empty", "c.zip")


def test_a_damaged_archive_in_an_archive_spoils_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "class").mkdir()
    (tmp_path / "class" / "jane.zip").write_bytes(
        zipped((f"work/{stage('00').name}", stage("00").read_bytes()), ("old.zip", b"no zip"))
    )
    assert graded(tmp_path)["jane"]["status"] == "graded"
