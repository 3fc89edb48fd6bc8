"""A robot or a link that stands elsewhere is one mistake; what went along is judged where it is."""

from __future__ import annotations

import pytest
from pxr import Sdf, Usd
from scene_stages import built, model_of

from lab3_usd.check.checker import Judgement, judge
from lab3_usd.spec.loader import load_lab

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


def judged(stage: Usd.Stage, checkpoint: str = "05") -> Judgement:
    lab = load_lab()
    found = judge(lab, lab.checkpoints[checkpoint], model_of(stage))
    assert not found.crashes
    return found


def told(found: Judgement) -> list[tuple[str, str, str | None]]:
    return [(f.rule, f.prim, f.actual) for f in found.findings if f.severity != "note"]


def lost(found: Judgement) -> set[str]:
    return {each.id for each in found.requirements if not each.met}


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
    related = [each.related for each in found.findings if each.rule == "S01"]
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


def test_a_missing_robot_stays_missing_when_nothing_holds_its_links() -> None:
    stage = built("00")
    stage.RemovePrim(ROBOT)
    assert ("S01", ROBOT, "is missing") in told(judged(stage, "00"))


def test_a_link_that_is_deactivated_is_not_taken_for_another() -> None:
    stage = built("02")
    stage.GetPrimAtPath(f"{ROBOT}/caster_back_link").SetActive(False)  # noqa: FBT003
    path = f"{ROBOT}/caster_back_link"
    assert ("S01", path, "is deactivated") in told(judged(stage, "02"))
