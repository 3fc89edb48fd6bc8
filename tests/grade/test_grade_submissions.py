"""Who handed in what: folders, archives and files as learning platforms export them."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.platforms import LARGEST
from lab3_usd.grade.intake.submissions import StudentSubmission, find_submissions, submissions_in

STAGE = "Lab3_05_odometry_tf.usda"


def handed(place: Path, *names: str) -> dict[str, StudentSubmission]:
    """What is found where there are files of these names; a slash at the end makes a folder."""
    for name in names:
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if name.endswith("/"):
            path.mkdir(exist_ok=True)
        else:
            path.touch()
    return {submission.student: submission for submission in find_submissions(place)}


def sources(found: StudentSubmission) -> list[tuple[str, str]]:
    return [(source.path.name, source.name) for source in found.sources]


def test_a_folder_for_each_student(tmp_path: Path) -> None:
    found = handed(tmp_path, "jane/work/", "ali/work/", ".DS_Store", "__MACOSX/", "readme.txt")
    assert list(found) == ["ali", "jane"]
    assert sources(found["jane"]) == [("jane", "")]


@pytest.mark.parametrize("name", ["jane.zip", "jane.tar.gz", "jane.tgz", "jane.rar"])
def test_an_archive_for_each_student(tmp_path: Path, name: str) -> None:
    assert sources(handed(tmp_path, name)["jane"]) == [(name, name)]


def test_single_stages_of_one_student_belong_together(tmp_path: Path) -> None:
    found = handed(tmp_path, f"jane_{STAGE}", "jane_Lab3_04_camera.usda", f"ali {STAGE}")
    assert sorted(found) == ["ali", "jane"]
    assert [name for _, name in sources(found["jane"])] == ["Lab3_04_camera.usda", STAGE]


def test_a_stage_without_a_name_of_a_student_goes_by_its_own(tmp_path: Path) -> None:
    assert list(handed(tmp_path, STAGE)) == ["Lab3_05_odometry_tf"]


def test_a_submission_itself_is_a_class_of_one(tmp_path: Path) -> None:
    found = handed(tmp_path / "jane", f"work/{STAGE}")
    assert list(found) == ["jane"]
    assert sources(found["jane"]) == [("jane", "")]


def test_canvas_names(tmp_path: Path) -> None:
    found = handed(
        tmp_path,
        "doejane_12345_678901_Lab3.zip",
        "doejane_12345_678902_report.pdf",
        "smithali_LATE_23456_678903_Lab3-2.zip",
    )
    assert list(found) == ["12345", "23456"]
    jane, ali = found["12345"], found["23456"]
    assert (jane.name, jane.late) == ("doejane", False)
    assert sorted(name for _, name in sources(jane)) == ["Lab3.zip", "report.pdf"]
    assert (ali.name, ali.late) == ("smithali", True)
    assert [name for _, name in sources(ali)] == ["Lab3.zip"]


def test_moodle_folders(tmp_path: Path) -> None:
    found = handed(
        tmp_path,
        "Jane Doe_1234567_assignsubmission_file_/work/",
        "Jane Doe_1234567_assignsubmission_onlinetext_/onlinetext.html",
        "Ali Smith_2345678_assignsubmission_file/Lab3.zip",
    )
    assert {student: each.name for student, each in found.items()} == {
        "1234567": "Jane Doe",
        "2345678": "Ali Smith",
    }
    assert len(found["1234567"].sources) == 2


def test_moodle_files(tmp_path: Path) -> None:
    found = handed(tmp_path, "Jane Doe_1234567_assignsubmission_file_Lab3.zip")
    assert [name for _, name in sources(found["1234567"])] == ["Lab3.zip"]


METADATA = """
submission_11:
  :submitters:
  - :name: Jane Doe
    :sid: '1001'
    :email: jane@example.invalid
  :created_at: 2026-11-20 10:00:00
submission_12:
  :submitters:
  - :name: Ali Smith
    :sid: ''
    :email: ali@example.invalid
  - :name: Bo Lee
    :sid: '1003'
submission_13: no mapping
"""


def test_gradescope_folders_are_named_by_their_metadata(tmp_path: Path) -> None:
    (tmp_path / "submission_metadata.yml").write_text(METADATA)
    found = handed(tmp_path, *(f"submission_{number}/work/" for number in (11, 12, 13)))
    assert {student: each.name for student, each in found.items()} == {
        "1001": "Jane Doe",
        "ali@example.invalid+1003": "Ali Smith, Bo Lee",
        "submission_13": "submission_13",
    }


@pytest.mark.parametrize("text", ["[", "- 1", "a: !!python/object:os.system x"])
def test_gradescope_folders_keep_their_numbers_where_the_metadata_is_damaged(
    tmp_path: Path, text: str
) -> None:
    (tmp_path / "submission_metadata.yml").write_text(text)
    assert list(handed(tmp_path, "submission_11/work/")) == ["submission_11"]


def test_report_folders_are_plain_and_never_shared(tmp_path: Path) -> None:
    names = ["Jane", "jane", "a b", "a_b", "dots..", "=1+1", "ü", "x" * 200]
    folders = [each.folder for each in handed(tmp_path, *(f"{name}/" for name in names)).values()]
    assert len({folder.casefold() for folder in folders}) == len(names)
    assert all(folder.isascii() and folder[0].isalnum() for folder in folders)
    assert max(map(len, folders)) < 100


def test_report_folders_do_not_depend_on_who_else_is_there(tmp_path: Path) -> None:
    alone = handed(tmp_path / "one", "a b/")["a b"].folder
    assert handed(tmp_path / "two", "a b/", "a_b/", "zoe/")["a b"].folder == alone


def test_a_name_that_is_no_text_is_shown_as_its_bytes(tmp_path: Path) -> None:
    import os

    (tmp_path / os.fsdecode(b"j\xff")).mkdir()
    (found,) = find_submissions(tmp_path)
    assert found.student == "j\\udcff"
    assert found.folder.isascii()


@pytest.mark.parametrize("name", ["gone", "file.txt"])
def test_what_is_no_folder_is_an_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "file.txt").touch()
    with pytest.raises(UsageError, match="no such folder"):
        find_submissions(tmp_path / name)


def test_a_folder_without_submissions_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "readme.txt").touch()
    with pytest.raises(UsageError, match="holds no submission"):
        find_submissions(tmp_path)


def class_zip(path: Path, *names: str) -> Path:
    with zipfile.ZipFile(path, "w") as packed:
        for name in names:
            packed.writestr(name, b"")
    return path


@pytest.mark.parametrize(
    ("names", "students"),
    [
        (["jane_1_2_a.zip", "ali_2_3_a.zip"], ["1", "2"]),
        (["jane/work/a.usda", "ali/work/a.usda"], ["ali", "jane"]),
        (["class/jane/work/a.usda", "class/ali/work/a.usda"], ["ali", "jane"]),
        (["jane/work/a.usda"], ["jane"]),
    ],
)
def test_the_archive_of_a_whole_class(
    tmp_path: Path, names: list[str], students: list[str]
) -> None:
    with submissions_in(class_zip(tmp_path / "class.zip", *names)) as place:
        assert isinstance(place.where, Path)
        assert [submission.student for submission in find_submissions(place)] == students
    assert not place.where.exists()


@pytest.mark.parametrize("data", [b"", b"no zip"])
def test_a_damaged_archive_of_a_class_is_an_error(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "class.zip").write_bytes(data)
    with pytest.raises(UsageError, match="pack it again"), submissions_in(tmp_path / "class.zip"):
        pytest.fail("it was opened")


def test_a_missing_archive_of_a_class_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such"), submissions_in(tmp_path / "class.zip"):
        pytest.fail("it was opened")


TWO_OF_ONE = """
submission_11:
  :submitters:
  - :name: Jane Doe
    :sid: '1001'
    :email: jane@example.invalid
submission_12:
  :submitters:
  - :name: Mallory
    :sid: '1001'
    :email: jane@example.invalid
submission_13:
  :submitters:
  - :name: Eve
    :sid: '1001 (submission_11)'
submission_14:
  :submitters:
  - :name: Bo
    :sid: submission_15
"""


def test_two_who_claim_one_number_are_two_students(tmp_path: Path) -> None:
    (tmp_path / "submission_metadata.yml").write_text(TWO_OF_ONE)
    found = handed(tmp_path, *(f"submission_{number}/work/" for number in range(11, 16)))
    who = {each.sources[0].path.name: (each.student, each.name) for each in found.values()}
    assert len(who) == len(found) == 5
    assert who["submission_11"] == ("1001 (submission_11)", "Jane Doe")
    assert who["submission_12"] == ("1001 (submission_12)", "Mallory")
    assert who["submission_13"][1] == "Eve"
    assert who["submission_15"] == ("submission_15", "submission_15")
    assert len({each.folder.casefold() for each in found.values()}) == 5
    numbers = {each.number for each in found.values() if "Doe" in each.name or "Mal" in each.name}
    assert numbers == {"1001"}


def test_a_student_called_as_the_report_folder_of_another_has_another_one(tmp_path: Path) -> None:
    taken = handed(tmp_path / "one", "b c/")["b c"].folder
    found = handed(tmp_path / "two", "b c/", f"{taken}/", f"a/{taken}", f"{taken.upper()}/")
    assert len({each.folder.casefold() for each in found.values()}) == len(found) == 4


@pytest.mark.parametrize(
    "damage",
    [
        "  :results: !ruby/object:Thing {a: 1}\n",
        "7: x\n",
        "? [1]\n: x\n",
        "  :created_at: 2026-99-99\n",
        "submission_13: 'not closed\n",
        "submission_13:\n  :a: {\n",
        "\tsubmission_13: x\n",
    ],
)
def test_a_fault_in_the_metadata_costs_nobody_elses_name(tmp_path: Path, damage: str) -> None:
    text = (
        "submission_11:\n  :submitters:\n  - :name: Jane\n    :sid: 0123\n"
        f"{damage}"
        "submission_12:\n  :submitters:\n"
        "  - :name: Ali\n    :sid: ~\n    :email: a@example.invalid\n"
    )
    (tmp_path / "submission_metadata.yml").write_text(text)
    found = handed(tmp_path, "submission_11/", "submission_12/")
    assert {each.student: each.name for each in found.values()} == {
        "0123": "Jane",
        "a@example.invalid": "Ali",
    }


def said_of(place: Path) -> list[str]:
    said: list[str] = []
    find_submissions(place, said.append)
    return said


def test_names_that_are_missing_are_said_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "submission_metadata.yml").write_text(METADATA + "x: [\n")
    handed(tmp_path, *(f"submission_{number}/work/" for number in (11, 12, 13)))
    (line,) = said_of(tmp_path)
    assert line.startswith("submission_metadata.yml: ")
    assert line.endswith("graded under the names of their folders: submission_13")
    assert "line " in line


def test_what_is_passed_over_is_said_in_one_line(tmp_path: Path) -> None:
    names = ["bob.pdf", "..x/", ".DS_Store", "._a", "__MACOSX/", "Thumbs.db"]
    handed(tmp_path, "jane/", *names, *(f"note{number}.txt" for number in range(9)))
    (line,) = said_of(tmp_path)
    begins, _, named = line.rpartition(": ")
    assert begins == f"{tmp_path}: ignored, since they belong to no student"
    assert named == "..x, bob.pdf, note0.txt, note1.txt, note2.txt and 6 more"


def test_files_of_canvas_with_one_name_are_one_attempt(tmp_path: Path) -> None:
    found = handed(tmp_path, f"bob_7_998_{STAGE}", f"bob_7_1000_{STAGE}", "bob_7_999_a.usda")
    assert sorted(sources(found["7"])) == [
        (f"bob_7_1000_{STAGE}", STAGE),
        (f"bob_7_998_{STAGE}", "Lab3_05_odometry_tf-998.usda"),
        ("bob_7_999_a.usda", "a.usda"),
    ]
    assert {source.upload for source in found["7"].sources} == {0}


def test_a_folder_of_submissions_that_cannot_be_read_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_folder: object) -> list[str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("lab3_usd.grade.intake.platforms.os.listdir", refuse)
    with pytest.raises(UsageError, match=r"cannot be read \(Permission denied\)"):
        find_submissions(tmp_path)


def test_metadata_beyond_the_limit_is_not_read_and_said(tmp_path: Path) -> None:
    metadata = tmp_path / "submission_metadata.yml"
    metadata.write_text(METADATA)
    with metadata.open("a") as file:
        file.truncate(LARGEST + 1)  # which takes no room on the disk
    handed(tmp_path, "submission_11/work/")
    (line,) = said_of(tmp_path)
    assert "larger than" in line
    assert line.endswith("submission_11")


def test_metadata_behind_a_link_that_cannot_be_followed_is_said(tmp_path: Path) -> None:
    (tmp_path / "submission_metadata.yml").symlink_to("a" * 300)  # the system refuses the name
    handed(tmp_path, "submission_11/work/")
    (line,) = said_of(tmp_path)
    assert "(it cannot be read: File name too long)" in line
