"""Loads `submission.yaml`: layout, deliverables, the starter's properties, the checklists."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder, lab_folder
from lab3_usd.spec.files import SUBMISSION
from lab3_usd.spec.load.records import record, records
from lab3_usd.spec.submission import (
    ChecklistSpec,
    Deliverable,
    FolderNames,
    StageFiles,
    StarterRules,
    SubmissionSpec,
)
from lab3_usd.spec.yaml_file import read_yaml


class _SubmissionFile(Struct, forbid_unknown_fields=True):
    folders: FolderNames
    stages: StageFiles
    deliverables: dict[str, dict[str, Any]] = {}
    starter: StarterRules | None = None  # as in the bundled lab
    checklist: dict[str, tuple[dict[str, Any], ...]] = {}


def load_submission(folder: Path | None = None) -> SubmissionSpec:
    """Load `submission.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    folder = folder if folder is not None else lab_folder()
    said = record(read_yaml(folder / SUBMISSION), _SubmissionFile, SUBMISSION)
    checklist = f"{SUBMISSION}: checklist"
    return SubmissionSpec(
        folders=said.folders,
        stages=said.stages,
        deliverables=records(said.deliverables, Deliverable, f"{SUBMISSION}: deliverables"),
        starter=said.starter or _usual_starter(),
        checklist=tuple(
            record({"section": section, **each}, ChecklistSpec, f"{checklist}: {section}")
            for section, lines in said.checklist.items()
            for each in lines
        ),
    )


def _usual_starter() -> StarterRules:
    """Return what the bundled lab compares of a starter: facts of USD and of Isaac Sim."""
    said = read_yaml(data_folder("graphs") / SUBMISSION)
    return record(said["starter"], StarterRules, f"{SUBMISSION}: starter")
