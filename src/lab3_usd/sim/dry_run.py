"""Opens a stage and plays it."""

from __future__ import annotations

from pathlib import Path

from msgspec import Struct

from lab3_usd.errors import StageError
from lab3_usd.model.behaviour import Behaviour, Replay, Unknown
from lab3_usd.model.scene import Scene
from lab3_usd.sim.behaviour.asked import interface
from lab3_usd.sim.behaviour.evidence import Evidence
from lab3_usd.sim.drive import drive_of, fixed_drive
from lab3_usd.sim.outcome import outcome
from lab3_usd.sim.play import record
from lab3_usd.sim.replay import replay
from lab3_usd.spec.lab import Lab


class DryRun(Struct, frozen=True):
    """What a stage does, and all that it did; there is no evidence of one that cannot be read."""

    behaviour: Behaviour
    evidence: Evidence | None = None

    @property
    def replay(self) -> Replay | None:
        """What there is to draw of it."""
        return replay(self.evidence) if self.evidence is not None else None


def scene_of(path: Path) -> Scene:
    """Open a stage, and return what is needed to play it.

    Raises:
        StageError: it cannot be read.
    """
    from lab3_usd.stage.read.opening import open_stage, quiet  # noqa: PLC0415 - pxr, only when needed
    from lab3_usd.stage.read.scene import read_scene  # noqa: PLC0415

    with quiet():
        return read_scene(open_stage(path))


def dry_run(path: Path, lab: Lab, checkpoint: str, drive: str | None = None) -> DryRun:
    """Play a stage and judge what it does by what the lab asks for at a checkpoint.

    Raises:
        UsageError: the drive is none.
    """
    wanted = interface(lab, lab.checkpoints[checkpoint])
    sessions = fixed_drive() if drive is None else drive_of(drive, wanted.limits)
    try:
        scene = scene_of(path)
    except StageError as error:
        reason = str(error).removeprefix(f"{path}: ")
        unknown = (Unknown("/", reason),)
        return DryRun(Behaviour(str(path), checkpoint, 0.0, "unreadable", not_simulated=unknown))
    evidence = record(scene, lab.catalog, sessions, wanted)
    return DryRun(outcome(str(path), checkpoint, evidence), evidence)
