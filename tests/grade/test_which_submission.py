"""Which of several folders, archives and uploads is the submission, and what is said of it."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import tarfile
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from other_labs import LAB, cut_wire, files_below, stage, starter, submission
from workers_here import graded_here

from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.intake.staging import Source, StagedSubmission, stage_submission
from lab3_usd.grade.intake.submission_copy import Limits

pytestmark = pytest.mark.usefixtures("equal_judged_once")

ALL = tuple(LAB.checkpoints)
OLD, NEW = 1_600_000_000, 1_700_000_000


def graded(place: Path, **settings: Any) -> dict[str, Any]:
    """Grade a class of one, and return its row."""
    out = place.parent / f"book of {place.name}"
    graded_here(ClassSettings(place, starter(), out, **settings))
    (row,) = json.loads((out / "grades.json").read_text())["students"]
    assert isinstance(row, dict)
    return {**row, "out": out}


def findings(row: dict[str, Any]) -> dict[str, list[str]]:
    """The sites of what the report says of the submission as a whole, by rule."""
    report = json.loads((row["out"] / "students" / row["folder"] / "report.json").read_text())
    found: dict[str, list[str]] = {}
    for finding in report["submissions"][0]["findings"]:
        found.setdefault(finding["rule"], []).append(finding["prim"])
    return found


def staged(folder: Path, **settings: Any) -> StagedSubmission:
    target = folder.parent / f"copy of {folder.name}"
    target.mkdir()
    return stage_submission([Source(folder)], target, Limits(), **settings)


def changed(folder: Path, when: float) -> Path:
    """Let all files of a folder have been changed at a time."""
    for path in folder.rglob("*"):
        os.utime(path, (when, when))
    return folder


def other(folder: Path) -> Path:
    """Make the stages of a folder others than those of the lab, without a fault."""
    for path in folder.rglob("*.usda"):
        path.write_text(f"{path.read_text()}# again\n")
    return folder


def packed(folder: Path, archive: Path) -> Path:
    """Pack what a folder holds, with the times and links that it has there."""
    archive.parent.mkdir(parents=True, exist_ok=True)
    paths = sorted(folder.rglob("*"))
    if archive.name.endswith(".tar.gz"):
        with tarfile.open(archive, "w:gz") as tar:
            for path in paths:
                tar.add(path, path.relative_to(folder), recursive=False)
        return archive
    with zipfile.ZipFile(archive, "w") as file:
        for path in paths:
            name = path.relative_to(folder).as_posix()
            if path.is_symlink():
                link = zipfile.ZipInfo(name)
                link.create_system = 3
                link.external_attr = 0o120777 << 16
                file.writestr(link, str(path.readlink()))
            elif path.is_file():
                file.write(path, name)
    return archive


FORMS: dict[str, Callable[[Path, Path], Path]] = {
    "folder": lambda folder, place: Path(shutil.copytree(folder, place / "ana", symlinks=True)),
    "zip": lambda folder, place: packed(folder, place / "ana.zip"),
    "tar.gz": lambda folder, place: packed(folder, place / "ana.tar.gz"),
}


def handed_in(form: str, folder: Path) -> Path:
    """Return a class of one who hands in a folder in one of the forms."""
    place = folder.parent / f"class of {form}"
    place.mkdir()
    FORMS[form](folder, place)
    return place


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The row of a whole submission with nothing beside it."""
    return graded(submission(tmp_path_factory.mktemp("alone") / "class" / "ana").parent)


# ---- folders beside each other


def backup(folder: Path) -> None:
    submission(folder / "Backup", "00")


def a_copy(folder: Path) -> None:
    submission(folder / "Copy of Lab3", "00", "01", "02")


def nine_old_stages(folder: Path) -> None:
    submission(folder / "Archive", work=".")
    for number in ALL[1:]:
        cut_wire(folder / "Archive" / stage(number).name)
    (folder / "Archive" / f"{LAB.checkpoints['05'].file}.usda").unlink()


def capitals(folder: Path) -> None:
    (folder / "LAB3" / "WORK").mkdir(parents=True)
    (folder / "LAB3" / "WORK" / stage("00").name).write_bytes(b"#usda 1.0\n(")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("beside", "name"),
    [
        (backup, "Backup"),
        (a_copy, "Copy of Lab3"),
        (nine_old_stages, "Archive"),
        (capitals, "LAB3"),
    ],
)
def test_the_folder_with_the_most_checkpoints_is_the_submission(
    beside: Callable[[Path], None], name: str, form: str, tmp_path: Path
) -> None:
    submission(tmp_path / "ana" / "Lab3" / "")
    beside(tmp_path / "ana")
    (source,) = handed_in(form, tmp_path / "ana").iterdir()
    found = staged(source)
    assert found.folder.name == "Lab3"
    right = {stage(number).name: stage(number).read_bytes() for number in ALL}
    assert files_below(found.folder / "work") == right
    if name != "LAB3":
        (remark,) = found.remarks
        assert remark.text.startswith("Lab3 is judged (6 checkpoints")
        assert f"left out: {name} (" in remark.text


def test_what_was_chosen_is_said_in_a_finding_the_gradebook_and_the_page(
    alone: dict[str, Any], tmp_path: Path
) -> None:
    submission(tmp_path / "class" / "ana" / "Lab3")
    submission(tmp_path / "class" / "ana" / "Backup", "00")
    row = graded(tmp_path / "class")
    assert (row["status"], row["earned"]) == (alone["status"], alone["earned"])
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    (remark,) = row["remarks"]
    assert findings(row)["Z03"] == ["Lab3"]
    with (row["out"] / "grades.csv").open(newline="", encoding="utf-8") as file:
        (line,) = csv.DictReader(file)
    assert remark in line["remarks"]
    assert remark in (row["out"] / "index.html").read_text()
    assert remark in (row["out"] / "students" / "ana" / "report.html").read_text()


def test_one_folder_alone_needs_no_remark(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "ana" / "Lab3")
    row = graded(tmp_path / "class")
    assert (row["remarks"], "Z03" in findings(row)) == ([], False)


def test_a_folder_that_lies_deeper_counts_where_it_holds_more(tmp_path: Path) -> None:
    submission(tmp_path / "ana", "00")
    submission(tmp_path / "ana" / "Lab3")
    assert staged(tmp_path / "ana").folder.name == "Lab3"


def test_stages_beside_an_empty_folder_of_stages_belong_to_it(tmp_path: Path) -> None:
    submission(tmp_path / "ana", work="usd")
    (tmp_path / "ana" / "work").mkdir()
    (tmp_path / "ana" / "work" / "notes.txt").write_text("later")
    found = staged(tmp_path / "ana")
    assert (found.folder.name, found.remarks) == ("copy of ana", ())


def test_a_single_stage_elsewhere_is_named(tmp_path: Path) -> None:
    submission(tmp_path / "ana" / "Lab3", *ALL[:-1])
    submission(tmp_path / "ana" / "extra", ALL[-1], work=".")
    (remark,) = staged(tmp_path / "ana").remarks
    assert remark.text.endswith(f"left out: extra (1 checkpoint: {ALL[-1]}; only there: {ALL[-1]})")


def test_files_beside_the_submission_are_named(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "ana" / "Lab3")
    (tmp_path / "class" / "ana" / "report.md").write_text("# Report")
    assert findings(graded(tmp_path / "class"))["Z05"] == ["report.md"]


def test_of_many_files_beside_the_submission_the_others_are_counted(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "ana" / "Lab3")
    for number in range(11):
        (tmp_path / "class" / "ana" / f"{number:02}.md").write_text("# Report")
    assert len(findings(graded(tmp_path / "class"))["Z05"]) == 8 + 1


# ---- which of two, where they hold as much


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("first", "second"), [(OLD, NEW), (NEW, OLD)])
def test_of_two_that_hold_as_much_the_newest_counts_and_it_is_said_that_it_is_not_clear(
    first: int, second: int, form: str, tmp_path: Path
) -> None:
    changed(submission(tmp_path / "ana" / "a"), first)
    changed(other(submission(tmp_path / "ana" / "b")), second)
    (source,) = handed_in(form, tmp_path / "ana").iterdir()
    found = staged(source)
    (remark,) = found.remarks
    assert found.folder.name == ("a" if first > second else "b")
    assert remark.text.startswith("ambiguous, ask the student: ")


def test_an_identical_copy_is_not_ambiguous(tmp_path: Path) -> None:
    changed(submission(tmp_path / "ana" / "a"), OLD)
    changed(submission(tmp_path / "ana" / "b"), NEW)
    (remark,) = staged(tmp_path / "ana").remarks
    assert remark.text.startswith("b is judged")
    assert remark.text.endswith("the same files)")


def test_of_two_of_one_age_the_one_that_lies_least_deep_counts(tmp_path: Path) -> None:
    changed(submission(tmp_path / "ana" / "a" / "b"), OLD)
    changed(other(submission(tmp_path / "ana" / "c")), OLD)
    assert staged(tmp_path / "ana").folder.name == "c"


@pytest.mark.parametrize("damage", [b"", b"#usda 1.0\n(\n", b"PXR-USDC", b"text"])
def test_a_stage_that_cannot_be_read_does_not_count(damage: bytes, tmp_path: Path) -> None:
    changed(submission(tmp_path / "ana" / "a"), OLD)
    submission(tmp_path / "ana" / "b")
    (tmp_path / "ana" / "b" / "work" / stage("03").name).write_bytes(damage)
    changed(tmp_path / "ana" / "b", NEW)
    (remark,) = staged(tmp_path / "ana").remarks
    assert remark.text.startswith("a is judged (6 checkpoints")


def test_a_folder_of_damaged_stages_is_named_too(tmp_path: Path) -> None:
    submission(tmp_path / "ana" / "Lab3")
    for path in submission(tmp_path / "ana" / "Archive", work=".").rglob("*.usda"):
        path.write_bytes(path.read_bytes()[:2000])
    (remark,) = staged(tmp_path / "ana").remarks
    assert remark.text.endswith("left out: Archive (6 stages, none of which can be read)")


@pytest.mark.parametrize("mtime", [float("nan"), -1, 10**400, "zip"])
def test_a_time_that_is_none_costs_nothing(mtime: float | str, tmp_path: Path) -> None:
    data = stage("00").read_bytes()
    name = f"work/{stage('00').name}"
    if mtime == "zip":
        archive = tmp_path / "ana.zip"
        with zipfile.ZipFile(archive, "w") as packed:
            packed.writestr(zipfile.ZipInfo(name), data)
        unknown = (33).to_bytes(2, "little")  # the date of a zip file: 1 January 1980
        written = archive.read_bytes()
        assert written.count(b"\0\0" + unknown) == 2
        archive.write_bytes(written.replace(b"\0\0" + unknown, b"\0\0\0\0"))
    else:
        archive = tmp_path / "ana.tar"
        with tarfile.open(archive, "w", format=tarfile.PAX_FORMAT) as tar:
            member = tarfile.TarInfo(name)
            member.size = len(data)
            member.pax_headers = {"mtime": str(mtime)}
            tar.addfile(member, io.BytesIO(data))
    found = staged(archive)
    assert (set(found.digests), found.refused) == ({name}, ())


# ---- archives in an archive


def archives_of(tmp_path: Path, **contents: Iterable[str]) -> Path:
    """Pack archives of stages into one archive."""
    for name, numbers in contents.items():
        folder = submission(tmp_path / "made" / name / "Lab3", *numbers).parent
        packed(folder, tmp_path / "inside" / f"{name}.zip")
    return packed(tmp_path / "inside", tmp_path / "class" / "ana.zip").parent


def test_of_two_archives_in_one_the_one_with_the_most_checkpoints_counts(tmp_path: Path) -> None:
    row = graded(archives_of(tmp_path, A_old=ALL[:3], Lab3_final=ALL))
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    (remark,) = row["remarks"]
    assert remark.startswith("Lab3_final.zip is judged")


def test_archives_that_hold_different_parts_are_put_together(tmp_path: Path) -> None:
    row = graded(archives_of(tmp_path, one=ALL[:3], two=ALL[3:]))
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    assert row["remarks"] == []


def test_an_archive_beside_the_folder_that_it_was_made_of_changes_nothing(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "ana" / "Lab3")
    packed(submission(tmp_path / "old", *ALL[:2]), tmp_path / "class" / "ana" / "Lab3.zip")
    row = graded(tmp_path / "class")
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    assert "left out: Lab3.zip (2 checkpoints" in row["remarks"][0]


# ---- several uploads


def brightspace(place: Path, number: int, numbers: Iterable[str]) -> None:
    name = f"39786-640693 - Ana Doe - Oct {number // 100}, 2025 1022 AM"
    submission(place / name, *numbers)


def blackboard(place: Path, number: int, numbers: Iterable[str]) -> None:
    folder = submission(place.parent / f"made {number}", *numbers)
    date = f"2026-11-{number // 100:02}-10-22-33"
    packed(folder, place / f"Lab 3_adoe_attempt_{date}_Lab3.zip")


PLATFORMS = [brightspace, blackboard]  # the others hold the last attempt alone


@pytest.mark.parametrize("upload", PLATFORMS)
def test_the_last_upload_alone_counts_and_that_an_earlier_one_had_more_is_said(
    upload: Callable[..., None], tmp_path: Path
) -> None:
    place = tmp_path / "class"
    upload(place, 200, ALL)
    upload(place, 1100, ALL[:3])
    row = graded(place)
    assert set(row["verdicts"]) == set(ALL[:3])
    (remark,) = row["remarks"]
    assert "has more (6 checkpoints" in remark
    assert findings(row)["Z04"] == ["."]


@pytest.mark.parametrize("upload", PLATFORMS)
def test_an_earlier_upload_that_had_no_more_needs_no_remark(
    upload: Callable[..., None], tmp_path: Path
) -> None:
    place = tmp_path / "class"
    upload(place, 200, ALL[:3])
    upload(place, 1100, ALL)
    row = graded(place)
    assert (set(row["verdicts"]), row["remarks"]) == (set(ALL), [])


@pytest.mark.parametrize("upload", PLATFORMS)
def test_merged_uploads_say_which_file_is_from_when(
    upload: Callable[..., None], tmp_path: Path
) -> None:
    place = tmp_path / "class"
    upload(place, 200, ALL)
    upload(place, 1100, ALL[:3])
    row = graded(place, merge_uploads=True)
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    first, rest = row["remarks"]
    assert all(stage(number).name in first for number in ALL[3:])
    assert not any(stage(number).name in first for number in ALL[:3])
    assert "upload" in rest


def test_a_changed_choice_of_uploads_is_judged_again(tmp_path: Path) -> None:
    place = tmp_path / "class"
    brightspace(place, 200, ALL)
    brightspace(place, 1100, ALL[:3])
    graded(place)
    assert set(graded(place, resume=True, merge_uploads=True)["verdicts"]) == set(ALL)


def test_a_last_upload_that_is_damaged_says_that_there_is_an_earlier_one(tmp_path: Path) -> None:
    place = tmp_path / "class"
    place.mkdir()
    blackboard(place, 200, ALL)
    (place / "Lab 3_adoe_attempt_2026-11-11-10-22-33_Lab3.zip").write_bytes(b"PK\3\4 cut")
    row = graded(place)
    assert row["status"] == "unreadable"
    assert "upload of 2026-11-02" in row["reason"]


def test_two_archives_of_canvas_are_one_upload_of_which_the_fuller_one_counts(
    tmp_path: Path,
) -> None:
    place = tmp_path / "class"
    place.mkdir()
    for number, numbers in (("60", ALL), ("61", ALL[:3])):
        folder = submission(tmp_path / number, *numbers)
        packed(folder, place / f"doeana_7_{number}_Lab3-{number}.zip")
    row = graded(place)
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    assert "is judged (6 checkpoints" in row["remarks"][0]


def test_two_stages_of_one_checkpoint_in_an_upload_to_canvas_are_named(tmp_path: Path) -> None:
    place = tmp_path / "class"
    place.mkdir()
    name = stage("03").name
    for number in ("60", "61"):
        shutil.copyfile(stage("03"), place / f"doeana_7_{number}_{name}")
    row = graded(place)
    assert row["verdicts"] == {"03": "pass"}
    assert findings(row)["X05"] == [name.replace(".usda", "-60.usda")]


# ---- placeholders, folders of programs, links


@pytest.mark.parametrize("form", FORMS)
def test_files_of_no_bytes_are_unreadable_placeholders(form: str, tmp_path: Path) -> None:
    for path in submission(tmp_path / "ana").rglob("*.usda"):
        path.write_bytes(b"")
    row = graded(handed_in(form, tmp_path / "ana"))
    assert (row["status"], row["earned"]) == ("unreadable", 0)
    assert "6 stages of 0 bytes: a placeholder" in row["reason"]


@pytest.mark.parametrize("form", FORMS)
def test_placeholders_of_icloud_are_named_by_their_files(form: str, tmp_path: Path) -> None:
    (tmp_path / "ana" / "work").mkdir(parents=True)
    (tmp_path / "ana" / "work" / f".{stage('00').name}.icloud").write_bytes(b"bplist00")
    row = graded(handed_in(form, tmp_path / "ana"))
    assert (row["status"], "placeholder of iCloud" in row["reason"]) == ("empty", True)
    assert findings(row)["Z01"] == [f"work/{stage('00').name}"]


@pytest.mark.parametrize("form", FORMS)
def test_folders_that_programs_fill_do_not_count_and_are_named_once(
    form: str, tmp_path: Path
) -> None:
    submission(tmp_path / "ana")
    for folder in (
        "build",
        "install",
        "log",
        "venv",
        ".git",
        "src/a/__pycache__",
        "src/b/__pycache__",
    ):
        (tmp_path / "ana" / folder / "deep").mkdir(parents=True)
        for number in range(5):
            (tmp_path / "ana" / folder / "deep" / f"{number}.txt").write_text("x")
    limits = Limits(files=12)
    row = graded(handed_in(form, tmp_path / "ana"), limits=limits)
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")
    assert sorted(findings(row)["Z05"]) == [
        ".git", "build", "install", "log", "src/a/__pycache__", "venv",
    ]  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_a_folder_of_stages_may_be_called_as_those_of_programs(form: str, tmp_path: Path) -> None:
    submission(tmp_path / "ana", work="build")
    row = graded(handed_in(form, tmp_path / "ana"))
    assert row["verdicts"] == dict.fromkeys(ALL, "pass")


def test_folders_of_programs_in_the_archive_of_a_class_are_named_for_their_student(
    tmp_path: Path,
) -> None:
    for student in ("ana", "ben"):
        submission(tmp_path / "class" / student, "00")
    (tmp_path / "class" / "ana" / "install").mkdir()
    (tmp_path / "class" / "ana" / "install" / "a.txt").write_text("x")
    archive = packed(tmp_path / "class", tmp_path / "class.zip")
    out = tmp_path / "book"
    graded_here(ClassSettings(archive, starter(), out))
    rows = json.loads((out / "grades.json").read_text())["students"]
    named = {row["student"]: findings({**row, "out": out}).get("Z05") for row in rows}
    assert named == {"ana": ["install"], "ben": None}


def linked(folder: Path) -> Path:
    """A submission whose last stages are links: to a file, to a link, and through a folder."""
    submission(folder, *ALL[:3])
    work, kept = folder / "work", folder / "kept"
    kept.mkdir()
    for number in ALL[3:]:
        shutil.copyfile(stage(number), kept / stage(number).name)
    (folder / "through").symlink_to("kept")
    (work / "next").symlink_to(f"../kept/{stage(ALL[4]).name}")
    (work / stage(ALL[3]).name).symlink_to(f"../kept/{stage(ALL[3]).name}")
    (work / stage(ALL[4]).name).symlink_to("next")
    (work / stage(ALL[5]).name).symlink_to(f"../through/{stage(ALL[5]).name}")
    return folder


def test_links_inside_a_submission_give_one_grade_in_every_form(tmp_path: Path) -> None:
    linked(tmp_path / "ana")
    rows = {form: graded(handed_in(form, tmp_path / "ana")) for form in FORMS}
    assert {form: row["verdicts"] for form, row in rows.items()} == {
        form: dict.fromkeys(ALL, "pass") for form in FORMS
    }
    assert len({row["earned"] for row in rows.values()}) == 1
    assert len({str(findings(row)) for row in rows.values()}) == 1


@pytest.mark.parametrize("form", ["zip", "tar.gz"])
@pytest.mark.parametrize("wrapper", ["", "class/"])
def test_links_in_the_archive_of_a_class_are_followed_within_a_student(
    wrapper: str, form: str, tmp_path: Path
) -> None:
    made = tmp_path / "made"
    linked(made / wrapper / "ana")
    work = made / wrapper / "ben" / "work"
    work.mkdir(parents=True)
    (work / stage("00").name).symlink_to(f"../../ana/work/{stage('00').name}")
    shutil.copyfile(stage("01"), work / stage("01").name)
    out = tmp_path / "book"
    archive = packed(made, tmp_path / f"all.{form}")
    graded_here(ClassSettings(archive, starter(), out))
    rows = json.loads((out / "grades.json").read_text())["students"]
    verdicts = {row["student"]: row["verdicts"] for row in rows}
    assert verdicts == {"ana": dict.fromkeys(ALL, "pass"), "ben": {"01": "pass"}}
    (ben,) = (row for row in rows if row["student"] == "ben")
    assert findings({**ben, "out": out})["Z01"] == [f"work/{stage('00').name}"]


def test_links_out_of_a_submission_give_one_grade_in_every_form(tmp_path: Path) -> None:
    solution = submission(tmp_path / "solution", "05")
    submission(tmp_path / "ana", *ALL[:5])
    target = solution / "work" / stage("05").name
    (tmp_path / "ana" / "work" / target.name).symlink_to(f"../../{target.relative_to(tmp_path)}")
    (tmp_path / "ana" / "work" / "absolute.usda").symlink_to(target)
    (tmp_path / "ana" / "work" / "circle.usda").symlink_to("circle.usda")
    rows = {form: graded(handed_in(form, tmp_path / "ana")) for form in FORMS}
    assert {tuple(row["verdicts"]) for row in rows.values()} == {ALL[:5]}
    assert len({row["earned"] for row in rows.values()}) == 1
    assert {tuple(findings(row)["Z01"]) for row in rows.values()} == {
        ("work/Lab3_05_navigation.usda", "work/absolute.usda", "work/circle.usda")
    }
