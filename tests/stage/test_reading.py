"""What of a stage becomes a node, a prim, or neither."""

from __future__ import annotations

import pytest
from breaking import broken, judged, place, the_lab
from pxr import Gf, Usd

from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.execution_order import run_states
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene
from lab3_usd.stage.read.stage_reader import read_model


def read(*steps: dict[str, object]) -> StageModel:
    return read_model(broken("05", list(steps)), the_lab().platform, "stage.usda")


def topics(stage: StageModel) -> list[str | None]:
    return [endpoint.topic for endpoint in endpoints(stage)]


def test_what_is_no_node_below_a_graph_is_a_prim_of_the_scene() -> None:
    wall = place("ROS_Clock/wall")
    stage = read({"define": ["ROS_Clock/wall", "Cube"]}, {"schema": [wall, "PhysicsCollisionAPI"]})
    assert stage.prims[wall].type == "Cube"
    assert wall in {each.path for each in stage.colliders.below("/")}
    assert wall not in {node.path for node in stage.nodes()}


def test_a_node_prim_of_another_type_is_absent_and_says_why() -> None:
    stage = read({"type of prim": ["ROS_Clock/ros2_context", "Xform"]})
    (gone,) = [each for graph in stage.graphs for each in graph.absent]
    assert (gone.path, gone.reason) == (
        place("ROS_Clock/ros2_context"),
        "of type Xform, expected OmniGraphNode",
    )


def test_a_namespace_counts_from_the_node_on_and_once() -> None:
    stage = read(
        {"declare": ["ROS_Clock/ros2_publish_clock.isaac:namespace", "string", "own"]},
        {"declare": ["ROS_Clock.isaac:namespace", "string", "graph"]},
        {"declare": ["/World.isaac:namespace", "string", "world"]},
    )
    assert "/world/graph/own/clock" in topics(stage)


def test_a_namespace_on_a_node_without_a_type_moves_no_node_below_it() -> None:
    stage = read(
        {"define": ["/World/left", "OmniGraphNode"]},
        {"declare": ["/World/left.isaac:namespace", "string", "left"]},
        {"copy": ["ROS_Clock", "/World/left/ROS_Clock"]},
    )
    assert topics(stage).count("/clock") == 2


def test_only_what_stands_below_the_applications_own_prims_is_ignored(
    subtests: pytest.Subtests,
) -> None:
    for top, count in (("/Replicator", 1), ("/ReplicatorX", 2), ("/Render", 1), ("/Renderer", 2)):
        with subtests.test(top=top, count=count):
            stage = read({"define": [top, "Xform"]}, {"copy": ["ROS_Clock", f"{top}/ROS_Clock"]})
            assert topics(stage).count("/clock") == count, top


def test_a_copy_beside_the_applications_own_prims_is_found() -> None:
    found = judged(broken("05", [{"copy": ["ROS_Clock", "/ReplicatorX"]}]), "05").findings
    assert ("Q01", "/ReplicatorX/ros2_publish_clock") in {(f.rule, f.prim) for f in found}


def test_the_type_of_a_node_and_a_namespace_may_be_asset_paths() -> None:
    stage = read(
        {"define": ["/Render", "Xform"]},
        {"define": ["/Render/script", "Xform"]},
        {"declare": ["/Render/script.node:type", "asset", "omni.graph.scriptnode.ScriptNode"]},
        {"declare": ["/World.isaac:namespace", "asset", "world"]},
    )
    assert [script.prim for script in stage.scripts] == ["/Render/script"]
    assert "/world/clock" in topics(stage)


@pytest.mark.parametrize("instanced", [False, True])
def test_a_graph_of_an_instance_may_run(instanced: bool) -> None:  # noqa: FBT001 - pytest passes it so
    steps: list[dict[str, object]] = [
        {"define": ["/World/Holder", "Xform"]},
        {"copy": ["ROS_Clock", "/World/Holder/ROS_Clock"]},
    ]
    stage = read(*steps, *([{"instance": "/World/Holder"}] if instanced else []))
    state = run_states(stage)["/World/Holder/ROS_Clock/ros2_publish_clock"]
    assert state == ("may run" if instanced else "runs")
    found = [endpoint for endpoint in endpoints(stage) if endpoint.topic == "/clock"]
    assert [each.sure for each in found] == [not instanced, True]


@pytest.mark.parametrize("said", [Gf.Matrix2d(), "1", True, None], ids=repr)
def test_a_unit_that_is_no_number_is_not_said(
    said: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = broken("05", [])
    # One flipped bit of a binary file gives a value another type, which no API writes.
    for kind in (Usd.Stage, Usd.Prim):
        monkeypatch.setattr(kind, "GetMetadata", lambda _of, _name: said)
    model = read_model(stage, the_lab().platform, "stage.usdc")
    assert (model.meters_per_unit, model.kilograms_per_unit) == (0.01, 1.0)
    assert max(box.high[0] for box in model.colliders.below("/")) < 1
    assert read_scene(stage, load_platform()).meters_per_unit == 0.01
