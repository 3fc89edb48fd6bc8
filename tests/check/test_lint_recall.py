"""How many typical faults the linter finds in robots of which it knows nothing."""

from __future__ import annotations

import json
from typing import Any

import pytest
import quick_yaml
from foreign_robots import ROBOTS
from linting import broken_robot, linted
from places import TESTS

FAULTS: dict[str, dict[str, Any]] = quick_yaml.load((TESTS / "lint_faults.yaml").read_text())
LEAST = 60
MISSED = {  # what no rule knows, and why
    "no node publishes a subscribed topic (rover)": "the publisher is outside the stage",
    "one topic of a robot is outside its namespace (rover)": "it may be meant for all robots",
}


def is_found(robot: str, seed: dict[str, Any]) -> bool:
    results = linted(broken_robot(robot, seed["break"]))
    assert not results.crashes, robot
    places = seed["at"] if isinstance(seed["at"], list) else [seed["at"]]
    told = {finding.prim for finding in results.findings if finding.severity != "note"}
    return bool(told & set(places))


def test_each_robot_has_faults() -> None:
    assert {robot for robots in FAULTS.values() for robot in robots} == ROBOTS.keys()


@pytest.mark.parametrize("name", FAULTS)
def test_a_seeded_fault_is_found_at_its_place(name: str) -> None:
    missed = {robot for robot, seed in FAULTS[name].items() if not is_found(robot, seed)}
    assert missed == {robot for robot in FAULTS[name] if f"{name} ({robot})" in MISSED}


def found(name: str) -> int:
    return sum(f"{name} ({robot})" not in MISSED for robot in FAULTS[name])


def test_enough_faults_are_found_wherever_they_are_seeded() -> None:
    assert sum(found(name) == len(robots) for name, robots in FAULTS.items()) >= LEAST


def test_the_measurement_of_validators_says_how_many_are_found() -> None:
    measured = json.loads((TESTS / "lint_validators.json").read_text(encoding="utf-8"))
    told = {name: cells.get("lab3 lint", "") for name, cells in measured["faults"].items()}
    counts = {name: f"{found(name)} of {len(robots)}" for name, robots in FAULTS.items()}
    assert told == {name: "" if count.startswith("0") else count for name, count in counts.items()}
