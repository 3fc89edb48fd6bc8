"""A dry run names kinds of faults, and a table beside the rules which of them explains each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import get_args

from places import REPOSITORY

from lab3_usd.check.explanations import EXPLAINED_BY
from lab3_usd.check.registry import all_rules
from lab3_usd.model.fault import FaultKind

KINDS = frozenset(get_args(FaultKind))


def sources() -> Iterator[str]:
    for path in sorted((REPOSITORY / "src" / "lab3_usd" / "sim").rglob("*.py")):
        yield path.read_text(encoding="utf-8")


def test_each_kind_is_explained_by_a_rule() -> None:
    assert EXPLAINED_BY.keys() == KINDS
    assert set(EXPLAINED_BY.values()) <= set(all_rules())


def test_each_kind_is_yielded_by_the_dry_run() -> None:
    quoted = {word for text in sources() for word in re.findall(r'"([a-z-]+)"', text)}
    assert sorted(KINDS - quoted) == []


def test_the_dry_run_knows_no_rule() -> None:
    words = {word for text in sources() for word in re.findall(r"\w+", text)}
    assert words & {*all_rules(), *EXPLAINED_BY.values()} == set()
