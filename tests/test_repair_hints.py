"""A hint repairs what the message says: what is there already is not made a second time."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import broken, judged

from lab3_usd.check.finding import Finding

CONTEXT = "/World/ROS_Clock/ros2_context"


def told(rule: str, *steps: dict[str, Any]) -> Finding:
    """The only error that these steps cost, which is this rule's."""
    found = judged(broken("05", list(steps)), "05").findings
    errors = [each for each in found if each.severity == "error"]
    assert [each.rule for each in errors] == [rule]
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
