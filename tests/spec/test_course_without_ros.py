"""A course of graphs that no ROS hears: `ros.yaml` is not needed."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import invoke
from other_labs import copied
from pxr import Usd

from lab3_usd.author.api import Stage
from lab3_usd.errors import SpecError, UsageError
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab


@pytest.fixture
def shift(tmp_path: Path) -> Path:
    """A stage with one graph, which counts and writes a number."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "shift.usda"))
    stage.SetDefaultPrim(stage.DefinePrim("/World", "Xform"))
    stage.Save()
    opened = Stage.open(tmp_path / "shift.usda")
    graph = opened.graph("/World/Shift")
    tick, over = graph.node("OnPlaybackTick"), graph.node("Branch")
    graph.wire(tick.tick, over.execIn)
    opened.save(tmp_path / "shift.usda", force=True, check=False)
    return tmp_path / "shift.usda"


def test_a_course_of_graphs_without_ros_has_no_file_of_it(shift: Path) -> None:
    said = invoke("lab", "new", shift.parent / "lab", shift).output
    assert "checkpoint shift, pass, " in said
    assert not (shift.parent / "lab" / "ros.yaml").exists()
    lab = load_lab(shift.parent / "lab")
    assert (lab.topics, lab.ros.commands, lab.ros.system.handout) == ({}, (), "")
    assert check_stage(shift, "shift", lab).verdict == "pass"
    with pytest.raises(UsageError, match="asks for no output of ROS commands"):
        invoke("--lab", shift.parent / "lab", "collect", "-o", shift.parent / "collect.sh")


def test_a_lab_that_publishes_needs_a_domain_of_the_system(tmp_path: Path) -> None:
    folder = copied(tmp_path / "lab")
    (folder / "ros.yaml").unlink()
    clock = (folder / "ROS_Clock.yaml").read_text().replace("domain_id: 0", "domain_id: 3")
    (folder / "ROS_Clock.yaml").write_text(clock)
    with pytest.raises(SpecError):
        load_lab(folder)
