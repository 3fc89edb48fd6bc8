"""Measures how the cost of a stage grows with its robots, beside bare usd-core, in whole processes.

    python benchmarks/bench_scale.py [--robots 1,10,100] [--runs 5]

Each robot is the rover of the tests: 34 nodes in six graphs, a lidar, a camera, two wheels. The
figures are medians of processor time, in seconds and as multiples of opening the stage.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

OPEN = "import sys; from pxr import Usd; Usd.Stage.Open(sys.argv[1])"
NATIVE = """
import sys
from pxr import Usd, UsdValidation
registry = UsdValidation.ValidationRegistry()
names = [each.name for each in registry.GetAllValidatorMetadata()]
context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
context.Validate(Usd.Stage.Open(sys.argv[1]))
"""
LAB3 = (sys.executable, "-m", "lab3_usd")
COMMANDS: dict[str, tuple[str, ...]] = {
    "open": (sys.executable, "-c", OPEN),
    "UsdValidation": (sys.executable, "-c", NATIVE),
    "lint": (*LAB3, "lint", "--isolated", "--quiet"),
    "topics": (*LAB3, "topics"),
    "tf": (*LAB3, "tf"),
}


def fleet(count: int, target: Path) -> Path:
    """Write a stage with that many rovers, each with its graphs and in a namespace of its own."""
    from foreign_robots import rover
    from pxr import Sdf, Usd

    source = rover().GetRootLayer()
    layer = Sdf.Layer.CreateNew(str(target))
    layer.TransferContent(source)
    del layer.rootPrims["World"]
    Sdf.CreatePrimInLayer(layer, "/Fleet").specifier = Sdf.SpecifierDef
    for number in range(count):
        Sdf.CopySpec(source, "/World", layer, f"/Fleet/R{number}")
    stage = Usd.Stage.Open(layer)
    for prim in stage.Traverse():
        kind = prim.GetAttribute("node:type")
        if kind and "ros2" in str(kind.Get()).lower():
            name = str(prim.GetPath()).split("/")[2]
            port = prim.CreateAttribute("inputs:nodeNamespace", Sdf.ValueTypeNames.String)
            port.Set(name)
    layer.Save()
    return target


def cpu_seconds(command: Sequence[str]) -> float:
    """Return the processor time of a process and its children."""
    before = os.times()
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = os.times()
    spent = after.children_user - before.children_user
    return spent + after.children_system - before.children_system


def rows(counts: Sequence[int], runs: int) -> Iterator[str]:
    """Yield the lines of the table, the commands of one stage in turn."""
    yield f"| robots | {' | '.join(COMMANDS)} |"
    yield f"|---|{'---|' * len(COMMANDS)}"
    with TemporaryDirectory() as folder:
        for count in counts:
            stage = str(fleet(count, Path(folder) / f"fleet_{count}.usdc"))
            times: dict[str, list[float]] = {name: [] for name in COMMANDS}
            for _ in range(runs):
                for name, command in COMMANDS.items():
                    times[name].append(cpu_seconds((*command, stage)))
            medians = {name: statistics.median(measured) for name, measured in times.items()}
            cells = [f"{medians['open']:.2f} s"]
            cells += [
                f"{seconds:.2f} s, {seconds / medians['open']:.2f}"
                for name, seconds in medians.items()
                if name != "open"
            ]
            yield f"| {count} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--robots", default="1,10,100")
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    counts = [int(text) for text in arguments.robots.split(",")]
    for line in rows(counts, arguments.runs):
        print(line, flush=True)


if __name__ == "__main__":
    main()
