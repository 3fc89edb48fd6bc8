"""Makes ten submissions of a correct one, each with something else missing or wrong.

python docs/examples/ten_submissions.py class/ana ten
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from pxr import Usd

ROBOT = "/turtlebot3_burger"
SCAN = f"{ROBOT}/base_scan/Lidar2D/ROS_Lidar2D/ros2_rtx_lidar_helper"
CAMERA = f"{ROBOT}/base_footprint/Camera_1"
ODOMETRY = "ROS_OdomTF"


def in_stages(first: str, change: Callable[[Usd.Stage], object]) -> Callable[[Path], None]:
    """Make a change in every stage from a checkpoint on."""

    def make(work: Path) -> None:
        for path in sorted(work.glob("*.usda")):
            if path.name[5:7] >= first:
                stage = Usd.Stage.Open(str(path))
                change(stage)
                stage.Save()

    return make


def attribute(path: str, name: str, value: object) -> Callable[[Usd.Stage], object]:
    """Set a value."""
    return lambda stage: stage.GetPrimAtPath(path).GetAttribute(name).Set(value)


def keep(*numbers: str) -> Callable[[Path], None]:
    """Remove the other stages."""

    def remove(work: Path) -> None:
        for path in work.glob("*.usda"):
            if path.name[5:7] not in numbers:
                path.unlink()

    return remove


def copy_upward(work: Path) -> None:
    """Save the lidar's stage under all later names."""
    lidar = next(work.glob("*_03_*"))
    for path in work.glob("*.usda"):
        if path.name[5:7] > "03":
            shutil.copyfile(lidar, path)


def script(work: Path) -> None:
    """Add a script to the odometry of one stage."""
    stage = Usd.Stage.Open(str(next(work.glob("*_05_*"))))
    graph = next(prim for prim in stage.Traverse() if prim.GetName() == ODOMETRY)
    node = stage.DefinePrim(graph.GetPath().AppendChild("script"), "OmniGraphNode")
    node.CreateAttribute("node:type", _token()).Set("omni.graph.scriptnode.ScriptNode")
    stage.Save()


def _token() -> object:
    from pxr import Sdf

    return Sdf.ValueTypeNames.Token


SUBMISSIONS: dict[str, Callable[[Path], object]] = {
    "01-whole": lambda _work: None,
    "02-no-map": lambda work: shutil.rmtree(work.parent / "maps"),
    "03-until-lidar": keep("00", "01", "02", "03"),
    "04-copied-upward": copy_upward,
    "05-no-tf-stage": keep("00", "01", "02", "03", "04", "06", "07", "08"),
    "06-wrong-topic": in_stages("03", attribute(SCAN, "inputs:topicName", "/laser")),
    "07-lens": in_stages("04", attribute(CAMERA, "focalLength", 24.0)),
    "08-script-once": script,
    "09-robot-changed": in_stages(
        "02", attribute(f"{ROBOT}/joints/wheel_left_joint", "drive:angular:physics:damping", 0.0)
    ),
    "10-empty-stage": lambda work: next(work.glob("*_08_*")).write_text("#usda 1.0\n"),
}


def main(correct: Path, target: Path) -> None:
    """Write the ten submissions."""
    for name, change in SUBMISSIONS.items():
        shutil.copytree(correct, target / name)
        change(target / name / "work")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
