"""Dry runs of stages that belong to no checkpoint."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

from breaking import the_lab
from msgspec.structs import replace
from pxr import Usd

from lab3_usd.model.dry_run import Behaviour, Check
from lab3_usd.sim import any_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.execution.drive import Session
from lab3_usd.sim.robots import drive_for

BRIEFLY = "0.15,0,0.6 0,0.8,0.4"  # where it is of no importance how far it drives
FIXED = None  # the drive that every stage is judged by
WHOLE = 9.0  # seconds, as long as any of its legs


def played(
    stage: Usd.Stage,
    folder: Path,
    topic: str = "",
    drive: str | None = BRIEFLY,
    longest: float = 0.5,
) -> Behaviour:
    """Play a stage; no leg lasts longer than this many seconds, or one in which joints arrive."""
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    with patch.object(any_stage, "drive_for", _drive_of(longest)):
        return dry_run(path, the_lab(), "", drive, topic).behaviour


def _drive_of(longest: float) -> Callable[..., tuple[Session, ...]]:
    def brief(*arguments: Any) -> tuple[Session, ...]:
        return tuple(
            replace(
                session,
                legs=tuple(
                    replace(
                        leg,
                        seconds=min(leg.seconds, max(longest, 1.0) if leg.joints else longest),
                    )
                    for leg in session.legs
                ),
            )
            for session in drive_for(*arguments)
        )

    return brief


def by_name(behaviour: Behaviour) -> dict[str, Check]:
    return {check.name: check for check in behaviour.checks}


def bad(behaviour: Behaviour) -> set[str]:
    return {check.name for check in behaviour.checks if check.verdict == "bad"}
