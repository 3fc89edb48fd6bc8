"""Repairs every single fault of the second author's stage, and prints how many pass afterwards.

Usage: python benchmarks/bench_fix.py [CHECKPOINT...] [--every N] [--verbose]
       python benchmarks/bench_fix.py [CHECKPOINT...] --spread [--structure NAME] [--every N]
                                      [--together N] [--drive] [--jobs N] [--results FILE]
                                      [--verbose]
       python benchmarks/bench_fix.py --edits [--count N] [--first NUMBER]
       python benchmarks/bench_fix.py --fuzz [--count N] [--first SEED]

Each stage is text with comments. `median` and `most` count the lines of the diff, taken out and put
in; `elsewhere` the repairs that changed the text of a prim which no edit names; `lost` the comments
that went away.

With --spread, each fault in stages of several structures: one file, text or binary, sublayers, a
sublayer in another folder, references, payloads, variants. The files are written and judged again;
`harm` counts stages with an error that was not there before. --together draws so many faults of a
checkpoint at once, --drive asks the dry run whether the stages that pass work; `wrong` counts those
that do not. --results keeps a line of JSON for each stage, and leaves out those that have theirs.

What checkpoints ask for alike is shared: the second author's stages of 05 to 08 are the same bytes.
Such a stage is broken and repaired once, and each state that the repair sees is judged at all of
these checkpoints. At one that finds anything else the stage is repaired anew, and at all of them
where the files written are not found as the repaired stage was. What composes to the same is played
once for all checkpoints that ask for the same.

With --edits, edits by chance, of which no repair knows, in stages of several checkpoints and
styles, text and binary: how many of those that fail pass afterwards. With --fuzz, random edits of
random text layers: each result must open, say what the edits ask for, and leave all other
statements and comments alone.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import sys
import tempfile
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from fixing import (
    STRUCTURES,
    Outcome,
    Spread,
    has_errors,
    repaired,
    repaired_edit,
    repaired_in,
    second_faults,
    second_stage,
)
from fuzzed_edits import fault_of
from made_once import starter_made_once
from sabotage import Fault

from lab3_usd.pipeline.processes import in_processes
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import quiet

Row: TypeAlias = dict[str, Any]  # what came of one stage, as it is kept


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


class Work(NamedTuple):
    """Faults, by their numbers, to be put together in a stage that these checkpoints ask for."""

    structure: str
    checkpoints: tuple[str, ...]
    faults: tuple[int, ...]
    drive: bool


def works(options: argparse.Namespace) -> list[Work]:
    """Return the stages to repair: all of the first structure, then all others by chance."""
    chosen = options.checkpoints or [*load_lab().checkpoints]
    structures = [options.structure] if options.structure else [*STRUCTURES]
    alike: dict[str, list[str]] = {}
    for checkpoint in chosen:
        alike.setdefault(second_stage(checkpoint).ExportToString(), []).append(checkpoint)
    found = []
    for structure in structures:
        for checkpoints in alike.values():
            chance = random.Random(f"{checkpoints[0]} {structure}")  # noqa: S311 - same on every run
            numbers = range(len(second_faults(checkpoints[0])))
            groups: list[tuple[int, ...]] = [
                (number,) for number in numbers[chance.randrange(options.every) :: options.every]
            ]
            if options.together > 1:
                groups = [tuple(chance.sample(numbers, options.together)) for _ in groups]
            found += [Work(structure, tuple(checkpoints), group, options.drive) for group in groups]
    chance = random.Random(0)  # noqa: S311 - the same on every run
    chance.shuffle(found)
    return sorted(found, key=lambda work: work.structure != structures[0])


def stages(work: Work) -> list[Row]:
    """Repair a stage, and return what came of it at each of its checkpoints."""
    lab, rows = load_lab(), []
    waiting = [*work.checkpoints]
    while waiting:
        checkpoint, *others = waiting
        faults = [second_faults(checkpoint)[number] for number in work.faults]
        with tempfile.TemporaryDirectory() as folder, quiet(), starter_made_once():
            found = repaired_in(
                work.structure,
                checkpoint,
                faults,
                Path(folder),
                lab,
                drive=work.drive,
                others=others,
            )
        at = [checkpoint, *(sorted(found.same_at) if found else others)]
        rows += [_row(work, number, faults, found) for number in at]
        waiting = [number for number in waiting if number not in at]
    return rows


def _row(work: Work, checkpoint: str, faults: Sequence[Fault], found: Spread | None) -> Row:
    row: Row = {
        "structure": work.structure,
        "checkpoint": checkpoint,
        "faults": [fault.name for fault in faults],
        "result": "no fault",
    }
    if found is not None:
        left = [finding for finding in found.after if finding.severity == "error"]
        row["result"] = "left" if left else "pass"
        row["harm"] = found.is_harmed
        row["left"] = [f"{each.rule} {each.prim} {each.property}" for each in left]
        row["wrong"] = [*found.wrong]
    return row


def spread(options: argparse.Namespace) -> None:
    """Repair faults in stages of all structures, keep what came of each, and print the shares."""
    kept = options.results
    rows = [json.loads(line) for line in kept.open()] if kept and kept.exists() else []
    done = {(row["structure"], row["checkpoint"], *row["faults"]) for row in rows}
    todo = [
        work
        for work in works(options)
        if any(_name(work, checkpoint) not in done for checkpoint in work.checkpoints)
    ]
    with kept.open("a") if kept else nullcontext() as file:
        for found in in_processes(stages, _ended, todo, options.jobs):
            for row in found:
                rows.append(row)
                if file:
                    print(json.dumps(row), file=file, flush=True)
                if options.verbose and (row.get("left") or row.get("wrong") or row.get("harm")):
                    print(json.dumps(row), flush=True)
    print(shares(rows))


def _name(work: Work, checkpoint: str) -> tuple[str, ...]:
    faults = second_faults(checkpoint)
    return work.structure, checkpoint, *(faults[number].name for number in work.faults)


def _ended(work: Work, reason: str) -> list[Row]:
    """Return the rows of a process that ended at its work."""
    rows = [
        _row(work, number, [second_faults(number)[fault] for fault in work.faults], None)
        for number in work.checkpoints
    ]
    return [{**row, "result": "left", "harm": True, "left": [reason]} for row in rows]


def shares(rows: Sequence[Row]) -> str:
    """Return how many stages pass, by checkpoint and structure."""
    found = [row for row in rows if row["result"] != "no fault"]
    lines = [f"{'':<14}{'stages':>8}{'pass':>8}{'share':>8}{'harm':>6}{'wrong':>7}"]
    kinds = [(row["checkpoint"], row["structure"]) for row in found]
    for kind in [*sorted(set(kinds)), ("all", "")]:
        some = [
            row for row in found if kind in {(row["checkpoint"], row["structure"]), ("all", "")}
        ]
        passed = [row for row in some if row["result"] == "pass"]
        lines.append(
            f"{' '.join(kind):<14}{len(some):>8}{len(passed):>8}"
            f"{len(passed) / len(some) if some else 1.0:>8.1%}"
            f"{sum(row['harm'] for row in some):>6}{sum(bool(row['wrong']) for row in some):>7}"
        )
    return "\n".join(lines)


def main() -> None:
    """Print the table of one checkpoint, or of all, or what random edits give."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoints", nargs="*")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--spread", action="store_true")
    parser.add_argument("--structure", choices=STRUCTURES)
    parser.add_argument("--together", type=int, default=1)
    parser.add_argument("--drive", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path)
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
    if options.spread:
        spread(options)
        return
    for checkpoint in options.checkpoints or load_lab().checkpoints:
        found = outcomes(checkpoint, options.every)
        print(f"checkpoint {checkpoint}\n{table(found)}\n", flush=True)
        for each in found if options.verbose else ():
            if not each.passes or each.elsewhere or each.lost_comments:
                print(each.fault.name, each.elsewhere, each.lost_comments)
                for left in each.fixed.left:
                    print(f"    {left.rule} {left.prim} {left.property}: {left.message}")


if __name__ == "__main__":
    main()
