"""What a submission must hold, and what of the starter must be found again, as data."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct


class FolderNames(Struct, frozen=True, forbid_unknown_fields=True):
    """The folders of a submission by what lies in them (4.3); `shown` holds saved output."""

    handout: str
    stages: str
    starter: str
    maps: str = ""
    shown: tuple[str, ...] = ()


class StageFiles(Struct, frozen=True, forbid_unknown_fields=True):
    """How stage files are named.

    `endings` are the handout's, the first preferred; `openable` ones USD opens as well; `slips`
    are no endings of USD. No two files of the checkpoints in `differ` may be the same.
    """

    handout: str
    endings: tuple[str, ...]
    openable: tuple[str, ...]
    slips: tuple[str, ...]
    starter: str
    differ: tuple[str, ...] = ()


class Deliverable(Struct, frozen=True, forbid_unknown_fields=True):
    """Something to hand in beside the stages.

    A file counts by its ending; where `names` and `links` are given, also by its name when it
    holds one of the links, and never by the names `never`. `folder` limits the search to the
    folders of saved output.
    """

    name: str
    title: str
    handout: str
    hint: str
    endings: tuple[str, ...]
    names: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    at_least: int = 1
    folder: str = ""


class StarterRules(Struct, frozen=True, forbid_unknown_fields=True):
    """Which properties of the starter are compared, and what a change of them is.

    Patterns have `*`. `never` ones are not compared, `physics` and `shapes` of collisions are
    errors, `looks` count on lights and cameras only. Prims of the types `anywhere` are recognised
    by their type, those named in `library` through the links that refer to them. Schemas that
    begin as one of `acting` change how a prim moves as soon as they are added; a property added
    with its value of `neutral` changes nothing.
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
    acting: tuple[str, ...] = ()
    neutral: tuple[tuple[str, bool | float], ...] = ()


class ChecklistSpec(Struct, frozen=True, forbid_unknown_fields=True):
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


class SubmissionSpec(Struct, frozen=True):
    """Everything that `submission.yaml` says."""

    folders: FolderNames
    stages: StageFiles
    deliverables: Mapping[str, Deliverable]
    starter: StarterRules
    checklist: tuple[ChecklistSpec, ...]
