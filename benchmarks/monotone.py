"""Makes one mistake more, again and again, in stages of all checkpoints: no grade may ever rise.

Usage: python benchmarks/monotone.py [--chains N] [--from N]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from fault_chains import LONGEST, drops
from grade_files import LAB


def main() -> None:
    """Go through the chains and print those in which a mistake more earned more."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chains", type=int, default=540)
    parser.add_argument("--from", dest="first", type=int, default=0)
    options = parser.parse_args()
    numbers = [*LAB.checkpoints]
    rising = 0
    for number in range(options.first, options.first + options.chains):
        for line in drops(number, numbers[number % len(numbers)]):
            rising += 1
            print(f"chain {number}: {line}", flush=True)
    print(f"{options.chains} chains of {LONGEST} mistakes, {rising} rises")
    sys.exit(1 if rising else 0)


if __name__ == "__main__":
    main()
