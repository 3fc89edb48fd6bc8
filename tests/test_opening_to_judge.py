"""Opening the first stage: rules are imported at the same time, and what fails is still told."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from breaking import correct_stage

from lab3_usd.errors import StageError
from lab3_usd.judge import opening
from lab3_usd.stage.read.opening import opener

SECONDS = 20.0
UNKNOWN = "lab3_usd.no_such_module"


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    path = tmp_path / "Lab3_01.usda"
    correct_stage("01").GetRootLayer().Export(str(path))
    return path


def test_a_module_is_imported_while_the_stage_opens(
    monkeypatch: pytest.MonkeyPatch, stage: Path
) -> None:
    begun, imported = threading.Event(), threading.Event()

    def load(_module: str) -> None:
        if begun.wait(SECONDS):
            imported.set()

    def open_slowly(_path: Path) -> Any:
        begun.set()
        assert imported.wait(SECONDS)
        raise FileNotFoundError

    monkeypatch.setattr(opening.importlib, "import_module", load)
    token = opener.set(open_slowly)
    try:
        with pytest.raises(FileNotFoundError):
            opening.open_while_importing(UNKNOWN, stage)
    finally:
        opener.reset(token)


def test_what_is_imported_already_takes_no_thread(
    monkeypatch: pytest.MonkeyPatch, stage: Path
) -> None:
    monkeypatch.setattr(opening, "Thread", None)
    assert opening.open_while_importing("sys", stage)


def test_a_module_that_fails_is_left_to_who_needs_it(stage: Path) -> None:
    assert opening.open_while_importing(UNKNOWN, stage)


def test_a_file_that_cannot_be_opened_is_said_and_no_thread_is_left(tmp_path: Path) -> None:
    before = threading.active_count()
    with pytest.raises(StageError, match="no such file"):
        opening.open_while_importing(UNKNOWN, tmp_path / "none.usda")
    assert threading.active_count() == before


@pytest.mark.parametrize("judge", ["stage.check_stage", "lint.lint_stage"])
def test_a_rule_that_cannot_be_imported_is_never_a_pass(judge: str, stage: Path) -> None:
    module, function = judge.split(".")
    broken = "sys.modules['lab3_usd.check.rules.submission.files'] = None"
    script = f"""
import sys
from lab3_usd.judge.{module} import {function}
{broken}
{function}(sys.argv[1])
"""
    done = subprocess.run(
        [sys.executable, "-c", script, str(stage)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "lab3_usd.check.rules.submission.files" in done.stderr
