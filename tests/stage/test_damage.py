"""Damage that shows only where a command reads what the rules do not ask for."""

from __future__ import annotations

from pathlib import Path
from subprocess import CompletedProcess

import pytest
from grade_files import stage, starter
from in_process import lab3
from pxr import Tf

# What reads the stage in each command, and the exit code with which it says so.
COMMANDS = {
    "check --starter": ("lab3_usd.stage.compare.stages._changes", 1),
    "check --sim": ("lab3_usd.stage.read.scene.read_scene", 1),
    "check --native": ("lab3_usd.stage.read.native_validators.native_errors", 1),
    "lint --native": ("lab3_usd.stage.read.native_validators.native_errors", 1),
    "sim": ("lab3_usd.stage.read.scene.read_scene", 2),
    "diff": ("lab3_usd.diff.scene_changes", 2),
}


def damaged(*_: object) -> None:
    raise Tf.ErrorException("Failed verification: ' !propName.IsEmpty() '")


def run(command: str, path: Path) -> CompletedProcess[str]:
    with_starter = [starter()] if command in {"check --starter", "diff"} else []
    return lab3(*command.split(), *with_starter, path)


@pytest.mark.parametrize("command", COMMANDS)
def test_damage_is_told_of_the_file(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = stage("01")
    reader, exit_code = COMMANDS[command]
    monkeypatch.setattr(reader, damaged)
    result = run(command, path)
    output = result.stdout + result.stderr
    assert result.returncode == exit_code, output
    assert path.name in output
    assert "it is damaged or not USD" in output


@pytest.mark.parametrize("command", COMMANDS)
def test_without_damage_nothing_of_the_kind_is_said(command: str) -> None:
    result = run(command, stage("01"))
    output = result.stdout + result.stderr
    assert result.returncode in {0, 1}
    assert "damaged" not in output
