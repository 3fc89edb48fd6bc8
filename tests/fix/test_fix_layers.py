"""Repairs of stages that are spread over files: every way of layering comes out right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from layerings import LAYERINGS
from second_author import Style

from lab3_usd.fix.repairing import FixOptions, fix_stage
from lab3_usd.judge.stage import check_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.starter import build_starter

Layering = Callable[[Path, Path, str, Style], Path]
RIGHT, WRONG = b"inputs:wheelRadius = 0.025", b"inputs:wheelRadius = 0.033"
IN_TEXT = [layering for layering in LAYERINGS if "binary" not in layering.__name__]


def with_a_wrong_value(layering: Layering, folder: Path) -> Path:
    build_starter(folder / "supplied.usda")
    path = layering(folder, folder / "supplied.usda", "05", Style())
    for file in folder.iterdir():
        file.write_bytes(file.read_bytes().replace(RIGHT, WRONG))
    return path


@pytest.mark.parametrize("root_only", [False, True])
@pytest.mark.parametrize("layering", IN_TEXT, ids=lambda each: each.__name__)
def test_a_value_in_any_layer_is_repaired(
    layering: Layering,
    root_only: bool,  # noqa: FBT001 - a parameter of the test
    tmp_path: Path,
) -> None:
    path = with_a_wrong_value(layering, tmp_path)
    assert check_stage(path, "05").verdict == "fail"
    fixed = fix_stage(path, "05", load_lab(), FixOptions(root_only=root_only))
    for file, data in fixed.files.items():
        file.write_bytes(data)
    assert len(fixed.files) == 1
    assert check_stage(path, "05").verdict == "pass"
