"""The table of promises names tests that exist."""

from __future__ import annotations

import ast
import re

import pytest
from places import REPOSITORY

ROOT = REPOSITORY
PROMISES = ROOT / "docs" / "promises.md"
NAMED = re.compile(r"`(test_\w+\.py)::(test_\w+)`")


def rows() -> list[list[str]]:
    """The cells of every row of every table, headings left aside."""
    lines = [line for line in PROMISES.read_text(encoding="utf-8").splitlines() if "|" in line]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row[0] != "guarantee" and set(row[0]) != {"-"}]


def names_in(name: str) -> set[str]:
    (path,) = (ROOT / "tests").rglob(name)
    tree = ast.parse(path.read_bytes())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_promise_says_what_holds_it_and_what_shows_it() -> None:
    found = rows()
    assert len(found) > 30
    assert [row for row in found if len(row) != 3 or not all(row)] == []
    assert [row[0] for row in found if not NAMED.search(row[2])] == []


@pytest.mark.parametrize(
    ("file", "name"), sorted(set(NAMED.findall(PROMISES.read_text(encoding="utf-8"))))
)
def test_a_test_that_is_named_exists(file: str, name: str) -> None:
    assert name in names_in(file)
