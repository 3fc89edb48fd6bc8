"""Opening stage files: names that usd-core cannot open are said to be names, not damage."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pxr import Sdf, Usd

from lab3_usd.errors import StageError
from lab3_usd.model.folder import Listing
from lab3_usd.pipeline.folder import find_starters
from lab3_usd.pipeline.results import unreadable_result
from lab3_usd.pipeline.stage import check_stage, lint_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import check_file, open_stage
from lab3_usd.stage.read.stage_reader import read_stage


def saved(path: Path) -> Path:
    stage = Usd.Stage.CreateInMemory()
    path.write_text(stage.GetRootLayer().ExportToString())
    return path


def test_a_name_in_another_script_is_opened(tmp_path: Path) -> None:
    assert open_stage(saved(tmp_path / "Übung 3.usda"))


def test_a_name_with_layer_arguments_is_said(tmp_path: Path) -> None:
    path = saved(tmp_path / "a:SDF_FORMAT_ARGS:b=c.usda")
    with pytest.raises(StageError, match="SDF_FORMAT_ARGS") as refused:
        open_stage(path)
    assert "damaged" not in str(refused.value)


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux only")
def test_a_name_that_is_no_utf_8_is_said(tmp_path: Path) -> None:
    path = saved(Path(os.fsdecode(os.fsencode(tmp_path) + b"/a\xff.usda")))
    with pytest.raises(StageError, match="UTF-8") as refused:
        open_stage(path)
    assert str(refused.value).encode("utf-8")


TOPIC = b"qzjxkvwy"  # which compression leaves as it is


def without_a_name(saved_as: bytes) -> bytes:
    """Take its name off one of two properties."""
    names = [struct.pack("<QII", 2, number, number + 1) for number in range(99)]
    (found,) = (each for each in names if each in saved_as)
    return saved_as.replace(found, struct.pack("<QII", 2, 9999, 9999))


def without_a_letter(saved_as: bytes) -> bytes:
    assert saved_as.count(TOPIC) == 1
    return saved_as.replace(TOPIC, TOPIC.replace(b"j", b"\xff"))


def damaged(path: Path, damage: Callable[[bytes], bytes]) -> Path:
    """Save a binary stage that opens, and shows its damage where its node is read."""
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    node = Sdf.CreatePrimInLayer(layer, "/World")
    node.specifier, node.typeName = Sdf.SpecifierDef, "OmniGraphNode"
    Sdf.AttributeSpec(node, "one", Sdf.ValueTypeNames.Float)
    topic = Sdf.AttributeSpec(node, "inputs:topicName", Sdf.ValueTypeNames.String)
    topic.default = TOPIC.decode()
    layer.Export(str(path))
    path.write_bytes(damage(path.read_bytes()))
    assert Usd.Stage.Open(str(path))
    return path


@pytest.mark.parametrize("damage", [without_a_name, without_a_letter])
def test_damage_that_shows_while_a_stage_is_read_makes_it_unreadable(
    tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    path = damaged(tmp_path / "Lab3_00_student_start.usdc", damage)
    assert check_stage(path).verdict == "unreadable"
    with pytest.raises(StageError, match="damaged"):
        read_stage(path, load_lab().platform)


@pytest.mark.parametrize("damage", [without_a_name, without_a_letter])
def test_a_starter_in_which_damage_shows_late_is_a_fault_of_the_submission(
    tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    listing = Listing({}, starter=damaged(tmp_path / "start.usdc", damage).name)
    found = find_starters(tmp_path, listing, None, load_lab())
    assert found.compared is None
    assert found.submitted is not None
    assert "damaged" in found.submitted.fault


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        ('def Xform "A"\n{\n    double x = 3\n', (5, 1), "5:1: Expected }"),
        ('def Xform "A"\n{\n    double x = \n}\n', (4, 5), "4:5: Expected }"),
        ('def Xform "A"\n{\n    token x = "abc\n}\n', (4, 19), "4:19: parse error"),
        ('(\n    subLayers = [ @./a.usd@\ndef "b" {}\n', (4, 1), "4:1: Expected ]"),
        ('def "A"\n{\n    token x = "\0"\n}\n', (4, None), "line 4"),
    ],
)
def test_damaged_text_has_the_place_and_the_reason_that_usd_core_names(
    tmp_path: Path, text: str, place: tuple[int, int | None], said: str
) -> None:
    path = tmp_path / "Lab3_01_ros_clock.usda"
    path.write_text(f"#usda 1.0\n{text}")
    (finding,) = check_stage(path).findings
    assert (finding.line, finding.column) == place
    assert said in finding.message
    assert f"line {place[0]}" in (finding.hint or "")


@pytest.mark.parametrize(("checkpoint", "repeats"), [("01", True), (None, False)])
def test_the_stage_before_is_named_where_a_checkpoint_has_one(
    checkpoint: str | None, *, repeats: bool
) -> None:
    (finding,) = unreadable_result("x.usda", checkpoint, "is damaged").findings
    assert ("checkpoint before" in (finding.hint or "")) == repeats


@pytest.mark.parametrize(
    ("name", "binary", "right"),
    [
        ("robot.txt", False, "robot.usda"),
        ("robot.usda.txt", False, "robot.usda"),
        ("robot.usd.txt", False, "robot.usd"),
        ("robot.usda.txt", True, "robot.usd"),
        ("robot.uda", False, "robot.usda"),
        ("robot.v2.txt", False, "robot.v2.usda"),
    ],
)
def test_a_stage_with_another_ending_is_told_its_right_name(
    tmp_path: Path, name: str, *, binary: bool, right: str
) -> None:
    written = tmp_path / f"stage.{'usdc' if binary else 'usda'}"
    Sdf.Layer.CreateNew(str(written)).Save()
    path = written.rename(tmp_path / name)
    with pytest.raises(StageError, match=f"is not a USD ending .*; rename the file to {right}$"):
        check_file(path)
    (finding,) = lint_stage(path).findings
    assert finding.hint == f"rename the file to {right}"


def test_what_is_no_stage_is_not_told_to_be_renamed(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("buy milk\n")
    with pytest.raises(StageError, match="and the content is not USD"):
        check_file(tmp_path / "notes.txt")


@pytest.mark.parametrize(
    ("encoding", "said"),
    [("utf-16", "UTF-16"), ("utf-16-le", "UTF-16"), ("utf-16-be", "UTF-16"), ("utf-32", "UTF-32")],
)
def test_text_of_wider_letters_is_told_by_its_encoding(
    tmp_path: Path, encoding: str, said: str
) -> None:
    path = tmp_path / "stage.usda"
    path.write_bytes("#usda 1.0\n".encode(encoding))
    with pytest.raises(StageError, match=f"is text in {said}") as refused:
        check_file(path)
    assert refused.value.repair == "save it again as UTF-8"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('def "A" {}\ndef "A" {}', "Duplicate prim 'A'"),
        ('def "1a" {}', "'1a' is not a valid prim name"),
        ('def "A" { rel a\n double a\n }', "attribute 'a' already has variability"),
    ],
)
def test_a_name_in_the_reason_is_kept(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "stage.usda"
    path.write_text(f"#usda 1.0\n{text}\n")
    with pytest.raises(StageError) as refused:
        open_stage(path)
    reason = str(refused.value)
    assert said in reason
    assert reason == reason.strip()
