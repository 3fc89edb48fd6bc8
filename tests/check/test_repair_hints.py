"""A hint repairs what the message says: what is there already is not made a second time."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import broken, correct_stage, judged
from scene_changes import CAMERA, LIDAR

from lab3_usd.model.finding import Finding

CONTEXT = "/World/ROS_Clock/ros2_context"


def told(rule: str, *steps: dict[str, Any]) -> Finding:
    """The only error that these steps cost, which is this rule's."""
    found = judged(broken("05", list(steps)), "05").findings
    errors = [each for each in found if each.severity == "error"]
    assert [error.rule for error in errors] == [rule]
    return errors[0]


@pytest.mark.parametrize(
    ("step", "site", "word"),
    [
        ({"deactivate": "ROS_Clock/ros2_context"}, CONTEXT, "Activate"),
        ({"over": "ROS_Clock/ros2_context"}, CONTEXT, "def"),
        ({"move": ["ROS_Clock/ros2_context", "/World/lost"]}, "/World/lost", "drag"),
    ],
)
def test_a_node_that_is_there_is_brought_back(step: dict[str, Any], site: str, word: str) -> None:
    found = told("N01", step)
    assert found.related == (site,)
    assert site in found.message
    assert site in (found.hint or "")
    assert word in (found.hint or "").split()
    assert not (found.hint or "").startswith("add ")


def test_a_node_that_is_nowhere_is_added() -> None:
    found = told("N01", {"remove": "ROS_Clock/ros2_context"})
    assert found.related == ()
    assert (found.hint or "").startswith("add ")


def test_a_graph_is_not_renamed_to_a_path_that_is_taken() -> None:
    found = told(
        "G02",
        {"move": ["ROS_Clock", "/World/ActionGraph"]},
        {"define": ["/World/ROS_Clock", "OmniGraph"]},
    )
    assert found.prim == "/World/ActionGraph"
    assert found.related == ("/World/ROS_Clock",)
    assert "empty graph" in found.message
    assert (found.hint or "").startswith("delete what stands at /World/ROS_Clock")


def test_a_graph_is_moved_to_a_path_that_is_free() -> None:
    found = told("G02", {"move": ["ROS_Clock", "/World/ActionGraph"]})
    assert found.related == ()
    assert (found.hint or "").startswith("rename")


@pytest.mark.parametrize(("sensor", "rule"), [(CAMERA, "C04"), (LIDAR, "L04")])
def test_a_sensor_that_was_moved_is_only_moved_back(sensor: str, rule: str) -> None:
    stage = correct_stage("05")
    stage.GetPrimAtPath(sensor).GetAttribute("xformOp:translate").Set((1, 2, 3))
    (found,) = [finding for finding in judged(stage, "05").findings if finding.rule == rule]
    assert f"set Translate to {found.expected}" in (found.hint or "")
    assert "Rigid Body" not in (found.hint or "")


def test_a_hint_names_the_graph_and_the_node() -> None:
    found = told("P01", {"set": ["ROS_Clock/ros2_context.inputs:domain_id", 7]})
    assert found.hint == (
        "in ROS_Clock, select ROS2 Context and set domain_id to 0 in the Property panel"
    )


def test_of_two_nodes_alike_a_hint_names_the_prim() -> None:
    found = told("W01", {"disconnect": "ROS_Drive/break_linear_velocity.inputs:tuple"})
    assert (found.hint or "").startswith("in ROS_Drive, drag a wire from scale_linear_velocity")
    assert (found.hint or "").endswith("to tuple of Break 3 Vector (break_linear_velocity)")


def test_the_hint_for_a_missing_node_lists_its_connections() -> None:
    found = told("N01", {"remove": "ROS_Drive/scale_linear_velocity"})
    assert found.hint == (
        "add Scale To/From Stage Units to ROS_Drive and connect "
        "ros2_subscribe_twist.linearVelocity -> value, result -> break_linear_velocity.tuple"
    )


def test_a_stage_that_fails_has_not_met_everything() -> None:
    found = judged(broken("05", [{"move": ["ROS_Clock", "/World/ActionGraph"]}]), "05")
    assert [requirement.id for requirement in found.requirements if not requirement.met] == [
        "ROS_Clock/other/G02"
    ]
