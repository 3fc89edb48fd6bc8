"""What a submission must hold and keep of the starter, and the names of stage files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any, ClassVar

from msgspec import Struct


class FolderNames(Struct, frozen=True, forbid_unknown_fields=True):
    """The folders of a submission; `shown` contain saved output."""

    handout: str
    stages: str
    starter: str
    maps: str = ""
    shown: tuple[str, ...] = ()


class StageFiles(Struct, frozen=True, forbid_unknown_fields=True):
    """Names of stage files.

    `endings` are the handout's, the preferred one first; USD also opens `openable` ones, and
    `slips` are mistakes. The files of the checkpoints in `differ` must differ. `starter` is the
    name of the supplied scene, else that of the first stage.
    """

    handout: str
    endings: tuple[str, ...]
    openable: tuple[str, ...]
    slips: tuple[str, ...]
    starter: str = ""
    differ: tuple[str, ...] = ()


class Deliverable(Struct, frozen=True, forbid_unknown_fields=True):
    """A file to hand in beside the stages.

    It counts by its ending, or by a name of `names` if it contains one of `links`; never by a name
    of `never`. `folder` limits the search. One that `concludes` is made last.
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
    concludes: bool = False


class StarterRules(Struct, frozen=True, forbid_unknown_fields=True):
    """The properties of the starter that are compared, as patterns with `*`.

    `never` are not compared; changes of `physics`, and of `shapes` of collisions, are errors;
    `appearance` counts on lights and cameras only. Prims of a type of `anywhere` are recognised by
    type, those in `library` by the references to them. An added schema that begins with an entry of
    `acting` changes how a prim moves; an added property with its value in `neutral` changes
    nothing.
    """

    FORMER: ClassVar[Mapping[str, str]] = {"looks": "appearance"}

    handout: str
    never: tuple[str, ...]
    physics: tuple[str, ...]
    masses: tuple[str, ...]
    shapes: tuple[str, ...]
    appearance: tuple[str, ...]
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
    """A line of a checklist; it is met when all of its parts are.

    `requirements` are patterns of ids and `rules` rule ids, in the last stage; `shown` is saved
    output as `kind target`; the stages in `stages` (a checkpoint, `last`, `all`) can be opened; a
    `person` must look at the rest.
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


_WORD = r"\{\w+\}|[A-Za-z]+|\d+"
_GAP = r"[\s_-]*"
TEAM = "{team}"  # stands for letters and digits of a student's own, in names of files
_OWN = "[A-Za-z0-9]+"


@lru_cache(maxsize=256)
def _shape(name: str) -> re.Pattern[str]:
    """Return the pattern of a name of the lab, in which students write what is their own."""
    return re.compile(_OWN.join(map(re.escape, name.split(TEAM))))


def is_called(stem: str, name: str) -> bool:
    """Whether a file, without ending, has a name of the lab."""
    return _shape(name).fullmatch(stem) is not None


def has_teams(files: Mapping[str, str]) -> bool:
    """Whether the names of a lab's files have a place for the team."""
    return any(TEAM in name for name in files.values())


def team_of(stem: str, name: str) -> str:
    """Return what a file, without ending, has at the place of the team, '' for nothing."""
    if TEAM not in name:
        return ""
    parts = [re.escape(part) for part in name.split(TEAM)]
    match = re.fullmatch(f"({_OWN})".join(parts), stem) or re.match(f"{parts[0]}({_OWN})", stem)
    return "" if match is None else match[1]


_TEAM_FOLDER = re.compile(r"(?i)(?<![a-z])(?:team|group)[\s_-]*(\d+)")


def team_in(folder: str) -> str:
    """Return the team that a submission is called after, as in `team_7`, '' for none."""
    match = _TEAM_FOLDER.search(folder)
    return "" if match is None else match[1]


FIRST_TEAM = "01"


def example_of(name: str, team: str = "") -> str:
    """Return a name of the lab as a team would write it, the first one where none is named."""
    return name.replace(TEAM, team or FIRST_TEAM)


def of_team(data: Any, team: str) -> Any:
    """Return what a file of the lab says for a team: a value that is `{team}` alone is a number."""
    if isinstance(data, dict):
        return {of_team(key, team): of_team(value, team) for key, value in data.items()}
    if isinstance(data, list):
        return [of_team(entry, team) for entry in data]
    if data == TEAM and team.isdecimal():
        return int(team)
    return data.replace(TEAM, team) if isinstance(data, str) else data


def _leads(files: Mapping[str, str]) -> dict[str, str]:
    """Map each checkpoint to what its file has before the id.

    The id may stand in what all names begin with as well: `Week5_5_imu`. A file that does not hold
    the id of its checkpoint has no such part.
    """
    names = list(files.items())
    first = names[0][1] if names else ""
    for end in range(len(first)):
        if all(file[:end] == first[:end] and file[end:].startswith(id_) for id_, file in names):
            return dict.fromkeys(files, first[:end])
    return {id_: file.partition(id_)[0] if id_ in file else "" for id_, file in names}


def _prefixes(files: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield each checkpoint and what names of its files begin with: `Lab3_03` of `Lab3_03_lidar`.

    A name that does not hold the id of its checkpoint is a prefix as a whole.
    """
    leads = _leads(files)
    for checkpoint, file in files.items():
        prefix = f"{leads[checkpoint]}{checkpoint}"
        yield checkpoint, prefix if file.startswith(prefix) else file


def named_checkpoint(name: str, files: Mapping[str, str]) -> str | None:
    """Return the checkpoint that a file name begins with, None for none.

    `files` holds the names of the lab, without ending, by checkpoint. `Lab3_031` is not of 03, and
    `jet_a` of a checkpoint `jet_a` rather than of `jet`.
    """
    longest, nearest = "", None
    for checkpoint, prefix in _prefixes(files):
        match = _shape(prefix).match(name)
        if match is None:
            continue
        start, rest = match[0], name[match.end() :]
        goes_on = rest[:1].isdigit() if start[-1:].isdigit() else rest[:1].isalnum()
        if not goes_on and len(start) > len(longest):
            longest, nearest = start, checkpoint
    return nearest


def nearly_named(stem: str, files: Mapping[str, str]) -> str | None:
    """Return the checkpoint whose prefix a name has except for case, gaps and leading zeros."""
    matches = ((_loose(prefix).match(stem), checkpoint) for checkpoint, prefix in _prefixes(files))
    ends = [(match.end(), checkpoint) for match, checkpoint in matches if match is not None]
    return max(ends, key=lambda end: end[0])[1] if ends else None


@lru_cache(maxsize=64)
def _loose(prefix: str) -> re.Pattern[str]:
    words = [_loose_word(word) for word in re.findall(_WORD, prefix)]
    return re.compile(rf"{_GAP.join(words)}(?![0-9])" if words else r"(?!)", re.IGNORECASE)


def _loose_word(word: str) -> str:
    if word == TEAM:
        return _OWN
    return rf"0*{int(word)}" if word.isdigit() else word


def after_a_student(files: Mapping[str, str]) -> re.Pattern[str]:
    """Return the pattern of stage files with a student's name before them.

    `jane_Lab3_05_odometry_tf.usda`: the group `name` is the student's, `file` the stage's. `files`
    holds the names of the lab, without ending, by checkpoint.
    """
    leads = {lead or files[checkpoint] for checkpoint, lead in _leads(files).items()}
    loose = (_GAP.join(map(_loose_word, re.findall(_WORD, lead))) for lead in sorted(leads))
    starts = "|".join(start for start in loose if start)
    return re.compile(rf"^(?P<name>.+?)[ _-]+(?P<file>(?:{starts})[ _-].*)$", re.IGNORECASE)
