"""Measures `lab3 check --watch`: the time from a save to the answer, for each way of saving.

A run is two saves: a fault comes, and goes again.
Usage: python benchmarks/bench_watch.py [--runs N] [--starter]
"""

from __future__ import annotations

import argparse
import os
import queue
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Usd

from lab3_usd import build_checkpoint, build_starter

ASKED = 100.0  # milliseconds
RADIUS = "/turtlebot3_burger/ROS_Drive/differential_controller.inputs:wheelRadius"
NAME = "Lab3_05_odometry_tf"
SECONDS = 60.0


def in_place(source: Path, target: Path) -> None:
    """Save as simple editors do."""
    target.write_bytes(source.read_bytes())


def by_renaming(source: Path, target: Path) -> None:
    """Save as Isaac Sim, usd-core and most editors do: a new file takes the name of the old."""
    temporary = target.with_name(f".{target.name}.tmp")
    temporary.write_bytes(source.read_bytes())
    temporary.replace(target)


WAYS = {"in place": in_place, "by renaming": by_renaming}


class Watch:
    """A running `lab3 check --watch`, and the lines that it prints."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        """Read the lines in a thread."""
        self._process = process
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            self._lines.put(line)

    def wait_for(self, text: str) -> None:
        """Wait for a line that holds `text`, and for the end of the report."""
        while text not in self._lines.get(timeout=SECONDS):
            pass
        while "file: " not in self._lines.get(timeout=SECONDS):
            pass


@contextmanager
def watching(stage: Path, *options: str) -> Iterator[Watch]:
    """Start to watch a stage, and end it as Ctrl-C does."""
    command = [
        sys.executable,
        "-m",
        "lab3_usd",
        "check",
        "--watch",
        "--quiet",
        *options,
        str(stage),
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        watch = Watch(process)
        watch.wait_for("watching")
        time.sleep(0.5)  # until the folder is watched
        yield watch
    finally:
        process.send_signal(2)
        process.wait(SECONDS)


def measured(
    watch: Watch,
    save: Callable[[Path, Path], None],
    sources: tuple[Path, Path],
    target: Path,
    runs: int,
) -> Iterator[float]:
    """Yield the milliseconds from each save to the end of the report."""
    for run in range(runs):
        time.sleep(0.3)
        begun = time.perf_counter()
        save(sources[run % 2], target)
        watch.wait_for("1 new" if run % 2 == 0 else "1 repaired")
        yield (time.perf_counter() - begun) * 1000


def versions(folder: Path, ending: str) -> tuple[Path, Path]:
    """Write a stage with a fault and one without, and return both."""
    right = build_checkpoint(None, "05", folder / f"right{ending}")
    stage = Usd.Stage.Open(str(right))
    stage.GetAttributeAtPath(RADIUS).Set(0.033)
    wrong = folder / f"wrong{ending}"
    stage.GetRootLayer().Export(str(wrong))
    return wrong, right


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--starter", action="store_true", help="compare with the starter as well")
    given = parser.parse_args()
    print(f"{'from save to answer, ms':<34}{'best':>8}{'median':>8}{'worst':>8}{'asked':>8}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(os.path.realpath(name))
        build_starter(folder / "starter.usda")
        options = ["--starter", str(folder / "starter.usda")] if given.starter else []
        (folder / "work").mkdir()
        for ending in (".usda", ".usd"):
            sources = versions(folder, ending)
            target = folder / "work" / f"{NAME}{ending}"
            target.write_bytes(sources[1].read_bytes())
            with watching(target, *options) as watch:
                for way, save in WAYS.items():
                    times = sorted(measured(watch, save, sources, target, 2 * given.runs))
                    title = f"{'text' if ending == '.usda' else 'binary'}, saved {way}"
                    median = statistics.median(times)
                    figures = (times[0], median, times[-1], ASKED)
                    print(f"{title:<34}" + "".join(f"{figure:>8.0f}" for figure in figures))


if __name__ == "__main__":
    main()
