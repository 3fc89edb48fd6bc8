"""Every command where pipes are cp1252 and nothing is there that only POSIX has."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import windows_like

from lab3_usd.commands.table import all_commands
from lab3_usd.stage.write.builder import build_checkpoint

STAGE = "work/Lab3_05_odometry_tf.usda"
BEFORE = "work/Lab3_01_ros_clock.usda"
# In this order: what one writes another reads.
CALLS = {
    "starter": ["starter", "-o", "Łódź starter.usda"],
    "build": ["build", "--out", "built", "--only", "00"],
    "check": ["check", "work"],
    "fix": ["fix", STAGE],
    "sim": ["sim", STAGE, "--bag", "bag", "--drive", "0.15,0,0.6 0,0.8,0.3"],
    "bag": ["bag", "bag", "--checkpoint", "05"],
    "add": ["add", "publisher", STAGE],
    "remove": ["remove", "clock", STAGE],
    "robots": ["robots", STAGE],
    "draw": ["draw", STAGE, "-o", "pictures"],
    "tf": ["tf", STAGE],
    "topics": ["topics", STAGE],
    "diff": ["diff", STAGE, STAGE],
    "map": ["map", STAGE, "-o", "map"],
    "nav2": ["nav2", "-o", "nav2"],
    "collect": ["collect", "-o", "Łódź.sh"],
    "record": ["record", "-o", "Łódź.py"],
    "grade": ["grade", "work", "--starter", "Łódź starter.usda", "-o", "book"],
    "lab": ["lab", "check"],
    "demo": ["demo", "demo"],
    "lint": ["lint", STAGE],
    "server": ["server", "--help"],
    "rules": ["rules"],
    "rule": ["rule", "W01"],
    "config": ["config", STAGE],
    "doctor": ["doctor"],
    "completion": ["completion", "bash"],
}
NAMED = ("starter", "check", "fix", "draw", "map", "nav2", "collect", "record", "lint")


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str]]:
    """What each command answered, in one process, in a folder with letters that cp1252 lacks."""
    folder = tmp_path_factory.mktemp("windows") / "Łódź"
    for name in (BEFORE, STAGE):
        build_checkpoint(None, Path(name).name[5:7], folder / name)
    calls = {
        name: [
            str(folder / word) if word.startswith("work") and name in NAMED else word
            for word in words
        ]
        for name, words in CALLS.items()
    }
    environment = windows_like.site_folder(tmp_path_factory.mktemp("site"))
    done = subprocess.run(
        [sys.executable, windows_like.__file__, json.dumps(calls)],
        cwd=folder, env=environment, capture_output=True, check=True, timeout=110,
    )  # fmt: skip
    told: dict[str, tuple[int, str]] = json.loads(done.stdout)
    return told


@pytest.mark.parametrize("command", list(all_commands()))
def test_every_command_works(answers: dict[str, tuple[int, str]], command: str) -> None:
    status, text = answers[command]
    assert (status, "internal error" in text) == (0, False), text


@pytest.mark.parametrize("command", ["starter", "check", "record", "lint", "tf"])
def test_what_it_prints_is_utf8(answers: dict[str, tuple[int, str]], command: str) -> None:
    letters = "└" if command == "tf" else "Łódź"
    assert letters in answers[command][1]
