"""Robots of many kinds: what each publishes, and what lint and dry runs find of its faults."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from dry_runs import played
from linting import broken_robot, linted, said_by
from places import TESTS
from robot_kinds import KINDS

from lab3_usd.model.dry_run import Behaviour


def table(name: str) -> dict[str, Any]:
    read: dict[str, Any] = quick_yaml.load((TESTS / name).read_text(encoding="utf-8"))
    return read


ROBOTS, FAULTS = table("robots.yaml"), table("robot_faults.yaml")


@cache
def played_robot(name: str, folder: Path) -> Behaviour:
    return played(KINDS[name](), folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("robots")


def rows(name: str) -> dict[tuple[str, int], tuple[str, int, str]]:
    """Return what a robot publishes by topic and domain: type, messages a second, frame."""
    robot = ROBOTS[name]
    found = rows(robot["like"]) if "like" in robot else {}
    for topic, kind, hz, frame, *domain in robot.get("topics", ()):
        found[topic, domain[0] if domain else 0] = (kind, hz, frame)
    return found


def test_each_robot_is_in_the_table() -> None:
    assert list(ROBOTS) == list(KINDS)
    assert len(ROBOTS) >= 28


@pytest.mark.parametrize("name", ROBOTS)
def test_lint_accuses_no_right_robot(name: str) -> None:
    assert said_by(KINDS[name](), "error", "warning") == []


@pytest.mark.parametrize("name", ROBOTS)
def test_a_dry_run_accuses_no_right_robot(name: str, folder: Path) -> None:
    found = played_robot(name, folder)
    assert [check.text for check in found.checks if check.verdict == "bad"] == []


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_publishes_what_it_is_to(name: str, folder: Path) -> None:
    topics = played_robot(name, folder).topics
    shown = {(topic.name, topic.domain): (topic.type, topic.frame) for topic in topics}
    asked = rows(name)
    assert shown == {key: (kind, frame) for key, (kind, _, frame) in asked.items()}
    rates = {(topic.name, topic.domain or 0): topic.hz for topic in topics}
    assert rates == {key: pytest.approx(hz, rel=0.03) for key, (_, hz, _) in asked.items()}


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_listens_where_it_is_to(name: str, folder: Path) -> None:
    robots = played_robot(name, folder).robots
    robot = ROBOTS[name]
    commands = robot["commands"] if "commands" in robot else ROBOTS[robot["like"]]["commands"]
    asked = [(topic, domain[0] if domain else 0) for topic, *domain in commands]
    assert [(robot.topic, robot.domain) for robot in robots] == asked


@pytest.mark.parametrize("name", FAULTS)
def test_lint_finds_a_fault_at_its_place(name: str) -> None:
    seed = FAULTS[name]
    places = seed["at"] if isinstance(seed["at"], list) else [seed["at"]]
    results = linted(broken_robot(seed["robot"], seed["break"]))
    assert not results.crashes
    found = [finding for finding in results.findings if finding.severity != "note"]
    assert {finding.rule for finding in found if finding.prim in places} == set(seed["lint"])


@pytest.mark.parametrize("name", [name for name, seed in FAULTS.items() if seed["sim"]])
def test_a_dry_run_shows_a_fault(name: str, tmp_path: Path) -> None:
    seed = FAULTS[name]
    found = played(broken_robot(seed["robot"], seed["break"]), tmp_path)
    assert {check.name for check in found.checks if check.verdict == "bad"} == set(seed["sim"])


def test_each_fault_says_where_it_is_and_who_says_so() -> None:
    assert {seed["robot"] for seed in FAULTS.values()} <= KINDS.keys()
    assert [name for name, seed in FAULTS.items() if not (seed["at"] and seed["source"])] == []


def test_another_robot_may_be_shown_beside_the_own_one_in_a_domain(tmp_path: Path) -> None:
    """A node of one domain may say where the robot of another one is."""
    also = "/World/beta_ROS/compute_alpha"
    steps = [
        {"copy": ["/World/beta_ROS/compute", also]},
        {"copy": ["/World/beta_ROS/odometry", "/World/beta_ROS/odometry_alpha"]},
        {"targets": [f"{also}.inputs:chassisPrim", "/World/alpha/base"]},
        {"set": ["/World/beta_ROS/odometry_alpha.inputs:topicName", "alpha/odom"]},
        {"connect": ["/World/beta_ROS/odometry_alpha.inputs:position", f"{also}.outputs:position"]},
    ]
    found = played(broken_robot("two robots in two domains", steps), tmp_path)
    assert [check.text for check in found.checks if check.name == "topics"] == [""]
