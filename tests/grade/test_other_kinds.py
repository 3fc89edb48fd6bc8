"""Files with the ending of an archive that are of another kind: told as what they are."""

from __future__ import annotations

import bz2
import io
import lzma
import tarfile
import zipfile
from pathlib import Path

import pytest
from other_labs import stage, starter
from workers_here import graded_here

from lab3_usd.grade.class_run import ClassSettings

pytestmark = pytest.mark.usefixtures("equal_judged_once")


def tar(packing: str = "") -> bytes:
    whole = io.BytesIO()
    with tarfile.open(fileobj=whole, mode=f"w:{packing}") as archive:  # type: ignore[call-overload]
        archive.add(stage("00"), stage("00").name)
    data: bytes = whole.getvalue()
    return data


def zip_file() -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        archive.write(stage("00"), stage("00").name)
    return whole.getvalue()


KINDS = {
    "a.zip": (tar("gz"), "is a gzip archive (.tar.gz) by its content, not .zip"),
    "b.zip": (tar(), "is a tar archive by its content, not .zip"),
    "c.zip": (lzma.compress(tar()), "is an xz archive"),
    "d.zip": (bz2.compress(tar()), "is a bzip2 archive"),
    "e.zip": (b"7z\xbc\xaf\x27\x1c\0\4" + bytes(40), "is a 7z archive by its content, not .zip"),
    "f.zip": (b"Rar!\x1a\x07\x01\0" + bytes(40), "is a rar archive by its content, not .zip"),
    "g.zip": (b"<!DOCTYPE html><title>Log in</title>", "is a web page by its content, not .zip"),
    "h.tar.gz": (
        zip_file(),
        "is a zip archive by its content, not .tar.gz; give it the ending .zip",
    ),
    "i.zip": (b"nonsense" * 9, "is damaged or not an archive"),
    "j.zip": (zip_file()[:90], "is damaged or not an archive"),
    "k.tgz": (tar("gz")[:90], "is damaged or not an archive"),
}


def test_an_archive_of_another_kind_is_told_as_what_it_is(
    tmp_path: Path, subtests: pytest.Subtests
) -> None:
    folder = tmp_path / "class"
    folder.mkdir()
    for name, (data, _) in KINDS.items():
        (folder / name).write_bytes(data)
    rows = graded_here(ClassSettings(folder, starter(), tmp_path / "book"))
    reasons = {row["student"]: (row["status"], row["reason"]) for row in rows}
    for name, (_, said) in KINDS.items():
        with subtests.test(name=name, said=said):
            status, reason = reasons[name.partition(".")[0]]
            assert (status, said in reason) == ("unreadable", True), reason


def test_what_tar_unpacks_whatever_it_is_called_is_graded(tmp_path: Path) -> None:
    folder = tmp_path / "class"
    folder.mkdir()
    (folder / "ann.tar.gz").write_bytes(tar("xz"))
    (row,) = graded_here(ClassSettings(folder, starter(), tmp_path / "book"))
    assert row["status"] == "graded"
