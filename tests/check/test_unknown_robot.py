"""A robot whose path only the running stage tells: nothing is said of what it has."""

from __future__ import annotations

from linting import broken_robot, linted

MOVE = "/World/Drive/move"
PATH = f"{MOVE}.inputs:robotPath"
COMPUTED = "/World/Drive/which"
UNKNOWN = [
    {"declare": [PATH, "string", ""]},
    {"node": [COMPUTED, "omni.graph.nodes.Concatenate"]},
    {"declare": [f"{COMPUTED}.outputs:value", "string", ""]},
    {"connect": [PATH, f"{COMPUTED}.outputs:value"]},
]


def test_a_robot_that_a_node_computes_is_not_said_to_be_missing() -> None:
    findings = linted(broken_robot("rover", UNKNOWN)).findings
    assert [finding.rule for finding in findings if finding.prim == MOVE] == []


def test_a_robot_that_is_written_is_said_to_be_missing() -> None:
    findings = linted(broken_robot("rover", [{"declare": [PATH, "string", "/Gone"]}])).findings
    assert [finding.rule for finding in findings if finding.prim == MOVE] == ["K60"]
