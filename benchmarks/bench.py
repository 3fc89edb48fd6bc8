"""Measures the commands as whole processes, and the checker in process, against bare usd-core.

Every figure is a ratio of medians of runs taken in turn (A B A B ...), because machines change
their speed while they work. Usage: python benchmarks/bench.py [--runs N] [NAME ...]
"""

from __future__ import annotations

import argparse
import gc
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench_scenes import crowded, lab_stage, meshed
from pxr import Usd

from lab3_usd import build_checkpoint, build_starter, check_stage

RUNS = 15
WARM_UPS = 2
MANY = 1000  # stages of a folder
FURTHER, FEW = 100, 20  # stages beyond a few
VENDOR = Path(__file__).resolve().parents[1] / "docs" / "examples" / "carter.usda"

OPEN_STAGE = "import sys; from pxr import Usd; Usd.Stage.Open(sys.argv[1])"
OPEN_ALL = "import sys; from pxr import Usd; [Usd.Stage.Open(path) for path in sys.argv[1:]]"
EXPORT_NINE = """
import sys
from pxr import Usd
stage = Usd.Stage.Open(sys.argv[1])
for number in range(9):
    stage.GetRootLayer().Export(f"{sys.argv[2]}/export_{number}.usda")
"""
# Users' Pythons keep what they compile, whatever this one was told.
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}


@dataclass(frozen=True, slots=True)
class Ratio:
    """One figure: how long ours takes, what it is compared with, and the ratio aimed at."""

    name: str
    ours: Sequence[float]
    other: Sequence[float]
    aim: float

    def line(self) -> str:
        """Write the medians in milliseconds and their ratio."""
        ours, other = statistics.median(self.ours), statistics.median(self.other)
        return (
            f"{self.name:<52}{ours * 1000:>9.1f}{other * 1000:>9.1f}"
            f"{ours / other:>8.2f}{self.aim:>7.2f}"
        )


def in_turn(
    name: str, ours: Callable[[], object], other: Callable[[], object], runs: int, aim: float
) -> Ratio:
    """Time two callables in turn, after warm-ups that are not counted; one run is counted."""
    times: tuple[list[float], list[float]] = ([], [])
    warm_ups = min(WARM_UPS, runs - 1)
    for number in range(runs + warm_ups):
        for call, kept in ((ours, times[0]), (other, times[1])):
            gc.collect()
            start = time.perf_counter()
            call()
            if number >= warm_ups:
                kept.append(time.perf_counter() - start)
    return Ratio(name, times[0], times[1], aim)


def process(*arguments: str) -> Callable[[], object]:
    """Return a call that runs this Python with arguments and throws the output away."""
    command = [sys.executable, *arguments]
    return lambda: subprocess.run(command, check=False, capture_output=True, env=ENVIRONMENT)


def check(*arguments: object) -> Callable[[], object]:
    """Return a call that runs `lab3 check --format json` as a process."""
    return process("-m", "lab3_usd", "check", "--format", "json", *map(str, arguments))


def opening(stage: Path) -> Callable[[], object]:
    """Return a call that opens a stage in a process of its own, and does nothing else."""
    return process("-c", OPEN_STAGE, str(stage))


def bench_check(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time `lab3 check` on one file against opening it, as whole processes."""
    scenes = {
        "lab stage, text": (lab_stage(folder), 1.3),
        "lab stage, binary": (lab_stage(folder, "usdc"), 1.3),
        "with 20,000 prims, binary": (crowded(folder, 20_000), 1.8),
        "with 20,000 prims, text": (crowded(folder, 20_000, "usda"), 1.8),
        "with 200 collision meshes of 5,000 points": (meshed(folder), 1.5),
    }
    for name, (stage, aim) in scenes.items():
        yield in_turn(f"check, {name}", check(stage), opening(stage), runs, aim)


def bench_lint(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time `lab3 lint` on one file against opening it, with and without OpenUSD's validators."""
    for name, stage in {"lab stage": lab_stage(folder), "stage of somebody else": VENDOR}.items():
        for options, aim in (((), 1.3), (("--native",), 1.5)):
            lint = process("-m", "lab3_usd", "lint", "--format", "json", *options, str(stage))
            title = " ".join(("lint", *options))
            yield in_turn(f"{title}, {name}", lint, opening(stage), runs, aim)


def bench_warm(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time checking in process against opening alone: nothing is imported any more."""
    for name, stage, times, aim in (
        ("lab stage", lab_stage(folder), runs * 3, 4.0),
        ("100,000 prims", crowded(folder, 100_000), max(runs // 3, 3), 2.5),
    ):
        yield in_turn(
            f"check in process, {name}",
            lambda stage=stage: check_stage(stage, "05"),
            lambda stage=stage: Usd.Stage.Open(str(stage)),
            times,
            aim,
        )


def bench_starter(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time `--starter` against checking without."""
    starter, stage = folder / "starter.usda", lab_stage(folder)
    build_starter(starter)
    compared = check("--starter", starter, stage)
    yield in_turn("check --starter, against check", compared, check(stage), runs, 1.5)


def bench_html(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time the HTML report of one stage against checking it."""
    stage = lab_stage(folder)
    page = process("-m", "lab3_usd", "check", "--format", "html", str(stage))
    yield in_turn("check --format html, against check", page, check(stage), runs, 1.4)


def bench_folder(folder: Path, _runs: int) -> Iterator[Ratio]:
    """Time a folder of stages with two processes against one."""
    many = folder / "many"
    many.mkdir()
    for number in range(MANY):
        shutil.copyfile(lab_stage(folder), many / f"Lab3_05_{number:04}.usda")
    two, one = (check("--jobs", jobs, *sorted(many.iterdir())) for jobs in (2, 1))
    yield in_turn(f"check of {MANY} stages, --jobs 2 against 1", two, one, 1, 0.55)


def bench_further(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time what a further stage costs in one process, against opening it there."""
    files = [folder / f"Lab3_05_{number:04}.usda" for number in range(FURTHER + FEW)]
    stage = lab_stage(folder)
    for file in files:
        shutil.copyfile(stage, file)
    opened = [process("-c", OPEN_ALL, *map(str, some)) for some in (files, files[:FEW])]
    times: list[Ratio] = []
    for many, few in ((check(*files), check(*files[:FEW])), opened):
        times.append(in_turn("", many, few, max(runs // 3, 3), 0.0))
    ours, other = (
        [(many - few) / FURTHER for many, few in zip(ratio.ours, ratio.other, strict=True)]
        for ratio in times
    )
    yield Ratio("check of a further stage, against opening it", ours, other, 3.3)


def bench_build(folder: Path, runs: int) -> Iterator[Ratio]:
    """Time `lab3 build` against opening the starter and exporting it nine times."""
    starter = build_checkpoint(None, "00", folder / "Lab3_00_bench.usda")
    target = str(folder / "nine")
    build = process("-m", "lab3_usd", "build", str(starter), "-o", target, "--force")
    export = process("-c", EXPORT_NINE, str(starter), str(folder))
    yield in_turn("build nine files", build, export, runs, 3.0)


BENCHES: dict[str, Callable[[Path, int], Iterator[Ratio]]] = {
    "check": bench_check,
    "lint": bench_lint,
    "warm": bench_warm,
    "starter": bench_starter,
    "html": bench_html,
    "folder": bench_folder,
    "further": bench_further,
    "build": bench_build,
}


def main() -> None:
    """Run the benches named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *BENCHES])
    parser.add_argument("--runs", type=int, default=RUNS)
    options = parser.parse_args()
    print(f"{'median of runs in turn, ms':<52}{'ours':>9}{'other':>9}{'ratio':>8}{'aim':>7}")
    for name in options.names or BENCHES:
        with tempfile.TemporaryDirectory() as folder:
            for ratio in BENCHES[name](Path(folder), options.runs):
                print(ratio.line(), flush=True)


if __name__ == "__main__":
    main()
