"""The core builds, checks, lints and repairs stages without any feature."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest
from places import REPOSITORY

from lab3_usd import hooks
from lab3_usd.errors import UsageError
from lab3_usd.spec.load.loader import load_lab

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CALLS = (
    "starter -o starter.usda",
    "build starter.usda --out work --only 02",
    "check work --starter starter.usda",
    "check work/Lab3_02_ros_drive.usda --format sarif",
    "lint work",
    "fix work/Lab3_02_ros_drive.usda --diff",
    "rule W01",
)
RUN = f"""
import sys
from lab3_usd.cli import lab3
for call in {CALLS}:
    try:
        lab3.main(call.split(), prog_name="lab3", standalone_mode=False)
    except SystemExit as leaving:
        assert not leaving.code, call
print(*sys.modules)
"""


def feature_packages() -> tuple[str, ...]:
    """Return what the core must not import, by the contract of import-linter."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    return next(
        tuple(each["forbidden_modules"])
        for each in contracts
        if "lab3_usd.commands" in each.get("source_modules", ())
    )


def test_the_commands_of_the_core_load_no_feature(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    loaded = {f"{name}." for name in done.stdout.split() if name.startswith("lab3_usd.")}
    packages = tuple(f"{name}." for name in feature_packages())
    assert "lab3_usd.fix.repairing." in loaded
    assert [name for name in sorted(loaded) if name.startswith(packages)] == []


@pytest.mark.parametrize("feature", [*hooks.features()], ids=hooks.FEATURES)
def test_a_feature_answers_a_question_as_the_core_asks_it(feature: hooks.Feature) -> None:
    for name, module in feature.answers.items():
        asked = inspect.signature(getattr(hooks, name)).parameters
        answered = inspect.signature(getattr(importlib.import_module(module), name)).parameters
        required = [each for each in answered.values() if each.default is each.empty]
        assert [each.name for each in required] == [*asked]


def test_what_no_feature_answers_is_refused_or_empty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hooks, "FEATURES", ())
    assert hooks.read_recordings(tmp_path, (), (load_lab(), "02"), lambda _: "") == ()
    with pytest.raises(UsageError, match="no feature for it"):
        hooks.unpacked_lab(tmp_path / "lab.zip")
