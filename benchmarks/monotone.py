"""Makes one mistake more, again and again, in stages of all checkpoints: no grade may ever rise.

Usage: python benchmarks/monotone.py [--chains N] [--from N] [--jobs N] [--verbose]
"""

from __future__ import annotations

import argparse
import os
import sys
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from failing_students import LONGEST, drops
from grade_files import LAB


def rises(number: int) -> tuple[int, list[str]]:
    """Return the number of a chain and where it rises; the checkpoints take turns."""
    numbers = [*LAB.checkpoints]
    return number, drops(number, numbers[number % len(numbers)])


def main() -> None:
    """Go through the chains and print those in which a mistake more earned more."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chains", type=int, default=540)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--verbose", action="store_true", help="print how far it has come")
    options = parser.parse_args()
    rising = 0
    chains = range(options.first, options.first + options.chains)
    with Pool(options.jobs) as pool:
        for number, lines in pool.imap(rises, chains):
            rising += len(lines)
            for line in lines:
                print(f"chain {number}: {line}", flush=True)
            if options.verbose and number % 20 == 0:
                print(f"until chain {number}: {rising} rises", flush=True)
    print(f"{options.chains} chains of {LONGEST} mistakes, {rising} rises")
    sys.exit(1 if rising else 0)


if __name__ == "__main__":
    main()
