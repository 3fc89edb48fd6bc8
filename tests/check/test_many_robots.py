"""How the work of `lint` grows with the robots of a stage: calls are counted, nothing is timed."""

import sys
from pathlib import Path
from types import FrameType

from foreign_robots import rover
from pxr import Sdf, Usd

from lab3_usd.pipeline.stage import lint_stage

SIZES = (2, 4, 6)


def fleet(size: int, folder: Path) -> Path:
    """Save a stage of rovers, each with graphs and topics of its own."""
    source = rover().GetRootLayer()
    path = folder / f"fleet{size}.usdc"
    layer = Sdf.Layer.CreateNew(str(path))
    Sdf.CreatePrimInLayer(layer, "/Fleet").specifier = Sdf.SpecifierDef
    for number in range(size):
        Sdf.CopySpec(source, "/World", layer, f"/Fleet/R{number}")
    stage = Usd.Stage.Open(layer)
    for prim in stage.Traverse():
        if "ros2" in (prim.GetAttribute("node:type").Get() or "").lower():
            space = prim.CreateAttribute("inputs:nodeNamespace", Sdf.ValueTypeNames.String)
            space.Set(prim.GetPath().pathString.split("/")[2])
    layer.Save()
    return path


def calls_of_lint(stage: Path) -> int:
    """Return how many calls of functions of ours `lint` takes."""
    calls = 0

    def count(frame: FrameType, event: str, _: object) -> None:
        nonlocal calls
        calls += event == "call" and "lab3_usd" in frame.f_code.co_filename

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        lint_stage(stage)
    finally:
        sys.setprofile(before)
    return calls


def test_each_further_robot_takes_as_many_calls_as_those_before(tmp_path: Path) -> None:
    stages = [fleet(size, tmp_path) for size in SIZES]
    lint_stage(stages[0])  # what is read once for all stages
    few, more, most = map(calls_of_lint, stages)
    assert most - more < 1.05 * (more - few), (few, more, most)
