"""The small frozen lab `labs/mini`: loaded and copied, its stages built once."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path
from unittest.mock import patch

from grade_files import build_all
from places import TESTS
from pxr import Sdf

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.spec.load.loader import load_lab

MINI = TESTS / "labs" / "mini"
LAB = load_lab(MINI)
LAST = list(LAB.checkpoints)[-1]


def in_force() -> patch.dict[str, str]:
    """Let the small lab stand for the bundled one, here and in child processes."""
    return patch.dict("os.environ", {LAB_VARIABLE: str(MINI)})


def copied(folder: Path) -> Path:
    """Copy the files of the lab, to be changed."""
    return shutil.copytree(MINI, folder, ignore=shutil.ignore_patterns("__pycache__"))


@cache
def built() -> Path:
    """Build the stages and the starter once, and return their folder."""
    with in_force():
        return build_all(LAB)


def starter() -> Path:
    return built() / "starter.usda"


def stage(number: str) -> Path:
    return built() / "work" / f"{LAB.checkpoints[number].file}.usda"


def submission(folder: Path, *numbers: str, work: str = "work") -> Path:
    """Write a submission with these stages, all of them when none is named."""
    (folder / work).mkdir(parents=True, exist_ok=True)
    for number in numbers or LAB.checkpoints:
        shutil.copyfile(stage(number), folder / work / stage(number).name)
    return folder


def cut_wire(path: Path) -> Path:
    """Take the execution wire of the clock out of a stage."""
    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    clock = LAB.graphs["ROS_Clock"].path
    attribute = layer.GetAttributeAtPath(f"{clock}/ros2_publish_clock.inputs:execIn")
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
