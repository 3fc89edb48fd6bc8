"""A dry run names kinds of faults, and a table beside the rules which of them explains each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

from places import REPOSITORY

from lab3_usd.check.explanations import EXPLAINED_BY
from lab3_usd.check.registry import all_rules
from lab3_usd.model.fault import FaultKind

RULE_ID = re.compile(r"\b[A-Z][0-9]{2}\b")
KINDS = frozenset(get_args(FaultKind))


def sources() -> Iterator[tuple[Path, str]]:
    for path in sorted((REPOSITORY / "src" / "lab3_usd" / "sim").rglob("*.py")):
        yield path, path.read_text(encoding="utf-8")


def test_each_kind_is_explained_by_a_rule() -> None:
    assert EXPLAINED_BY.keys() == KINDS
    assert set(EXPLAINED_BY.values()) <= set(all_rules())


def test_each_kind_is_yielded_by_the_dry_run() -> None:
    quoted = {word for _, text in sources() for word in re.findall(r'"([a-z-]+)"', text)}
    assert sorted(KINDS - quoted) == []


def test_the_dry_run_knows_no_rule() -> None:
    named = [(path.name, word) for path, text in sources() for word in RULE_ID.findall(text)]
    assert named == []
    assert all(RULE_ID.fullmatch(rule) for rule in all_rules())
