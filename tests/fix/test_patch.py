"""Patches of long files: they lead from what was to what is, as those of short ones do."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable
from difflib import unified_diff

import pytest

from lab3_usd.fix import patch as module
from lab3_usd.fix.patch import patch

LINES = [line for number in range(300) for line in ("{\n", f"    value = {number}\n", "}\n")]


@pytest.fixture(autouse=True)
def every_file_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_LONG", 0)


def applied(lines: list[str], patched: Iterable[str]) -> list[str]:
    """Return the lines after a patch, of which each old line must be as it says."""
    result: list[str] = []
    at = 0
    for line in [*patched][2:]:
        hunk = re.match(r"@@ -(\d+)(?:,(\d+))? ", line)
        if hunk:
            start = int(hunk[1]) - (hunk[2] != "0")
            result += lines[at:start]
            at = start
        elif line[0] == "+":
            result.append(line[1:])
        else:
            assert lines[at] == line[1:]
            result += [line[1:]] * (line[0] == " ")
            at += 1
    return result + lines[at:]


def test_values_that_differ_give_the_patch_of_the_whole_file() -> None:
    after = [line.replace("= 7\n", "= 8000\n").replace("= 250\n", "= 1\n") for line in LINES]
    expected = [*unified_diff(LINES, after, "a", "b")]
    assert [*patch(LINES, after, "a", "b")] == expected


@pytest.mark.parametrize("seed", range(30))
def test_a_patch_leads_to_what_is(seed: int) -> None:
    choice = random.Random(seed)  # noqa: S311 - no secret
    after = [*LINES]
    for _ in range(choice.randint(0, 9)):
        at, count = choice.randrange(len(after)), choice.randint(0, 5)
        after[at : at + count] = choice.choices([*LINES, "new\n"], k=choice.randint(0, 5))
    assert applied(LINES, patch(LINES, after, "a", "b")) == after


@pytest.mark.parametrize(("before", "after"), [([], ["a\n"]), (["a\n"], []), (["a"], ["a"])])
def test_an_end_is_that_of_a_short_file(before: list[str], after: list[str]) -> None:
    assert [*patch(before, after, "a", "b")] == [*unified_diff(before, after, "a", "b")]
