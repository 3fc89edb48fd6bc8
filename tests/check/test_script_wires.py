"""The script that holds NVIDIA's own wires against the rules about wires."""

from __future__ import annotations

import ast
import runpy
from typing import Any

import pytest
from places import REPOSITORY

SCRIPT = """
async def test(graph_path):
    edit({
        keys.CREATE_NODES: [
            ("Tick", "omni.graph.action.OnPlaybackTick"),
            (graph_path + "/Clock", "isaacsim.ros2.bridge.ROS2PublishClock"),
        ],
        keys.CONNECT: [
            ("Tick.outputs:tick", f"{graph_path}/Clock.inputs:execIn"),
            ("Tick.outputs:time", "Clock.inputs:timeStamp"),
            ("Elsewhere.outputs:time", "Clock.inputs:timeStamp"),
        ],
    })
"""


@pytest.fixture(scope="module")
def module() -> dict[str, Any]:
    return runpy.run_path(str(REPOSITORY / "benchmarks" / "script_wires.py"))


def test_the_literal_wires_of_a_script_are_read(module: dict[str, Any]) -> None:
    wires = list(module["literal_wires"](ast.parse(SCRIPT)))
    assert [wire.ends for wire in wires] == [
        ("OnPlaybackTick.outputs:tick", "ROS2PublishClock.inputs:execIn"),
        ("OnPlaybackTick.outputs:time", "ROS2PublishClock.inputs:timeStamp"),
        (".outputs:time", "ROS2PublishClock.inputs:timeStamp"),
    ]


@pytest.mark.parametrize(
    ("source", "target", "rules"),
    [
        ("outputs:tick", "inputs:execIn", []),
        ("outputs:tick", "inputs:timeStamp", ["K22"]),
        ("outputs:tick", "inputs:time", ["K21"]),
    ],
)
def test_a_wire_is_judged_by_the_rules_about_wires(
    module: dict[str, Any], source: str, target: str, rules: list[str]
) -> None:
    kinds = ("omni.graph.action.OnPlaybackTick", "isaacsim.ros2.bridge.ROS2PublishClock")
    wire = module["Wire"](kinds[0], source, kinds[1], target)
    assert [finding.rule for _, finding in module["judge"]([wire], "6.0")] == rules
