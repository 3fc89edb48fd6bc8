"""Loads `submission.yaml`: layout, deliverables, the starter's properties, the checklists."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder
from lab3_usd.spec.submission_spec import (
    ChecklistSpec,
    Deliverable,
    FolderNames,
    StageFiles,
    StarterRules,
    SubmissionSpec,
)
from lab3_usd.spec.yaml_file import expect, known_keys, need, read_yaml, texts

FILE = "submission.yaml"


def load_submission(folder: Path | None = None) -> SubmissionSpec:
    """Load `submission.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    return _load(folder if folder is not None else data_folder("graphs"))


@lru_cache(maxsize=4)
def _load(folder: Path) -> SubmissionSpec:
    data = read_yaml(folder / FILE)
    known_keys(data, ("folders", "stages", "deliverables", "starter", "checklist"), FILE)
    starter = need(data, "starter", dict, FILE)
    groups = need(starter, "together", list, f"{FILE}: starter")
    together = tuple(texts({"together": each}, "together", f"{FILE}: starter") for each in groups)
    return SubmissionSpec(
        folders=FolderNames(**_plain(FolderNames, need(data, "folders", dict, FILE), "folders")),
        stages=StageFiles(**_plain(StageFiles, need(data, "stages", dict, FILE), "stages")),
        deliverables={
            name: Deliverable(**_plain(Deliverable, {**spec, "name": name}, name))
            for name, spec in need(data, "deliverables", dict, FILE).items()
        },
        starter=StarterRules(**{**_plain(StarterRules, starter, "starter"), "together": together}),
        checklist=tuple(_checklist(need(data, "checklist", dict, FILE))),
    )


def _checklist(sections: Mapping[str, Any]) -> list[ChecklistSpec]:
    lines = []
    for section, items in sections.items():
        for item in expect(items, list, f"{FILE}: checklist: {section}"):
            where = f"checklist: {section}"
            spec = {**expect(item, dict, f"{FILE}: {where}"), "section": section}
            lines.append(ChecklistSpec(**_plain(ChecklistSpec, spec, where)))
    return lines


def _plain(kind: type[Struct], data: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the fields of a record out of the file: lists become tuples of texts.

    Raises:
        SpecError: a field is missing, of another kind, or unknown.
    """
    place = f"{FILE}: {where}"
    fields = kind.__struct_fields__
    optional = fields[len(fields) - len(kind.__struct_defaults__) :]
    known_keys(data, fields, place)
    values: dict[str, Any] = {}
    for name in fields:
        if name not in data and name in optional:
            continue
        annotation = kind.__annotations__[name]
        if annotation == "tuple[str, ...]":
            values[name] = texts(data, name, place)
        else:
            values[name] = need(data, name, _KINDS.get(annotation, list), place)
    return values


_KINDS = {"str": str, "int": int}
