"""Loads `submission.yaml`: layout, deliverables, the starter's properties, the checklists."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder
from lab3_usd.spec.records import record, records
from lab3_usd.spec.submission_spec import (
    ChecklistSpec,
    Deliverable,
    FolderNames,
    StageFiles,
    StarterRules,
    SubmissionSpec,
)
from lab3_usd.spec.yaml_file import read_yaml

FILE = "submission.yaml"


class _SubmissionFile(Struct, forbid_unknown_fields=True):
    folders: FolderNames
    stages: StageFiles
    deliverables: dict[str, dict[str, Any]]
    starter: StarterRules
    checklist: dict[str, tuple[dict[str, Any], ...]]


def load_submission(folder: Path | None = None) -> SubmissionSpec:
    """Load `submission.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    folder = folder if folder is not None else data_folder("graphs")
    said = record(read_yaml(folder / FILE), _SubmissionFile, FILE)
    return SubmissionSpec(
        folders=said.folders,
        stages=said.stages,
        deliverables=records(said.deliverables, Deliverable, f"{FILE}: deliverables"),
        starter=said.starter,
        checklist=tuple(
            record({"section": section, **each}, ChecklistSpec, f"{FILE}: checklist: {section}")
            for section, lines in said.checklist.items()
            for each in lines
        ),
    )
