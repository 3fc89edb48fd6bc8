"""A feature is taken out by deleting its folders, its tests, and its line in the list."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import REPOSITORY

from lab3_usd import hooks

SOURCE = Path("src/lab3_usd")
# What each consists of below the source, and what the help says no more.
FEATURES = {
    "collect": (("features/collect",), "  collect "),
    "bag": (("features/bag", "sim/bag"), "--bag"),
    "live": (("features/live",), "--live"),
}
IMPORT_ALL = """
import importlib, pathlib
for file in sorted(pathlib.Path("src/lab3_usd").rglob("*.py")):
    name = ".".join(file.relative_to("src").with_suffix("").parts).removesuffix(".__init__")
    if "plugins" not in file.parts and file.name != "__main__.py":
        importlib.import_module(name)
from lab3_usd.cli import lab3
for call in (["--help"], ["sim", "--help"]):
    lab3.main(call, prog_name="lab3", standalone_mode=False)
"""


def without(name: str, folder: Path) -> Path:
    """Return a copy of the repository without a feature."""
    copy = folder / "copy"
    passed_over = shutil.ignore_patterns("__pycache__", "*.pyc")
    for part in ("src", "graphs", "maps", "schema"):
        shutil.copytree(REPOSITORY / part, copy / part, ignore=passed_over)
    shutil.copy(REPOSITORY / "pyproject.toml", copy)
    assert (REPOSITORY / "tests" / name).is_dir()
    for part in FEATURES[name][0]:
        shutil.rmtree(copy / SOURCE / part)
    registry = copy / SOURCE / "hooks.py"
    text, count = re.subn(rf'^    "{name}",\n', "", registry.read_text(), flags=re.MULTILINE)
    assert count == 1
    registry.write_text(text)
    return copy


def run_in(copy: Path, *command: str) -> str:
    """Run a command with the package of the copy, and return what it prints."""
    done = subprocess.run(
        command,
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy / "src")},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("name", FEATURES)
def test_the_rest_stands_without_a_feature(name: str, tmp_path: Path) -> None:
    said = FEATURES[name][1]
    help_of_all = "".join(run_in(REPOSITORY, *call) for call in HELP)
    assert said in help_of_all
    copy = without(name, tmp_path)
    assert said not in run_in(copy, sys.executable, "-c", IMPORT_ALL)
    run_in(copy, str(Path(sys.executable).with_name("lint-imports")), "--no-cache")


HELP = [(sys.executable, "-m", "lab3_usd", *words) for words in (("--help",), ("sim", "--help"))]


def test_each_feature_is_listed() -> None:
    folders = {
        path.parent.name for path in (REPOSITORY / SOURCE / "features").glob("*/__init__.py")
    }
    assert {*hooks.FEATURES} == folders
