"""An input with thousands of wires: judging takes no square of their number."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from places import REPOSITORY
from pxr import Sdf

from lab3_usd.judge.lint import lint_stage

ROBOT = REPOSITORY / "docs" / "examples" / "carter.usda"
INPUT = "/World/Carter/differential_drive/ros2_subscribe_twist.inputs:execIn"


def wired(folder: Path, kind: str, number: int) -> Path:
    """Write a stage of which one input has so many wires more, from nodes or ports that are not."""
    layer = Sdf.Layer.OpenAsAnonymous(str(ROBOT))
    wires = layer.GetAttributeAtPath(INPUT).connectionPathList
    (first,) = wires.GetAddedOrExplicitItems()
    prim, port = first.GetPrimPath(), first.name
    more = [f"{prim}_{n}.{port}" if kind == "nodes" else f"{prim}.{port}{n}" for n in range(number)]
    wires.explicitItems = [first, *map(Sdf.Path, more)]
    path = folder / f"{kind}{number}.usda"
    layer.Export(str(path))
    return path


def steps(stage: Path) -> int:
    """Count the steps of generators, loops and calls of the program as it judges a stage."""
    counted = 0

    def count(_frame: object, event: str, _arg: object) -> None:
        nonlocal counted
        counted += event in {"call", "c_call"}

    sys.setprofile(count)
    try:
        found = lint_stage(stage)
    finally:
        sys.setprofile(None)
    assert len(found.findings) > 100
    return counted


@pytest.mark.parametrize("kind", ["nodes", "ports"])
def test_the_work_grows_with_the_number_of_wires(tmp_path: Path, kind: str) -> None:
    few, many = (wired(tmp_path, kind, number) for number in (200, 800))
    lint_stage(few)  # what is loaded once
    assert steps(many) < 5 * steps(few)


@pytest.mark.parametrize("kind", ["nodes", "ports"])
def test_no_repair_holds_thousands_of_wires(tmp_path: Path, kind: str) -> None:
    found = lint_stage(wired(tmp_path, kind, 800)).findings
    assert {len(str(finding.fix)) < 10_000 for finding in found} == {True}
