"""One cause is one finding, with the number of wires and targets that it leaves without an end."""

from __future__ import annotations

from pathlib import Path

from in_process import invoke
from linting import broken_robot, linted
from pxr import Sdf, Usd

from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab


def told(stage: Usd.Stage, rule: str) -> list[str]:
    found = linted(stage).findings
    return [each.message for each in found if each.rule == rule and each.severity != "note"]


def moved_without_its_wires() -> Usd.Stage:
    """A graph that was renamed in a text editor: its wires still lead to the old path."""
    stage = broken_robot("rover", [])
    layer = stage.GetRootLayer()
    text = layer.ExportToString().replace('def OmniGraph "Odometry"', 'def OmniGraph "Moved"')
    layer.ImportFromString(text)
    return stage


def test_the_wires_of_a_moved_graph_are_one_finding() -> None:
    (message,) = told(moved_without_its_wires(), "K20")
    assert message.endswith("23 more wires lead to /World/Odometry, which is missing")


def test_the_targets_of_a_deactivated_robot_are_one_finding() -> None:
    (message,) = told(broken_robot("rover", [{"deactivate": "/World/Rover"}]), "K14")
    assert message.endswith("9 more targets lead to /World/Rover, which is deactivated")


def test_few_wires_are_listed_one_by_one() -> None:
    names = ("execIn", "timeStamp")
    wires = [f"/World/Clock/clock.inputs:{name}" for name in names]
    steps = [{"connect": [wire, "/World/Gone/node.outputs:x"]} for wire in wires]
    assert len(told(broken_robot("rover", steps), "K20")) == len(names)


def test_a_time_step_that_is_not_wired_is_said_without_what_needs_it(
    shared: Path, tmp_path: Path
) -> None:
    yard, dt = shared / "courses" / "yard", "/World/Buggy/Steering/ackermann.inputs:dt"
    assert invoke("--lab", yard, "build", "--out", tmp_path, "--only", "4").exit_code == 0
    (stage,) = tmp_path.iterdir()
    layer = Sdf.Layer.FindOrOpen(str(stage))
    layer.GetAttributeAtPath(dt).connectionPathList.ClearEdits()
    layer.Save()
    findings = check_stage(stage, lab=load_lab(yard)).findings
    assert [f"{each.rule} {each.prim}.{each.property}" for each in findings] == [f"W01 {dt}"]
