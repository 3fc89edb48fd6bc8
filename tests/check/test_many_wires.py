"""An input with thousands of wires: judging takes no square of their number."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from places import REPOSITORY
from pxr import Sdf

from lab3_usd.pipeline.stage import lint_stage

ROBOT = REPOSITORY / "docs" / "examples" / "carter.usda"
INPUT = "/World/Carter/differential_drive/ros2_subscribe_twist.inputs:execIn"
STAMP = "/World/Carter/odometry/publish_odometry.inputs:timeStamp"


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


def fed_by_many(folder: Path, number: int) -> Path:
    """Write a stage of which one input has so many wires more, from nodes that there are."""
    layer = Sdf.Layer.OpenAsAnonymous(str(ROBOT))
    wires = layer.GetAttributeAtPath(STAMP).connectionPathList
    (first,) = wires.GetAddedOrExplicitItems()
    copies = [Sdf.Path(f"{first.GetPrimPath()}_{n}") for n in range(number)]
    for copy in copies:
        Sdf.CopySpec(layer, first.GetPrimPath(), layer, copy)
    wires.explicitItems = [first, *(copy.AppendProperty(first.name) for copy in copies)]
    path = folder / f"copies{number}.usda"
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
    assert found.findings
    return counted


@pytest.mark.parametrize("kind", ["nodes", "ports"])
def test_the_work_grows_with_the_number_of_wires(tmp_path: Path, kind: str) -> None:
    few, many = (wired(tmp_path, kind, number) for number in (100, 400))
    lint_stage(few)  # what is loaded once
    assert steps(many) < 5 * steps(few)


def test_the_work_grows_with_the_number_of_nodes_that_feed_an_input(tmp_path: Path) -> None:
    few, many = (fed_by_many(tmp_path, number) for number in (50, 200))
    lint_stage(few)  # what is loaded once
    assert steps(many) < 5 * steps(few)


@pytest.mark.parametrize("kind", ["nodes", "ports"])
def test_no_repair_holds_thousands_of_wires(tmp_path: Path, kind: str) -> None:
    found = lint_stage(wired(tmp_path, kind, 800)).findings
    assert {len(str(finding.fix)) < 10_000 for finding in found} == {True}
