"""What judging a stage takes grows as the stage does: nothing is looked for among all the others.

Steps are counted, not timed: the lines that each function executes, for a stage and for one with
twice as many robots.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest
from foreign_robots import rover
from pxr import Sdf, Usd
from robot_kinds import fleet

import lab3_usd
from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.judge.lint import lint_platform
from lab3_usd.stage.read.reader import read_model

SOURCE = str(Path(lab3_usd.__file__).parent)
FEW = 4
MORE, BESIDES = 2.3, 30  # times as many steps, and some that do not grow
Steps = Counter[CodeType]


@contextmanager
def counted() -> Iterator[Steps]:
    """Count the lines of the program that are executed, by the function that they are in."""
    steps: Steps = Counter()

    def in_function(frame: FrameType, event: str, _: Any) -> Any:
        if event == "line":
            steps[frame.f_code] += 1
        return in_function

    def at_call(frame: FrameType, _event: str, _: Any) -> Any:
        return in_function if frame.f_code.co_filename.startswith(SOURCE) else None

    before = sys.gettrace()
    sys.settrace(at_call)
    try:
        yield steps
    finally:
        sys.settrace(before)


def drives(count: int) -> Usd.Stage:
    """One robot, with many graphs that drive it and as many clocks, each in a namespace."""
    source = rover().GetRootLayer()
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(source)
    for graph in ("Clock", "Drive", "Odometry", "Lidar", "Camera"):
        del layer.GetPrimAtPath("/World").nameChildren[graph]
    for number in range(count):
        space = Sdf.CreatePrimInLayer(layer, f"/World/P{number}")
        space.specifier, space.typeName = Sdf.SpecifierDef, "Scope"
        for graph in ("Clock", "Drive"):
            Sdf.CopySpec(source, f"/World/{graph}", layer, f"{space.path}/{graph}")
        Sdf.AttributeSpec(
            space, "isaac:namespace", Sdf.ValueTypeNames.String
        ).default = f"p{number}"
    return Usd.Stage.Open(layer)


def lint_steps(stage: Usd.Stage) -> Steps:
    """Count what reading and linting takes."""
    platform = lint_platform()
    with counted() as steps:
        lint(LintSubject(read_model(stage, platform, "stage.usda"), platform))
    return steps


@pytest.mark.parametrize("make", [fleet, drives])
def test_no_function_of_lint_takes_more_for_each_robot_where_there_are_more(
    make: Callable[[int], Usd.Stage],
) -> None:
    lint_steps(make(2 * FEW))  # what is kept from one stage to the next
    few, many = lint_steps(make(FEW)), lint_steps(make(2 * FEW))
    grown = {
        f"{Path(code.co_filename).stem}.{code.co_name}": (few[code], count)
        for code, count in many.items()
        if count > MORE * few[code] + BESIDES
    }
    assert not grown
