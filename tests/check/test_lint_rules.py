"""Each rule that needs no spec against its case file: what triggers it, and what does not."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
import quick_yaml
from foreign_robots import ROBOTS
from golden import assert_golden, findings_text
from linting import broken_robot, found_by, linted, said_by, sites_of
from places import TESTS
from pxr import Usd, UsdGeom

from lab3_usd.check.registry import all_rules, holds_without_lab
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.facts.stances import machines
from lab3_usd.model.finding import ordered
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.read.stage_reader import read_model

FOLDER = TESTS / "lint_cases"
CASES = {path.stem: quick_yaml.load(path.read_text()) for path in sorted(FOLDER.glob("*.yaml"))}
TRIGGERS = {
    f"{rule} {name}".strip(): {
        "robot": case.get("robot", "rover"),
        "from": case.get("from", ""),
        **entry,
    }
    for rule, case in CASES.items()
    for name, entry in {"": case, **case.get("more", {})}.items()
}
RULES = [rule.id for rule in all_rules().values() if rule.scope == "lint"]


@pytest.mark.parametrize("robot", ROBOTS)
def test_nothing_is_said_of_a_robot_that_works(robot: str) -> None:
    assert said_by(ROBOTS[robot]()) == []


@cache
def results(name: str) -> RuleResults:
    case = TRIGGERS[name]
    stage = broken_robot(case["robot"], case["break"])
    return linted(stage, case.get("isaac", "6.0"), case.get("from", ""))


@pytest.mark.parametrize("rule", CASES)
def test_a_fault_is_said_once_at_its_place(rule: str) -> None:
    for name in (name for name in TRIGGERS if name.partition(" ")[0] == rule):
        case, found = TRIGGERS[name], results(name)
        assert sites_of(found, "error", "warning") == sorted(case["expect"]), name
        notes = sites_of(found, "note")
        assert [note for note in case.get("notes", []) if note not in notes] == [], name
        rules = {site.split()[0] for site in (*case["expect"], *case.get("notes", []))}
        assert rule in rules, name


def test_what_is_said_of_each_fault_is_as_it_was() -> None:
    shown = {name: findings_text(ordered(results(name).findings)) for name in TRIGGERS}
    assert_golden("lint-cases", shown)


def with_y_up(stage: Usd.Stage) -> Usd.Stage:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    for top in stage.GetPseudoRoot().GetChildren():
        place = UsdGeom.Xformable(top)
        turn = place.AddRotateXOp(opSuffix="up")
        turn.Set(-90.0)
        place.SetXformOpOrder([turn, *place.GetOrderedXformOps()[:-1]])
    return stage


@pytest.mark.parametrize("name", [name for name in TRIGGERS if name.startswith(("Y01", "Y04"))])
def test_how_a_robot_stands_is_judged_with_y_up_as_with_z_up(name: str) -> None:
    case = TRIGGERS[name]
    stage = with_y_up(broken_robot(case["robot"], case["break"]))
    assert sites_of(found_by(name[:3], stage)) == case["expect"]


@pytest.mark.parametrize("turned", [lambda stage: stage, with_y_up], ids=["Z", "Y"])
def test_boxes_tell_that_four_wheels_carry_a_robot(
    turned: Callable[[Usd.Stage], Usd.Stage],
) -> None:
    model = read_model(turned(broken_robot("skid steer", [])), lint_platform("6.0"), "x")
    assert machines(model) is None


@pytest.mark.parametrize("rule", CASES)
def test_what_is_only_alike_does_not_trigger_the_rule(rule: str) -> None:
    case = CASES[rule]
    for name, known in {"": case["clear"], **case.get("alike", {})}.items():
        alike = known if isinstance(known, dict) else {"steps": known}
        robot = alike.get("robot", case.get("robot", "rover"))
        stage = broken_robot(robot, alike["steps"])
        release, moved_from = alike.get("isaac", "6.0"), alike.get("from", case.get("from", ""))
        found = found_by(rule, stage, release, moved_from)
        assert (found.crashes, found.findings) == ((), ()), name


def test_a_wire_from_a_prim_is_not_said_to_come_from_nowhere() -> None:
    wire = ["/World/Clock/clock.inputs:timeStamp", "/World/Clock/time"]
    (found,) = linted(broken_robot("rover", [{"connect": wire}])).findings
    assert found.message == "inputs:timeStamp is connected to time, which is a prim, not a port"


def test_a_single_command_was_for_all_joints_before() -> None:
    command = ["/World/Drive/move.inputs:velocityCommand", "double[]", [1.0]]
    steps = [{"disconnect": command[0]}, {"declare": command}]
    stage = broken_robot("rover", steps)
    found = "K68 /World/Drive/move inputs:velocityCommand"
    assert found in sites_of(found_by("K68", stage))
    assert found not in sites_of(found_by("K68", stage, "5.1"))


def test_how_a_joint_of_no_articulation_was_read_before_is_not_known() -> None:
    stage = broken_robot(
        "arm", CASES["K15"]["more"]["the effort of a joint outside the articulation"]["break"]
    )
    found = "K15 /ActionGraph/effort inputs:prim"
    assert found in sites_of(found_by("K15", stage))
    assert found not in sites_of(found_by("K15", stage, "5.1"))


def test_two_topics_of_one_node_are_no_rivals_of_another() -> None:
    steps = CASES["K40"]["more"]["two topics of one node"]["break"]
    (found,) = linted(broken_robot("rover", steps)).findings
    assert found.message == "inputs:semanticLabelsTopicName and inputs:topicName are both /rgb"
    assert found.related == ()


def test_graphs_that_are_switched_off_are_counted_where_the_clock_is_missing() -> None:
    steps = [{"deactivate": "/World/Clock"}, {"deactivate": "/World/Drive"}]
    (found,) = [
        each for each in linted(broken_robot("rover", steps)).findings if each.rule == "K47"
    ]
    assert "/World/Clock and /World/Drive are not in the scene" in found.message


def test_only_rules_of_lint_hold_without_a_lab() -> None:
    rules = all_rules()
    assert holds_without_lab(rules["T03"])  # K50 as well
    assert not holds_without_lab(rules["T01"])
    assert not holds_without_lab(rules["K50"])


def test_every_rule_has_a_case() -> None:
    assert list(CASES) == RULES
