"""What a submission must hold, and what of the starter must be found again: `submission.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from lab3_usd.data import data_folder
from lab3_usd.spec.yaml_file import expect, known_keys, need, read_yaml, texts

FILE = "submission.yaml"


@dataclass(frozen=True, slots=True)
class FolderNames:
    """The folders of a submission by what lies in them (4.3); `shown` holds saved output."""

    handout: str
    stages: str
    starter: str
    maps: str
    shown: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StageFiles:
    """How stage files are named.

    `endings` are the handout's, the first preferred; `openable` ones USD opens as well; `slips`
    are no endings of USD. No two files of the checkpoints in `differ` may be the same.
    """

    handout: str
    endings: tuple[str, ...]
    openable: tuple[str, ...]
    slips: tuple[str, ...]
    differ: tuple[str, ...]
    starter: str


@dataclass(frozen=True, slots=True)
class Deliverable:
    """Something to hand in beside the stages.

    A file counts by its ending; where `names` and `links` are given, also by its name when it
    holds one of the links. `folder` limits the search to the folders of saved output.
    """

    name: str
    title: str
    handout: str
    hint: str
    endings: tuple[str, ...]
    names: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    at_least: int = 1
    folder: str = ""


@dataclass(frozen=True, slots=True)
class StarterRules:
    """Which properties of the starter are compared, and what a change of them is.

    Patterns have `*`. `never` ones are not compared, `physics` and `shapes` of collisions are
    errors, `looks` count on lights and cameras only. Prims of the types `anywhere` are recognised
    by their type, those named in `library` through the links that refer to them.
    """

    handout: str
    never: tuple[str, ...]
    physics: tuple[str, ...]
    masses: tuple[str, ...]
    shapes: tuple[str, ...]
    looks: tuple[str, ...]
    ignored_prims: tuple[str, ...]
    library: tuple[str, ...]
    anywhere: tuple[str, ...]
    articulation: tuple[str, ...]
    articulation_properties: tuple[str, ...]
    body: str
    collision: str
    physics_names: tuple[str, ...]
    together: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class ChecklistSpec:
    """One line of the handout's checklists, and what decides it.

    `requirements` are patterns of requirement ids and `rules` rule ids, both of the last stage;
    `shown` names saved output as `kind target`; `deliverables` are names of those. `person` says
    what a person has to look at. A line is met when all of it is.
    """

    section: str
    text: str
    requirements: tuple[str, ...] = ()
    rules: tuple[str, ...] = ()
    shown: tuple[str, ...] = ()
    deliverables: tuple[str, ...] = ()
    stages: str = ""
    person: str = ""


@dataclass(frozen=True, slots=True)
class SubmissionSpec:
    """Everything that `submission.yaml` says."""

    folders: FolderNames
    stages: StageFiles
    deliverables: Mapping[str, Deliverable]
    starter: StarterRules
    checklist: tuple[ChecklistSpec, ...]


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


def _plain(kind: type, data: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the fields of a dataclass out of the file: lists become tuples of texts.

    Raises:
        SpecError: a field is missing, of another kind, or unknown.
    """
    place = f"{FILE}: {where}"
    fields = kind.__dataclass_fields__  # type: ignore[attr-defined]  # a dataclass
    known_keys(data, tuple(fields), place)
    values: dict[str, Any] = {}
    for name, field in fields.items():
        is_optional = field.default is not MISSING
        if name not in data and is_optional:
            continue
        if field.type == "tuple[str, ...]":
            values[name] = texts(data, name, place)
        else:
            values[name] = need(data, name, _KINDS.get(field.type, list), place)
    return values


_KINDS = {"str": str, "int": int}
