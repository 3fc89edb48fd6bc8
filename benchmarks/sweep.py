"""Makes every single fault, one at a time, and prints how many are found, where, and how often.

Usage: python benchmarks/sweep.py [CHECKPOINT] [--lab DIR] [--verbose]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/support"))

from breaking import copied
from lab_sabotage import lab_scene_faults
from pxr import Sdf
from sabotage import Fault, graph_faults
from scene_sabotage import scene_sabotage

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.data import LAB_VARIABLE, own_lab
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.lab import Checkpoint
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.builder import build_checkpoint

# Parts B and F press Play and then save: what lies below the robot has moved by then.
ONLY_IN_THE_STARTER = ("in the starter", "lidar link moved")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the rules said of one fault."""

    fault: Fault
    stage: StageModel
    judged: RuleResults

    @property
    def told(self) -> tuple[Finding, ...]:
        """The errors and warnings: a robot that stands elsewhere is one from checkpoint 06 on."""
        return tuple(each for each in self.judged.findings if each.severity != "note")

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The errors among them."""
        return tuple(each for each in self.told if each.severity == "error")

    @property
    def found(self) -> bool:
        """Whether anything was said at all."""
        return bool(self.told)

    @property
    def at_place(self) -> bool:
        """Whether one of the findings names a site of the fault."""
        return any(each.prim in self.fault.sites for each in self.told)


def sweep(checkpoint: str, every: int = 1, start: int = 0) -> Iterator[Outcome]:
    """Make each `every`-th fault of a checkpoint, from `start` on, and yield what is said.

    The lab is the one that `LAB3_LAB` names.
    """
    lab = load_lab()
    asked = lab.checkpoints[checkpoint]
    with tempfile.TemporaryDirectory() as folder:
        clean = build_checkpoint(None, checkpoint, Path(folder) / f"{asked.file}.usda")
        layer = Sdf.Layer.FindOrOpen(str(clean))
        of_scene = scene_faults(asked) if own_lab() is None else lab_scene_faults(lab, asked)
        faults = [*graph_faults(lab, asked), *of_scene]
        for fault in faults[start::every]:
            stage = copied(layer)
            fault.break_it(stage)
            model = read_model(stage, lab.platform, clean.name)
            judged = judge(lab, asked, model)
            if judged.crashes:
                raise RuntimeError(judged.crashes)
            yield Outcome(fault, model, judged)


def scene_faults(asked: Checkpoint) -> Iterator[Fault]:
    """Yield the faults of the scene items that this checkpoint or an earlier one asks for."""
    for each in scene_sabotage():
        only_there = each.checkpoint == "00" and each.name.endswith(ONLY_IN_THE_STARTER)
        if each.checkpoint <= asked.id and not (only_there and asked.id != "00"):
            yield Fault(each.name, "scene", each.apply, (each.site[0],))


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the figures by kind of fault."""
    lines = [f"{'kind':<10}{'faults':>8}{'found':>8}{'at place':>10}{'mean':>8}"]
    kinds = [*dict.fromkeys(outcome.fault.kind for outcome in outcomes), "all"]
    for kind in kinds:
        some = [outcome for outcome in outcomes if kind in {outcome.fault.kind, "all"}]
        count, errors = len(some), sum(len(each.errors) for each in some)
        found, placed = sum(each.found for each in some), sum(each.at_place for each in some)
        lines.append(f"{kind:<10}{count:>8}{found:>8}{placed:>10}{errors / count:>8.3f}")
    return "\n".join(lines)


def main() -> None:
    """Print the table of one checkpoint, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoint", nargs="?")
    parser.add_argument("--lab", help="the folder of another lab")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    if options.lab:
        os.environ[LAB_VARIABLE] = options.lab
    chosen = [options.checkpoint] if options.checkpoint else list(load_lab().checkpoints)
    for checkpoint in chosen:
        outcomes = list(sweep(checkpoint))
        print(f"checkpoint {checkpoint}\n{table(outcomes)}\n")
        for outcome in outcomes if options.verbose else ():
            if len(outcome.errors) != 1 or not outcome.at_place:
                print(outcome.fault.name, outcome.fault.sites)
                for error in outcome.errors:
                    print(f"    {error.rule} {error.prim} {error.property}: {error.message}")


if __name__ == "__main__":
    main()
