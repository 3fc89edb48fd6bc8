"""The archive of a whole class: nobody of whom anything was in it is lost."""

from __future__ import annotations

import io
import json
import stat
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import pytest
from other_labs import stage, starter
from workers_here import graded_here

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.intake.submissions import StudentSubmission, find_submissions, submissions_in

pytestmark = pytest.mark.usefixtures("equal_judged_once")

STAGE = stage("00").name
LINK = zipfile.ZipInfo("link")
LINK.external_attr = (stat.S_IFLNK | 0o777) << 16
LINK.create_system = 3
BOMB = bytes(5_000_000)


def zipped(path: Path, entries: dict[str, bytes], links: tuple[str, ...] = ()) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in entries.items():
            packed.writestr(name, data)
        for name in links:
            link = zipfile.ZipInfo(name)
            link.create_system, link.external_attr = 3, LINK.external_attr
            packed.writestr(link, "/etc/passwd")
    return path


def found_in(archive: Path) -> tuple[dict[str, StudentSubmission], list[str]]:
    """Who is found in an archive, and what is said of the rest."""
    said: list[str] = []
    with submissions_in(archive) as place:
        return {
            submission.student: submission for submission in find_submissions(place, said.append)
        }, said


def left_out(handed: StudentSubmission) -> list[str]:
    return [each.path for source in handed.sources for each in source.left_out]


def rows(archive: Path, out: Path) -> dict[str, dict[str, Any]]:
    graded_here(ClassSettings(archive, starter(), out))
    students = json.loads((out / "grades.json").read_text())["students"]
    return {row["student"]: row for row in students}


def test_everybody_in_the_archive_has_a_row_with_a_reason(tmp_path: Path) -> None:
    data = stage("00").read_bytes()
    archive = zipped(
        tmp_path / "class.zip",
        {
            f"ana/{STAGE}": data,
            f"bob/{STAGE}": BOMB,
            "cat/": b"",
            "dan/notes\n.usda": data,
            f"../eve/{STAGE}": data,
        },
        links=(f"fay/{STAGE}",),
    )
    found = rows(archive, tmp_path / "book")
    assert {student: row["status"] for student, row in found.items()} == {
        "ana": "graded",
        **dict.fromkeys(["bob", "cat", "dan", "eve", "fay"], "empty"),
    }
    reasons = {student: row["reason"] for student, row in found.items()}
    assert f"{STAGE}: it would grow" in reasons["bob"]
    assert "leads out" in reasons["eve"]
    assert "link" in reasons["fay"]
    report = json.loads((tmp_path / "book" / "students" / "bob" / "report.json").read_text())
    sites = [(each["rule"], each["prim"]) for each in report["submissions"][0]["findings"]]
    assert ("Z01", STAGE) in sites


def test_what_is_refused_beside_good_files_is_a_finding_of_that_student(tmp_path: Path) -> None:
    archive = zipped(
        tmp_path / "class.zip", {"ana/work/a.usda": b"", "bob/work/a.usda": b""}, links=("bob/x",)
    )
    found, said = found_in(archive)
    assert {student: left_out(each) for student, each in found.items()} == {
        "ana": [],
        "bob": ["x"],
    }
    assert said == []


def test_a_students_archive_that_is_refused_is_still_that_students(tmp_path: Path) -> None:
    names = ("doejane_1_2_a.zip", "class/smith.zip")
    for name in names:
        found, _ = found_in(zipped(tmp_path / "c.zip", {"ali_2_3_b.zip": b"PK", name: BOMB}))
        assert len(found) == 2
    found, _ = found_in(zipped(tmp_path / "c.zip", {"ali_2_3_b.zip": b"PK", names[0]: BOMB}))
    assert (found["1"].name, left_out(found["1"])) == ("doejane", ["doejane_1_2_a.zip"])


def test_refused_students_are_found_within_the_folder_that_wraps_the_class(tmp_path: Path) -> None:
    archive = zipped(
        tmp_path / "c.zip",
        {"class/ana/work/a.usda": b"", "class/cat/": b"", "class/dan.zip": BOMB},
        links=("class/bob/work/a.usda",),
    )
    found, _ = found_in(archive)
    assert list(found) == ["ana", "bob", "cat", "dan"]
    assert left_out(found["bob"]) == ["work/a.usda"]
    assert left_out(found["dan"]) == ["dan.zip"]


def test_empty_folders_in_a_tar_are_students_too(tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "c.tar", "w") as packed:
        for name, kind in (("ana", tarfile.DIRTYPE), ("bob/a", tarfile.FIFOTYPE)):
            member = tarfile.TarInfo(name)
            member.type = kind
            packed.addfile(member, io.BytesIO())
    found, _ = found_in(tmp_path / "c.tar")
    assert list(found) == ["ana", "bob"]


def test_what_is_nobodys_is_said(tmp_path: Path) -> None:
    archive = zipped(
        tmp_path / "c.zip",
        {"ana/a.usda": b"", "notes.txt": b"", ".bob/a.usda": b"", ".DS_Store": b""},
        links=("odd.txt",),
    )
    found, said = found_in(archive)
    assert list(found) == ["ana"]
    assert said == [
        f"{archive}: ignored, since they belong to no student: .bob, notes.txt, odd.txt"
    ]


def test_a_name_that_no_file_system_takes_is_still_a_row(tmp_path: Path) -> None:
    name = "x" * 300
    found, _ = found_in(zipped(tmp_path / "c.zip", {"ana/a.usda": b"", f"{name}/a.usda": b""}))
    assert list(found) == ["ana", name]


@pytest.mark.parametrize("name", ["new\nline", "J\u202eane", "x" * 250])
def test_an_odd_name_of_a_student_costs_nothing(tmp_path: Path, name: str) -> None:
    with tarfile.open(tmp_path / "c.tar", "w") as packed:
        for path in (f"{name}/{STAGE}", f"{name}/o\ndd.usda", f"ana/{STAGE}"):
            member = tarfile.TarInfo(path)
            member.size = len(stage("00").read_bytes())
            packed.addfile(member, io.BytesIO(stage("00").read_bytes()))
    found = rows(tmp_path / "c.tar", tmp_path / "book")
    assert found[name]["status"] == "graded"
    assert found[name]["earned"] == found["ana"]["earned"] > 0


def test_an_archive_of_a_class_that_is_cut_short_is_an_error(tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "c.tar", "w") as packed:
        for name in ("ana/a.usda", "bob/a.usda"):
            member = tarfile.TarInfo(name)
            member.size = 5000
            packed.addfile(member, io.BytesIO(bytes(5000)))
    data = (tmp_path / "c.tar").read_bytes()
    (tmp_path / "c.tar").write_bytes(data[:7000])
    with pytest.raises(UsageError, match="damaged"), submissions_in(tmp_path / "c.tar"):
        pytest.fail("it was opened")


def test_an_empty_archive_of_a_class_is_called_by_its_own_name(tmp_path: Path) -> None:
    archive = zipped(tmp_path / "c.zip", {})
    with pytest.raises(UsageError) as raised, submissions_in(archive) as place:
        find_submissions(place)
    assert str(raised.value) == f"{archive}: holds no submission: no folder, archive or stage"


def test_the_archive_of_one_student_has_the_students_name(tmp_path: Path) -> None:
    found, _ = found_in(zipped(tmp_path / "jane.zip", {f"work/{STAGE}": b""}, links=("work/x",)))
    assert list(found) == ["jane"]
    assert left_out(found["jane"]) == ["work/x"]


def test_a_file_that_is_no_archive_is_not_said_to_be_missing(tmp_path: Path) -> None:
    (tmp_path / "class.txt").touch()
    with (
        pytest.raises(UsageError, match="neither a folder nor an archive"),
        submissions_in(tmp_path / "class.txt"),
    ):
        pytest.fail("it was opened")


def test_a_place_that_nobody_may_look_into_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_path: Path, **_options: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "stat", refuse)
    with (
        pytest.raises(UsageError, match=r"cannot be read \(Permission denied\)"),
        submissions_in(tmp_path / "class"),
    ):
        pytest.fail("it was opened")


def test_folders_whose_names_lead_out_are_students_too(tmp_path: Path) -> None:
    archive = zipped(tmp_path / "c.zip", {"ana/a.usda": b"", "../eve/": b"", "C:\\fay\\x": b""})
    found, said = found_in(archive)
    assert list(found) == ["ana", "eve", "fay"]
    assert said == []


def test_a_folder_and_a_file_of_one_name_are_one_student(tmp_path: Path) -> None:
    found, _ = found_in(
        zipped(tmp_path / "c.zip", {"ana/a.usda": b"", "bob.zip": b"PK", "bob.zip/": b""})
    )
    assert list(found) == ["ana", "bob"]
    assert len(left_out(found["bob"])) == 1
