"""Tests replace parts of the program in few places, and in fewer from release to release."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from places import TESTS

MOST = 80  # lower it with each that goes; what a call can be given is better than a patch
PATCHES = {"setattr", "delattr", "setitem", "delitem", "object", "multiple"}


def patches(path: Path) -> Iterator[str]:
    """Yield what a test module patches of this program: by its name, or by a module's."""
    text = path.read_text(encoding="utf-8")
    if not any(f".{name}(" in text for name in PATCHES):
        return
    nodes = [*ast.walk(ast.parse(text))]
    ours = {
        alias.asname or alias.name
        for node in nodes
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lab3_usd")
        for alias in node.names
    }
    for node in nodes:
        is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        if is_call and node.func.attr in PATCHES and node.args:
            target = ast.unparse(node.args[0])
            if target.split(".")[0] in ours or "lab3_usd." in target:
                yield f"{path.name}:{node.lineno} {target}"


def test_the_program_is_patched_in_few_places() -> None:
    found = [each for path in sorted(TESTS.rglob("*.py")) for each in patches(path)]
    assert len(found) <= MOST, "\n".join(found)
