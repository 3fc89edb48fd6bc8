"""What of a submission is not copied, why, and what that costs."""

from __future__ import annotations

import io
import os
import shutil
import tarfile
import zipfile
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from lab3_usd.grade.intake import submission_copy
from lab3_usd.grade.intake.archives import unpack
from lab3_usd.grade.intake.staging import (
    Source,
    StagedSubmission,
    stage_submission,
)
from lab3_usd.grade.intake.submission_copy import (
    Limits,
    RefusedFile,
    SubmissionCopy,
    UnreachedError,
)
from lab3_usd.grade.workers.worker_messages import decoded_message, encode
from lab3_usd.spec.submission import named_checkpoint

STAGE = b'#usda 1.0\ndef Xform "World"\n{\n}\n'
UNFOLDS = b"a: &a 1\nb: [" + b"*a, " * 60 + b"]"


def write(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def staged(tmp_path: Path, *sources: Source) -> StagedSubmission:
    target = tmp_path / "copy"
    target.mkdir()
    return stage_submission(sources, target, Limits())


def names_below(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))


def test_yaml_of_gigabytes_is_not_read_and_costs_only_itself(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    os.truncate(write(tmp_path / "jane/nav2.yaml", b"a: 1"), 20 << 30)
    found = staged(tmp_path, Source(tmp_path / "jane"))
    assert [each.path for each in found.refused] == ["nav2.yaml"]
    assert names_below(found.folder) == ["work/a.usda"]


@pytest.mark.parametrize("ending", [".zip", ".tar"])
def test_yaml_in_an_archive_is_bounded_as_in_a_folder(tmp_path: Path, ending: str) -> None:
    entries = {"work/a.usda": STAGE, "map.yaml": UNFOLDS, "good.yaml": b"a: [1, 2]"}
    archive = tmp_path / f"jane{ending}"
    if ending == ".zip":
        with zipfile.ZipFile(archive, "w") as packed:
            for name, data in entries.items():
                packed.writestr(name, data)
    else:
        with tarfile.open(archive, "w") as tar:
            for name, data in entries.items():
                member = tarfile.TarInfo(name)
                member.size = len(data)
                tar.addfile(member, io.BytesIO(data))
    found = staged(tmp_path, Source(archive))
    assert [each.path for each in found.refused] == ["map.yaml"]
    assert (found.folder / "good.yaml").read_bytes() == b"a: [1, 2]"


def unreadable(monkeypatch: pytest.MonkeyPatch, name: str, *parts: str) -> None:
    """Make a function of `os` refuse paths that end in one of these names."""
    really = getattr(os, name)

    def refuse(path: Any, *arguments: Any, **options: Any) -> Any:
        if str(path).rstrip("/").endswith(parts):
            raise PermissionError(13, "Permission denied")
        return really(path, *arguments, **options)

    monkeypatch.setattr(f"lab3_usd.grade.intake.staging.os.{name}", refuse)


def test_a_folder_that_this_computer_may_not_read_is_no_fault_of_the_student(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    write(tmp_path / "jane/locked/b.usda", STAGE)
    unreadable(monkeypatch, "scandir", "locked")
    with pytest.raises(UnreachedError, match=r"^locked: cannot be read \(Permission denied\)$"):
        staged(tmp_path, Source(tmp_path / "jane"))


def test_a_submission_that_cannot_be_read_did_not_arrive_and_is_named_without_its_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    unreadable(monkeypatch, "scandir", "jane")
    with pytest.raises(UnreachedError) as raised:
        staged(tmp_path, Source(tmp_path / "jane"))
    assert str(raised.value) == "jane: cannot be read (Permission denied)"


def test_a_file_that_is_gone_did_not_arrive(tmp_path: Path) -> None:
    with pytest.raises(UnreachedError, match=r"jane\.zip: cannot be read \(No such file"):
        staged(tmp_path, Source(tmp_path / "jane.zip"))


def test_an_archive_that_cannot_be_read_is_not_said_to_be_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = write(tmp_path / "jane.zip", b"PK")

    def refuse(*_arguments: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(UnreachedError) as raised:
        unpack(archive, "", SubmissionCopy(tmp_path, Limits()))
    assert str(raised.value) == "jane.zip: cannot be read (Permission denied)"


def test_a_full_disk_is_nobodys_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    archive = tmp_path / "jane.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.writestr("a.usda", STAGE)

    def full(*_arguments: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(submission_copy, "_copied", full)
    with pytest.raises(UnreachedError, match="No space"):
        staged(tmp_path, Source(archive))


def test_what_was_left_out_on_the_way_is_refused_and_changes_the_digest(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    left_out = (RefusedFile("work/b.usda", "it is damaged in the archive"),)
    found = staged(tmp_path, Source(tmp_path / "jane", left_out=left_out))
    assert found.refused == left_out
    (tmp_path / "copy").rename(tmp_path / "first")
    assert staged(tmp_path, Source(tmp_path / "jane")).digest != found.digest


def test_what_a_file_brings_about_by_its_name_costs_only_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    write(tmp_path / "jane/work/b.usda", STAGE)
    really = os.open

    def refuse(path: Any, *arguments: Any) -> int:
        if str(path).endswith("b.usda"):
            raise OSError(36, "File name too long")
        return really(path, *arguments)

    monkeypatch.setattr("lab3_usd.grade.intake.staging.os.open", refuse)
    found = staged(tmp_path, Source(tmp_path / "jane"))
    assert found.refused == (RefusedFile("work/b.usda", "it cannot be read (File name too long)"),)


def test_a_source_is_the_same_after_its_way_to_a_worker(tmp_path: Path) -> None:
    source = Source(tmp_path, "a.zip", left_out=(RefusedFile("b", "c"),), fault="d")
    assert decoded_message(encode(source), Source) == source


def test_the_digests_of_files_are_by_their_names_in_the_submission(tmp_path: Path) -> None:
    for name, data in (("work/a.usda", STAGE), ("nav2.yaml", b"a: 1"), ("video.mp4", b"none")):
        write(tmp_path / "jane/lab" / name, data)
    write(tmp_path / "jane/beside.txt", b"not in it")
    write(tmp_path / "jane/lab2.txt", b"nor this")
    found = staged(tmp_path, Source(tmp_path / "jane"))
    assert found.folder.name == "lab"
    assert found.digests == {
        "nav2.yaml": sha256(b"a: 1").hexdigest(),
        "video.mp4": "",
        str(Path("work", "a.usda")): sha256(STAGE).hexdigest(),
    }


def counted_names(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list of the names of files of which it is asked what checkpoint they are of."""
    asked = list[str]()

    def count(name: str, files: Mapping[str, str]) -> str | None:
        asked.append(name)
        return named_checkpoint(name, files)

    for module in ("staging", "submission_copy"):
        monkeypatch.setattr(f"lab3_usd.grade.intake.{module}.named_checkpoint", count)
    return asked


@pytest.mark.parametrize("form", [".zip", ".tar", "folder"])
@pytest.mark.parametrize("name", ["venv/{}.txt", "venv/{}/a.txt", "work/{}.txt", "{}.zip"])
def test_the_work_of_taking_a_submission_in_grows_with_the_number_of_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, form: str
) -> None:
    number = 100
    with zipfile.ZipFile(tmp_path / "inner.zip", "w") as packed:
        packed.writestr("a.usda", STAGE)
    held = (tmp_path / "inner.zip").read_bytes() if name.endswith(".zip") else b""
    for count in range(number):
        write(tmp_path / "jane" / name.format(count), held)
    write(tmp_path / "jane/venv/Lab3_01.usda" if "/a" in name else tmp_path / "jane/a.usda", STAGE)
    source = tmp_path / "jane"
    if form != "folder":
        kind = form.removeprefix(".")
        source = Path(shutil.make_archive(str(source), kind, source))
    asked = counted_names(monkeypatch)
    staged(tmp_path, Source(source))
    assert len(asked) < 20 * number


def test_files_of_archives_in_archives_are_put_where_the_outer_one_lay(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "inner.zip", "w") as packed:
        packed.writestr("maps/a.yaml", b"a: 1")
        packed.writestr("maps/c.yaml", UNFOLDS)
    (tmp_path / "jane").mkdir()
    with zipfile.ZipFile(tmp_path / "jane" / "outer.zip", "w") as packed:
        packed.write(tmp_path / "inner.zip", "inner.zip")
        packed.writestr("work/a.usda", STAGE)
    write(tmp_path / "jane/notes.txt", b"n")
    found = staged(tmp_path, Source(tmp_path / "jane"))
    assert names_below(found.folder) == ["a.yaml", "notes.txt", "work/a.usda"]
    assert [each.path for each in found.refused] == ["c.yaml"]
