"""Puts every single fault, and edits by chance, before two judges: the rules and a dry run.

Usage: python benchmarks/crosscheck.py [--edits N] [--first N] [--jobs N]

Fails on a disagreement that tests/disagreements.yaml does not explain, on a row of it that is not
true, and on an edit that changes what the robot does and that no error or warning tells.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from two_judges import (
    Silence,
    Verdicts,
    all_faults,
    idle_rows,
    idle_silence,
    silent,
    unexplained,
    verdicts,
    wrong,
)

ALL = 1000  # edits of a full run


def fault(number: int) -> Verdicts:
    """Judge the fault of this number."""
    return verdicts(all_faults()[number])


def main() -> None:
    """Print what is wrong, and how much was tried."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edits", type=int, default=ALL)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    start = time.monotonic()
    with Pool(options.jobs) as pool:
        found = pool.map(fault, range(len(all_faults())), chunksize=8)
        numbers = range(options.first, options.first + options.edits)
        edits: list[Silence] = pool.map(silent, numbers, chunksize=8)
    said = [
        *wrong(found),
        *(f"no fault is like {row}" for row in idle_rows(each.fault for each in found)),
    ]
    said += unexplained(edits)
    if options.edits >= ALL:
        said += [f"no edit is like {each}" for each in idle_silence(edits)]
    agree = sum(each.agree for each in found)
    changed = sum(bool(edit.changes) for edit in edits)
    print(f"{len(found)} faults: both judges see {agree}, only the rules {len(found) - agree}")
    print(f"{len(edits)} edits: {changed} change what the robot does")
    print(f"{time.monotonic() - start:.0f} seconds", *said, sep="\n")
    sys.exit(1 if said else 0)


if __name__ == "__main__":
    main()
