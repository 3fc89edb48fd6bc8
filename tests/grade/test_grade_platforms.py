"""Whose a file is, by the names that learning platforms write."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from other_labs import LAB, stage, starter, submission
from workers_here import graded_here

from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.intake.download_names import FileOwner, file_owners, is_platform_name
from lab3_usd.grade.intake.people import (
    BLACKBOARD_USER,
    CANVAS_USER,
    MOODLE_NUMBER,
    STUDENT_ID,
    Person,
)
from lab3_usd.grade.intake.submissions import find_submissions

pytestmark = pytest.mark.usefixtures("equal_judged_once")


def students(*names: str) -> dict[str, list[str]]:
    """The files of each student, by what tells the student from others."""
    found: dict[str, list[str]] = {}
    for owner in file_owners(names).values():
        found.setdefault(owner.student, []).append(owner.file)
    return found


def canvas(name: str, number: str, file: str, *, late: bool = False) -> FileOwner:
    return FileOwner(number, "canvas", Person(name, {CANVAS_USER: number}), file, late=late)


def hidden(name: str, file: str, *, late: bool = False) -> FileOwner:
    return FileOwner(name, "canvas", Person(), file, late=late)


def moodle(name: str, number: str, file: str = "") -> FileOwner:
    ids = {MOODLE_NUMBER: number} if number else {}
    return FileOwner(number or name, "moodle", Person(name, ids), file)


def brightspace(
    student: str, name: str, upload: int, file: str = "", number: str = ""
) -> FileOwner:
    ids = {STUDENT_ID: number} if number else {}
    return FileOwner(student, "brightspace", Person(name, ids), file, upload=upload)


def blackboard(user: str, file: str, upload: int) -> FileOwner:
    return FileOwner(
        user, "blackboard", Person("", {BLACKBOARD_USER: user}), file, upload=upload
    )  # fmt: skip


# The names that platforms write: canvas-lms lib/content_zipper.rb, moodle mod/assign
# classes/downloader.php, kwurst/bb-file-cleanup, and parsers of Brightspace's folders.
@pytest.mark.parametrize(
    ("name", "owner"),
    [
        ("doejane_12345_678901_Lab3.zip", canvas("doejane", "12345", "Lab3.zip")),
        (
            "smithali_LATE_23456_678903_Lab3-2.zip",
            canvas("smithali", "23456", "Lab3.zip", late=True),
        ),
        (
            "team_alpha_1030_5050_Lab3_05_odometry_tf.usda",
            canvas("team_alpha", "1030", "Lab3_05_odometry_tf.usda"),
        ),
        (
            "the_a_team_LATE_1030_5050_work.tar.gz",
            canvas("the_a_team", "1030", "work.tar.gz", late=True),
        ),
        (
            "anon_aB3xQ_60100_Lab3_01_ros_clock.usda",
            hidden("anon_aB3xQ", "Lab3_01_ros_clock.usda"),
        ),
        ("LATE_anon_Zz9Qp_60101_Lab3.zip", hidden("anon_Zz9Qp", "Lab3.zip", late=True)),
        ("müllerzoë_77_88_Lab3.zip", canvas("müllerzoë", "77", "Lab3.zip")),
        ("李小龙_77_88_my Lab 3.zip", canvas("李小龙", "77", "my Lab 3.zip")),
        ("doejane_10000000000234_88_a.zip", canvas("doejane", "10000000000234", "a.zip")),
        ("doejane_12345_text.html", canvas("doejane", "12345", "text.html")),
        ("doejane_LATE_12345_link.html", canvas("doejane", "12345", "link.html", late=True)),
        ("anon_aB3xQ_text.html", hidden("anon_aB3xQ", "text.html")),
        (
            "Jane Doe_1234567_assignsubmission_file_Lab3.zip",
            moodle("Jane Doe", "1234567", "Lab3.zip"),
        ),
        ("Jane OBrien_1234567_assignsubmission_file", moodle("Jane OBrien", "1234567")),
        ("王芳_1234567_assignsubmission_file_", moodle("王芳", "1234567")),
        ("Participant_77_assignsubmission_onlinetext", moodle("Participant", "77")),
        ("Team A_77_assignsubmission_file", moodle("Team A", "77")),
        (
            "Default group_assignsubmission_file_Lab3.zip",
            moodle("Default group", "", "Lab3.zip"),
        ),
        (
            "39786-640693 - Aiden Rodriguez - Oct 10, 2025 1022 AM - Lab3.zip",
            brightspace("39786", "Aiden Rodriguez", 202510101022, "Lab3.zip"),
        ),
        (
            "39786-640693 - Zoë Smith-Lee - Nov 2, 2025 905 PM",
            brightspace("39786", "Zoë Smith-Lee", 202511022105),
        ),
        (
            "39786-640693 - Jo Lee (1001234) - Nov 2, 2025 905 PM",
            brightspace("39786", "Jo Lee", 202511022105, number="1001234"),
        ),
        (
            "39786-640693 - 1001234 - Jo Lee - Nov 2, 2025 905 PM",
            brightspace("39786", "Jo Lee", 202511022105, number="1001234"),
        ),
        ("Jo Lee- Nov 2, 2025 905 PM", brightspace("Jo Lee", "Jo Lee", 202511022105)),
        (
            "Coursework submission_ln220_attempt_2021-12-10-22-29-43_alu.v",
            blackboard("ln220", "alu.v", 20211210222943),
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


ATTEMPT = "attempt_2026-11-20-10-22-33"


def receipt(name: str, user: str) -> str:
    """What Blackboard writes about an attempt, as in the examples of public scripts."""
    return f"Name: {name} ({user})\nAssignment: Lab 3\nDate Submitted: Friday\n\nNo comments\n"


def test_blackboards_users_follow_the_common_start_where_they_hold_underscores() -> None:
    found = file_owners([f"Lab_3_{user}_{ATTEMPT}_a.zip" for user in ("jane_doe", "jim_doe", "bo")])
    assert sorted(each.student for each in found.values()) == ["bo", "jane_doe", "jim_doe"]


def test_the_receipt_names_the_user_of_blackboard(tmp_path: Path) -> None:
    for user in ("a_lens", "a_bo"):
        (tmp_path / f"Lab 3_{user}_{ATTEMPT}_work.zip").touch()
    (tmp_path / f"Lab 3_a_lens_{ATTEMPT}.txt").write_text(receipt("Ann Lens", "a_lens"))
    found = find_submissions(tmp_path)
    # The one receipt shows where the users begin, for all.
    assert [(each.student, each.people, each.may_be) for each in found] == [
        ("a_bo", (Person("", {BLACKBOARD_USER: "a_bo"}),), ()),
        ("a_lens", (Person("Ann Lens", {BLACKBOARD_USER: "a_lens"}),), ()),
    ]


def test_a_receipt_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text(receipt("Ann Lens", "a_lens"))
    folder = tmp_path / "class"
    folder.mkdir()
    (folder / f"Lab 3_a_lens_{ATTEMPT}.txt").symlink_to(tmp_path / "notes")
    (found,) = find_submissions(folder)
    assert (found.student, found.people) == ("lens", (Person("", {BLACKBOARD_USER: "lens"}),))


def test_a_receipt_at_an_address_is_read_too() -> None:
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed")
    storage = fsspec.filesystem("memory")
    for user in ("a_lens", "a_bo"):
        text = receipt("Ann", user).encode()
        storage.pipe(f"/receipts/Lab 3_{user}_{ATTEMPT}.txt", text)
    try:
        assert [found.student for found in find_submissions("memory://receipts")] == [
            "a_bo", "a_lens",
        ]  # fmt: skip
    finally:
        storage.rm("/receipts", recursive=True)


@pytest.mark.parametrize(
    "text", ["", "Name: Eve (eve)\n", "no receipt", "Name: (a_lens\n", "\x00" * 9]
)
def test_a_user_that_no_receipt_names_may_begin_at_an_earlier_underscore(
    text: str, tmp_path: Path
) -> None:
    for user in ("a_lens", "a_bo"):
        (tmp_path / f"Lab 3_{user}_{ATTEMPT}.txt").write_text(text)
    bo, lens = find_submissions(tmp_path)
    assert (bo.student, lens.student) == ("bo", "lens")
    assert lens.may_be == tuple(Person("", {BLACKBOARD_USER: user}) for user in ("lens", "a_lens"))


def test_a_file_called_like_a_receipt_is_of_who_handed_it_in(tmp_path: Path) -> None:
    name = f"Lab 3_mal_{ATTEMPT}_x_jo_{ATTEMPT}.txt"
    (tmp_path / name).write_text(receipt("Jo", "jo"))
    (tmp_path / f"Lab 3_mal_{ATTEMPT}.txt").write_text(receipt("Mal", "mal"))
    (found,) = find_submissions(tmp_path)
    assert (found.student, len(found.entries)) == ("mal", 2)


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


def test_two_names_of_brightspace_with_one_number_are_two_students() -> None:
    # As in a public script: 397063-2557369 - Mary-Ann Smith, 397063-2557369 - John Doe
    names = [f"39-25 - {name} - Sep 24, 2024 926 PM" for name in ("Mary-Ann Smith", "John Doe")]
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


def graded(tmp_path: Path) -> dict[str, dict[str, Any]]:
    out = tmp_path / "book"
    graded_here(ClassSettings(tmp_path / "class", starter(), out))
    return {
        row["student"]: row for row in json.loads((out / "grades.json").read_text())["students"]
    }


def test_all_files_of_a_user_of_canvas_are_one_attempt_and_keep_their_own_names() -> None:
    names = [
        "doe_7_60_shot-1.png", "doe_7_61_shot-2.png", "doe_7_62_Lab3_01_ros_clock-1.usda",
        "doe_7_63_work-3.tar.gz",
    ]  # fmt: skip
    found = file_owners(names)
    assert {owner.upload for owner in found.values()} == {0}
    assert [found[name].file for name in names] == [
        "shot-1.png", "shot-2.png", "Lab3_01_ros_clock.usda", "work.tar.gz",
    ]  # fmt: skip


def test_two_files_of_one_name_in_an_attempt_both_stay() -> None:
    found = file_owners(["doe_7_60_work.tar.gz", "doe_7_61_work.tar.gz"])
    assert [owner.file for owner in found.values()] == ["work-60.tar.gz", "work.tar.gz"]


def test_stages_whose_own_names_end_in_numbers_have_full_points(tmp_path: Path) -> None:
    (tmp_path / "class").mkdir()
    for order, number in enumerate(LAB.checkpoints):
        name = stage(number).name.replace(".usda", f"-{order % 2 + 1}.usda")
        (tmp_path / "class" / f"doe_7_{60 + order}_{name}").write_bytes(stage(number).read_bytes())
    for order in (1, 2):
        (tmp_path / "class" / f"doe_7_{80 + order}_shot-{order}.png").write_bytes(b"png")
    (row,) = graded(tmp_path).values()
    assert (row["status"], row["earned"]) == ("graded", 100.0)


def test_a_result_holds_the_names_that_the_platform_wrote_and_whose_they_are(
    tmp_path: Path,
) -> None:
    folder = "Jane Doe_77_assignsubmission_file"
    submission(tmp_path / "class" / folder, "00")
    (row,) = graded(tmp_path).values()
    assert (row["platform"], row["entries"]) == ("moodle", [folder])
    assert row["people"] == [{"name": "Jane Doe", "ids": {"Moodle number": "77"}}]


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
