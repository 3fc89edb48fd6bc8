"""Values by team: `{team}` in domains, topics and namespaces, from the names of files or --team."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from in_process import invoke
from other_labs import copied

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import UnknownTeamError, UsageError
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.submission_grading import grade_submission
from lab3_usd.grade.workers.worker_main import load_setup
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task
from lab3_usd.spec.contradictions.references import team_faults
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import lab_of_team, load_lab

DRIVE = "ROS_Drive"
EDITS = {
    "checkpoints.yaml": ('files: "', 'files: "T{team}_'),
    "ros.yaml": ("domain: 0", 'domain: "{team}"'),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mini lab, in which each team has a domain and a topic for its commands."""
    folder = copied(tmp_path_factory.mktemp("teams") / "lab")
    for file, (before, after) in EDITS.items():
        text = (folder / file).read_text()
        assert before in text, file
        (folder / file).write_text(text.replace(before, after))
    for file in (folder / "ros.yaml", *folder.glob("ROS_*.yaml")):
        text = file.read_text().replace("domain_id: 0", 'domain_id: "{team}"')
        file.write_text(text.replace("/cmd_vel", '"/t{team}/cmd_vel"'))
    rubric = folder / "rubric.yaml"
    title = "/cmd_vel controls the robot"
    rubric.write_text(rubric.read_text().replace(title, f'"/t{{team}}{title}"'))
    return folder


@pytest.fixture(scope="module")
def last(folder: Path) -> Path:
    """The last stage of team 7, as it is built."""
    out = folder.parent / "built"
    assert invoke("--lab", folder, "--team", "7", "build", "--out", out).exit_code == 0
    return max(out.glob("T7_*.usda"))


def of_another(stage: Path, team: str) -> Path:
    """Hand in the stage of one team under the name of another one."""
    copy = stage.with_name(stage.name.replace("T7", team))
    shutil.copyfile(stage, copy)
    return copy


def values(lab: Lab) -> list[object]:
    """Domain and topic of the drive graph, and the domain of the system."""
    nodes = lab.graphs[DRIVE].nodes
    named = {s.port: s.value for node in nodes.values() for s in node.settings}
    return [named["inputs:domain_id"], named["inputs:topicName"], lab.ros.system.domain]


def test_without_a_team_the_values_are_those_of_the_first_one(folder: Path) -> None:
    assert values(load_lab(folder)) == [1, "/t01/cmd_vel", 1]


def test_a_team_alone_is_a_number_and_a_text_within_a_text(folder: Path) -> None:
    assert values(load_lab(folder, "07")) == [7, "/t07/cmd_vel", 7]


def test_a_lab_without_such_values_is_the_same_for_each_team(tmp_path: Path) -> None:
    lab = load_lab(copied(tmp_path / "lab"))
    assert lab_of_team(lab, [("any.usda", lab.first)]) is lab
    assert load_lab(lab.folder, "7") is lab


def test_the_stage_of_a_team_passes_by_its_name(folder: Path, last: Path) -> None:
    told = invoke("--lab", folder, "check", "--quiet", last)
    assert told.exit_code == 0, told.output


def test_values_of_another_team_are_found(folder: Path, last: Path) -> None:
    told = invoke("--lab", folder, "check", of_another(last, "T8"), "--select", "P01").output
    assert "inputs:topicName is '/t7/cmd_vel', expected '/t8/cmd_vel'" in told


def test_the_option_counts_in_place_of_the_name(folder: Path, last: Path) -> None:
    stage = of_another(last, "T8")
    assert invoke("--lab", folder, "--team", "7", "check", "--quiet", stage).exit_code == 0


def test_a_repair_writes_the_values_of_the_team(folder: Path, last: Path) -> None:
    stage = of_another(last, "T9")
    assert invoke("--lab", folder, "fix", "--in-place", "--no-orig", stage).exit_code == 0
    assert "/t9/cmd_vel" in stage.read_text()
    assert invoke("--lab", folder, "check", "--quiet", stage).exit_code == 0


def test_a_dry_run_commands_the_topic_of_the_team(folder: Path, last: Path) -> None:
    told = invoke("--lab", folder, "sim", last)
    assert told.exit_code == 0, told.output


def test_a_recording_is_judged_by_the_topic_of_the_team(
    folder: Path, last: Path, tmp_path: Path
) -> None:
    pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")
    invoke("--lab", folder, "sim", last, "--bag", tmp_path / last.stem)
    told = invoke("--lab", folder, "bag", tmp_path / last.stem)
    assert "ok  follows" in told.output
    assert told.exit_code == 0, told.output


def test_a_file_that_names_no_team_is_refused(folder: Path) -> None:
    lab = load_lab(folder)
    name = lab.files[lab.first].replace("T{team}_", "")
    with pytest.raises(UnknownTeamError, match=r"names no team, as T01_.* does; lab3 --team N"):
        lab_of_team(lab, [(f"{name}.usda", lab.first)])


def test_a_team_that_cannot_be_the_value_is_refused(folder: Path) -> None:
    lab = load_lab(folder)
    name = lab.files[lab.first].replace("{team}", "red")
    with pytest.raises(UnknownTeamError, match=r"no values for the team red: .*domain_id is 'red'"):
        lab_of_team(lab, [(f"{name}.usda", lab.first)])


def test_a_team_is_letters_and_digits() -> None:
    with pytest.raises(UsageError, match="expected letters and digits"):
        invoke("--team", "7/8", "rules")


@pytest.mark.parametrize(
    ("team", "status", "earned"),
    [("7", "graded", 5.0), ("8", "graded", 4.3), ("red", "unreadable", 0)],
)
def test_a_submission_is_graded_by_the_team_of_its_names(
    folder: Path, last: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    team: str, status: str, earned: float,
) -> None:  # fmt: skip
    monkeypatch.setenv(LAB_VARIABLE, str(folder))
    work, scratch = tmp_path / "ann" / "work", tmp_path / "scratch"
    work.mkdir(parents=True)
    scratch.mkdir()
    shutil.copyfile(last, work / last.name.replace("T7", f"T{team}"))
    setup = load_setup(PoolSettings(None, None, Limits()))
    task = Task("ann", "ann", (Source(work.parent),))
    graded = grade_submission(setup, task, scratch, lambda _name: None)
    assert (graded["status"], graded["earned"]) == (status, earned)
    assert graded.get("team", "") == (team if status == "graded" else "")


@pytest.mark.parametrize(
    ("student", "status", "earned"),
    [("team_7", "graded", 5.0), ("Group 8", "graded", 4.3), ("steam7", "unreadable", 0)],
)
def test_where_names_of_files_say_no_team_that_of_the_folder_does(
    folder: Path, last: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    student: str, status: str, earned: float,
) -> None:  # fmt: skip
    lab = shutil.copytree(folder, tmp_path / "lab")
    points = lab / "checkpoints.yaml"
    points.write_text(points.read_text().replace("T{team}_", ""))
    monkeypatch.setenv(LAB_VARIABLE, str(lab))
    work, scratch = tmp_path / student / "work", tmp_path / "scratch"
    work.mkdir(parents=True)
    scratch.mkdir()
    shutil.copyfile(last, work / last.name.replace("T7_", ""))
    setup = load_setup(PoolSettings(None, None, Limits()))
    task = Task(student, student, (Source(work.parent),))
    graded = grade_submission(setup, task, scratch, lambda _name: None)
    assert (graded["status"], graded["earned"]) == (status, earned)
    assert "LAB3_TEAM" not in os.environ


def test_values_that_only_the_option_can_give_are_said(folder: Path, tmp_path: Path) -> None:
    lab = shutil.copytree(folder, tmp_path / "lab")
    points = lab / "checkpoints.yaml"
    points.write_text(points.read_text().replace("T{team}_", ""))
    (told,) = team_faults(load_lab(lab))
    assert str(told).startswith("checkpoints.yaml: files: no {team}, so that only --team and")
    assert not [*team_faults(load_lab(folder))]


def test_the_environment_is_as_before_after_a_call(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAB3_TEAM", "5")
    monkeypatch.setenv(LAB_VARIABLE, str(folder))
    assert values(load_lab()) == [5, "/t5/cmd_vel", 5]
    invoke("--team", "6", "rules")
    assert values(load_lab()) == [5, "/t5/cmd_vel", 5]
