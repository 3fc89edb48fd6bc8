"""Makes one repair in a stage that somebody else has open."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lab3_usd.judge.stage import checkpoint_of
from lab3_usd.model.repair import MovePrim, Repair
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.apply import apply_edit
from lab3_usd.stage.edit.session import EditSession


def repair_open_stage(repair: Repair, stage: Any) -> None:  # noqa: ANN401 - pxr has no types
    """Make the edits of a repair in the layers of a stage; no file is written."""
    lab = load_lab()
    checkpoint = checkpoint_of(Path(stage.GetRootLayer().realPath).name, lab) or lab.first
    session = EditSession(stage, lab, lab.checkpoints[checkpoint])
    for edit in sorted(repair.edits, key=lambda each: isinstance(each, MovePrim)):
        apply_edit(session, edit)
