"""Graphs and sensors below prims that the lab demands of no stage: `/World/Graphs`, a mount."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import quick_yaml
from in_process import invoke
from places import REPOSITORY
from pxr import Usd

from lab3_usd.spec.load.loader import load_lab

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
MOUNT = "/World/Jetbot/chassis/mount"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The second lab with the clock below a folder of graphs, and the IMU on a mount."""
    folder = tmp_path_factory.mktemp("below") / "lab"
    shutil.copytree(JETBOT, folder)
    for path in folder.glob("*.yaml"):
        text = path.read_text().replace("path: /World/Clock", "path: /World/Graphs/Clock")
        path.write_text(text.replace("/World/Jetbot/chassis/Imu", f"{MOUNT}/Imu"))
    starter = quick_yaml.load((folder / "starter.yaml").read_text())
    robot = starter["prims"]["World"]["children"]["Jetbot"]["children"]
    robot["chassis"]["children"]["mount"] = {"type": "Xform"}
    (folder / "starter.yaml").write_text(quick_yaml.dump(starter))
    return folder


@pytest.fixture(scope="module")
def stages(lab: Path) -> list[Path]:
    shown = invoke("--lab", lab, "build", "--out", lab.parent / "out")
    assert shown.exit_code == 0, shown.output
    return [Path(line) for line in shown.output.split()]


def without(stage: Path, path: str, folder: Path) -> Path:
    """Copy a stage without one of its prims."""
    copy = folder / stage.name
    shutil.copyfile(stage, copy)
    opened = Usd.Stage.Open(str(copy))
    assert opened.RemovePrim(path)
    opened.GetRootLayer().Save()
    return copy


def findings(lab: Path, stage: Path) -> list[tuple[str, str]]:
    shown = invoke("--lab", lab, "check", "--format", "json", stage).stdout
    (result,) = json.loads(shown)["results"]
    return [(finding["rule"], finding["prim"]) for finding in result["findings"]]


def test_what_is_above_a_graph_is_built_with_it(lab: Path, stages: list[Path]) -> None:
    assert not Usd.Stage.Open(str(stages[0])).GetPrimAtPath("/World/Graphs")
    shown = invoke("--lab", lab, "check", "--quiet", *stages)
    assert "7 files: 7 passed, 0 failed" in shown.output


def test_the_first_stage_passes_by_a_lab_whose_graphs_have_a_folder_of_their_own(
    stages: list[Path], tmp_path: Path
) -> None:
    named = [word for stage in stages[:2] for word in ("--from", stage)]
    shown = invoke("lab", "new", tmp_path / "lab", *named)
    assert shown.exit_code == 0, shown.output
    assert load_lab(tmp_path / "lab").scene.world.graph_parent.path == "/World"


def test_a_graph_is_missing_though_no_rule_demands_the_prim_above(
    lab: Path, stages: list[Path], tmp_path: Path
) -> None:
    stage = without(stages[1], "/World/Graphs", tmp_path)
    assert findings(lab, stage) == [("G01", "/World/Graphs/Clock")]


def test_a_sensor_is_missing_though_no_rule_demands_the_prim_above(
    lab: Path, stages: list[Path], tmp_path: Path
) -> None:
    stage = without(stages[4], MOUNT, tmp_path)
    rules = [rule for rule, prim in findings(lab, stage) if prim == f"{MOUNT}/Imu"]
    assert rules == ["D01"]


def test_a_graph_is_repaired_together_with_the_prim_above(
    lab: Path, stages: list[Path], tmp_path: Path
) -> None:
    stage = without(stages[1], "/World/Graphs", tmp_path)
    shown = invoke("--lab", lab, "fix", stage, "--unsafe", "--in-place")
    assert "1 repaired, 0 left" in shown.output
    assert findings(lab, stage) == []
