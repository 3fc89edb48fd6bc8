"""How grave it is that a node changes the scene: what it hits, and whether it surely runs."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import broken, judged

ROBOT, NODE = "/turtlebot3_burger", "/Graph/writer"
WRITE, MOVE = "omni.graph.nodes.WritePrimAttribute", "omni.graph.nodes.TranslateToTarget"
CONVEYOR = "isaacsim.asset.gen.conveyor.IsaacConveyor"
CAMERA = "isaacsim.core.nodes.IsaacSetCameraOnRenderProduct"
SERVICE = "isaacsim.ros2.bridge.ROS2ServicePrim"


def severities(kind: str, *steps: dict[str, Any], event: str = "OnPlaybackTick") -> list[str]:
    signal = "onStep" if kind == CONVEYOR else "execIn"
    driven: list[dict[str, Any]] = [
        {"define": ["/Graph", "OmniGraph"]},
        {"node": ["/Graph/event", f"omni.graph.action.{event}"]},
        {"declare": ["/Graph/event.outputs:tick", "uint"]},
        {"node": [NODE, kind]},
        {"declare": [f"{NODE}.inputs:{signal}", "uint"]},
        {"connect": [f"{NODE}.inputs:{signal}", "/Graph/event.outputs:tick"]},
    ]
    found = judged(broken("04", [*driven, *steps]), "04").findings
    return [finding.severity for finding in found if finding.rule == "N13"]


def at(port: str, prim: str) -> dict[str, Any]:
    return {"targets": [f"{NODE}.inputs:{port}", prim]}


def named(name: str) -> dict[str, Any]:
    return {"declare": [f"{NODE}.inputs:name", "token", name]}


@pytest.mark.parametrize(
    ("kind", "steps", "severity"),
    [
        (WRITE, [at("prim", f"{ROBOT}/base_link"), named("physics:mass")], "error"),
        (WRITE, [at("prim", f"{ROBOT}/visuals"), named("primvars:displayColor")], "warning"),
        (WRITE, [at("prim", "/World/ObservationCamera"), named("focalLength")], "warning"),
        (WRITE, [at("prim", "/physicsScene"), named("physics:gravityMagnitude")], "error"),
        (WRITE, [at("prim", "/World"), named("visibility")], "warning"),
        (MOVE, [at("sourcePrim", f"{ROBOT}/base_scan/Lidar2D")], "error"),
        (MOVE, [at("sourcePrim", "/Environment/GroundPlane")], "error"),
        (MOVE, [at("targetPrim", ROBOT)], "warning"),  # which it goes to
        (CONVEYOR, [at("conveyorPrim", f"{ROBOT}/base_link")], "error"),
        (CONVEYOR, [at("conveyorPrim", "/Environment/GroundPlane/CollisionPlane")], "warning"),
        (SERVICE, [], "warning"),
    ],
)
def test_it_is_an_error_to_change_what_the_lab_asks_for(
    kind: str, steps: list[dict[str, Any]], severity: str
) -> None:
    assert severities(kind, *steps) == [severity]


def test_another_camera_on_a_product_of_the_lab_is_an_error() -> None:
    wire = f"{NODE}.inputs:renderProductPath"
    product = "ROS_Camera/isaac_create_render_product.outputs:renderProductPath"
    steps = [{"declare": [wire, "token"]}, {"connect": [wire, product]}]
    assert severities(CAMERA, *steps) == ["error"]


def test_what_an_event_may_trigger_is_a_warning() -> None:
    aim = at("sourcePrim", ROBOT)
    assert severities(MOVE, aim, event="OnCustomEvent") == ["warning"]
