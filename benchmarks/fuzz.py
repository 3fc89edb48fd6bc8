"""Throws damaged and made-up stages at the workers, and counts how they answer.

Usage: python benchmarks/fuzz.py [--count N] [--seed N] [--jobs N] [--keep FOLDER] [--odd SHARE]

Of the tasks, `--odd` is the share over which a worker misbehaves: it dies, hangs, writes without
end, talks nonsense, closes its pipe, or dies when it has answered.

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

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from fuzz_inputs import generate, inputs, write_inputs
from grade_files import LAB, stage, starter

from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.pool import run_tasks
from lab3_usd.grade.workers.worker_messages import (
    FAILED_OVER_IT,
    PROGRAM,
    PoolSettings,
    Task,
    status_of,
)
from lab3_usd.stage.write.builder import BuildOptions, build_files

BATCH = 500
SECONDS = 20.0
ODD_SECONDS = 8.0  # many of them hang
ODD = """
import sys
sys.path[:0] = sys.argv[1:]
import json, os, random, signal, threading, time
from lab3_usd.grade.workers import worker_main as worker
judge, channels, dice, out = worker.answer, worker._channels, random.Random(os.getpid()), []

def remembered():
    tasks, answers = channels()
    out.append(answers.fileno())
    return tasks, answers

def forever():
    for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
        signal.signal(number, signal.SIG_IGN)
    time.sleep(600)

def write(data, times):
    for _ in range(times):
        os.write(out[0], data)

def soon():
    threading.Timer(0.01, lambda: os.kill(os.getpid(), signal.SIGKILL)).start()

WAYS = [
    lambda: os.kill(os.getpid(), signal.SIGKILL),
    lambda: os.kill(os.getpid(), signal.SIGSEGV),
    lambda: os._exit(3),
    forever,
    lambda: (os.close(out[0]), forever()),
    lambda: write(b"x" * 65536, 10**9),
    lambda: write(json.dumps({"open": "x"}).encode() + bytes([10]), 10**9),
    lambda: write(b"nonsense" + bytes([10]), 1),
    soon,
]

def answer(course, task, scratch, announce):
    if dice.random() < SHARE:
        if dice.random() < 0.5:
            announce(os.path.basename(task.sources[0].path))
        dice.choice(WAYS)()
    return judge(course, task, scratch, announce)

worker.answer, worker._channels = answer, remembered
worker.serve()
"""


def main() -> int:
    """Run as many inputs as asked for, batch by batch."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--odd", type=float, default=0.0)
    options = parser.parse_args()
    seconds = ODD_SECONDS if options.odd else SECONDS
    program = odd_program(options.odd) if options.odd else PROGRAM
    counts: Counter[str] = Counter()
    started = time.monotonic()
    for first in range(0, options.count, BATCH):
        size = min(BATCH, options.count - first)
        counts += fuzz(size, options.seed + first, options.jobs, options.keep, seconds, program)
        print(f"{counts.total()} inputs, {time.monotonic() - started:.0f} s: {shown(counts)}")
    if counts.total() != options.count:
        print(f"only {counts.total()} of {options.count} inputs were answered")
    return int(counts.total() != options.count or bool(counts["tool failed"]))


def shown(counts: Counter[str]) -> str:
    """Return the counts, the most frequent first."""
    return ", ".join(f"{count} {name}" for name, count in counts.most_common())


def odd_program(share: float) -> str:
    """Return the program of a worker that misbehaves in this share of its tasks."""
    return ODD.replace("SHARE", repr(share))


def fuzz(
    count: int,
    seed: int,
    jobs: int = 2,
    keep: Path | None = None,
    seconds: float = SECONDS,
    program: str = PROGRAM,
) -> Counter[str]:
    """Judge `count` inputs, and return how many there were of each kind of answer."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = generate(inputs(*real_files(folder / "real")), count, seed)
        write_inputs(folder / "inputs", made)
        settings = PoolSettings(
            starter(), None, Limits(seconds=seconds), (folder,), jobs, program=program
        )
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
        is_own = answer["failed"].startswith(FAILED_OVER_IT)
        return "tool failed" if is_own else status_of(answer["failed"])
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
