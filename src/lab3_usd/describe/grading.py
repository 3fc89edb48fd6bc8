"""Describes what is handed in of a new lab, and its points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lab3_usd.describe.checkpoints import FileNames, Step
from lab3_usd.describe.yaml_text import document
from lab3_usd.spec.scene import SensorSpec
from lab3_usd.spec.submission import FolderNames

_HEAD = """\
What a submission holds: folders and files. Add what else is handed in (`deliverables`) and the
checklists of your handout (`checklist`)."""
_DIFFER = "No two files of the checkpoints in `differ` may be the same."
_POINTS = 10


def submission_text(names: FileNames, steps: Sequence[Step], folders: FolderNames) -> str:
    """Return `submission.yaml`; `folders` are those of the bundled lab."""
    data = {
        "folders": {
            "handout": "A1",
            "stages": folders.stages,
            "starter": folders.starter,
            "shown": list(folders.shown),
        },
        "stages": {
            "handout": "A1",
            "endings": [".usda", ".usd"],
            "openable": [".usdc", ".usdz"],
            "slips": [".uda"],
            "differ": [step.id for step in steps],
            "starter": names.first_file,
        },
    }
    return document(_HEAD, data, {"stages": _DIFFER})


def rubric_text(
    title: str, steps: Sequence[Step], sensors: Mapping[str, SensorSpec], *, frames: bool
) -> str:
    """Return `rubric.yaml`: the same points for each checkpoint."""
    items: dict[str, Any] = {}
    for step in steps:
        groups = [*step.graphs, *(sensors[name].name for name in step.sensors)]
        items[f"part {step.part}" if f"part {step.part}" not in items else step.name] = {
            "title": step.title,
            "checkpoint": step.id,
            "groups": groups or ["Scene"],
            "points": _POINTS,
        }
    if frames:
        tree = {"title": "The TF tree", "checkpoint": steps[-1].id, "groups": ["TF"]}
        items["tree"] = {**tree, "points": _POINTS}
    head = "Points: what each part of the lab is worth. `groups` are graphs, sensors, Scene and TF."
    return document(head, {"title": title, "items": items})
