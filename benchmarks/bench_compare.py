"""Measures how long comparing a stage with its starter takes, beside opening both.

Usage: python benchmarks/bench_compare.py [ROUNDS]
"""

from __future__ import annotations

import gc
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.compare.stages import compare_starter
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import build_starter

LIMIT = 1.5  # times the time of opening both stages
ROUNDS = 30


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds for opening both stages, and for comparing them once they are open."""

    opening: float
    comparing: float

    @property
    def ratio(self) -> float:
        """Comparing as a share of opening."""
        return self.comparing / self.opening


def measure(rounds: int = ROUNDS) -> Times:
    """Return the median times; usd-core keeps nothing of the files from one round to the next."""
    lab = load_lab()
    with tempfile.TemporaryDirectory() as folder:
        starter, stage = Path(folder) / "starter.usda", Path(folder) / "stage.usda"
        build_starter(starter)
        build_checkpoint(starter, "08", stage)
        opening, comparing = [], []
        for _ in range(rounds):
            gc.collect()
            begin = time.perf_counter()
            before, after = open_stage(starter), open_stage(stage)
            opened = time.perf_counter()
            compare_starter(before, after, lab, "08")
            comparing.append(time.perf_counter() - opened)
            opening.append(opened - begin)
            del before, after
    return Times(median(opening), median(comparing))


def main() -> int:
    """Print the times; exit 1 when comparing takes too long."""
    times = measure(int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS)
    print(f"opening both   {times.opening * 1e3:6.2f} ms")
    print(f"comparing      {times.comparing * 1e3:6.2f} ms, {times.ratio:.2f} times as long")
    return int(times.ratio > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
