"""The rules are imported while the first stage opens; what fails there is told all the same."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from breaking import correct_stage

from lab3_usd.commands.shared import judging
from lab3_usd.commands.shared.judging import AFTER_OPENING
from lab3_usd.errors import EXIT_CRASH
from lab3_usd.report.formats.registry import FORMATS, module_of
from lab3_usd.stage.read.opening import open_stage, opener

SECONDS = 20.0
UNKNOWN = "lab3_usd.no_such_module"
RULES = "lab3_usd.check.rules.files"
CHECKERS = ("lab3_usd.check.checker", "lab3_usd.check.lint")


def saved(folder: Path) -> Path:
    path = folder / "Lab3_01.usda"
    correct_stage("01").GetRootLayer().Export(str(path))
    return path


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return saved(tmp_path)


@pytest.fixture
def imported(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Keep the names of the modules that would have been imported, and import none."""
    names: list[str] = []
    monkeypatch.setattr(judging.importlib, "import_module", names.append)
    return names


def run(script: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_modules_are_imported_while_a_stage_opens(
    monkeypatch: pytest.MonkeyPatch, stage: Path
) -> None:
    begun, imported = threading.Event(), threading.Event()

    def load(_module: str) -> None:
        if begun.wait(SECONDS):
            imported.set()

    def open_slowly(path: Path) -> Any:
        begun.set()
        assert imported.wait(SECONDS)
        raise FileNotFoundError(path)

    monkeypatch.setattr(judging.importlib, "import_module", load)
    token = opener.set(open_slowly)
    try:
        with judging.imported_while_opening(UNKNOWN), pytest.raises(FileNotFoundError):
            open_stage(stage)
    finally:
        opener.reset(token)


def test_nothing_is_imported_where_no_stage_is_opened(imported: list[str]) -> None:
    with judging.imported_while_opening(UNKNOWN):
        pass
    assert not imported


def test_a_second_stage_starts_no_second_thread(stage: Path, imported: list[str]) -> None:
    with judging.imported_while_opening(UNKNOWN):
        assert open_stage(stage)
        assert open_stage(stage)
    assert imported == [UNKNOWN]


def test_a_stage_that_is_open_waits_for_what_is_imported(
    monkeypatch: pytest.MonkeyPatch, stage: Path
) -> None:
    monkeypatch.setattr(judging.importlib, "import_module", lambda _module: time.sleep(0.2))
    before = threading.active_count()
    with judging.imported_while_opening(UNKNOWN):
        open_stage(stage)
        assert threading.active_count() == before


@pytest.fixture(scope="module", params=["check", "lint"])
def by_another_thread(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, bool]:
    """Whether another thread imported each module that is there after a command."""
    done = run(
        """
import json, sys, threading
from click.testing import CliRunner
from lab3_usd.cli import lab3

class Finder:
    def find_spec(self, name, path=None, target=None):
        threads[name] = threading.current_thread()

threads, main = {}, threading.main_thread()
sys.meta_path.insert(0, Finder())
done = CliRunner().invoke(lab3, sys.argv[1:], catch_exceptions=False)
assert done.exit_code in {0, 1}
print(json.dumps({name: threads.get(name, main) is not main for name in sys.modules}))
""",
        request.param,
        saved(tmp_path_factory.mktemp("stage")),
    )
    found: dict[str, bool] = json.loads(done.stdout)
    return found


def test_a_command_has_its_rules_imported_by_another_thread(
    by_another_thread: dict[str, bool],
) -> None:
    assert by_another_thread[RULES]


def test_a_command_without_a_configuration_imports_no_toml(
    by_another_thread: dict[str, bool],
) -> None:
    assert {"tomllib", "tomli"}.isdisjoint(by_another_thread)


@pytest.mark.parametrize("command", ["check", "lint"])
def test_rules_that_cannot_be_imported_are_never_a_pass(command: str, stage: Path) -> None:
    start = (
        f"import sys; sys.modules[{RULES!r}] = None; from lab3_usd.__main__ import start; start()"
    )
    done = run(start, command, stage)
    assert done.returncode == EXIT_CRASH
    assert RULES in done.stdout + done.stderr


def test_what_is_imported_beside_an_opening_stage_imports_no_more_of_usd_core() -> None:
    """Two threads that import its compiled modules could wait for each other."""
    formats = (module_of(name) for name in FORMATS)
    done = run(
        """
import importlib, sys
import lab3_usd.stage.read.opening
before = {*sys.modules}
for name in sys.argv[1:]:
    importlib.import_module(name)
print(sorted(name for name in {*sys.modules} - before if name.startswith("pxr")))
""",
        *CHECKERS,
        *AFTER_OPENING,
        *formats,
    )
    assert done.stdout.strip() == "[]", done.stderr
