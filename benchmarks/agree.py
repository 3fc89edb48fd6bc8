"""Asks five commands about every stage of tests and examples, and counts what contradicts itself.

Usage: python benchmarks/agree.py [--every N] [--first N] [--jobs N] [--verbose]

Compares what check, lint, sim, tf and topics say of one question. The last line is the number of
contradictions that no row of `answers` in tests/disagreements.yaml explains. Fails unless it is 0,
and on a row that explains nothing.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from functools import cache
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from agreement import (
    Contradiction,
    Subject,
    all_subjects,
    contradictions_of,
    once_contradictory,
    unexplained,
)
from two_judges import idle_rows

SHOWN = 3  # stages of one contradiction


@cache
def stages() -> tuple[Subject, ...]:
    """Return every stage, and those that once contradicted themselves."""
    return (*once_contradictory(), *all_subjects())


def asked(number: int) -> list[Contradiction]:
    """Ask about the stage of this number."""
    return contradictions_of(stages()[number])


def main() -> None:
    """Print the contradictions, how many of each kind there are, and how many in all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--verbose", action="store_true", help="name every stage")
    options = parser.parse_args()
    start, count = time.monotonic(), len(stages())
    numbers = range(options.first, count, options.every)
    with Pool(options.jobs) as pool:
        found = [each for said in pool.map(asked, numbers, chunksize=4) for each in said]
    left = unexplained(found)
    idle = idle_rows(map(str, found), "answers") if options.every == 1 else []
    print(f"{len(numbers)} stages, {time.monotonic() - start:.0f} seconds")
    print(f"{len(found)} contradictions, of which {len(found) - len(left)} are explained")
    alike: dict[tuple[str, str], list[str]] = {}
    for each in left:
        alike.setdefault((each.question, each.answers), []).append(each.stage)
    for (question, answers), names in alike.items():
        shown = names if options.verbose else names[:SHOWN]
        more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
        print(f"{question}: {answers} [{'; '.join(shown)}{more}]")
    for row in idle:
        print(f"nothing is like the row {row}")
    for question, number in Counter(each.question for each in left).items():
        print(f"{number:>6} {question}")
    print(len(left))
    sys.exit(1 if left or idle else 0)


if __name__ == "__main__":
    main()
