"""A stage that is handed in for several checkpoints is judged again only where they differ."""

from __future__ import annotations

import pytest
from breaking import Step, broken, the_lab
from breaking import judged as judged_alone
from msgspec import Struct
from own_rules import add_counting_rule
from pxr import Usd, UsdGeom

from lab3_usd.check.checker import Judgement, judge
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.stage.read.reader import read_model

PROFILE: list[Step] = [
    {"node": ["ROS_Clock/profile", "isaacsim.ros2.bridge.ROS2QoSProfile"]},
    {
        "connect": [
            "ROS_Clock/ros2_publish_clock.inputs:qosProfile",
            "ROS_Clock/profile.outputs:qosProfile",
        ]
    },
]
COPIES = ("05", "06", "07")


def stage() -> Usd.Stage:
    """A stage with faults that count otherwise from checkpoint to checkpoint."""
    made = broken("05", PROFILE)
    root = UsdGeom.XformCommonAPI(made.GetPrimAtPath(the_lab().scene.robot.path))
    root.SetTranslate((1.0, 0.5, 0.0))
    return made


def judged_at(checkpoint: str, model: StageModel) -> Judgement:
    lab = the_lab()
    return judge(lab, lab.checkpoints[checkpoint], model)


@pytest.mark.parametrize("order", [COPIES, COPIES[::-1]], ids="-".join)
def test_judged_at_another_checkpoint_before_a_stage_is_judged_alike(
    order: tuple[str, ...],
) -> None:
    model = read_model(stage(), the_lab().platform, "stage.usda")
    again = [judged_at(number, model) for number in order]
    assert again == [judged_alone(stage(), number) for number in order]
    said = {tuple((found.rule, found.severity) for found in each.findings) for each in again}
    assert len(said) > 1


@pytest.mark.usefixtures("own_rules")
def test_a_rule_that_does_not_look_at_the_checkpoint_is_not_asked_again() -> None:
    asked: list[str] = []
    add_counting_rule("S98", asked, looks_at_checkpoint=False)
    add_counting_rule("S99", asked, looks_at_checkpoint=True)
    model = read_model(stage(), the_lab().platform, "stage.usda")
    judged_at("05", model)
    judged_at("06", model)
    assert asked == ["S98", "S99", "S99"]


class Subject(Struct, frozen=True, eq=False):
    stage: StageModel


@once_per_stage
def looked_at(subject: Subject) -> int:
    subject.stage.note_checkpoint_use()
    return subject.stage.checkpoint_uses


def test_who_asks_again_for_what_looked_at_the_checkpoint_has_looked_too() -> None:
    subject = Subject(StageModel(the_lab().platform, "Z", 1.0, 1.0, (), {}))
    assert [looked_at(subject), looked_at(subject)] == [1, 1]
    assert subject.stage.checkpoint_uses == 2
