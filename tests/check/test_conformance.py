"""When a value, a target or a wire is what a spec asks for."""

from __future__ import annotations

import math

import pytest
from breaking import the_lab

from lab3_usd.check.match.conformance import (
    setting_matches,
    target_matches,
)
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.values import Value
from lab3_usd.model.stage import Node, PortState, same_value
from lab3_usd.spec.graph import Setting, Target

SAME: list[tuple[Value, Value]] = [
    (1, 1.0),
    (0.22, 0.2199999988079071),
    (0.025, 0.02500000037252903),
    (0.0, -0.0),
    ((1, 2.0), (1.0, 2)),
    ("a", "a"),
    (True, True),
]
OTHER: list[tuple[Value | None, Value | None]] = [
    (1, True),
    (0, False),
    (1.0, True),
    (0.0, False),
    (0.22, 0.2200005),
    (0.0, 1e-9),
    ((1.0,), (1.0, 1.0)),
    ((1.0,), 1.0),
    (1.0, (1.0,)),
    ("a", "b"),
    (16_777_216, 16_777_217),  # whole numbers have no noise
    ("1", 1),
    (None, 0),
    (math.inf, 1.0),
]


@pytest.mark.parametrize(
    ("one", "other", "same"), [(*pair, True) for pair in SAME] + [(*pair, False) for pair in OTHER]
)
def test_values_are_the_same_up_to_noise(
    one: Value | None, other: Value | None, *, same: bool
) -> None:
    assert same_value(one, other) is same
    assert same_value(other, one) is same


CLOCK = "isaacsim.ros2.bridge.ROS2PublishClock"
LIDAR = "isaacsim.ros2.bridge.ROS2RtxLidarHelper"


def node(type_name: str, name: str = "node", **ports: PortState) -> Node:
    states = {f"inputs:{port}": state for port, state in ports.items()}
    return Node(f"/g/{name}", type_name, the_lab().platform.get(type_name), 1, states)


def state(value: Value | None = None, *sources: str) -> PortState:
    return PortState("", "", value, sources)


@pytest.mark.parametrize("topic", ["/clock", "clock", "//clock/", "~/clock", "_clock"])
def test_topics_are_compared_as_ros_2_resolves_them(topic: str) -> None:
    setting = Setting("inputs:topicName", "/clock", "B6")
    assert setting_matches(node(CLOCK), setting, topic)


@pytest.mark.parametrize("topic", ["/clock2", "", "/a/clock", "/Clock", None])
def test_another_topic_is_not_met(topic: str | None) -> None:
    assert not setting_matches(node(CLOCK), Setting("inputs:topicName", "/clock", "B6"), topic)


@pytest.mark.parametrize("frame", ["/base_scan", "base_scan/", "Base_scan"])
def test_frames_are_compared_letter_by_letter(frame: str) -> None:
    assert not setting_matches(node(LIDAR), Setting("inputs:frameId", "base_scan", "D8"), frame)


def test_targets_are_a_set() -> None:
    target = Target("inputs:targetPrims", ("/a", "/b"), "F9")
    asked = PortState("inputs:targetPrims", "rel", targets=("/b", "/a", "/b"))
    assert target_matches(Node("/g/n", "", None, 1, {"inputs:targetPrims": asked}), target)
    fewer = PortState("inputs:targetPrims", "rel", targets=("/b",))
    assert not target_matches(Node("/g/n", "", None, 1, {"inputs:targetPrims": fewer}), target)


TOKEN = node("omni.graph.nodes.ConstantToken", "token", value=state("laser_scan"))
UNKNOWN = node("omni.graph.nodes.ConstantString", "unknown", value=state("/other"))
TICK = node("omni.graph.action.OnPlaybackTick", "tick")
TIME = node("isaacsim.core.nodes.IsaacReadSimulationTime", "time")
NODES = {each.path: each for each in (TOKEN, UNKNOWN, TICK, TIME)}


@pytest.mark.parametrize(
    ("source", "value"),
    [
        ("/g/token.inputs:value", "laser_scan"),
        ("/g/unknown.inputs:value", "/other"),
        # A port that its type does not have, or a node that is gone.
        ("/g/token.outputs:value", "own"),
        ("/g/gone.inputs:value", "own"),
        # A signal or a number is no text: the application drops the wire.
        ("/g/tick.outputs:tick", "own"),
        ("/g/time.outputs:simulationTime", "own"),
        # An input that is no constant feeds nothing.
        ("/g/time.inputs:resetOnStop", "own"),
    ],
)
def test_a_value_is_followed_through_a_wire(source: str, value: str) -> None:
    helper = node(LIDAR, type=state("own", source))
    assert effective_value(helper, "inputs:type", NODES) == value


def test_a_node_of_an_unknown_type_takes_what_a_constant_brings() -> None:
    unknown = node("not.known", text=state("own", "/g/unknown.inputs:value"))
    assert effective_value(unknown, "inputs:text", NODES) == "/other"


def test_what_is_known_at_run_time_only_is_no_value() -> None:
    wheels = "isaacsim.robot.wheeled_robots.DifferentialController"
    controller = node(wheels, wheelRadius=state(0.025, "/g/time.outputs:simulationTime"))
    assert effective_value(controller, "inputs:wheelRadius", NODES) is None
    setting = Setting("inputs:wheelRadius", 0.025, "C8")
    assert not setting_matches(controller, setting, None)


def test_a_value_that_nobody_wrote_is_the_default_of_the_type() -> None:
    assert effective_value(node(CLOCK), "inputs:queueSize", {}) == 10
    assert effective_value(node("not.known"), "inputs:queueSize", {}) is None
