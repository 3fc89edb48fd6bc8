"""Measures grading a class: time for each further clean stage, and memory, as the class grows.

Usage: python benchmarks/bench_grade.py [--count N] [--jobs N]

Generates submissions of nine clean stages, each of its own student: no two students' files are the
same, and 06 to 08 are 05 saved again, as the lab has it. A class of ten is graded first, then one
of `--count`; what the second costs beyond the first is divided by its further files.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from msgspec import Struct

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from grade_files import LAB, stage, starter

from lab3_usd.grade.class_run import ClassSettings, grade_class

SMALL = 10
SAVED_AGAIN = ("06", "07", "08")
MEGABYTE = 1 << 20


class Figures(Struct, frozen=True):
    """What grading a class took: seconds, and the most memory of ours and of any worker."""

    students: int
    seconds: float
    parent: int
    workers: int


def main() -> int:
    """Grade a small and a large class, and print what each further stage costs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    small, large = measure([SMALL, options.count], options.jobs)
    files = len(LAB.checkpoints) * (large.students - small.students)
    each = (large.seconds - small.seconds) * options.jobs / files
    print("students  seconds  ms a stage  parent MB  workers MB")
    for found in (small, large):
        stages = found.students * len(LAB.checkpoints)
        print(
            f"{found.students:8}  {found.seconds:7.1f}  {1000 * found.seconds / stages:10.1f}"
            f"  {found.parent / MEGABYTE:9.0f}  {found.workers / MEGABYTE:10.0f}"
        )
    print(f"each further clean stage takes {1000 * each:.1f} ms of one core, reports included")
    print(f"memory from {small.students} to {large.students} students: "
          f"{(large.parent - small.parent) / MEGABYTE:+.1f} MB for the parent, "
          f"{(large.workers - small.workers) / MEGABYTE:+.1f} MB for the workers")  # fmt: skip
    return 0


def measure(counts: list[int], jobs: int = 1) -> list[Figures]:
    """Grade a class of each size, and return the figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        figures = []
        for count in counts:
            make_class(folder / str(count), count)
            with watched() as most:
                started = time.perf_counter()
                settings = ClassSettings(
                    folder / str(count), starter(), folder / f"{count}.out", jobs=jobs
                )
                rows = grade_class(settings)
                seconds = time.perf_counter() - started
            if any(row["percent"] != 100 for row in rows):  # noqa: PLR2004 - per cent
                message = "a clean submission is not graded as one"
                raise RuntimeError(message)
            figures.append(Figures(count, seconds, most["parent"], most["workers"]))
            shutil.rmtree(folder / str(count))
            shutil.rmtree(folder / f"{count}.out")
    return figures


def make_class(folder: Path, count: int) -> None:
    """Write the submissions; a line of each stage's metadata names the student."""
    texts = {number: stage(number).read_text() for number in LAB.checkpoints}
    for index in range(count):
        work = folder / f"student{index:04}" / "work"
        work.mkdir(parents=True)
        for number, text in texts.items():
            source = texts["05"] if number in SAVED_AGAIN else text
            own = source.replace("(\n", f'(\n    doc = "student {index}"\n', 1)
            (work / stage(number).name).write_text(own)


@contextmanager
def watched() -> Iterator[dict[str, int]]:
    """Watch how much memory this process and its workers have, in bytes, while something runs."""
    most = {"parent": 0, "workers": 0}
    done = threading.Event()

    def watch() -> None:
        while not done.wait(0.1):
            most["parent"] = max(most["parent"], resident(os.getpid()))
            workers = [resident(each) for each in children(os.getpid())]
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
