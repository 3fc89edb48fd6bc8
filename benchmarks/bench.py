"""Measures the commands as whole processes, and the checker in process, against bare usd-core.

Every figure is a ratio of medians of runs taken in turn (A B A B ...), because machines change
their speed while they work. Usage: python benchmarks/bench.py [--runs N] [NAME ...]
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pxr import Usd

from lab3_usd import build_checkpoint, check_stage

RUNS = 15
WARM_UPS = 2

OPEN_STAGE = "import sys; from pxr import Usd; Usd.Stage.Open(sys.argv[1])"
EXPORT_NINE = """
import sys
from pxr import Usd
stage = Usd.Stage.Open(sys.argv[1])
for number in range(9):
    stage.GetRootLayer().Export(f"{sys.argv[2]}/export_{number}.usda")
"""


@dataclass(frozen=True, slots=True)
class Ratio:
    """One figure: how long ours takes, bare usd-core, and the ratio that was aimed at."""

    name: str
    ours: Sequence[float]
    bare: Sequence[float]
    aim: float

    def line(self) -> str:
        """Write the medians in milliseconds and their ratio."""
        ours, bare = statistics.median(self.ours), statistics.median(self.bare)
        return (
            f"{self.name:<42}{ours * 1000:>9.1f}{bare * 1000:>9.1f}"
            f"{ours / bare:>8.2f}{self.aim:>7.1f}"
        )


def in_turn(
    name: str, ours: Callable[[], object], bare: Callable[[], object], runs: int, aim: float
) -> Ratio:
    """Time two callables in turn, after warm-ups that are not counted."""
    times: tuple[list[float], list[float]] = ([], [])
    for number in range(runs + WARM_UPS):
        for call, kept in ((ours, times[0]), (bare, times[1])):
            start = time.perf_counter()
            call()
            if number >= WARM_UPS:
                kept.append(time.perf_counter() - start)
    return Ratio(name, times[0], times[1], aim)


def process(*arguments: str) -> Callable[[], object]:
    """Return a call that runs this Python with arguments and throws the output away."""
    command = [sys.executable, *arguments]
    return lambda: subprocess.run(command, check=False, capture_output=True)


def bench_check(folder: Path, runs: int) -> list[Ratio]:
    """Time `lab3 check --format json` on one file against opening it, as whole processes."""
    stage = _built(folder, "05")
    return [
        in_turn(
            "check one file, whole process",
            process("-m", "lab3_usd", "check", "--format", "json", str(stage)),
            process("-c", OPEN_STAGE, str(stage)),
            runs,
            1.6,
        )
    ]


def bench_warm(folder: Path, runs: int) -> list[Ratio]:
    """Time opening, model and rules in process against opening alone."""
    stage = _built(folder, "05")
    check_stage(stage)
    return [
        in_turn(
            "check one file, in process and warm",
            lambda: check_stage(stage),
            lambda: Usd.Stage.Open(str(stage)),
            runs * 3,
            2.0,
        )
    ]


def bench_build(folder: Path, runs: int) -> list[Ratio]:
    """Time `lab3 build` against opening the starter and exporting it nine times."""
    starter = _built(folder, "00")
    return [
        in_turn(
            "build nine files, whole process",
            process("-m", "lab3_usd", "build", str(starter), "-o", str(folder / "n"), "--force"),
            process("-c", EXPORT_NINE, str(starter), str(folder)),
            runs,
            3.0,
        )
    ]


def _built(folder: Path, checkpoint: str) -> Path:
    target = folder / f"Lab3_{checkpoint}_bench.usda"
    return target if target.exists() else build_checkpoint(None, checkpoint, target)


BENCHES: dict[str, Callable[[Path, int], list[Ratio]]] = {
    "build": bench_build,
    "check": bench_check,
    "warm": bench_warm,
}


def main() -> None:
    """Run the benches named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *BENCHES])
    parser.add_argument("--runs", type=int, default=RUNS)
    options = parser.parse_args()
    print(f"{'median of runs in turn, ms':<42}{'ours':>9}{'bare':>9}{'ratio':>8}{'aim':>7}")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.names or BENCHES:
            for ratio in BENCHES[name](Path(folder), options.runs):
                print(ratio.line())


if __name__ == "__main__":
    main()
