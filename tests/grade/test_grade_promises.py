"""The table of promises names tests that exist."""

from __future__ import annotations

import re
from functools import cache

from places import REPOSITORY

ROOT = REPOSITORY
PROMISES = ROOT / "SECURITY.md"
NAMED = re.compile(r"`(test_\w+\.py)::(test_\w+)`")


def rows() -> list[list[str]]:
    """The cells of every row of the tables of promises, headings left aside."""
    tables = PROMISES.read_text(encoding="utf-8").partition("## Sandbox layers")[0]
    lines = [line for line in tables.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row[0] != "promise" and set(row[0]) != {"-"}]


@cache
def names_in(name: str) -> set[str]:
    (path,) = (ROOT / "tests").rglob(name)
    return set(re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE))


def test_every_promise_names_a_test() -> None:
    found = rows()
    assert len(found) > 30
    assert [row for row in found if len(row) != 2 or not all(row)] == []
    assert [row[0] for row in found if not NAMED.search(row[1])] == []


def test_each_test_that_is_named_exists() -> None:
    named = sorted(set(NAMED.findall(PROMISES.read_text(encoding="utf-8"))))
    assert [(file, name) for file, name in named if name not in names_in(file)] == []
