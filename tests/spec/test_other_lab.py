"""Another lab's description: its ids, its file names, its folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import invoke
from places import REPOSITORY

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.platforms import parts_of
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint, nearly_named

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
WEEKS = {"A": "Week5_A_start", "B": "Week5_B_clock", "B2": "Week5_B2_drive"}


def lab3_run(*arguments: object) -> str:
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize(
    ("name", "checkpoint"),
    [
        ("Week5_A_start.usda", "A"),
        ("Week5_B_mine.usda", "B"),
        ("Week5_B2.usda", "B2"),
        ("Week5_C_late.usda", None),
        ("week5_A_start.usda", None),
    ],
)
def test_a_name_begins_with_its_checkpoint(name: str, checkpoint: str | None) -> None:
    assert named_checkpoint(name, WEEKS) == checkpoint


def test_an_id_may_stand_before_itself_in_a_name() -> None:
    files = {"4": "Week5_4_lidar", "5": "Week5_5_imu", "6": "Week5_6_odometry"}
    assert named_checkpoint("Week5_6_odometry.usda", files) == "6"
    assert nearly_named("week 5 - 6", files) == "6"


@pytest.mark.parametrize("name", ["week 5 - b2 drive", "WEEK5B2", "week05_B2"])
def test_a_name_may_be_meant_for_a_checkpoint(name: str) -> None:
    assert nearly_named(name, WEEKS) == "B2"


def test_the_environment_names_a_lab_as_the_option_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LAB_VARIABLE, str(JETBOT))
    assert load_lab().title == "Week 5"


def test_the_option_is_for_one_command() -> None:
    lab3_run("--lab", JETBOT, "rules")
    assert load_lab().first == "00"


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no such folder"):
        invoke("--lab", tmp_path / "gone", "rules")


def test_a_students_name_stands_before_the_lab_s_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LAB_VARIABLE, str(JETBOT))
    (part,) = parts_of([("jane_Week5_3_drive.usda", False)], {})
    assert (part.student, part.source.name) == ("jane", "Week5_3_drive.usda")
