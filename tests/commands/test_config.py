"""Configuration files: where they are found, what they say, what they never decide."""

from __future__ import annotations

import json
import os
import shutil
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from breaking import Step, broken, correct_stage
from in_process import invoke as lab3
from report_examples import assert_valid

from lab3_usd.commands.config import _DEFAULTS
from lab3_usd.config.lookup import find_file
from lab3_usd.config.settings import _KEYS, Config, config_for, load_config, reading_for
from lab3_usd.data import LAB_VARIABLE, data_folder
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.stage.write.starter import build_starter

DRIVE = "ROS_Drive/differential_controller.inputs:wheelRadius"
STEPS: list[Step] = [
    {"set": [DRIVE, 0.033]},
    {"disconnect": "ROS_Clock/ros2_publish_clock.inputs:execIn"},
]


@pytest.fixture
def wrong(tmp_path: Path) -> Path:
    """A stage in a folder of its own with two faults: P01 and W01."""
    path = tmp_path / "course" / "work" / "Lab3_02_ros_drive.usda"
    path.parent.mkdir(parents=True)
    broken("02", STEPS).GetRootLayer().Export(str(path))
    return path


def report(*arguments: Path | str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(lab3("check", "--format", "json", *arguments).stdout)
    assert_valid(document)
    return document


def found(*arguments: Path | str) -> set[tuple[str, str]]:
    return {
        (each["rule"], each["severity"])
        for result in report(*arguments)["results"]
        for each in result["findings"]
    }


def set_up(folder: Path, text: str, name: str = "lab3.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


# ---- where it is found


def test_without_a_file_nothing_is_configured(wrong: Path) -> None:
    assert config_for([str(wrong)]) == Config()
    assert found(wrong) == {("P01", "error"), ("W01", "error")}


def test_a_file_above_the_stage_is_in_force(wrong: Path) -> None:
    set_up(wrong.parents[1], 'ignore = ["W01"]')
    assert found(wrong) == {("P01", "error")}


def test_the_nearest_file_is_in_force_alone(wrong: Path) -> None:
    set_up(wrong.parents[1], 'ignore = ["W01"]')
    near = set_up(wrong.parent, 'ignore = ["P"]')
    assert find_file(wrong) == near
    assert found(wrong) == {("W01", "error")}


def test_a_table_of_pyproject_is_in_force(wrong: Path) -> None:
    set_up(wrong.parent, '[tool.lab3]\nignore = ["W01"]\n', "pyproject.toml")
    assert found(wrong) == {("P01", "error")}


@pytest.mark.parametrize("text", ["[tool.ruff]\n", "# tool lab3\n", "name = 'lab3 tool'\n"])
def test_a_pyproject_without_the_table_is_passed_over(wrong: Path, text: str) -> None:
    above = set_up(wrong.parents[1], 'ignore = ["W01"]')
    set_up(wrong.parent, text, "pyproject.toml")
    assert find_file(wrong) == above


def test_an_own_file_counts_before_pyproject(wrong: Path) -> None:
    set_up(wrong.parent, "[tool.lab3]\n", "pyproject.toml")
    own = set_up(wrong.parent, "")
    assert find_file(wrong) == own


def test_several_configurations_in_one_call_are_wrong_use(wrong: Path) -> None:
    other = wrong.parents[1] / "other" / wrong.name
    other.parent.mkdir()
    shutil.copy(wrong, other)
    set_up(other.parent, 'ignore = ["W01"]')
    with pytest.raises(UsageError, match="--config"):
        config_for([str(wrong), str(other)])
    chosen = set_up(wrong.parents[1], 'ignore = ["P01"]', "other.toml")
    assert found("--config", chosen, wrong, other) == {("W01", "error")}


def test_a_hidden_file_counts_before_an_open_one(wrong: Path) -> None:
    (wrong.parent / "lab3.toml").write_text('ignore = ["P"]')
    (wrong.parent / ".lab3.toml").write_text('ignore = ["W"]')
    assert found(wrong) == {("P01", "error")}


@pytest.mark.parametrize(
    ("key", "pattern", "command"),
    [
        ("exclude", "spoilt", ("check",)),
        ("exclude", "Lab3_02*spoilt.usda", ("check",)),
        ("exclude", "work/spoilt/*", ("check",)),
        ("extend-exclude", "spoilt", ("check",)),
        ("exclude", "spoilt", ("lint",)),
        ("exclude", "spoilt", ("fix", "--in-place")),
    ],
)
def test_what_is_excluded_is_passed_over_in_folders(
    wrong: Path, key: str, pattern: str, command: tuple[str, ...]
) -> None:
    folder = wrong.parent / "spoilt"
    folder.mkdir()
    spoilt = folder / "Lab3_02_ros_drive_spoilt.usda"
    spoilt.write_text("no stage")
    (wrong.parents[1] / "lab3.toml").write_text(f'{key} = ["{pattern}"]')
    result = lab3(*command, wrong.parent)
    assert "spoilt" not in result.output
    with pytest.raises(Lab3Error) if command[0] == "fix" else nullcontext():
        assert "spoilt" in lab3(*command, spoilt).output


@pytest.mark.parametrize("command", ["check", "lint"])
def test_what_is_excluded_is_passed_over_where_it_is_named_if_asked(
    wrong: Path, command: str
) -> None:
    spoilt = wrong.with_name("Lab3_02_ros_drive_spoilt.usda")
    spoilt.write_text("no stage")
    (wrong.parents[1] / "lab3.toml").write_text('exclude = ["*spoilt*"]')
    both = lab3(command, "--force-exclude", "--format", "concise", spoilt, wrong)
    assert "spoilt" not in both.output
    assert (wrong.name in both.output, both.exit_code) == (True, 1)
    for more in ([], ["--fix"] if command == "lint" else ["--format", "json"]):
        assert lab3(command, "--force-exclude", *more, spoilt).exit_code == 0


def test_isolated_uses_none(wrong: Path) -> None:
    set_up(wrong.parent, 'ignore = ["W01"]')
    assert found("--isolated", wrong) == {("P01", "error"), ("W01", "error")}


# ---- what it says


def test_the_command_line_counts_before_the_file(wrong: Path) -> None:
    set_up(wrong.parent, 'select = ["W01"]')
    assert found(wrong) == {("W01", "error")}
    assert found("--select", "P", wrong) == {("P01", "error")}


@pytest.mark.parametrize("pattern", ["Lab3_02*", "work/*.usda"])
def test_rules_are_ignored_in_files_that_a_pattern_names(wrong: Path, pattern: str) -> None:
    set_up(wrong.parents[1], f'[per-file-ignores]\n"{pattern}" = ["W01"]\n"*_03_*" = ["P"]')
    assert found(wrong) == {("P01", "error")}


def test_a_severity_decides_the_verdict(wrong: Path) -> None:
    set_up(wrong.parent, '[severity]\nW01 = "note"\nP01 = "warning"')
    document = report(wrong)
    assert found(wrong) == {("P01", "warning"), ("W01", "note")}
    assert document["results"][0]["verdict"] == "pass"
    assert lab3("check", wrong).exit_code == 0
    assert lab3("check", "--fail-on", "warning", wrong).exit_code == 1


def test_a_rule_counts_before_its_family(wrong: Path) -> None:
    set_up(wrong.parent, '[severity]\nP01 = "warning"\nP = "note"\nW = "note"')
    assert found(wrong) == {("P01", "warning"), ("W01", "note")}


def test_that_a_file_cannot_be_read_is_never_ignored(wrong: Path) -> None:
    wrong.write_text("#usda 1.0\nnonsense")
    set_up(
        wrong.parent, 'ignore = ["F"]\n[severity]\nF01 = "note"\n[per-file-ignores]\n"*" = ["F"]'
    )
    assert found(wrong) == {("F01", "error")}


def test_a_pattern_gives_the_checkpoint(wrong: Path) -> None:
    other = wrong.rename(wrong.with_name("drive.usda"))
    set_up(wrong.parent, '[checkpoints]\n"drive*" = "02"')
    assert report(other)["results"][0]["checkpoint"] == "02"
    set_up(wrong.parent, '[checkpoints]\n"drive*" = "77"')
    with pytest.raises(UsageError, match="there is no checkpoint '77'"):
        lab3("check", other)


def test_the_checkpoint_of_the_command_line_counts_before_that_of_a_pattern(wrong: Path) -> None:
    set_up(wrong.parent, '[checkpoints]\n"Lab3*" = "03"')
    assert report(wrong)["results"][0]["checkpoint"] == "03"
    assert report(wrong, "--checkpoint", "01")["results"][0]["checkpoint"] == "01"


def test_the_starter_is_found_from_the_file(wrong: Path) -> None:
    set_up(wrong.parent, 'starter = "starter.usda"')
    build_starter(wrong.parent / "starter.usda")
    stage = broken("02", STEPS)
    stage.RemovePrim("/Environment/Walls")
    stage.GetRootLayer().Export(str(wrong))
    assert ("U01", "error") in found(wrong)


def test_the_lab_is_that_of_the_file_for_this_call(wrong: Path) -> None:
    shutil.copytree(data_folder("graphs"), wrong.parent / "lab")
    scene = wrong.parent / "lab" / "ROS_Drive.yaml"
    scene.write_text(scene.read_text().replace("0.025", "0.033"))
    set_up(wrong.parent, 'lab = "lab"')
    assert found(wrong) == {("W01", "error")}
    assert LAB_VARIABLE not in os.environ
    assert lab3("topics", wrong).exit_code == 0


def test_the_environment_counts_before_the_lab_of_the_file(
    wrong: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (wrong.parent / "lab").mkdir()
    set_up(wrong.parent, 'lab = "lab"')
    monkeypatch.setenv(LAB_VARIABLE, str(data_folder("graphs")))
    assert found(wrong) == {("P01", "error"), ("W01", "error")}
    assert "(--lab or LAB3_LAB)" in lab3("config", wrong).stdout


def linted(path: Path) -> set[str]:
    document = json.loads(lab3("lint", "--format", "json", path).stdout)
    return {each["rule"] for result in document["results"] for each in result["findings"]}


def test_lint_is_configured_as_check_is(wrong: Path) -> None:
    before = linted(wrong)
    set_up(wrong.parent, f'ignore = ["{min(before)}"]')
    assert linted(wrong) == before - {min(before)}


@pytest.mark.parametrize("name", ["K64", "wheel-size"])
def test_a_parameter_of_a_rule_decides_what_it_finds(tmp_path: Path, name: str) -> None:
    stage = tmp_path / "drive.usda"  # the radius of the handout is not that of its wheels
    correct_stage("02").GetRootLayer().Export(str(stage))
    assert "K64" in linted(stage)
    set_up(tmp_path, f"[parameters.{name}]\ntolerance = 0.5")
    assert "K64" not in linted(stage)


def shown(tmp_path: Path, stage: Path) -> tuple[bool, bool]:
    """Whether the dry run names K64 as the reason, and the picture of the drive has a warning."""
    played = lab3("sim", stage, "--color", "never").stdout
    drawn = lab3("draw", "--lint", stage, "-o", tmp_path / "pictures", "--force")
    assert drawn.exit_code == 0
    picture = (tmp_path / "pictures" / "wide-ROS_Drive.svg").read_text(encoding="utf-8")
    assert "turned 300.0, expected 121.0" in played
    return "(lab3 rule K64)" in played, "with a warning" in picture


def test_what_is_drawn_and_played_is_judged_with_the_parameters_of_lint(tmp_path: Path) -> None:
    stage = tmp_path / "wide.usda"
    correct_stage("02").GetRootLayer().Export(str(stage))
    text = stage.read_text(encoding="utf-8")
    stage.write_text(text.replace("wheelDistance = 0.16", "wheelDistance = 0.4"), encoding="utf-8")
    assert shown(tmp_path, stage) == (True, True)
    set_up(tmp_path, "[parameters.K64]\ntolerance = 0.9")
    assert shown(tmp_path, stage) == (False, False)


def test_parameters_of_custom_rules_that_are_not_loaded_are_left_out(tmp_path: Path) -> None:
    own, known = "[parameters.O01]\nlimit = 1", "[parameters.K64]\ntolerance = 0.9"
    set_up(tmp_path, f'rules = ["own.py"]\n{own}\n{known}')
    assert reading_for(tmp_path / "a.usda").parameters == ((("K64", "tolerance"), 0.9),)


# ---- what is wrong with it

WRONG = {
    "an unknown key": ('selct = ["W"]', "there is no key 'selct'; did you mean 'select'?"),
    "a key like no other": ("qqqq = 1", "known are rules, select"),
    "no TOML": ("select = [", "is not TOML"),
    "an unknown rule": ('ignore = ["W99"]', "ignore: there is no rule or family 'W99'"),
    "a misspelt parameter": (
        "[parameters.K64]\ntolerence = 0.1",
        "parameters: K64 has no parameter 'tolerence'; did you mean 'tolerance'?",
    ),
    "a parameter of a rule without any": ("[parameters.W01]\na = 1", "W01 has no parameters; K64,"),
    "a parameter of no rule": ("[parameters.K640]\na = 1", "'K640'; did you mean 'K64'"),
    "a tolerance of nothing": (
        "[parameters.K64]\ntolerance = 0",
        "is 0, expected a number above 0",
    ),
    "rules that are no list": ("rules = 3", "rules is 3, expected a list"),
    "no list": ('ignore = "W01"', "ignore is 'W01', expected a list"),
    "a severity that there is not": ('[severity]\nW01 = "off"', "expected one of error, warning"),
    "no table": ("severity = 1", "severity is 1, expected a table"),
    "a checkpoint that is a number": ('[checkpoints]\n"a" = 2', "expected a checkpoint in quotes"),
    "a path to nothing": ('starter = "nowhere.usd"', "starter: there is no "),
    "a path that is none": ("maps = 3", "maps is 3, expected a path"),
}


@pytest.mark.parametrize(("text", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_file_is_named_with_what_is_wrong(wrong: Path, text: str, said: str) -> None:
    path = set_up(wrong.parent, text)
    for read in (lambda: config_for([str(wrong)]), lambda: load_config(path)):
        with pytest.raises(UsageError) as error:
            read()
        assert str(error.value).startswith(str(path))
        assert said in str(error.value)
        line, column = map(int, str(error.value).rpartition(f", at {path}:")[2].split(":"))
        assert column <= len(path.read_text().splitlines()[line - 1]) + 1


def test_a_wrong_rule_is_said_with_its_place(wrong: Path) -> None:
    path = set_up(wrong.parent, 'ignore = ["W01"]\n[severity]\nP01 = "note"\nP99 = "note"\n')
    with pytest.raises(UsageError) as error:
        load_config(path)
    assert str(error.value).endswith(f", at {path}:4:1")


def test_a_file_without_the_table_cannot_be_chosen(tmp_path: Path) -> None:
    path = set_up(tmp_path, "[tool.ruff]", "pyproject.toml")
    with pytest.raises(UsageError, match="has no table"):
        load_config(path)
    with pytest.raises(UsageError, match="cannot be read"):
        load_config(tmp_path / "nowhere.toml")


# ---- what is told of it


def test_config_prints_every_key_with_its_source(wrong: Path) -> None:
    path = set_up(wrong.parent, 'ignore = ["W01"]\n[severity]\nP = "note"')
    printed = lab3("config", wrong).stdout.splitlines()
    assert printed[0] == f"configuration: {path}"
    assert [line.split()[0] for line in printed[1:]] == list(_KEYS) == list(_DEFAULTS)
    sources = {line.split()[0]: line.rpartition("(")[2][:-1] for line in printed[1:]}
    assert {key for key, source in sources.items() if source == str(path)} == {"ignore", "severity"}
    assert "configuration: none" in lab3("config", "--isolated", wrong).stdout


# ---- where it never counts


@pytest.mark.usefixtures("forked_workers")
def test_grading_heeds_no_file_of_a_submission(tmp_path: Path) -> None:
    work = tmp_path / "class" / "ana" / "work"
    work.mkdir(parents=True)
    broken("02", STEPS).GetRootLayer().Export(str(work / "Lab3_02_ros_drive.usda"))
    correct_stage("01").GetRootLayer().Export(str(work / "Lab3_01_ros_clock.usda"))
    for folder in (tmp_path / "class", work.parent, work):
        set_up(folder, 'ignore = ["W01", "P01"]\n[severity]\nP = "note"\n')
    starter = tmp_path / "starter.usda"
    build_starter(starter)
    grade_class(ClassSettings(tmp_path / "class", starter, tmp_path / "book", jobs=1))
    graded = json.loads((tmp_path / "book" / "students" / "ana" / "report.json").read_text())
    told = {each["rule"] for result in graded["results"] for each in result["findings"]}
    assert {"P01", "W01"} <= told


def test_a_path_that_is_not_there_has_no_configuration(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no such file or folder"):
        lab3("config", tmp_path / "gone")
