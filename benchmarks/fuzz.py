"""Throws damaged and made-up stages at the workers, and counts how they answer.

Usage: python benchmarks/fuzz.py [--count N] [--seed N] [--jobs N] [--keep FOLDER]

Every input must be answered. An input that the tool itself fails on is a bug: it is printed, kept
where `--keep` says, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from fuzz_inputs import generate, inputs, write_inputs
from grade_files import LAB, stage, starter

from lab3_usd.grade.judge import Task
from lab3_usd.grade.limits import Limits
from lab3_usd.grade.outcome import status_of
from lab3_usd.grade.pool import run_tasks
from lab3_usd.grade.staging import Source
from lab3_usd.grade.worker_process import PoolSettings
from lab3_usd.stage.builder import BuildOptions, build_files

BATCH = 500
SECONDS = 20.0


def main() -> int:
    """Run as many inputs as asked for, batch by batch."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    started = time.monotonic()
    for first in range(0, options.count, BATCH):
        size = min(BATCH, options.count - first)
        counts += fuzz(size, options.seed + first, options.jobs, options.keep)
        print(f"{counts.total()} inputs, {time.monotonic() - started:.0f} s: {shown(counts)}")
    if counts.total() != options.count:
        print(f"only {counts.total()} of {options.count} inputs were answered")
    return int(counts.total() != options.count or bool(counts["tool failed"]))


def shown(counts: Counter[str]) -> str:
    """Return the counts, the most frequent first."""
    return ", ".join(f"{count} {name}" for name, count in counts.most_common())


def fuzz(count: int, seed: int, jobs: int = 2, keep: Path | None = None) -> Counter[str]:
    """Judge `count` inputs, and return how many there were of each kind of answer."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = generate(inputs(*real_files(folder / "real")), count, seed)
        write_inputs(folder / "inputs", made)
        settings = PoolSettings(starter(), None, Limits(seconds=SECONDS), (folder,), jobs)
        tasks = [
            Task(place.name, place.name, (Source(place),))
            for place in sorted((folder / "inputs").iterdir())
        ]
        counts: Counter[str] = Counter()
        for task, answer in run_tasks(tasks, settings):
            kind = kind_of(answer)
            counts[kind] += 1
            if kind in {"tool failed", "crashed", "timeout", "too large"}:
                print(
                    f"{kind}: {answer.get('failed') or answer.get('reason') or answer['crashes']}"
                )
                if keep is not None:
                    shutil.copytree(
                        task.sources[0].path, keep / f"{seed}-{task.student}", dirs_exist_ok=True
                    )
    return counts


def kind_of(answer: dict[str, Any]) -> str:
    """Return the status of an answer; of a graded one, its verdict."""
    if answer.get("crashes"):
        return "tool failed"
    if "failed" in answer:
        return status_of(answer["failed"])
    if answer["status"] != "graded":
        return str(answer["status"])
    return next(iter(answer["verdicts"].values()))


def real_files(folder: Path) -> tuple[list[bytes], list[bytes]]:
    """Return real stages as text, and the same ones as crate files."""
    numbers = ("01", "05")
    crates = []
    for number in numbers:
        target = folder / f"{number}.usd"
        plan = {target: LAB.checkpoints[number]}
        build_files(LAB, None, plan, BuildOptions("usdc", force=True))
        crates.append(target.read_bytes())
    return [stage(number).read_bytes() for number in numbers], crates


if __name__ == "__main__":
    sys.exit(main())
