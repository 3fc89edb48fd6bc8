"""Rows of tests/disagreements.yaml: differences between two judges that are known, and why."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache

import quick_yaml
from msgspec import Struct, convert
from places import TESTS

TABLE = TESTS / "disagreements.yaml"


class Row(Struct, frozen=True):
    """A difference that is known: which faults, and why the judges see them otherwise."""

    title: str
    faults: tuple[str, ...]  # regular expressions for whole names
    happens: str
    reason: str

    def holds(self, fault: str) -> bool:
        return any(re.fullmatch(each, fault) for each in self.faults)


@cache
def table() -> dict[str, object]:
    content: dict[str, object] = quick_yaml.load(TABLE.read_text(encoding="utf-8"))
    return content


@cache
def known_rows(section: str = "disagreements") -> list[Row]:
    return convert(table()[section], list[Row])


def idle_rows(names: Iterable[str], section: str = "disagreements") -> list[str]:
    """Return the rows that are about none of these faults."""
    known = list(names)
    return [row.title for row in known_rows(section) if not any(map(row.holds, known))]
