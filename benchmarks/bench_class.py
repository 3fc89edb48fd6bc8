"""Measures what a student of a class costs, right or with faults, in turn with another checkout.

Usage: python benchmarks/bench_class.py [OTHER_CHECKOUT] [--right N] [--faulty N] [--runs N]

Two classes are graded: the right students of `bench_grade.py`, and such with one mistake each, as
in `failing_class.py`. No two of them have arranged their nodes alike. Checkouts take turns on the
same files; what counts is the processor time of all processes, in the median, without what the
start of a run takes. The gradebooks of two checkouts are compared to the byte.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from bench_grade import LAB, SMALL, make_class, of_student
from failing_class import failing_at, hand_in
from grade_files import stage, starter

REPOSITORY = Path(__file__).resolve().parents[1]
MOST_NAMED = 10  # files that differ


def main() -> int:
    """Grade both classes with both checkouts, and print what a student costs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, nargs="?", help="the other checkout")
    parser.add_argument("--right", type=int, default=40, help="right students")
    parser.add_argument("--faulty", type=int, default=40, help="students with faults")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    checkouts = [REPOSITORY, *([options.other.resolve()] if options.other else [])]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_class(folder / "few", SMALL, tuple(LAB.checkpoints))
        make_class(folder / "right", SMALL + options.right, tuple(LAB.checkpoints))
        make_faulty_class(folder / "faulty", options.faulty)
        took: dict[tuple[Path, str], list[float]] = {}
        for _ in range(options.runs):
            for kind in ("few", "right", "faulty"):
                for checkout in checkouts:
                    seconds = graded(checkout, folder, kind)
                    took.setdefault((checkout, kind), []).append(seconds)
        for checkout in checkouts:
            few, right, faulty = (median(took[checkout, k]) for k in ("few", "right", "faulty"))
            each = (right - few) / options.right
            failing = (faulty - few + each * SMALL) / options.faulty
            print(
                f"{checkout}: {1000 * each:.0f} ms a right student,"
                f" {1000 * failing:.0f} ms one with faults"
            )
        if options.other is None:
            return 0
        different = [
            f"{kind}/{line}"
            for kind in ("right", "faulty")
            for line in differing(*(folder / f"{kind}-{c.name}" for c in checkouts))
        ]
    print(f"{len(different)} files differ", *different[:MOST_NAMED], sep="\n  ")
    return 1 if different else 0


def make_faulty_class(folder: Path, count: int) -> None:
    """Write students with a mistake each, chosen evenly, who arranged their nodes differently."""
    right = folder.with_name("right-submission")
    make_class(right, 1, tuple(LAB.checkpoints))
    (own,) = right.iterdir()
    mistakes = list(failing_at("05", stage("05")))
    for number in range(count):
        mistake = mistakes[number * len(mistakes) // count]
        place = folder / f"{number:04}-{re.sub(r'[^a-zA-Z0-9-]+', '_', mistake.name)}"
        hand_in(mistake, own, place)
        for path in place.glob("work/*.usda"):
            path.write_text(of_student(path.read_text(), number))
    shutil.rmtree(right)


def graded(checkout: Path, folder: Path, kind: str) -> float:
    """Grade a class with a checkout, and return the seconds of processors that it took."""
    out = folder / f"{kind}-{checkout.name}"
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, "-m", "lab3_usd", "grade", str(folder / kind)]
    command += ["--starter", str(starter()), "--output", str(out)]
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src"), "PYTHONHASHSEED": "0"}
    before = os.times()
    subprocess.run(command, env=environment, cwd=checkout, check=True, capture_output=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def differing(ours: Path, theirs: Path) -> Iterator[str]:
    """Yield the files of two gradebooks that are not the same."""
    names = {path.relative_to(book) for book in (ours, theirs) for path in book.rglob("*.*")}
    for name in sorted(names):
        both = [book / name for book in (ours, theirs)]
        if not all(path.is_file() for path in both) or len({p.read_bytes() for p in both}) > 1:
            yield name.as_posix()


if __name__ == "__main__":
    sys.exit(main())
