"""Whatever reaches an input of a node, its function answers: it computes, or says what is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from breaking import correct_stage
from lone_nodes import node

from lab3_usd.isaac.node_types import INPUT, NodeType, Port
from lab3_usd.isaac.values import Value
from lab3_usd.sim.execution.node_instance import NodeInstance, function_of
from lab3_usd.sim.execution.world import World, world_of
from lab3_usd.sim.timeline import render
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

ROBOT = "/turtlebot3_burger"
LIDAR = f"{ROBOT}/base_scan/Lidar2D"
TARGETS = (ROBOT, LIDAR, f"{ROBOT}/base_footprint/Camera_1", "/World/ROS_Clock", "/nowhere", "")
NUMBERS = (0, -1, 1, 2**31 - 1, -(2**31), 2**64 - 1, 1e-300, -1e308, math.inf, -math.inf, math.nan)
OTHER: tuple[Any, ...] = (None, "", "a", True, (), ("a", "b", "c"), ((),) * 3)
TYPES = sorted(
    (known for known in load_platform().types.values() if function_of(known)),
    key=lambda known: known.type,
)
PRODUCT = "/Render/Product0"


@pytest.fixture(scope="module")
def stage() -> World:
    """A stage with the render product of its lidar."""
    stage = world_of(read_scene(correct_stage("05"), load_platform()), load_platform())
    shown = node("isaacsim.core.nodes.IsaacCreateRenderProduct", cameraPrim=LIDAR)
    shown.values |= {"enabled": True, "width": 64, "height": 48}
    shown.memory["path"] = PRODUCT
    assert shown.compute(stage)
    return stage


def odd_values(port: Port) -> Iterator[Value | None]:
    """Yield tokens that are allowed, and odd values of any shape: wires bring what they like."""
    yield from port.allowed
    yield from OTHER
    for number in NUMBERS:
        yield number
        for count in (1, 2, 3, 4):
            yield (number,) * count
        yield ((number,) * 3,) * 3
        yield ((number,) * 4,) * 3


def sensible(known: NodeType) -> dict[str, Any]:
    """Return what lets a node come as far as it can."""
    values: dict[str, Any] = {
        "topicName": "odd", "context": 1, "renderProductPath": PRODUCT, "enabled": True,
        "speed": 1.0, "steeringAngle": 0.5, "wheelBase": 0.5, "trackWidth": 0.4,
        "frontWheelRadius": 0.1, "wheelDistance": 0.3, "linearVelocity": (1.0, 0.0, 0.0),
        "robotPath": ROBOT, "velocityCommand": (1.0, 2.0), "a": 1.0, "b": 2.0, "value": 1.0,
        "jointNames": ("a",), "jointPositions": (0.0,), "jointVelocities": (0.0,),
        "jointEfforts": (0.0,), "jointDofTypes": (0,), "stageMetersPerUnit": 1.0,
        "messagePackage": "std_msgs", "messageSubfolder": "msg", "messageName": "Int32",
    }  # fmt: skip
    if known.type.endswith("HolonomicController"):
        values |= {
            "wheelRadius": (0.1,), "mecanumAngles": (90.0,), "inputVelocity": (1.0, 0.0, 0.1),
            "wheelPositions": ((0.2, 0.0, 0.0), (-0.1, 0.2, 0.0), (-0.1, -0.2, 0.0)),
            "wheelOrientations": ((1.0, 0.0, 0.0, 0.0),) * 3,
        }  # fmt: skip
    elif known.type.endswith("DifferentialController"):
        values["wheelRadius"] = 0.1
    return {name: value for name, value in values.items() if known.input(name) is not None}


def made(known: NodeType, values: dict[str, Any], target: str) -> NodeInstance:
    ports = [port for port in known.ports.values() if port.name.startswith(INPUT)]
    targets = {port.short: target for port in ports if port.is_target and target}
    return node(known.type, {**sensible(known), **values}, **targets)


def run(stage: World, running: NodeInstance) -> None:
    stage.network.sent.clear()
    stage.writers.clear()
    for made in [name for name in stage.products if name != PRODUCT]:
        del stage.products[made]
    stage.network.contexts[1] = 0
    for _ in range(3):
        running.compute(stage)
        stage.frame += 1
        stage.since_play += stage.dt
        render(stage)


@pytest.mark.parametrize("known", TYPES, ids=lambda known: known.type)
def test_a_node_answers_whatever_reaches_it(stage: World, known: NodeType) -> None:
    for target in TARGETS:
        run(stage, made(known, {}, target))
    for port in known.ports.values():
        if not port.name.startswith(INPUT) or port.is_execution or port.is_target:
            continue
        target = LIDAR if "Lidar" in known.type else ROBOT
        for value in odd_values(port):
            run(stage, made(known, {port.short: value}, target))
