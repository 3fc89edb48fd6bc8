"""A rule states what it requires of the scene where it is written, and so earns its points."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from breaking import correct_stage, judged
from pxr import Usd

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Demand, rule
from lab3_usd.model.finding import Problem, StageResult

BEACON = "/World/Beacon"
CHECKPOINT = "02"


def with_beacon() -> Usd.Stage:
    stage = correct_stage(CHECKPOINT)
    stage.DefinePrim(BEACON, "Cube")
    return stage


def points(stage: Usd.Stage) -> tuple[float, float]:
    score = StageResult("", None, requirements=judged(stage, CHECKPOINT).requirements).score
    return score.earned, score.possible


def require_a_beacon() -> None:
    @rule(
        "S99",
        "missing-beacon",
        scope="stage",
        demands=lambda lab, _: [Demand("Scene/beacon", "a beacon", BEACON, lab.first)],
    )
    def missing_beacon(subject: StageSubject) -> Iterator[Problem]:
        """The beacon is missing."""
        if subject.stage.prim(BEACON) is None:
            yield Problem(BEACON, "there is no beacon", unmet=("Scene/beacon",))


@pytest.mark.usefixtures("own_rules")
def test_a_scene_rule_earns_its_point_by_the_function_that_is_the_rule() -> None:
    earned, possible = points(correct_stage(CHECKPOINT))
    assert earned == possible
    require_a_beacon()
    assert points(correct_stage(CHECKPOINT)) == (earned, possible + 1)
    assert points(with_beacon()) == (earned + 1, possible + 1)


@pytest.mark.usefixtures("own_rules")
def test_what_a_rule_requires_is_listed_last_where_the_scene_file_does_not_name_the_prim() -> None:
    require_a_beacon()
    scene = [
        item for item in judged(with_beacon(), CHECKPOINT).requirements if item.kind == "scene"
    ]
    assert [item.id for item in scene][-1] == "Scene/beacon"


def test_the_requirements_of_a_rule_of_another_test_are_gone() -> None:
    found = judged(correct_stage(CHECKPOINT), CHECKPOINT).requirements
    assert "Scene/beacon" not in {requirement.id for requirement in found}
