"""The rules are imported while the first stage opens; what fails there is told all the same."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from breaking import correct_stage

from lab3_usd.commands.shared import judging
from lab3_usd.commands.shared.judging import AFTER_OPENING
from lab3_usd.errors import EXIT_CRASH
from lab3_usd.report.formats.registry import all_formats
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


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], str]:
    """Return what writes a module that can be imported, and returns its name."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(name: str, text: str) -> str:
        (tmp_path / f"{name}.py").write_text(text)
        return name

    return write


def test_modules_are_imported_while_a_stage_opens(
    monkeypatch: pytest.MonkeyPatch, stage: Path, module: Callable[[str, str], str]
) -> None:
    begun, imported = threading.Event(), threading.Event()
    events = SimpleNamespace(begun=lambda: begun.wait(SECONDS), imported=imported)
    monkeypatch.setitem(sys.modules, "events_of_opening", events)
    waits = "import events_of_opening as on\nif on.begun():\n    on.imported.set()\n"
    name = module("waits_for_opening", waits)

    def open_slowly(path: Path) -> Any:
        begun.set()
        assert imported.wait(SECONDS)
        raise FileNotFoundError(path)

    token = opener.set(open_slowly)
    try:
        with judging.imported_while_opening(name), pytest.raises(FileNotFoundError):
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
    stage: Path, module: Callable[[str, str], str]
) -> None:
    name = module("slow_to_import", "import time\ntime.sleep(0.2)\n")
    before = threading.active_count()
    with judging.imported_while_opening(name):
        open_stage(stage)
        assert threading.active_count() == before


# Asks each question in a process of its own, forked where a stage can be opened and no rule is
# imported, and prints what each printed, both its streams together, and how it ended.
ASKED = """
import json, os, sys, tempfile, traceback
import click.testing
import lab3_usd.cli, lab3_usd.stage.read.opening
told = []
for code, *sys.argv[1:] in json.loads(sys.argv[1]):
    with tempfile.TemporaryFile() as file:
        child = os.fork()
        if not child:
            for stream in (1, 2):
                os.dup2(file.fileno(), stream)
            status = 0
            try:
                exec(code, {"__name__": "__main__"})
            except SystemExit as leaving:
                status = leaving.code or 0
            except BaseException:
                traceback.print_exc()
                status = 70
            sys.stdout.flush()
            os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        file.seek(0)
        told.append((file.read().decode(), status))
print(json.dumps(told))
"""
THREADS = """
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
"""
WITHOUT_RULES = (
    f"import sys; sys.modules[{RULES!r}] = None; from lab3_usd.__main__ import start; start()"
)
BESIDE = """
import importlib, sys
before = {*sys.modules}
for name in sys.argv[1:]:
    importlib.import_module(name)
print(sorted(name for name in {*sys.modules} - before if name.startswith("pxr")))
"""
JUDGED = """
import sys
import lab3_usd.pipeline.preloaded
from lab3_usd.pipeline.entries import Target, judge_target
from lab3_usd.pipeline.stage import JudgeSettings
before = {*sys.modules}
judge_target(JudgeSettings(checkpoint="01"), Target(sys.argv[1]))
print(sorted(name for name in {*sys.modules} - before if name.startswith("lab3_usd.check")))
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, int]]:
    """What was printed for each question, and the exit status."""
    path = str(saved(tmp_path_factory.mktemp("stage")))
    formats = [form.module for form in all_formats().values()]
    asked = {
        "threads of check": [THREADS, "check", path],
        "threads of lint": [THREADS, "lint", path],
        "check without rules": [WITHOUT_RULES, "check", path],
        "lint without rules": [WITHOUT_RULES, "lint", path],
        "beside": [BESIDE, *CHECKERS, *AFTER_OPENING, *formats],
        "judged": [JUDGED, path],
    }
    command = [sys.executable, "-c", ASKED, json.dumps([*asked.values()])]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(zip(asked, json.loads(done.stdout), strict=True))


@pytest.mark.parametrize("command", ["check", "lint"])
def test_a_command_has_its_rules_imported_by_another_thread_and_no_toml(
    answers: dict[str, tuple[str, int]], command: str
) -> None:
    """A command without a configuration reads no TOML."""
    by_another_thread = json.loads(answers[f"threads of {command}"][0])
    assert by_another_thread[RULES]
    assert {"tomllib", "tomli"}.isdisjoint(by_another_thread)


@pytest.mark.parametrize("command", ["check", "lint"])
def test_rules_that_cannot_be_imported_are_never_a_pass(
    answers: dict[str, tuple[str, int]], command: str
) -> None:
    said, status = answers[f"{command} without rules"]
    assert status == EXIT_CRASH
    assert RULES in said


def test_what_is_imported_beside_an_opening_stage_imports_no_more_of_usd_core(
    answers: dict[str, tuple[str, int]],
) -> None:
    """Two threads that import its compiled modules could wait for each other."""
    said, _ = answers["beside"]
    assert said.strip() == "[]"


def test_a_process_imports_no_rule_anew(answers: dict[str, tuple[str, int]]) -> None:
    """All that judges is imported once, before the processes are forked."""
    said, _ = answers["judged"]
    assert said.strip() == "[]"
