"""Grades a class of students with one mistake each, which `check` finds, and prints what they earn.

Usage: python benchmarks/failing_class.py [--count N] [--keep DIR] [--verbose]
       python benchmarks/failing_class.py --read GRADES.csv (of another checkout)
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from failing_students import failing_at, hand_in
from grade_files import starter
from submissions import write_submission

from lab3_usd.grade.class_run import ClassSettings, grade_class

BINS = (0, 50, 80, 90, 95, 98, 99, 100)


def make_class(folder: Path, right: Path, count: int) -> None:
    """Write a class: every gross mistake, and of the others some, evenly chosen."""
    found = list(failing_at("05", next(right.glob("work/*_05_*.usda"))))
    chosen = [mistake for mistake in found if mistake.gross]
    others = [mistake for mistake in found if not mistake.gross]
    more = min(count - len(chosen), len(others))
    chosen += [others[number * len(others) // more] for number in range(more)]
    for mistake in chosen:
        hand_in(mistake, right, folder / re.sub(r"[^\w.-]+", "_", mistake.name))


def table(rows: Sequence[dict[str, str]]) -> str:
    """Return the distribution of the percentages."""
    percents = sorted(float(row["percent"]) for row in rows)
    lines = [f"{len(percents)} submissions, median {percents[len(percents) // 2]:.2f} %"]
    for low, high in zip(BINS, [*BINS[1:], 1000], strict=True):
        count = sum(low <= percent < high for percent in percents)
        lines.append(f"{f'{low} %' if low == high else f'from {low} %':<12}{count:>5}")
    return "\n".join(lines)


def main() -> None:
    """Make, grade and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=211)
    parser.add_argument("--keep", type=Path, help="write class and gradebook into this new folder")
    parser.add_argument("--read", type=Path, help="print the distribution of this table instead")
    parser.add_argument("--verbose", action="store_true", help="print every row")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        grades = options.read or folder / "gradebook" / "grades.csv"
        if options.read is None:
            right = write_submission(Path(scratch) / "right")
            make_class(folder / "class", right, options.count)
            grade_class(ClassSettings(folder / "class", starter(), folder / "gradebook"))
            (folder / "starter.usda").write_bytes(starter().read_bytes())
        with grades.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    print(table(rows))
    for row in sorted(rows, key=lambda row: -float(row["percent"])) if options.verbose else ():
        print(row["percent"], row["student"], row["remarks"])


if __name__ == "__main__":
    main()
