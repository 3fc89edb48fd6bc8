"""Unusual stages that work: the linter gives them no error."""

from __future__ import annotations

from typing import Any

import pytest
import quick_yaml
from linting import broken_robot, said_by
from places import TESTS

LEGAL: dict[str, Any] = quick_yaml.load((TESTS / "lint_legal.yaml").read_text())
LEAST = 25


@pytest.mark.parametrize("name", LEGAL)
def test_an_unusual_stage_that_works_has_no_error(name: str) -> None:
    case = LEGAL[name] if isinstance(LEGAL[name], dict) else {"steps": LEGAL[name]}
    stage = broken_robot(case.get("robot", "rover"), case["steps"])
    assert said_by(stage, "error") == []


def test_there_are_enough_of_them() -> None:
    assert len(LEGAL) >= LEAST
