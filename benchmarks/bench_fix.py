"""Repairs every single fault of the second author's stage, and prints how many pass afterwards.

Usage: python benchmarks/bench_fix.py [CHECKPOINT] [--every N] [--verbose]
       python benchmarks/bench_fix.py [CHECKPOINT] --spread [--structure NAME] [--every N]
                                      [--together N] [--drive] [--verbose]
       python benchmarks/bench_fix.py --edits [--count N] [--first NUMBER]
       python benchmarks/bench_fix.py --fuzz [--count N] [--first SEED]

Each stage is text with comments. `median` and `most` count the lines of the diff, taken out and put
in; `elsewhere` the repairs that changed the text of a prim which no edit names; `lost` the comments
that went away.

With --spread, each fault in stages of several structures: one file, text or binary, sublayers, a
sublayer in another folder, references, payloads, variants. The files are written and judged again;
`harm` counts stages with an error that was not there before. --together draws so many faults of a
checkpoint at once, --drive asks the dry run whether the stages that pass work.

With --edits, edits by chance, of which no repair knows, in stages of several checkpoints and
styles, text and binary: how many of those that fail pass afterwards. With --fuzz, random edits of
random text layers: each result must open, say what the edits ask for, and leave all other
statements and comments alone.
"""

from __future__ import annotations

import argparse
import random
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from fixing import (
    STRUCTURES,
    Outcome,
    has_errors,
    repaired,
    repaired_edit,
    repaired_in,
    second_faults,
)
from fuzzed_edits import fault_of

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import quiet


def outcomes(checkpoint: str, every: int = 1) -> list[Outcome]:
    """Repair every `every`-th fault of a checkpoint."""
    lab = load_lab()
    with tempfile.TemporaryDirectory() as folder:
        found = (
            repaired(checkpoint, fault, Path(folder), lab)
            for fault in second_faults(checkpoint)[::every]
        )
        return [each for each in found if each is not None]


def table(found: Sequence[Outcome]) -> str:
    """Return the figures by kind of fault."""
    columns = ("faults", "pass", "share", "median", "most", "elsewhere", "lost")
    lines = [f"{'kind':<10}" + "".join(f"{column:>10}" for column in columns)]
    for kind in [*dict.fromkeys(each.fault.kind for each in found), "all"]:
        some = [each for each in found if kind in {each.fault.kind, "all"}]
        passed = [each for each in some if each.passes]
        counts = [each.lines for each in passed] or [0]
        lines.append(
            f"{kind:<10}{len(some):>10}{len(passed):>10}{len(passed) / len(some):>10.1%}"
            f"{statistics.median(counts):>10.0f}{max(counts):>10}"
            f"{sum(bool(each.elsewhere) for each in some):>10}"
            f"{sum(len(each.lost_comments) for each in some):>10}"
        )
    return "\n".join(lines)


def fuzz(first: int, count: int) -> int:
    """Edit random layers, print what went wrong, and return how often something did."""
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            found = fault_of(seed, Path(folder))
            if found is not None:
                faults += 1
                print(f"seed {seed}: {found}", flush=True)
    print(f"{count} layers edited, {faults} wrong")
    return faults


def edits(first: int, count: int) -> None:
    """Repair edits by chance, and print what is left."""
    lab, passed, failed = load_lab(), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, first + count):
            told, fixed = repaired_edit(number, Path(folder), lab)
            if fixed is None:
                continue
            failed += 1
            passed += not has_errors(fixed.after)
            if has_errors(fixed.after):
                left = [f"{each.rule} {each.prim}" for each in fixed.left]
                print(f"{number}: {told}; left {', '.join(left)}", flush=True)
    print(f"{count} edits: {failed} are errors, of which {passed} pass afterwards")


def spread(checkpoint: str, structure: str, options: argparse.Namespace) -> None:
    """Repair faults in stages of one structure, and print how many pass."""
    lab, faults = load_lab(), second_faults(checkpoint)
    chance = random.Random(f"{checkpoint} {structure}")  # noqa: S311 - the same on every run
    start = chance.randrange(options.every)
    groups = [[fault] for fault in faults[start :: options.every]]
    if options.together > 1:
        groups = [chance.sample(faults, options.together) for _ in groups]
    count = passed = harmed = driven = 0
    with tempfile.TemporaryDirectory() as folder:
        for group in groups:
            found = repaired_in(
                structure, checkpoint, group, Path(folder), lab, drive=options.drive
            )
            if found is None:
                continue
            is_passed = not has_errors(found.after)
            count, passed = count + 1, passed + is_passed
            harmed += found.is_harmed
            driven += is_passed and not found.wrong
            if options.verbose and (not is_passed or found.is_harmed or found.wrong):
                left = [f"{each.rule} {each.prim} {each.property}" for each in found.fixed.left]
                names = " + ".join(fault.name for fault in group)
                print(f"    {names}: {left} {found.wrong}", flush=True)
    works = f", {driven} of these work" if options.drive else ""
    share = passed / count if count else 1.0
    print(
        f"{checkpoint} {structure:<10} {count:>5} {passed:>5} {share:>7.1%} harm {harmed}{works}",
        flush=True,
    )


def main() -> None:
    """Print the table of one checkpoint, or of all, or what random edits give."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoint", nargs="?")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--spread", action="store_true")
    parser.add_argument("--structure", choices=STRUCTURES)
    parser.add_argument("--together", type=int, default=1)
    parser.add_argument("--drive", action="store_true")
    parser.add_argument("--edits", action="store_true")
    parser.add_argument("--fuzz", action="store_true")
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    if options.fuzz:
        sys.exit(bool(fuzz(options.first, options.count)))
    if options.edits:
        edits(options.first, options.count)
        return
    chosen = [options.checkpoint] if options.checkpoint else list(load_lab().checkpoints)
    if options.spread:
        with quiet():
            for checkpoint in chosen:
                for structure in [options.structure] if options.structure else STRUCTURES:
                    spread(checkpoint, structure, options)
        return
    for checkpoint in chosen:
        found = outcomes(checkpoint, options.every)
        print(f"checkpoint {checkpoint}\n{table(found)}\n", flush=True)
        for each in found if options.verbose else ():
            if not each.passes or each.elsewhere or each.lost_comments:
                print(each.fault.name, each.elsewhere, each.lost_comments)
                for left in each.fixed.left:
                    print(f"    {left.rule} {left.prim} {left.property}: {left.message}")


if __name__ == "__main__":
    main()
