"""Dry runs of stages that belong to no checkpoint."""

from __future__ import annotations

from pathlib import Path

from breaking import the_lab
from pxr import Usd

from lab3_usd.model.dry_run import Behaviour, Check
from lab3_usd.sim.dry_run import dry_run

BRIEFLY = "0.15,0,1 0,0.8,0.5"  # where it is of no importance how far it drives
FIXED = None  # the drive that every stage is judged by, three times as long


def played(
    stage: Usd.Stage, folder: Path, topic: str = "", drive: str | None = BRIEFLY
) -> Behaviour:
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    return dry_run(path, the_lab(), "", drive, topic).behaviour


def by_name(behaviour: Behaviour) -> dict[str, Check]:
    return {check.name: check for check in behaviour.checks}


def bad(behaviour: Behaviour) -> set[str]:
    return {check.name for check in behaviour.checks if check.verdict == "bad"}
