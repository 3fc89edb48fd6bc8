"""The core builds, checks, lints and repairs stages without any feature."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

from places import REPOSITORY

from lab3_usd import features

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
        if "lab3_usd.commands.check" in each.get("source_modules", ())
    )


def test_the_commands_of_the_core_load_no_feature(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    loaded = {f"{name}." for name in done.stdout.split() if name.startswith("lab3_usd.")}
    packages = tuple(f"{name}." for name in feature_packages())
    assert "lab3_usd.fix.repairing." in loaded
    assert [name for name in sorted(loaded) if name.startswith(packages)] == []


def test_each_function_of_a_feature_is_where_the_core_looks_for_it() -> None:
    tree = ast.parse(Path(features.__file__).read_text(encoding="utf-8"))
    typed = {
        name.name: node.module
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    looked_for = {name: getattr(features, name).__module__ for name in features.__all__}
    assert looked_for == typed
