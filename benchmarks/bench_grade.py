"""Measures grading a class: time for each further clean stage, and memory, as the class grows.

Usage: python benchmarks/bench_grade.py [--count N] [--jobs N]

Generates submissions of nine clean stages, each of its own student: no two students' files are the
same, each has arranged the nodes of the graphs in another way, and 06 to 08 are 05 saved again, as
the lab has it. Three classes are graded: ten students, `--count` students, and some who handed in
the first stage alone. The differences say what a further student costs, and what a further stage
of a student who is graded anyway.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from msgspec import Struct

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from grade_files import LAB, stage, starter

from lab3_usd.data import data_folder
from lab3_usd.grade.class_run import ClassSettings, grade_class

SMALL = 10
FEW = 100
SAVED_AGAIN = ("06", "07", "08")
MEGABYTE = 1 << 20
POSITION = re.compile(r"(node:pos = \()(-?\d+), (-?\d+)\)")


class Figures(Struct, frozen=True):
    """What grading a class took.

    `seconds` by the clock, `busy` of processors, and the most memory of ours and of any worker.
    """

    students: int
    stages: int
    seconds: float
    busy: float
    parent: int
    workers: int


def main() -> int:
    """Grade a small and a large class, and print what each further stage costs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    whole = tuple(LAB.checkpoints)
    alone = min(options.count, FEW)
    small, large, first = (
        measure(count, numbers, options.jobs)
        for count, numbers in ((SMALL, whole), (options.count, whole), (alone, whole[:1]))
    )
    print("students  stages  seconds  of a core  parent MB  workers MB")
    for found in (small, large, first):
        print(
            f"{found.students:8}  {found.stages:6}  {found.seconds:7.1f}  {found.busy:9.1f}"
            f"  {found.parent / MEGABYTE:9.0f}  {found.workers / MEGABYTE:10.0f}"
        )
    each = (large.busy - small.busy) / (large.students - small.students)
    start = small.busy - each * small.students
    lone = (first.busy - start) / first.students
    print(f"each further student takes {1000 * each:.0f} ms of a core, reports included:")
    print(f"  {1000 * each / len(whole):.1f} ms a stage,")
    print(f"  {1000 * (each - lone) / (len(whole) - 1):.1f} ms for each stage beyond the first")
    print(
        f"from {small.students} to {large.students} students memory grows by "
        f"{(large.parent - small.parent) / MEGABYTE:.1f} MB (parent) and "
        f"{(large.workers - small.workers) / MEGABYTE:.1f} MB (worker)"
    )
    return 0


def measure(count: int, numbers: tuple[str, ...], jobs: int = 1) -> Figures:
    """Grade a class of `count` students who handed in these stages, and return the figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_class(folder / "class", count, numbers)
        settings = ClassSettings(folder / "class", starter(), folder / "book", jobs=jobs)
        with watched() as most:
            started, before = time.perf_counter(), sum(os.times()[:4])
            rows = grade_class(settings)
            seconds, busy = time.perf_counter() - started, sum(os.times()[:4]) - before
        lost = [line for row in rows for line in row["lost"]]
        if any(line["rule"] != "M01" and not line["title"].endswith("missing") for line in lost):
            raise RuntimeError("a clean submission is not graded as one")
    return Figures(count, count * len(numbers), seconds, busy, most["parent"], most["workers"])


def make_class(folder: Path, count: int, numbers: tuple[str, ...]) -> None:
    """Write the submissions; each student has arranged the nodes of the graphs differently."""
    for index in range(count):
        work = folder / f"student{index:04}" / "work"
        work.mkdir(parents=True)
        for number in numbers:
            text = stage("05" if number in SAVED_AGAIN else number).read_text()
            (work / stage(number).name).write_text(of_student(text, index))
        shutil.copytree(data_folder("maps"), work.parent / "maps")


def of_student(text: str, index: int) -> str:
    """Return the text of a stage as a student has it, with nodes arranged in another way."""
    named = text.replace("(\n", f'(\n    doc = "student {index}"\n', 1)
    return POSITION.sub(lambda found: arranged(found, index), named)


def arranged(found: re.Match[str], index: int) -> str:
    """Return a node's position moved a little, for each student and node by another length."""
    start, x, y = found[1], int(found[2]), int(found[3])
    return f"{start}{x + (31 * x + 17 * y + 13 * index) % 40}, {y})"


@contextmanager
def watched() -> Iterator[dict[str, int]]:
    """Watch how much memory this process and its workers have, in bytes, while something runs."""
    most = {"parent": 0, "workers": 0}
    done = threading.Event()

    def watch() -> None:
        while not done.wait(0.1):
            most["parent"] = max(most["parent"], resident(os.getpid()))
            workers = [resident(child) for child in children(os.getpid())]
            most["workers"] = max([most["workers"], *workers])

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield most
    finally:
        done.set()
        thread.join()


def resident(process: int) -> int:
    """Return the memory of a process in bytes; 0 where that is not known."""
    try:
        pages = Path(f"/proc/{process}/statm").read_text().split()[1]
    except OSError:
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def children(process: int) -> list[int]:
    """Return the processes that a process has started; empty where that is not known."""
    found: list[int] = []
    for path in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            found += map(int, path.read_text().split())
    return found


if __name__ == "__main__":
    sys.exit(main())
