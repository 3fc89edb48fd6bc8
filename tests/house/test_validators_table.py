"""The committed table of who sees which fault, against what the validators here say."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator

import pytest
from places import REPOSITORY

DOCS = REPOSITORY / "docs"
sys.path.insert(0, str(DOCS))

import make_validators as script  # noqa: E402 - a script beside the pages

ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in script.PAGE.read_text(encoding="utf-8").partition(script.MARK)[2].splitlines()
    if line.startswith("|")
]
VERSIONS = dict(zip(ROWS[0][1:], ROWS[-1][1:], strict=True))
USERS = ROWS[0].index("users")
SOME = list(script.FAULTS)[::6]  # of the validators that take their time


@pytest.fixture(autouse=True)
def silence() -> Iterator[None]:
    """Some validators log whatever a file lacks."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def committed(title: str) -> dict[str, str]:
    at = ROWS[0].index(title)
    return {row[0]: row[at] for row in ROWS if row[0] in script.FAULTS}


def test_the_table_has_a_row_for_each_fault_and_counts_them() -> None:
    assert [row[0] for row in ROWS[2 : 2 + len(script.FAULTS)]] == list(script.FAULTS)
    for validator in script.VALIDATORS:
        counted = sum(cell != "-" for cell in committed(validator.title).values())
        total = ROWS[2 + len(script.FAULTS)][ROWS[0].index(validator.title)]
        assert total == f"**{counted}**"


def test_every_issue_is_of_a_fault_and_stands_beside_it() -> None:
    assert script.ISSUES.keys() <= script.FAULTS.keys()
    rows = {row[0]: row[USERS] for row in ROWS if row[0] in script.FAULTS}
    assert rows == {name: script.issue_link(name) for name in script.FAULTS}


def test_our_own_column_is_what_the_linter_says() -> None:
    ours = script.VALIDATORS[0]
    assert script.column(ours) == committed(ours.title)


@pytest.mark.parametrize("other", script.VALIDATORS[1:], ids=lambda each: each.package)
def test_the_column_of_another_is_what_it_says(other: script.Validator) -> None:
    here = script.installed(other.package)
    if here != VERSIONS[other.title]:
        pytest.skip(f"measured with {VERSIONS[other.title]}, here is {here}")
    told = committed(other.title)
    assert script.column(other, SOME) == {name: told[name] for name in SOME}
    at = ROWS[0].index(other.title)
    assert script.control(other) == next(row[at] for row in ROWS if row[0] == script.CONTROL)
