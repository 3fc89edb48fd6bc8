"""A stage that is handed in for several checkpoints is judged at each as it is alone."""

from __future__ import annotations

import pytest
from breaking import Step, broken, the_lab
from breaking import judged as judged_alone
from pxr import Usd, UsdGeom

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.model.stage import StageModel
from lab3_usd.stage.read.stage_reader import read_model

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


def judged_at(checkpoint: str, model: StageModel) -> RuleResults:
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
