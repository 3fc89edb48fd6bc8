"""`lab3 fix` in a lab that has no starter: what the lab says by itself is repaired."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from in_process import invoke
from pxr import Usd

ROBOT = "/World/Jetbot"


@pytest.fixture
def lab(repository: Path, tmp_path: Path) -> Path:
    """The second lab, whose starter is taken away after the stage is built."""
    folder = tmp_path / "lab"
    shutil.copytree(repository / "docs" / "examples" / "labs" / "jetbot", folder)
    invoke("--lab", folder, "build", "--out", tmp_path, "--only", "6")
    (folder / "starter.yaml").rename(tmp_path / "starter.yaml")
    return folder


def edited(lab: Path) -> tuple[Path, Usd.Stage]:
    """Return the stage of the sixth checkpoint, open."""
    path = lab.parent / "Week5_6_odometry.usda"
    return path, Usd.Stage.Open(str(path))


def test_masses_poses_and_sensors_are_repaired(lab: Path) -> None:
    path, stage = edited(lab)
    stage.GetPrimAtPath(f"{ROBOT}/mast").GetAttribute("physics:mass").Set(7.0)
    stage.GetPrimAtPath(f"{ROBOT}/chassis/Imu").GetAttribute("xformOp:translate").Set((0, 0, 1))
    stage.RemovePrim(f"{ROBOT}/mast/Scanner")
    stage.GetRootLayer().Save()
    del stage  # whose layer USD would go on showing
    result = invoke("--lab", lab, "fix", path, "--in-place", "--unsafe")
    assert result.exit_code == 0, result.output
    assert invoke("--lab", lab, "check", path).exit_code == 0


def test_what_only_a_starter_says_is_left_out_with_the_reason(lab: Path) -> None:
    path, stage = edited(lab)
    stage.GetPrimAtPath(f"{ROBOT}/mast").GetAttribute("physics:mass").Set(7.0)
    stage.RemovePrim(f"{ROBOT}/chassis/left_wheel_joint")
    stage.GetRootLayer().Save()
    del stage  # whose layer USD would go on showing
    result = invoke("--lab", lab, "fix", path, "--in-place", "--unsafe")
    assert result.exit_code == 1
    assert "left out (its repair needs the starter: name it with --starter)" in result.output
    assert f"repaired S04 {ROBOT}/mast" in result.output


def test_a_starter_that_is_given_says_the_rest(lab: Path) -> None:
    shutil.copy(lab.parent / "starter.yaml", lab)
    invoke("--lab", lab, "starter", "--out", lab.parent / "starter.usda")
    (lab / "starter.yaml").unlink()
    path, stage = edited(lab)
    stage.RemovePrim(f"{ROBOT}/chassis/left_wheel_joint")
    stage.GetRootLayer().Save()
    del stage  # whose layer USD would go on showing
    starter = lab.parent / "starter.usda"
    result = invoke("--lab", lab, "fix", path, "--in-place", "--unsafe", "--starter", starter)
    assert result.exit_code == 0, result.output
