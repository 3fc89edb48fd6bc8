"""Archives of a folder as people make them: of the folder, of what is in it, and of `.`."""

from __future__ import annotations

import json
import shutil
import tarfile
from pathlib import Path

import pytest
from grade_files import stage, starter
from workers_here import graded_here

from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.intake.staging import Source, stage_submission
from lab3_usd.grade.intake.submission_copy import Limits

STAGE = b'#usda 1.0\ndef Xform "World"\n{\n}\n'


def packed(folder: Path, name: str) -> Path:
    """Pack a folder as `tar -cf ana.tar NAME` does."""
    archive = folder.parent / "class" / "ana.tar"
    archive.parent.mkdir()
    with tarfile.open(archive, "w") as tar:
        tar.add(folder, name)
    return archive


@pytest.mark.parametrize("name", [".", "./Lab3_ana", "Lab3_ana"])
def test_every_file_of_a_packed_folder_is_taken(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "ana"
    for inside in ("work/Lab3_00_starter.usda", "work/map.yaml", "notes.md"):
        (folder / inside).parent.mkdir(parents=True, exist_ok=True)
        (folder / inside).write_bytes(STAGE)
    target = tmp_path / "copy"
    target.mkdir()
    staged = stage_submission([Source(packed(folder, name))], target, Limits())
    assert set(staged.digests) == {"work/Lab3_00_starter.usda", "work/map.yaml", "notes.md"}
    assert staged.refused == ()


def test_a_packed_dot_is_worth_what_its_folder_is(tmp_path: Path) -> None:
    work = tmp_path / "ana" / "work"
    work.mkdir(parents=True)
    shutil.copy(stage("00"), work)
    points = {}
    for place in (packed(tmp_path / "ana", ".").parent, tmp_path / "ana"):
        out = tmp_path / f"book of {place.name}"
        graded_here(ClassSettings(place, starter(), out))
        (row,) = json.loads((out / "grades.json").read_text())["students"]
        points[place.name] = (row["student"], row["status"], row["earned"])
    assert points["class"] == points["ana"]
    assert points["class"][2] > 0
