"""The stages of the bundled lab, a starter, and submissions made of them."""

from __future__ import annotations

import atexit
import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files
from lab3_usd.stage.write.starter import build_starter

LAB = load_lab()


def build_all(lab: Lab) -> Path:
    """Build the stages and the starter of the lab in force, and return their folder."""
    folder = Path(mkdtemp(prefix="built"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    build_files(
        lab, None, plan_files(lab, folder / "work", list(lab.checkpoints), "usda"), BuildOptions()
    )
    build_starter(folder / "starter.usda")
    return folder


@cache
def built() -> Path:
    return build_all(LAB)


def starter() -> Path:
    return built() / "starter.usda"


def stage(number: str) -> Path:
    return built() / "work" / f"{LAB.checkpoints[number].file}.usda"


def submission(folder: Path, number: str) -> Path:
    """Write a submission with this stage."""
    (folder / "work").mkdir(parents=True)
    shutil.copyfile(stage(number), folder / "work" / stage(number).name)
    return folder
