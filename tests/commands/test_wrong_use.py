"""What does not go together on a command line is refused in one line, before anything is read."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import invoke
from other_labs import stage

from lab3_usd.errors import Lab3Error

# `STAGE` is a stage of a checkpoint, `OTHER` another one, `EMPTY` a folder without any.
REFUSED = {
    "grade": "Missing argument 'SUBMISSIONS'",
    "grade -o book --feedback": "--feedback is for --gradebook PLATFORM with --roster FILE",
    "grade -o book --adjust STAGE": "--adjust goes with SUBMISSIONS or --regrade",
    "grade -o book --roster STAGE": "--gradebook and --roster go together",
    "grade EMPTY": "Missing option '--starter'",
    "grade EMPTY --starter EMPTY -o book": "empty: is a folder; name the stage in it",
    "grade EMPTY --starter nope.usd -o book": "nope.usd: there is no such file",
    "grade EMPTY --starter STAGE": "Missing option '--output'",
    "grade EMPTY --regrade rubric.yaml -o book": "reads a gradebook, and no submissions",
    "grade -o book --explain jane --format gradescope": "--explain is for a class",
    "grade -o book --gradebook nobody --roster STAGE": "nobody: is none of canvas",
    "grade -o book --gradebook canvas": "go together",
    "grade -o book --gradebook gradescope --roster STAGE": "Gradescope imports no points",
    "grade -o book --explain jane --scale": "--scale is for --gradebook",
    "grade -o book --explain jane --map STAGE": "--map is for --gradebook",
    "grade --regrade book --gradebook canvas --roster STAGE --preview": "--preview writes nothing",
    "fix EMPTY": "holds no stage and no script, nor does a folder in it",
    "fix .": "--lint repairs stages of any name",
    "fix STAGE --diff --in-place": "exclude each other",
    "fix STAGE --isaac 5.0": "--isaac goes with --lint",
    "fix STAGE OTHER -o fixed.usda": "--output goes with one stage",
    "fix STAGE -o fixed.usdc": "must end in .usda",
    "fix STAGE -o STAGE": "use --in-place",
    "sim STAGE --topic /cmd_vel": "commands have a topic",
}


@pytest.mark.parametrize("line", REFUSED)
def test_wrong_use_is_refused(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "robot.usda").write_text("#usda 1.0\n")
    paths = {"STAGE": stage("01"), "OTHER": stage("00"), "EMPTY": "empty"}
    before = stage("01").read_bytes()
    try:
        result = invoke(*(paths.get(word, word) for word in line.split()))
    except Lab3Error as error:
        said = str(error)
    else:
        said = result.output
        assert result.exit_code == 2
    assert REFUSED[line] in said
    assert stage("01").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "robot.usda"]
