"""One line of data for a port that a later release renames, which every command follows."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path

import pytest
import yaml
from in_process import invoke
from pxr import Sdf

from lab3_usd import data
from lab3_usd.data import data_folder
from lab3_usd.spec.contradictions import scene
from lab3_usd.spec.load import loader
from lab3_usd.stage.write.builder import build_checkpoint

CLOCK = "isaacsim.ros2.bridge.ROS2PublishClock"
PUBLISHER = "/World/ROS_Clock/ros2_publish_clock"
TIME = "isaacsim.core.nodes.IsaacReadSimulationTime"
PORTS = {
    f"{CLOCK}.inputs:topicName": {"6.3": "inputs:topic"},
    f"{TIME}.outputs:simulationTime": {"6.3": "outputs:seconds"},
}


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """The clock of the lab as a release would save it that renames a topic and an output."""
    path = tmp_path / "Lab3_01_ros_clock.usda"
    build_checkpoint(None, "01", path)
    text = path.read_text()
    assert "inputs:topicName" in text
    assert "outputs:simulationTime" in text
    text = text.replace("inputs:topicName", "inputs:topic")
    path.write_text(text.replace("outputs:simulationTime", "outputs:seconds"))
    return path


@pytest.fixture
def _with_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Isaac Sim's data with one line more."""
    graphs = Path(shutil.copytree(data_folder("graphs"), tmp_path / "graphs"))
    renames = graphs / "isaac" / "renames.yaml"
    table = yaml.safe_load(renames.read_text())
    table["ports"] |= PORTS
    renames.write_text(yaml.safe_dump(table))

    def folder(name: str) -> Path:
        return graphs if name == "graphs" else data_folder(name)

    for module in (data, loader, scene):
        monkeypatch.setattr(module, "data_folder", folder)
    # What other tests have loaded stays as it is.
    monkeypatch.setattr(loader, "_bundled", cache(loader._bundled.__wrapped__))


def said(*arguments: object) -> str:
    return invoke(*arguments).output


def rules(*command: object) -> set[str]:
    lines = said(*command, "--format", "concise").splitlines()
    return {word for line in lines for word in line.split() if word[1:].isdecimal()}


def test_without_the_line_nobody_knows_the_port(stage: Path) -> None:
    assert rules("check", stage) == {"P08", "W03"}


@pytest.mark.usefixtures("_with_line")
def test_every_command_follows_the_line(stage: Path) -> None:
    checked = said("check", stage, "--format", "concise").splitlines()
    assert [line for line in checked if "error" in line] == []
    assert any("N06" in line and "of Isaac Sim from 6.3 on" in line for line in checked)
    linted = said("lint", stage, "--format", "concise")
    assert "error" not in linted
    assert "K31 2 nodes have port names of Isaac Sim from 6.3 on, such as outputs:seconds" in linted
    assert "/clock" in said("topics", stage)
    assert "60 Hz" in said("sim", stage)
    assert "0 bad" in said("sim", stage)


@pytest.mark.usefixtures("_with_line")
def test_by_the_later_release_its_own_names_are_no_others(stage: Path) -> None:
    assert "K31" not in said("lint", "--isaac", "6.3", stage, "--format", "concise")


@pytest.mark.usefixtures("_with_line")
def test_a_repair_writes_the_name_that_the_file_has(stage: Path, tmp_path: Path) -> None:
    layer = Sdf.Layer.FindOrOpen(str(stage))
    layer.GetAttributeAtPath(f"{PUBLISHER}.inputs:topic").default = "/clok"
    stamp = layer.GetAttributeAtPath(f"{PUBLISHER}.inputs:timeStamp")
    stamp.connectionPathList.ClearEditsAndMakeExplicit()
    layer.Save()
    shown = said("check", stage, "--format", "concise")
    assert "inputs:topic is" in shown
    assert "inputs:topicName" not in shown.replace("now inputs:topicName", "")
    assert "set topic to '/clock'" in " ".join(said("check", stage).split())
    fixed = tmp_path / "fixed" / stage.name
    fixed.parent.mkdir()
    invoke("fix", stage, "--output", fixed)
    text = fixed.read_text()
    assert 'inputs:topic = "/clock"' in text
    assert "outputs:seconds>" in text
    assert "topicName" not in text
    assert "simulationTime" not in text.replace("read_simulation_time", "")
