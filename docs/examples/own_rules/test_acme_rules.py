"""Each case of each rule."""

from __future__ import annotations

from pathlib import Path

import acme_rules  # noqa: F401 - which registers the rules
import pytest

from lab3_usd.own_rules import RuleCase, rule_cases


@pytest.mark.parametrize("case", rule_cases(Path(__file__).with_name("cases")), ids=str)
def test_the_rule_finds_what_it_should(case: RuleCase) -> None:
    assert case.found() == case.expect
