"""Measures a class of thousands: time, memory, the size of the gradebook and of its page.

Usage: python benchmarks/bench_large_class.py [--count N] [--jobs N] [--stages 00,01]

Two classes of the submissions of `bench_grade.py` are graded, of a tenth of `--count` students and
of `--count`, as a large class is: reports name nobody. From their difference follows what 10,000
students take. The page of 10,000 rows is made of the rows of these.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from bench_grade import LAB, MEGABYTE, make_class, starter, watched
from msgspec import Struct

from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.report.html.class_page import class_page

LARGE = 10_000
BLOCK = 4096


class Figures(Struct, frozen=True):
    """What a class took: seconds by the clock and of processors, bytes of memory and of disk."""

    students: int
    seconds: float
    busy: float
    parent: int
    workers: int
    disk: int
    reports: int


def main() -> int:
    """Grade two classes, and print what they and one of 10,000 students take."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--stages", default=",".join(LAB.checkpoints))
    options = parser.parse_args()
    stages = tuple(options.stages.split(","))
    with tempfile.TemporaryDirectory() as name:
        small = measure(Path(name, "small"), max(options.count // 10, 2), stages, options.jobs)
        large = measure(Path(name, "large"), options.count, stages, options.jobs)
        page = page_size(Path(name, "large", "book"))
    print("students   minutes  of a core  parent MB  workers MB  gradebook MB  reports")
    for found in (small, large, extrapolated(small, large)):
        print(
            f"{found.students:8}  {found.seconds / 60:8.1f}  {found.busy / 60:9.1f}"
            f"  {found.parent / MEGABYTE:9.0f}  {found.workers / MEGABYTE:10.0f}"
            f"  {found.disk / MEGABYTE:12.1f}  {found.reports:7}"
        )
    print(f"the last line is extrapolated; its page has {page / MEGABYTE:.1f} MB")
    return 0


def measure(folder: Path, count: int, stages: tuple[str, ...], jobs: int) -> Figures:
    """Grade a class of `count` students who handed in these stages."""
    make_class(folder / "class", count, stages)
    book = folder / "book"
    with watched() as most:
        started, before = time.perf_counter(), sum(os.times()[:4])
        rows = grade_class(
            ClassSettings(folder / "class", starter(), book, jobs=jobs, most_named=0)
        )
        seconds, busy = time.perf_counter() - started, sum(os.times()[:4]) - before
    if {row["status"] for row in rows} != {"graded"}:
        raise RuntimeError("a submission was not graded")
    reports = len(list(book.glob("reports/*")))
    return Figures(count, seconds, busy, most["parent"], most["workers"], on_disk(book), reports)


def on_disk(folder: Path) -> int:
    """Return the bytes that a folder takes on a disk of blocks of 4 kB."""
    return sum(
        -(-path.stat().st_size // BLOCK) * BLOCK if path.is_file() else BLOCK
        for path in folder.rglob("*")
    )


def extrapolated(small: Figures, large: Figures) -> Figures:
    """Return what 10,000 students take, if each further one takes what the last ones took."""

    def at_large(name: str) -> float:
        first, last = float(getattr(small, name)), float(getattr(large, name))
        each = (last - first) / (large.students - small.students)
        return max(last, last + each * (LARGE - large.students))

    return Figures(
        LARGE,
        at_large("seconds"),
        at_large("busy"),
        *(round(at_large(name)) for name in Figures.__struct_fields__[3:]),
    )


def page_size(book: Path) -> int:
    """Return the bytes of the page of 10,000 students with the rows of a gradebook."""
    found: dict[str, Any] = json.loads((book / "grades.json").read_bytes())
    own = found["students"]
    rows = [own[number % len(own)] for number in range(LARGE)]
    return sum(len(part.encode()) for part in class_page(found["title"], found["items"], rows))


if __name__ == "__main__":
    sys.exit(main())
