"""What no listener hears together is not two: domains and topics keep publishers and trees apart.

Every command says so of the same stage.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from breaking import broken, judged
from in_process import invoke
from linting import broken_robot, linted, said_by
from pxr import Usd

AT = "05"
BRIEF = ("--drive", "0.15,0,0.6 0,0.8,0.4")  # where it is of no importance how far it drives
Step = dict[str, Any]
SECOND: list[Step] = [
    {"copy": ["ROS_Clock", "/World/Second_Clock"]},
    {"copy": ["ROS_OdomTF", "/World/Second_OdomTF"]},
    {"set": ["/World/Second_OdomTF/ros2_publish_raw_transform_tree.inputs:parentFrameId", "start"]},
]
AWAY: list[Step] = [
    {"set": [f"/World/Second_{graph}/ros2_context.inputs:domain_id", 7]}
    for graph in ("Clock", "OdomTF")
]
WITH_NAMESPACE: list[Step] = [
    {"declare": [f"/World/Odometry/{node}.inputs:nodeNamespace", "string", "robot1"]}
    for node in ("transform", "tree")
]
TWO_PARENTS: list[Step] = [
    {"copy": ["/World/Odometry/transform", "/World/Odometry/again"]},
    {"declare": ["/World/Odometry/again.inputs:parentFrameId", "string", "map"]},
    {"disconnect": "/World/Odometry/again.inputs:translation"},
    {"disconnect": "/World/Odometry/again.inputs:rotation"},
]


def found_by_check(stage: Usd.Stage, *severities: str) -> set[str]:
    """The rules that judge a stage of the lab and find something."""
    findings = judged(stage, AT).findings
    return {each.rule for each in findings if each.severity in (severities or ("error", "warning"))}


def asked(command: str, stage: Usd.Stage, folder: Path) -> Any:
    """What a command prints of a stage, as JSON."""
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    return json.loads(
        invoke(command, path, "--format", "json", *(BRIEF if command == "sim" else ())).stdout
    )


# ---- domains


def test_a_second_robot_in_a_domain_of_its_own_costs_nothing() -> None:
    result = judged(broken(AT, [*SECOND, *AWAY]), AT)
    assert not [each for each in result.findings if each.severity != "note"]
    assert all(requirement.met for requirement in result.requirements)


def test_a_second_robot_in_the_same_domain_is_found() -> None:
    assert "Q01" in found_by_check(broken(AT, SECOND), "error")


def test_two_parents_in_the_same_domain_are_found() -> None:
    alone: Step = {"remove": "/World/Second_OdomTF/ros2_publish_odometry"}
    assert "T03" in found_by_check(broken(AT, [*SECOND, alone]), "error")


def test_two_parents_in_another_domain_are_a_warning_at_most() -> None:
    again = "/World/Second_OdomTF/again"
    twice: list[Step] = [
        {"copy": ["/World/Second_OdomTF/ros2_publish_raw_transform_tree", again]},
        {"set": [f"{again}.inputs:parentFrameId", "map"]},
    ]
    stage = broken(AT, [*SECOND, *AWAY, *twice])
    assert "T03" in found_by_check(stage, "warning")
    assert "T03" not in found_by_check(stage, "error")


def test_a_tree_in_another_domain_gives_the_lab_no_frame() -> None:
    steps = [*SECOND, *AWAY, {"remove": "ROS_OdomTF/ros2_publish_transform_tree"}]
    unmet = {each.id for each in judged(broken(AT, steps), AT).requirements if not each.met}
    assert {"TF/frame/base_link", "TF/frame/base_scan"} <= unmet


def test_odom_is_placed_in_another_domain_without_harm() -> None:
    raw = "/World/Second_OdomTF/ros2_publish_raw_transform_tree"
    named: list[Step] = [
        {"set": [f"{raw}.inputs:parentFrameId", "world"]},
        {"set": [f"{raw}.inputs:childFrameId", "odom"]},
    ]
    assert "T07" in found_by_check(broken(AT, [*SECOND, *named]))
    assert "T07" not in found_by_check(broken(AT, [*SECOND, *AWAY, *named]))


def test_tf_draws_a_tree_for_each_domain(tmp_path: Path) -> None:
    tree = asked("tf", broken(AT, [*SECOND, *AWAY]), tmp_path)
    assert not tree["problems"]
    assert {(each["domain"], tuple(each["roots"])) for each in tree["trees"]} == {
        (0, ("odom",)),
        (7, ("start",)),
    }


@pytest.mark.parametrize(("domain", "rules"), [(0, {"Q05", "Q06"}), (7, set())])
def test_commands_in_another_domain_reach_nobody(domain: int, rules: set[str]) -> None:
    steps: list[Step] = [
        {"copy": ["ROS_Drive", "/World/Drive"]},
        {"remove": "/World/Drive/articulation_controller"},
        {"set": ["/World/Drive/ros2_context.inputs:domain_id", domain]},
        {"node": ["/World/Drive/sender", "isaacsim.ros2.bridge.ROS2Publisher"]},
        {
            "connect": [
                "/World/Drive/sender.inputs:execIn",
                "/World/Drive/on_playback_tick.outputs:tick",
            ]
        },
        {
            "connect": [
                "/World/Drive/sender.inputs:context",
                "/World/Drive/ros2_context.outputs:context",
            ]
        },
        {"declare": ["/World/Drive/sender.inputs:topicName", "string", "cmd_vel"]},
        {"declare": ["/World/Drive/sender.inputs:messagePackage", "string", "geometry_msgs"]},
        {"declare": ["/World/Drive/sender.inputs:messageName", "string", "Twist"]},
    ]
    assert found_by_check(broken(AT, steps)) & {"Q05", "Q06"} == rules


# ---- topics of transforms


def test_tf_draws_the_tree_of_a_namespace(tmp_path: Path) -> None:
    tree = asked("tf", broken_robot("rover", WITH_NAMESPACE), tmp_path)
    assert [each["topic"] for each in tree["trees"]] == ["/robot1/tf"]
    assert {"parent": "odom", "child": "chassis"}.items() <= tree["transforms"][0].items()


def test_two_parents_on_the_topic_of_a_namespace_are_found() -> None:
    steps = [*WITH_NAMESPACE, *TWO_PARENTS]
    assert "K50 /World/Odometry/again" in said_by(broken_robot("rover", steps))


def test_a_parent_on_another_topic_is_no_second_one() -> None:
    apart: Step = {"declare": ["/World/Odometry/again.inputs:nodeNamespace", "string", "robot1"]}
    rules = {each.rule for each in linted(broken_robot("rover", [*TWO_PARENTS, apart])).findings}
    assert "K50" not in rules


# ---- what a dry run says of it


@pytest.mark.parametrize(
    ("parent", "child", "rule"), [("map", "chassis", "K50"), ("laser", "odom", "K52")]
)
def test_a_dry_run_without_a_lab_names_the_rule_of_lint(
    parent: str, child: str, rule: str, tmp_path: Path
) -> None:
    names: list[Step] = [
        {"declare": ["/World/Odometry/again.inputs:parentFrameId", "string", parent]},
        {"declare": ["/World/Odometry/again.inputs:childFrameId", "string", child]},
    ]
    stage = broken_robot("rover", [*TWO_PARENTS, *names])
    (tree,) = (each for each in asked("sim", stage, tmp_path)["checks"] if each["name"] == "tree")
    assert (tree["verdict"], tree["rule"]) == ("bad", rule)
    assert rule in {each.rule for each in linted(stage).findings}


# ---- topics whose names come over a wire


def wired_number() -> Usd.Stage:
    """The lab with a number at the topic name of the clock: OmniGraph refuses such a wire."""
    number = "ROS_Clock/number"
    return broken(
        AT,
        [
            {"node": [number, "omni.graph.nodes.ConstantInt"]},
            {"declare": [f"{number}.inputs:value", "int", 5]},
            {
                "connect": [
                    "ROS_Clock/ros2_publish_clock.inputs:topicName",
                    f"{number}.inputs:value",
                ]
            },
        ],
    )


def test_a_number_that_is_wired_to_a_topic_name_changes_it_for_no_command(tmp_path: Path) -> None:
    stage = wired_number()
    (clock,) = (
        each
        for each in asked("topics", stage, tmp_path)["topics"]
        if each["node"].endswith("ros2_publish_clock")
    )
    assert clock["topic"] == "/clock"
    assert "/clock" in {each["name"] for each in asked("sim", stage, tmp_path)["topics"]}
    assert "P01" not in found_by_check(stage)


def test_a_number_at_a_topic_name_changes_it_for_no_command(tmp_path: Path) -> None:
    sender = "/World/Odometry/transform"
    stage = broken_robot("rover", [{"declare": [f"{sender}.inputs:topicName", "int", 5]}])
    ends = {each["node"]: each["topic"] for each in asked("topics", stage, tmp_path)["topics"]}
    assert ends[sender] == "/tf"
    sent = {(each["parent"], each["child"]) for each in asked("tf", stage, tmp_path)["transforms"]}
    played = {(each["parent"], each["child"]) for each in asked("sim", stage, tmp_path)["frames"]}
    assert ("odom", "chassis") in sent & played


def test_check_and_lint_find_the_wire_of_a_number_to_a_topic_name() -> None:
    stage = wired_number()
    assert "W09" in found_by_check(stage)
    assert "K22" in {each.rule for each in linted(stage).findings}
