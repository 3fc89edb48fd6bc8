"""Measures how the cost of a stage grows with robots, graphs and prims, beside other validators.

    python benchmarks/bench_scale.py [--rows 1,100] [--runs 3] [--files 10000] [--rep PYTHON]

Whole processes in turn: opening the stage with usd-core, the commands, the validators of OpenUSD
and NVIDIA, and with `--rep` the checker of REP-0158 in a Python that has it. A figure is the median
of processor time, in seconds for opening, else as a multiple of it; of linting and the validators
with the most memory in MB. A validator that is not installed is left out, what takes more than a
minute of the processor is ended. All rows take about eight minutes with `--runs 1`.

A robot is the rover of the tests: 34 nodes in six graphs, a lidar, a camera, two wheels. A pair of
graphs has a clock and a drive, 16 nodes, in a namespace of its own; all drive one robot. Instanced
prims are furniture, and the others boxes, around the lab's robot. `--files` lints so many copies
of a stage in one folder, with `--jobs 2`.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from msgspec import Struct

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

STAGE, FOLDER, SLOW = "STAGE", "FOLDER", 60
KILOBYTES = 1024
OPEN = "import sys; from pxr import Usd; Usd.Stage.Open(sys.argv[1])"
OPENUSD = """
import sys
from pxr import Usd, UsdValidation
registry = UsdValidation.ValidationRegistry()
names = [each.name for each in registry.GetAllValidatorMetadata()]
context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
context.Validate(Usd.Stage.Open(sys.argv[1]))
"""
NVIDIA = """
import sys
from usd_validation_nvidia import ValidationEngine
ValidationEngine(variants=False).validate(sys.argv[1]).issues()
"""
REP = """
import sys
from compliance_checker import ComplianceChecker
ComplianceChecker.from_path(sys.argv[1], include_export=True, include_extended=True).run()
"""
BUILD = """
import sys
from pathlib import Path
from lab3_usd import build_checkpoint
build_checkpoint(None, "05", Path(sys.argv[1]))
"""
PYTHON = (sys.executable, "-c")
LAB3 = (sys.executable, "-m", "lab3_usd")
COMMANDS: dict[str, tuple[str, ...]] = {
    "open": (*PYTHON, OPEN, STAGE),
    "check": (*LAB3, "check", "--isolated", "--quiet", "--checkpoint", "05", STAGE),
    "lint": (*LAB3, "lint", "--isolated", "--quiet", STAGE),
    "topics": (*LAB3, "topics", STAGE),
    "tf": (*LAB3, "tf", STAGE),
    "draw": (*LAB3, "draw", "--lint", "--out", FOLDER, STAGE),
    "fix": (*LAB3, "fix", "--isolated", "--lint", "--unsafe", "--diff", STAGE),
    "diff": (*LAB3, "diff", STAGE, STAGE),
    "HTML": (*LAB3, "lint", "--isolated", "--quiet", "--format", "html", "-o", FOLDER, STAGE),
    "OpenUSD": (*PYTHON, OPENUSD, STAGE),
}
WITH_MEMORY = ("lint", "OpenUSD", "NVIDIA", "REP-0158")


class Cost(Struct, frozen=True):
    """What a process took: seconds of the processor, and megabytes."""

    seconds: float
    memory: float


def rovers(count: int, target: Path) -> Path:
    """Write a stage with that many rovers, each with its graphs and in a namespace of its own.

    They stand 2 m apart.
    """
    from foreign_robots import rover
    from pxr import Sdf, Usd, UsdGeom

    source = rover().GetRootLayer()
    layer = Sdf.Layer.CreateNew(str(target))
    layer.TransferContent(source)
    del layer.rootPrims["World"]
    Sdf.CreatePrimInLayer(layer, "/Fleet").specifier = Sdf.SpecifierDef
    for number in range(count):
        Sdf.CopySpec(source, "/World", layer, f"/Fleet/R{number}")
    stage = Usd.Stage.Open(layer)
    apart = 2.0 / UsdGeom.GetStageMetersPerUnit(stage)
    for number in range(count):
        place = UsdGeom.XformCommonAPI(UsdGeom.Xform.Define(stage, f"/Fleet/R{number}"))
        place.SetTranslate((apart * (number % 10), apart * (number // 10), 0.0))
    return _in_namespaces(layer)


def pairs(count: int, target: Path) -> Path:
    """Write a rover with that many pairs of graphs: a clock, and a drive for the robot."""
    import robot_kinds
    from pxr import Sdf

    layer = Sdf.Layer.CreateNew(str(target))
    layer.TransferContent(robot_kinds.pairs(count))
    return _in_namespaces(layer)


def _in_namespaces(layer: Any) -> Path:
    """Give each ROS node the name of the second prim above it as its namespace, and save."""
    from pxr import Sdf, Usd

    stage = Usd.Stage.Open(layer)
    for prim in stage.Traverse():
        kind = prim.GetAttribute("node:type")
        if kind and "ros2" in str(kind.Get()).lower():
            name = str(prim.GetPath()).split("/")[2]
            port = prim.CreateAttribute("inputs:nodeNamespace", Sdf.ValueTypeNames.String)
            port.Set(name)
    layer.Save()
    return Path(layer.realPath)


def instanced(count: int, target: Path) -> Path:
    """Write the lab's stage with instances of furniture that have so many prims in all."""
    from bench_scenes import lab_stage
    from pxr import Sdf, Usd, UsdGeom

    per_room = 100
    Sdf.Layer.FindOrOpen(str(lab_stage(target.parent))).Export(str(target))
    stage = Usd.Stage.Open(str(target))
    room = UsdGeom.Xform.Define(stage, "/Rooms/Room").GetPrim()
    for number in range(per_room - 1):
        UsdGeom.Cube.Define(stage, f"/Rooms/Room/Box_{number:02}").GetSizeAttr().Set(0.1)
    stage.GetPrimAtPath("/Rooms").SetSpecifier(Sdf.SpecifierClass)
    for number in range(count // per_room):
        prim = UsdGeom.Xform.Define(stage, f"/Furniture/Room_{number:05}").GetPrim()
        prim.GetReferences().AddInternalReference(room.GetPath())
        prim.SetInstanceable(True)  # noqa: FBT003 - it takes no keyword
    stage.GetRootLayer().Save()
    return target


def crowd(count: int, target: Path) -> Path:
    """Write the lab's stage with so many boxes."""
    from bench_scenes import crowded

    return crowded(target.parent, count).rename(target)


ROWS: dict[str, Callable[[Path], Path]] = {
    "1 robot": partial(rovers, 1),
    "10 robots": partial(rovers, 10),
    "100 robots": partial(rovers, 100),
    "100 pairs of graphs": partial(pairs, 100),
    "1,000 pairs of graphs": partial(pairs, 1000),
    "100,000 instanced prims": partial(instanced, 100_000),
    "500,000 prims": partial(crowd, 500_000),
}


def cost(command: Sequence[str], most: int = SLOW) -> Cost:
    """Run a process, and return what it and its children took; without an end where it is slow."""
    environment = {name: value for name, value in os.environ.items() if name != _NO_CACHE}
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    resource.prlimit(process.pid, resource.RLIMIT_CPU, (most, most))
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = status
    is_ended = os.WIFSIGNALED(status)
    seconds = float("inf") if is_ended else used.ru_utime + used.ru_stime
    return Cost(seconds, used.ru_maxrss / KILOBYTES)


_NO_CACHE = "PYTHONDONTWRITEBYTECODE"  # with which the program compiles its data at each start


def rows(names: Sequence[str], commands: dict[str, tuple[str, ...]], runs: int) -> Iterator[str]:
    """Yield the lines of the table, the commands of one stage in turn."""
    yield f"| stage | {' | '.join(commands)} |"
    yield f"|---|{'---|' * len(commands)}"
    with TemporaryDirectory() as name:
        folder = Path(name)
        for number, row in enumerate(names):
            stage = folder / f"{row.replace(' ', '_')}.usdc"
            # In a process of its own: a child begins with what its parent has in memory.
            subprocess.run([sys.executable, __file__, "--write", row, str(stage)], check=True)
            for command in () if number else ("check", "lint"):  # compiled at the first start
                cost([str(stage) if word == STAGE else word for word in COMMANDS[command]])
            costs: dict[str, list[Cost]] = {command: [] for command in commands}
            for _ in range(runs):
                for command, words in commands.items():
                    if costs[command] and costs[command][0].seconds == float("inf"):
                        continue
                    out = folder / "out"
                    places = {STAGE: str(stage), FOLDER: str(out)}
                    costs[command].append(cost([places.get(word, word) for word in words]))
                    shutil.rmtree(out, ignore_errors=True)
                    out.unlink(missing_ok=True)
            yield f"| {row} | {' | '.join(_cells(costs))} |"


def _cells(costs: dict[str, list[Cost]]) -> Iterator[str]:
    opening = statistics.median(each.seconds for each in costs["open"])
    for command, several in costs.items():
        seconds = statistics.median(each.seconds for each in several)
        memory = max(each.memory for each in several)
        figure = f"{seconds:.2f} s" if command == "open" else f"{seconds / opening:.2f}"
        if seconds == float("inf"):
            yield f"over {SLOW} s"
        else:
            yield f"{figure}, {memory:,.0f} MB" if command in WITH_MEMORY else figure


def files(count: int) -> Iterator[str]:
    """Yield what it takes to lint so many copies of a stage in two processes."""
    with TemporaryDirectory() as name:
        folder = Path(name) / "class"
        folder.mkdir()
        written = Path(name) / "Lab3_05.usdc"
        subprocess.run([*PYTHON, BUILD, str(written)], check=True)
        stage = written.read_bytes()
        for number in range(count):
            (folder / f"Lab3_05_{number:05}.usdc").write_bytes(stage)
        words = (*LAB3, "lint", "--isolated", "--quiet", "--jobs", "2", str(folder))
        started = time.monotonic()
        used = cost(
            words, most=resource.RLIM_INFINITY
        )  # without the workers' time, which nobody waits for
        took = time.monotonic() - started
        yield f"{count} files: {took:.0f} s of the clock, {used.memory:.0f} MB"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rows", nargs="*", default=[*ROWS], choices=[*ROWS], metavar="ROW")
    parser.add_argument("--columns", nargs="*", default=[], metavar="COLUMN")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--files", type=int, default=0)
    parser.add_argument("--rep", help="a Python with the checker of REP-0158")
    parser.add_argument("--write", nargs=2, metavar=("ROW", "FILE"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.write:
        ROWS[arguments.write[0]](Path(arguments.write[1]))
        return
    commands = dict(COMMANDS)
    if find_spec("usd_validation_nvidia") is not None:
        commands["NVIDIA"] = (*PYTHON, NVIDIA, STAGE)
    if arguments.rep:
        commands["REP-0158"] = (arguments.rep, "-c", REP, STAGE)
    if arguments.columns:
        commands = {name: commands[name] for name in ("open", *arguments.columns)}
    for line in rows(arguments.rows, commands, arguments.runs):
        print(line, flush=True)
    for line in files(arguments.files) if arguments.files else ():
        print(line, flush=True)


if __name__ == "__main__":
    main()
