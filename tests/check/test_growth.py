"""What judging a stage takes grows as the stage does: nothing is looked for among all the others.

Steps are counted, not timed: the lines that each function executes, for a stage and for one with
twice as many robots.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest
from in_process import lab3
from pxr import Sdf, Usd
from robot_kinds import faulty_fleet, fleet, heap, pairs

import lab3_usd
from lab3_usd.check.checker import judge
from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import all_rules
from lab3_usd.model.finding import Report
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.report.formats.registry import render
from lab3_usd.sim.execution.drive import Leg, Session
from lab3_usd.sim.plays import Play
from lab3_usd.sim.robots import expected_of
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.scene import read_scene
from lab3_usd.stage.read.stage_reader import read_model

SOURCE = str(Path(lab3_usd.__file__).parent)
FEW = 1
INSTANCES = 5  # for each robot that another stage would have
MORE, BESIDES = 2.3, 30  # times as many steps, and some that do not grow
Steps = Counter[CodeType]


@contextmanager
def counted() -> Iterator[Steps]:
    """Count the lines of the program that are executed, by the function that they are in."""
    steps: Steps = Counter()
    # A code object is slow to look up, as its hash is computed each time.
    tracers: dict[int, tuple[CodeType, Any, list[int]]] = {}

    def at_call(frame: FrameType, _event: str, _: Any) -> Any:
        code = frame.f_code
        if id(code) not in tracers:
            is_ours = code.co_filename.startswith(SOURCE)
            tracers[id(code)] = (code, *(_line_counter() if is_ours else (None, [0])))
        return tracers[id(code)][1]

    before = sys.gettrace()
    sys.settrace(at_call)
    try:
        yield steps
    finally:
        sys.settrace(before)
        for code, _, (count,) in tracers.values():
            steps[code] += count


def _line_counter() -> tuple[Any, list[int]]:
    """Return what traces one function, and the number of its lines that were executed."""
    count = [0]

    def in_function(_frame: FrameType, event: str, _: Any) -> Any:
        if event == "line":
            count[0] += 1
        return in_function

    return in_function, count


def drives(count: int) -> Usd.Stage:
    """One robot, with many graphs that drive it and as many clocks, each in a namespace.

    Each but the first is compared with one before it: of eight that is a little over twice as often
    as of four.
    """
    layer = pairs(4 * count)
    for number in range(4 * count):
        space = layer.GetPrimAtPath(f"/World/P{number}")
        namespace = Sdf.AttributeSpec(space, "isaac:namespace", Sdf.ValueTypeNames.String)
        namespace.default = f"p{number}"
    return Usd.Stage.Open(layer)


def instances(count: int) -> Usd.Stage:
    """Instances of one graph, each in a namespace."""
    layer = pairs(1)
    Sdf.CreatePrimInLayer(layer, "/Kind").specifier = Sdf.SpecifierClass
    Sdf.CopySpec(layer, "/World/P0/Clock", layer, "/Kind/Clock")
    stage = Usd.Stage.Open(layer)
    for number in range(INSTANCES * count):
        prim = stage.DefinePrim(f"/World/I{number}", "Xform")
        prim.GetReferences().AddInternalReference("/Kind")
        prim.SetInstanceable(True)  # noqa: FBT003 - it takes no keyword
        namespace = prim.CreateAttribute("isaac:namespace", Sdf.ValueTypeNames.String)
        namespace.Set(f"i{number}")
    return stage


def heaped(count: int) -> Usd.Stage:
    """Robots of which each is inside all others."""
    return heap(4 * count)


def linted(stage: Usd.Stage) -> None:
    """Read and lint a stage."""
    platform = lint_platform()
    lint(LintSubject(read_model(stage, platform, "stage.usda")))


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Files of robots of which each has two faults that are repaired."""
    folder = tmp_path_factory.mktemp("faulty")

    @cache
    def written(count: int) -> Path:
        stage, path = faulty_fleet(count), folder / f"{count}.usda"
        stage.GetRootLayer().Export(str(path))
        return path

    return written


def grown(run: Callable[[int], object], few: int = FEW) -> dict[str, tuple[int, int]]:
    """Return the functions that take more than twice as many steps for twice as much."""
    run(2 * few)  # what is kept from one stage to the next
    with counted() as before:
        run(few)
    with counted() as after:
        run(2 * few)
    return {
        f"{Path(code.co_filename).stem}.{code.co_name}": (before[code], count)
        for code, count in after.items()
        if count > MORE * before[code] + BESIDES
    }


@pytest.mark.parametrize("make", [fleet, heaped, drives, instances])
def test_no_function_of_lint_takes_more_for_each_robot_where_there_are_more(
    make: Callable[[int], Usd.Stage],
) -> None:
    assert not grown(lambda count: linted(make(count)))


def test_no_function_of_a_check_takes_more_for_each_robot_where_there_are_more() -> None:
    """All robots but one are none of the lab's, with nodes and lidars that nobody asks for."""
    lab = load_lab()

    def run(count: int) -> None:
        model = read_model(fleet(count), lab.platform, "stage.usda")
        judge(lab, lab.checkpoints["05"], model)

    assert not grown(run, few=12)


def test_no_function_of_a_dry_run_takes_more_for_each_robot_where_there_are_more() -> None:
    """What one play takes, whose robots are all driven over the same ground at the same time."""
    platform = lint_platform()

    def run(count: int) -> None:
        scene = read_scene(fleet(count), platform)
        drive = (Session((Leg("ahead", 0.2, (0.2, 0.0, 0.0)),)),)
        Play("", expected_of(None), drive).recorded(scene, platform)

    assert not grown(run)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fix", "--isolated", "--lint", "--unsafe", "--diff", "STAGE"),
        ("draw", "STAGE", "--lint", "--force", "--out", "FOLDER"),
        ("topics", "-v", "STAGE"),
        ("diff", "STAGE", "STAGE"),
        ("lint", "--isolated", "--quiet", "--format", "html", "STAGE"),
    ],
)
def test_no_function_of_a_command_takes_more_for_each_robot_where_there_are_more(
    arguments: tuple[str, ...], faulty: Callable[[int], Path], tmp_path: Path
) -> None:
    drawn = (tmp_path / str(number) for number in range(3))  # nothing is there to be replaced

    def run(count: int) -> None:
        places = {"STAGE": faulty(count), "FOLDER": next(drawn)}
        assert lab3(*(places.get(word, word) for word in arguments)).returncode in {0, 1}

    assert not grown(run)


def test_no_function_of_a_format_takes_more_for_each_robot_where_there_are_more(
    faulty: Callable[[int], Path],
) -> None:
    found = cache(lambda count: Report((lint_stage(faulty(count)),)))
    for count in (FEW, 2 * FEW):
        found(count)
    assert not grown(lambda count: render("sarif", found(count), all_rules()))
