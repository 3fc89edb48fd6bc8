"""Files for the tests of grading: the nine stages, a starter, and submissions made of them."""

from __future__ import annotations

import atexit
import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from pxr import Sdf

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files
from lab3_usd.stage.write.starter import build_starter

LAB = load_lab()
CLOCK = LAB.graphs["ROS_Clock"].path


@cache
def built() -> Path:
    """Build the nine stages and the starter once, and return their folder."""
    folder = Path(mkdtemp(prefix="built"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    plan = plan_files(LAB, folder / "work", list(LAB.checkpoints), "usda")
    build_files(LAB, None, plan, BuildOptions())
    build_starter(folder / "starter.usda")
    return folder


def starter() -> Path:
    return built() / "starter.usda"


def stage(number: str) -> Path:
    return built() / "work" / f"{LAB.checkpoints[number].file}.usda"


def submission(folder: Path, *numbers: str, work: str = "work") -> Path:
    """Write a submission with these stages, all nine when none is named."""
    (folder / work).mkdir(parents=True, exist_ok=True)
    for number in numbers or LAB.checkpoints:
        shutil.copyfile(stage(number), folder / work / stage(number).name)
    return folder


def cut_wire(path: Path) -> Path:
    """Take the execution wire of the clock out of a stage."""
    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    attribute = layer.GetAttributeAtPath(f"{CLOCK}/ros2_publish_clock.inputs:execIn")
    attribute.connectionPathList.ClearEditsAndMakeExplicit()
    layer.Export(str(path))
    return path


def files_below(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its path there."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
