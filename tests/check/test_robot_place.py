"""A robot or a link that stands elsewhere is one mistake; what went along is judged where it is."""

from __future__ import annotations

import pytest
from pxr import Sdf, Usd
from scene_stages import built, model_of

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.spec.load.loader import load_lab

ROBOT = "/turtlebot3_burger"
DRAGGED = f"/World{ROBOT}"


def dragged(*moves: tuple[str, str], checkpoint: str = "05") -> Usd.Stage:
    """A built checkpoint after these moves in the Stage panel."""
    stage = built(checkpoint)
    for path, target in moves:
        editor = Usd.NamespaceEditor(stage)
        assert editor.MovePrimAtPath(path, target)
        assert editor.ApplyEdits()
    return stage


def judged(stage: Usd.Stage, checkpoint: str = "05") -> RuleResults:
    lab = load_lab()
    found = judge(lab, lab.checkpoints[checkpoint], model_of(stage))
    assert not found.crashes
    return found


def told(found: RuleResults) -> list[tuple[str, str, str | None]]:
    return [(f.rule, f.prim, f.actual) for f in found.findings if f.severity != "note"]


def lost(found: RuleResults) -> set[str]:
    return {requirement.id for requirement in found.requirements if not requirement.met}


@pytest.mark.parametrize("home", [DRAGGED, "/Robot"])
@pytest.mark.parametrize("checkpoint", ["00", "02", "05", "08"])
def test_a_robot_elsewhere_is_one_error_where_it_is(home: str, checkpoint: str) -> None:
    found = judged(dragged((ROBOT, home), checkpoint=checkpoint), checkpoint)
    assert told(found) == [("S01", home, home)]
    assert lost(found) == {"Scene/prim/turtlebot3_burger"}


def test_what_is_wrong_on_a_robot_elsewhere_is_told_where_it_is() -> None:
    stage = dragged((ROBOT, DRAGGED))
    stage.GetPrimAtPath(f"{DRAGGED}/base_link").GetAttribute("physics:mass").Set(1.0)
    found = judged(stage)
    assert {(rule, prim) for rule, prim, _ in told(found)} == {
        ("S01", DRAGGED),
        ("S04", f"{DRAGGED}/base_link"),
    }
    assert lost(found) == {"Scene/prim/turtlebot3_burger", "Scene/mass/base_link"}


def test_a_target_at_the_place_without_the_robot_is_wrong() -> None:
    stage = dragged((ROBOT, DRAGGED))
    node = next(
        prim
        for prim in stage.Traverse()
        if prim.HasRelationship("inputs:chassisPrim") and str(prim.GetPath()).startswith(DRAGGED)
    )
    node.GetRelationship("inputs:chassisPrim").SetTargets([Sdf.Path(ROBOT)])
    assert ("R02", str(node.GetPath())) in {(rule, prim) for rule, prim, _ in told(judged(stage))}


def test_a_renamed_link_is_one_error_that_names_it() -> None:
    found = judged(dragged((f"{ROBOT}/base_scan", f"{ROBOT}/laser")))
    assert [(rule, prim) for rule, prim, _ in told(found)] == [("S01", f"{ROBOT}/base_scan")]
    related = [finding.related for finding in found.findings if finding.rule == "S01"]
    assert related == [(f"{ROBOT}/laser",)]
    assert "Scene/mass/base_scan" in lost(found)
    assert "Lidar2D/prim" not in lost(found)


def test_a_link_below_another_one_takes_its_sensor_along() -> None:
    inside = f"{ROBOT}/base_link/base_scan"
    found = judged(dragged((f"{ROBOT}/base_scan", inside)))
    assert [(rule, prim) for rule, prim, _ in told(found)] == [("S01", f"{ROBOT}/base_scan")]


def test_a_sensor_that_left_a_robot_elsewhere_is_a_second_mistake() -> None:
    lidar = f"{DRAGGED}/base_scan/Lidar2D"
    found = judged(dragged((ROBOT, DRAGGED), (lidar, "/World/Lidar2D")))
    rules = sorted(rule for rule, _, _ in told(found))
    assert rules == ["L02", "S01"]


# Graphs that are missing together with a prim are named in its finding.

ON_ROBOT = ("ROS_Drive", "ROS_Lidar2D", "ROS_Camera", "ROS_OdomTF")


def only(found: RuleResults, rule: str) -> str:
    (message,) = [finding.message for finding in found.findings if finding.rule == rule]
    return message


@pytest.mark.parametrize(
    ("gone", "rule", "names"),
    [
        (ROBOT, "S01", ON_ROBOT),
        (f"{ROBOT}/base_scan", "S01", ("ROS_Lidar2D",)),
        (f"{ROBOT}/base_footprint", "S01", ("ROS_Camera",)),
        (f"{ROBOT}/base_scan/Lidar2D", "L01", ("ROS_Lidar2D",)),
        (f"{ROBOT}/base_footprint/Camera_1", "C01", ("ROS_Camera",)),
        ("/World", "S01", ("ROS_Clock",)),
    ],
)
@pytest.mark.parametrize("deactivated", [False, True])
def test_a_missing_prim_names_the_graphs_that_are_missing_with_it(
    gone: str, rule: str, names: tuple[str, ...], *, deactivated: bool
) -> None:
    stage = built("05")
    if deactivated:
        stage.GetPrimAtPath(gone).SetActive(False)  # noqa: FBT003 - pxr takes it so
    else:
        stage.RemovePrim(gone)
    found = judged(stage)
    assert [finding.rule for finding in found.findings if finding.rule == "G01"] == []
    assert only(found, rule).endswith(f"; missing with it: {', '.join(names)}")


def test_a_graph_that_is_missing_alone_is_its_own_finding() -> None:
    stage = built("05")
    stage.RemovePrim(f"{ROBOT}/ROS_Drive")
    stage.RemovePrim(f"{ROBOT}/base_link")
    found = judged(stage)
    assert only(found, "G01") == "graph ROS_Drive is missing"
    assert "ROS_Drive" not in only(found, "S01")


def test_a_graph_that_alone_did_not_come_along_is_its_own_finding() -> None:
    stage = dragged((ROBOT, DRAGGED))
    stage.RemovePrim(f"{DRAGGED}/ROS_Drive")
    found = judged(stage)
    assert only(found, "G01") == "graph ROS_Drive is missing"
    assert "ROS_Drive" not in only(found, "S01")


def behind_an_asset(path: str, *, by_over: bool = False) -> Usd.Stage:
    """A stage whose robot is nothing but a reference that leads nowhere."""
    stage = built("05")
    stage.RemovePrim(ROBOT)
    robot = stage.OverridePrim(path) if by_over else stage.DefinePrim(path, "Xform")
    robot.GetReferences().AddReference("./turtlebot3_burger.usd")
    return stage


@pytest.mark.parametrize("by_over", [False, True])
@pytest.mark.parametrize("home", [DRAGGED, "/World/robots/turtlebot3_burger_01"])
def test_a_robot_whose_asset_is_missing_is_known_by_its_name(home: str, *, by_over: bool) -> None:
    found = judged(behind_an_asset(home, by_over=by_over))
    assert [(rule, prim) for rule, prim, _ in told(found)] == [("S01", home)]
    assert only(found, "S01").endswith(f"; missing with it: {', '.join(ON_ROBOT)}")
    assert "Scene/mass/base_link" not in lost(found)


def test_a_prim_of_another_name_behind_a_missing_asset_is_not_the_robot() -> None:
    found = judged(behind_an_asset("/World/table"))
    assert ("S01", ROBOT, "is missing") in told(found)


def test_a_robot_where_it_belongs_is_not_looked_for_elsewhere() -> None:
    stage = behind_an_asset(ROBOT)
    stage.DefinePrim(DRAGGED, "Xform").GetReferences().AddReference("./other.usd")
    assert [finding.prim for finding in judged(stage).findings if finding.rule == "S01"] == []


def test_graphs_of_a_robot_whose_asset_is_missing_are_judged_where_they_are() -> None:
    stage = built("05")
    editor = Usd.NamespaceEditor(stage)
    assert editor.MovePrimAtPath(ROBOT, DRAGGED)
    assert editor.ApplyEdits()
    for link in ("base_link", "caster_back_link", "wheel_left_link", "wheel_right_link", "joints"):
        stage.RemovePrim(f"{DRAGGED}/{link}")
    stage.GetPrimAtPath(DRAGGED).GetPayloads().AddPayload("./turtlebot3_burger.usd")
    found = judged(stage)
    assert [(rule, prim) for rule, prim, _ in told(found)] == [("S01", DRAGGED)]
    stage.RemovePrim(f"{DRAGGED}/ROS_Drive")
    rules = [(rule, prim) for rule, prim, _ in told(judged(stage))]
    assert rules == [("G01", f"{DRAGGED}/ROS_Drive"), ("S01", DRAGGED)]


def test_a_robot_elsewhere_without_its_graphs_names_them() -> None:
    stage = dragged((ROBOT, DRAGGED), checkpoint="02")
    stage.RemovePrim(f"{DRAGGED}/ROS_Drive")
    found = judged(stage, "02")
    assert [(rule, prim) for rule, prim, _ in told(found)] == [("S01", DRAGGED)]
    assert only(found, "S01").endswith("; missing with it: ROS_Drive")
