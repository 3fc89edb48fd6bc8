"""How many typical faults the linter finds in robots of which it knows nothing."""

from __future__ import annotations

from typing import Any

import pytest
import quick_yaml
from linting import broken_robot, linted
from places import TESTS

FAULTS: dict[str, dict[str, Any]] = quick_yaml.load((TESTS / "lint_faults.yaml").read_text())
LEAST = 60
MISSED = {  # what no rule knows, and why
    "the wheel radius differs (truck)": "only differential wheels are measured",
    "no node publishes a subscribed topic (rover)": "the publisher is outside the stage",
    "one topic of a robot is outside its namespace (rover)": "it may be meant for all robots",
}


def is_found(robot: str, seed: dict[str, Any]) -> bool:
    results = linted(broken_robot(robot, seed["break"]))
    assert not results.crashes
    places = seed["at"] if isinstance(seed["at"], list) else [seed["at"]]
    told = {finding.prim for finding in results.findings if finding.severity != "note"}
    return bool(told & set(places))


SEEDS = [
    pytest.param(robot, seed, name, id=f"{name} ({robot})")
    for name, robots in FAULTS.items()
    for robot, seed in robots.items()
]


def test_there_are_seventy_nine_faults_in_three_robots() -> None:
    assert len(FAULTS) == 79
    assert {robot for robots in FAULTS.values() for robot in robots} == {"rover", "truck", "arm"}


@pytest.mark.parametrize(("robot", "seed", "name"), SEEDS)
def test_a_seeded_fault_is_found_at_its_place(robot: str, seed: dict[str, Any], name: str) -> None:
    assert is_found(robot, seed) is (f"{name} ({robot})" not in MISSED)


def test_enough_faults_are_found_wherever_they_are_seeded() -> None:
    whole = [
        name
        for name, robots in FAULTS.items()
        if not any(f"{name} ({robot})" in MISSED for robot in robots)
    ]
    assert len(whole) >= LEAST
