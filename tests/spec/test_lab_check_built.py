"""`lab3 lab check`: what contradicts itself only in the stages that are built, where it stands."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from in_process import invoke
from places import REPOSITORY

from lab3_usd.errors import SpecError
from lab3_usd.spec.load.loader import load_lab

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
# By what is wrong: the file, what stands there and what instead, the rule or the words of the
# warning, and the text at the place that it names.
WRONG = {
    "a wheel radius unlike the tyres of the starter": (
        ("Drive.yaml", "wheelRadius: 0.03", "wheelRadius: 0.05"),
        "K64",
        "wheelRadius: 0.05",
    ),
    "a value of a sensor": (
        (
            "scene.yaml",
            'nearRangeM": {type: float, value: 0.1',
            'nearRangeM": {type: float, value: 50.0',
        ),
        "L09",
        '"omni:sensor:Core:nearRangeM"',
    ),
    "a prim that only the starter describes": (
        ("starter.yaml", "axis: Z, purpose: guide", "axis: X, purpose: guide"),
        "S13",
        "axis: X, purpose: guide",
    ),
    "an attribute that no schema has": (
        (
            "starter.yaml",
            '"inputs:intensity": 1500.0',
            '"inputs:intensty": {type: float, value: 3.0}',
        ),
        "'inputs:intensty' is not known, 'inputs:intensity' is",
        '"inputs:intensty"',
    ),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return shutil.copytree(JETBOT, tmp_path / "lab")


def edited(folder: Path, edit: tuple[str, str, str]) -> None:
    file, old, new = edit
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))


@pytest.mark.parametrize("case", WRONG)
def test_what_a_built_stage_shows_is_one_warning_at_its_place(case: str, folder: Path) -> None:
    edit, told, pointed = WRONG[case]
    edited(folder, edit)
    (line, _) = invoke("lab", "check", folder).output.splitlines()
    assert line.startswith("warning ")
    assert told in line
    file, number, column = line.rpartition(", at ")[2].rsplit(":", 2)
    text = Path(file).read_text().splitlines()[int(number) - 1][int(column) - 1 :]
    assert text.startswith(pointed), (line, text)


def test_findings_that_a_lab_accepts_are_left_out(folder: Path) -> None:
    edited(folder, WRONG["a wheel radius unlike the tyres of the starter"][0])
    edited(folder, ("checkpoints.yaml", "policy:\n", "policy:\n  accepts: [K64]\n"))
    assert invoke("lab", "check", folder).output == "Week 5: 0 errors, 0 warnings\n"


def test_an_earlier_stage_that_fails_by_its_own_lab_is_told(folder: Path) -> None:
    edited(
        folder,
        ("checkpoints.yaml", "adds: {graphs: [Drive]}", "adds: {graphs: [Drive], frames: true}"),
    )
    output = invoke("lab", "check", folder).output
    assert "later checkpoint publishes" in output or "built for checkpoint 3" in output


REFUSED = {
    "a unit of 0": (
        ("scene.yaml", "meters_per_unit: 1.0", "meters_per_unit: 0"),
        "a number above 0",
    ),
    "a scale of 0": (
        ("scene.yaml", "scale: [1.0, 1.0, 1.0], handout: D1", "scale: [0, 1.0, 1.0], handout: D1"),
        "lidar: pose: scale has a 0",
    ),
    "a type of a prim that is misspelt": (
        ("starter.yaml", "type: DistantLight", "type: DistantLigth"),
        "did you mean DistantLight?",
    ),
    "an attribute that is misspelt": (
        ("starter.yaml", '"inputs:intensity": 1500.0', '"inputs:intensty": 1500.0'),
        "did you mean inputs:intensity?",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused(case: str, folder: Path) -> None:
    edit, told = REFUSED[case]
    edited(folder, edit)
    with pytest.raises(SpecError) as refusal:
        invoke("lab", "check", folder)
    assert told in str(refusal.value)


def test_a_frame_that_is_its_own_parent_is_one_error_at_its_edge(folder: Path) -> None:
    edited(folder, ("checkpoints.yaml", "[odom -> chassis, ", "[odom -> odom, odom -> chassis, "))
    first, *rest = invoke("lab", "check", folder).output.splitlines()
    assert first.startswith(
        "error checkpoints.yaml: frames: edges: odom -> odom: 'odom' is its own"
    )
    assert len(rest) == 1


def test_every_topic_is_told_at_its_own_line(tmp_path: Path) -> None:
    folder = shutil.copytree(JETBOT.parent / "warehouse", tmp_path / "fleet")
    edited(
        folder,
        ("ros.yaml", "/r2/cmd_vel: {type: geometry_msgs/msg/Twist", "/r2/cmd_vel: {type: x/msg/Y"),
    )
    line = next(x for x in invoke("lab", "check", folder).output.splitlines() if "/r2/cmd_vel" in x)
    number = int(line.rpartition(", at ")[2].rsplit(":", 2)[1])
    assert (
        "/r2/cmd_vel: {type: x/msg/Y" in (folder / "ros.yaml").read_text().splitlines()[number - 1]
    )


def test_the_starter_of_a_lab_is_compared_by_a_section_of_its_own_handout(folder: Path) -> None:
    lab = load_lab(folder)
    assert lab.submission.starter.handout == lab.submission.stages.handout
