"""The committed measurement of who finds which fault, against what the validators here report."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator

import pytest
from places import REPOSITORY

DOCS = REPOSITORY / "docs"
sys.path.insert(0, str(DOCS))

import make_validators as script  # noqa: E402 - a script beside the pages

MEASURED = json.loads(script.MEASURED.read_text(encoding="utf-8"))


@pytest.fixture(autouse=True)
def silence() -> Iterator[None]:
    """Some validators log whatever a file lacks."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def committed(title: str) -> dict[str, str]:
    return {name: cells[title] for name, cells in MEASURED["faults"].items() if title in cells}


def test_the_measurement_covers_each_fault() -> None:
    assert list(MEASURED["faults"]) == list(script.FAULTS)


def test_the_score_of_the_linter_is_what_its_tables_say() -> None:
    by_kind = script.quick_yaml.load((script.TESTS / "robot_faults.yaml").read_text("utf-8"))
    found = sum(int(cell.partition(" ")[0]) for cell in committed(script.LINT).values())
    found += sum(bool(seed["lint"]) for seed in by_kind.values())
    assert MEASURED["corpus"][script.LINT]["place"] == found


def test_the_page_shows_the_measurement() -> None:
    page = script.PAGE.read_text(encoding="utf-8")
    assert page == script.page(), "docs/make_validators.py: page()"


def test_every_issue_is_of_a_fault_and_stands_on_the_page() -> None:
    assert script.ISSUES.keys() <= script.FAULTS.keys()
    page = script.PAGE.read_text(encoding="utf-8")
    assert [
        name for name in script.ISSUES if f"- {name} ({script.issue_link(name)})" not in page
    ] == []


# All faults of the linter: tests/check/test_lint_recall.py.
@pytest.mark.parametrize("each", script.VALIDATORS, ids=lambda each: each.package)
def test_the_column_of_a_validator_is_what_it_says(each: script.Validator) -> None:
    here = script.installed(each.package)
    measured = MEASURED["versions"][each.title]
    if here != measured and each.title != script.LINT:
        pytest.skip(f"measured with {measured}, here is {here}")
    told = committed(each.title)
    some = [*list(told)[:2], *list(script.FAULTS)[::60]]
    assert script.column(each, some) == {name: told[name] for name in some if name in told}
    assert script.control(each) == MEASURED["control"].get(each.title, "")
