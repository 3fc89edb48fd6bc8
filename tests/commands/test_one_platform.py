"""What a lab adds to the node types of Isaac Sim holds for every command alike."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import invoke
from pxr import Sdf, Usd

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_checkpoint, build_files

CLOCK = "isaacsim.ros2.bridge.ROS2PublishClock"
OF_A_FORK = "acme.ros.ClockPublisher"
PUBLISHER = "/World/ROS_Clock/ros2_publish_clock"
LAB = Path(__file__).parents[1] / "labs" / "mini"


def built(checkpoint: str, path: Path) -> None:
    lab = load_lab(LAB)
    build_files(lab, None, {path: lab.checkpoints[checkpoint]}, BuildOptions())


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """The clock of the lab under the name that a fork of Isaac Sim has for its publisher."""
    path = tmp_path / "Lab3_01_ros_clock.usda"
    built("01", path)
    opened = Usd.Stage.Open(str(path))
    opened.GetPrimAtPath(PUBLISHER).GetAttribute("node:type").Set(OF_A_FORK)
    opened.Save()
    return path


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A lab that says what the name means, in one line."""
    folder = tmp_path / "lab"
    folder.mkdir()
    for file in LAB.glob("*.yaml"):
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / "node_types.yaml").write_text(f"renamed: {{{OF_A_FORK}: {CLOCK}}}\n")
    return folder


def said(*arguments: object) -> str:
    return invoke(*arguments).output


@pytest.mark.parametrize(
    ("command", "shown"),
    [
        (("check", "--format", "concise"), "N06"),
        (("lint", "--format", "concise"), "K31"),
        (("topics",), "rosgraph_msgs/msg/Clock"),
        (("sim",), "60 Hz"),
    ],
)
def test_a_name_that_the_lab_declares_is_known(
    command: tuple[str, ...], shown: str, stage: Path, lab: Path
) -> None:
    assert shown not in said(*command, stage)
    assert shown in said("--lab", lab, *command, stage)


@pytest.fixture
def broken_lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "broken"
    folder.mkdir()
    monkeypatch.setenv(LAB_VARIABLE, str(folder))
    return folder


@pytest.mark.parametrize("types", [None, "renamed: [no, mapping]\n"])
def test_lint_needs_no_lab(types: str | None, broken_lab: Path, tmp_path: Path) -> None:
    path = tmp_path / "any.usda"
    built("04", path)
    if types is not None:
        (broken_lab / "node_types.yaml").write_text(types)
    shown = invoke("lint", path)
    assert shown.stdout.startswith(f"{path}: pass")
    assert "is left aside" in shown.stderr


def test_two_domains_have_a_tree_each(tmp_path: Path) -> None:
    path = tmp_path / "two.usda"
    build_checkpoint(None, "05", path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    graph = "/turtlebot3_burger/ROS_OdomTF"
    Sdf.CopySpec(layer, graph, layer, "/World/Again")
    layer.Save()
    opened = Usd.Stage.Open(layer)
    for prim in Usd.PrimRange(opened.GetPrimAtPath("/World/Again")):
        for attribute in prim.GetAttributes():
            old = attribute.GetConnections()
            attribute.SetConnections([p.ReplacePrefix(graph, "/World/Again") for p in old])
    context = opened.GetPrimAtPath("/World/Again/ros2_context")
    context.GetAttribute("inputs:domain_id").Set(7)
    opened.Save()
    shown = said("tf", path)
    assert "domain 7:" in shown
    assert "!" not in shown
