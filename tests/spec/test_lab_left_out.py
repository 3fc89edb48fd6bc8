"""`lab3 lab new`: what of a graph no file of a lab can hold, and the reason that is given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from other_labs import write_stage
from pxr import Sdf, Usd

from lab3_usd.new_lab.lab import describe_lab
from lab3_usd.spec.load.loader import load_lab

INERTIA = "/World/Inertia"
UINT, STRING = Sdf.ValueTypeNames.UInt, Sdf.ValueTypeNames.String


def left_out(folder: Path, change: Callable[[Usd.Stage], object]) -> tuple[str, ...]:
    """Describe a lab after a changed stage, and return what it leaves out of the IMU's graph."""
    path = write_stage(folder)
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.Save()
    lines = describe_lab([path], load_lab()).left_out
    return tuple(line.replace(f"{INERTIA}/", "") for line in lines)


def port(stage: Usd.Stage, path: str, kind: Sdf.ValueTypeName = UINT) -> Usd.Attribute:
    prim, _, name = path.partition(".")
    return stage.GetPrimAtPath(f"{INERTIA}/{prim}").CreateAttribute(name, kind)


def wire(stage: Usd.Stage, source: str, path: str) -> None:
    port(stage, path).AddConnection(f"{INERTIA}/{source}")


def blank_node(stage: Usd.Stage) -> None:
    stage.DefinePrim(f"{INERTIA}/blank", "OmniGraphNode")
    port(stage, "blank.inputs:x").Set(1)


REASONS: dict[str, tuple[Callable[[Usd.Stage], object], str]] = {
    "a value of no input of the type": (
        lambda stage: port(stage, "publish.inputs:colour", STRING).Set("red"),
        "publish.inputs:colour: isaacsim.ros2.bridge.ROS2PublishImu has no such input",
    ),
    "a value of another type": (
        lambda stage: port(stage, "publish.inputs:queueSize", STRING).Set("ten"),
        "publish.inputs:queueSize: 'ten' is not a value of uint64",
    ),
    "a second wire into an input": (
        lambda stage: wire(stage, "tick.outputs:tick", "publish.inputs:execIn"),
        "tick.outputs:tick -> publish.inputs:execIn: one of 2 wires into one input",
    ),
    "a wire of a node that is gone": (
        lambda stage: wire(stage, "gone.outputs:x", "publish.inputs:timeStamp"),
        "gone.outputs:x -> publish.inputs:timeStamp: joins no known ports",
    ),
    "a wire of a port that the type does not have": (
        lambda stage: wire(stage, "tick.outputs:tock", "publish.inputs:timeStamp"),
        "tick.outputs:tock -> publish.inputs:timeStamp: joins no known ports",
    ),
    "a wire into a port that the type does not have": (
        lambda stage: wire(stage, "imu.outputs:angVel", "publish.inputs:colour"),
        "imu.outputs:angVel -> publish.inputs:colour: joins no known ports",
    ),
    "a wire between types that do not meet": (
        lambda stage: wire(stage, "tick.outputs:tick", "publish.inputs:timeStamp"),
        "tick.outputs:tick -> publish.inputs:timeStamp: joins no known ports",
    ),
    "a wire from an input that is called as an output": (
        lambda stage: wire(stage, "imu.inputs:angVel", "publish.inputs:linearAcceleration"),
        "imu.inputs:angVel -> publish.inputs:linearAcceleration: joins no known ports",
    ),
    "a node without a type": (
        blank_node,
        "blank: has no type",
    ),
}


ALONE = "a wire into a port that the type does not have"  # which another value adds to the node
AT_ONCE = ([name for name in REASONS if name != ALONE], [ALONE])


@pytest.mark.parametrize("names", AT_ONCE, ids=", ".join)
def test_what_is_not_described_is_named_with_its_reason(names: list[str], tmp_path: Path) -> None:
    def change(stage: Usd.Stage) -> None:
        for name in names:
            REASONS[name][0](stage)

    assert sorted(left_out(tmp_path, change)) == sorted(REASONS[name][1] for name in names)


def test_everything_of_a_stage_without_faults_is_described(tmp_path: Path) -> None:
    assert left_out(tmp_path, lambda _stage: None) == ()


def test_the_file_of_the_graph_says_what_it_leaves_out(tmp_path: Path) -> None:
    path = write_stage(tmp_path)
    stage = Usd.Stage.Open(str(path))
    blank_node(stage)
    stage.Save()
    files = describe_lab([path], load_lab()).files
    note = "Not described, because a lab cannot contain it:"
    assert note in files["Inertia.yaml"]
    assert f"{INERTIA}/blank: has no type" in files["Inertia.yaml"]
    assert note not in files["Wheels.yaml"]


@pytest.mark.parametrize("is_active", [True, False])
def test_a_graph_that_is_switched_off_is_not_described(*, is_active: bool, tmp_path: Path) -> None:
    path = write_stage(tmp_path)
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath(INERTIA).SetActive(is_active)
    stage.Save()
    files = describe_lab([path], load_lab()).files
    assert ("Inertia.yaml" in files) is is_active


def test_two_graphs_of_one_name_are_told_apart_by_what_they_lie_in(tmp_path: Path) -> None:
    path = write_stage(tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CopySpec(layer, INERTIA, layer, "/World/Carter/Inertia")
    layer.Save()
    files = describe_lab([path], load_lab()).files
    names = {name for name in files if name.endswith("Inertia.yaml")}
    assert names in (
        {"Inertia.yaml", "Carter_Inertia.yaml"},
        {"Inertia.yaml", "World_Inertia.yaml"},
    )


def test_what_moves_the_robot_is_described_before_its_sensors(tmp_path: Path) -> None:
    path = write_stage(tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CopySpec(layer, "/World/Wheels", layer, "/World/Later")
    del layer.GetPrimAtPath("/World").nameChildren["Wheels"]
    layer.Save()
    files = describe_lab([path], load_lab()).files
    parts = {
        name: yaml.safe_load(files[f"{name}.yaml"])["handout"] for name in ("Later", "Inertia")
    }
    assert parts == {"Later": "B1", "Inertia": "C1"}


@pytest.mark.parametrize(("versions", "described"), [((1,), 1), ((1, 3), 3), ((3, 1), 3)])
def test_an_unknown_type_has_the_latest_version_and_every_port_of_its_nodes(
    versions: tuple[int, ...], described: int, tmp_path: Path
) -> None:
    path = write_stage(tmp_path)
    stage = Usd.Stage.Open(str(path))
    for number, version in enumerate(versions):
        node = stage.DefinePrim(f"{INERTIA}/own_{number}", "OmniGraphNode")
        node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set("acme.LowPass")
        node.CreateAttribute("node:typeVersion", Sdf.ValueTypeNames.Int).Set(version)
        port(stage, f"own_{number}.inputs:gain_{number}").Set(4)
        node.CreateRelationship("inputs:prims").SetTargets(["/World/Carter"])
        port(stage, f"own_{number}.outputs:x")
    stage.Save()
    files = describe_lab([path], load_lab()).files
    kind = yaml.safe_load(files["node_types.yaml"])["types"]["acme.LowPass"]
    gains = {f"gain_{number}": "uint" for number in range(len(versions))}
    assert kind == {
        "version": described,
        "name": "LowPass",
        "prim": "low_pass",
        "inputs": {"prims": "target", **gains},
        "outputs": {"x": "union"},
    }
