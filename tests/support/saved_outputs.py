"""Reading the outputs that somebody saved in a folder, without a submission around them."""

from __future__ import annotations

from pathlib import Path

from lab3_usd.deliverables.evidence.saved_outputs import read_texts
from lab3_usd.deliverables.submission_files import entries_below
from lab3_usd.model.folder import Evidence
from lab3_usd.spec.load.lab import load_ros

ROS = load_ros()


def read_evidence(folder: Path, root: Path | None = None) -> Evidence:
    """Read what the texts in `folder` show, named relative to `root`, by default the folder."""
    base = folder if root is None else root
    files = [folder / entry.path for entry in entries_below(folder) if not entry.why_not]
    named = {file.relative_to(base).as_posix(): file for file in files}
    return read_texts(named, folder.relative_to(base).as_posix(), ROS)
