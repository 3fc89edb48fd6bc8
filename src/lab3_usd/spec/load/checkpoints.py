"""Loads checkpoints, policy and TF frames from `checkpoints.yaml`."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any, ClassVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import (
    CHECKPOINTS,
    Checkpoint,
    FrameSpec,
    Handout,
    Policy,
    Removal,
)
from lab3_usd.spec.scene import SensorSpec
from lab3_usd.spec.submission import TEAM
from lab3_usd.yaml_file import as_record

FORMAT = 1  # of the files of a lab; what is older than that has no number
_PLACEHOLDERS = ("{id}", "{name}", TEAM)
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_REFERENCES = frozenset({"from", "pose_is_error_until"})  # keys whose values name a checkpoint
_UNTIL = "until"  # the key whose own keys do


def is_checkpoint_id(text: str) -> bool:
    """Whether a checkpoint may be called so."""
    return _ID.fullmatch(text) is not None


class _Additions(Struct, forbid_unknown_fields=True):
    """The difference from the previous checkpoint.

    From `frames: true` on, the TF tree is asked for, as far as the graphs that are there send it.
    """

    graphs: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    frames: bool = False
    topics: bool = False
    localization: bool = False


class CheckpointEntry(Struct, forbid_unknown_fields=True):
    """A checkpoint; the other files refer to its key.

    `files` inserts `id` and `name` for {id} and {name}; {team} is what each team writes there.
    `id` is the key unless given. The stage of an `optional` one need not be handed in, and later
    ones ask for nothing that it adds, nor for its frames. What it `removes` is no longer there:
    graphs and sensors of earlier ones by name, supplied prims by path (`removes: [Scan,
    /World/Room/Crate]`), all in a section of the handout (`removes: {B4: [...]}`).
    """

    GONE: ClassVar[Mapping[str, str]] = {
        "file": "write its part of the name as `name`, and the pattern of all as `files` above"
    }

    name: str
    title: str
    part: str
    adds: _Additions
    id: str = ""
    optional: bool = False
    removes: dict[str, tuple[str, ...]] | tuple[str, ...] = ()

    @property
    def removals(self) -> tuple[Removal, ...]:
        """What is to be gone, by name or path."""
        listed = self.removes if isinstance(self.removes, dict) else {"": self.removes}
        return tuple(Removal(name, section) for section, names in listed.items() for name in names)


class CheckpointsFile(Struct, forbid_unknown_fields=True):
    """The checkpoints in order, and the rules for all of them.

    `isaac` is the release of Isaac Sim that the course uses. `format` is the version of the form
    in which the files of the lab are written; it grows when a key gets another name or is gone.

    `{team}`, in quotation marks, is also a value by team in graphs, scene, `ros.yaml` and frames:
    `topicName: "/t{team}/scan"`, or alone a number, `domain_id: "{team}"`. The name of a stage says
    the team, without a place for it the folder of a submission to `grade` (`team_7`), or `--team 7`
    before the command; `build` without it takes 01.
    """

    title: str
    files: str
    policy: Policy
    checkpoints: dict[str, Any]  # one by one, so that a missing one is reported first
    frames: FrameSpec = FrameSpec("")
    handout: Handout = Handout()
    isaac: str = "6.0"
    format: int = FORMAT


class CheckpointFile(Struct, frozen=True):
    """What `checkpoints.yaml` says: each checkpoint and its id by its key, policy and TF frames.

    `files` is the pattern of the stages' names: `Lab3_{id}_{name}`.
    """

    title: str
    files: str
    entries: Mapping[str, CheckpointEntry]
    ids: Mapping[str, str]
    policy: Policy
    frames: FrameSpec
    handout: Handout

    def graph_names(self) -> list[str]:
        """Name the graphs in the order in which the checkpoints add them."""
        return [name for entry in self.entries.values() for name in entry.adds.graphs]


def read_checkpoint_file(data: Mapping[str, Any]) -> CheckpointFile:
    """Read the data of the file.

    Raises:
        SpecError: something is missing or wrong; the line names the key.
    """
    written = data.get("format", 0)
    if isinstance(written, int) and written > FORMAT:
        raise SpecError(
            f"{CHECKPOINTS}: format is {written}, and this release reads up to {FORMAT}; install a "
            "newer one"
        )
    content = as_record(data, CheckpointsFile, CHECKPOINTS)
    if content.frames.trees and content.frames.edges:
        raise SpecError(f"{CHECKPOINTS}: frames: trees or edges: both are given, expected one")
    if "{id}" not in content.files:
        wrong = f"'{content.files}' does not contain {{id}}, which distinguishes stages"
        raise SpecError(f"{CHECKPOINTS}: files: {wrong}")
    for written in re.findall(r"\{[^}]*\}?", content.files):  # which is filled in as it stands
        if written not in _PLACEHOLDERS:
            known = f"no file can match; known are {', '.join(_PLACEHOLDERS)}"
            raise SpecError(f"{CHECKPOINTS}: files: '{written}' is not a placeholder: {known}")
    frames = content.frames.joined if content.frames.trees else content.frames
    entries = _entries(content.checkpoints)
    ids = {key: entry.id or key for key, entry in entries.items()}
    localization = frames.localization
    if localization is not None:
        since = ids.get(localization.since, localization.since)
        frames = replace(frames, localization=replace(localization, since=since))
    return CheckpointFile(
        content.title, content.files, entries, ids, content.policy, frames, content.handout
    )


def _entries(specs: Mapping[str, Any]) -> dict[str, CheckpointEntry]:
    if not specs:
        raise SpecError(f"{CHECKPOINTS}: checkpoints: there is none")
    entries = {}
    for key, spec in specs.items():
        where = f"{CHECKPOINTS}: checkpoint '{key}'"
        entry = as_record(spec, CheckpointEntry, where)
        for name in (key, entry.id or key):
            if not is_checkpoint_id(name):
                wrong = f"'{name}' is not an id: letters, digits, _ and -, in quotation marks"
                raise SpecError(f"{where}: {wrong}")
        entries[key] = entry
    return entries


def accumulate(
    content: CheckpointFile, graphs: Mapping[str, GraphSpec], sensors: Mapping[str, SensorSpec]
) -> dict[str, Checkpoint]:
    """Return the checkpoints in order, each with all that the earlier ones added.

    Raises:
        SpecError: one names a graph or sensor that does not exist, or that is there already.
    """
    paths = {name: graph.path for name, graph in graphs.items()}
    paths |= {name: sensor.path for name, sensor in sensors.items()}
    checkpoints: dict[str, Checkpoint] = {}
    previous = Checkpoint("", "", "", "", (), (), (), ())
    for key, entry in content.entries.items():
        where = f"{CHECKPOINTS}: checkpoint '{key}'"
        adds, checkpoint_id, removed = entry.adds, content.ids[key], entry.removals
        _check_known(adds.graphs, graphs, f"{where}: graphs")
        _check_known(adds.sensors, sensors, f"{where}: sensors")
        _check_removable((gone.path for gone in removed), previous, f"{where}: removes")
        named = {gone.path for gone in removed}
        checkpoint = Checkpoint(
            id=checkpoint_id,
            key=key,
            file=content.files.replace("{id}", checkpoint_id).replace("{name}", entry.name),
            title=entry.title,
            part=entry.part,
            graphs=(*(name for name in previous.graphs if name not in named), *adds.graphs),
            new=adds.graphs,
            sensors=(*(name for name in previous.sensors if name not in named), *adds.sensors),
            new_sensors=adds.sensors,
            frames=previous.frames or adds.frames,
            topics=previous.topics or adds.topics,
            localization=previous.localization or adds.localization,
            optional=entry.optional,
            removals=(
                *previous.removals,
                *(replace(gone, path=paths.get(gone.path, gone.path)) for gone in removed),
            ),
        )
        _check_new(checkpoint, checkpoints.values(), where)
        checkpoints[checkpoint.id] = checkpoint
        previous = previous if entry.optional else checkpoint
    return checkpoints


def with_ids(data: Any, ids: Mapping[str, str]) -> Any:
    """Return what a file of the lab says with ids of checkpoints, as reports have them, for keys.

    `ids` are those by the keys that files refer to. What is no key stays as it is: an id, or a
    mistake.
    """
    if isinstance(data, list):
        return [with_ids(entry, ids) for entry in data]
    if not isinstance(data, dict):
        return data
    said = {key: with_ids(value, ids) for key, value in data.items()}
    for key in _REFERENCES & said.keys():
        if isinstance(said[key], str):
            said[key] = ids.get(said[key], said[key])
    if isinstance(said.get(_UNTIL), dict):
        said[_UNTIL] = {ids.get(key, key): value for key, value in said[_UNTIL].items()}
    return said


def _check_known(names: Iterable[str], available: Collection[str], where: str) -> None:
    for name in names:
        if name not in available:
            raise SpecError(f"{where}: there is no '{name}'; known are {', '.join(available)}")


def _check_removable(names: Iterable[str], previous: Checkpoint, where: str) -> None:
    """Refuse to take away what no earlier checkpoint has, and no starter can have."""
    removable = (*previous.graphs, *previous.sensors)
    for name in names:
        if name not in removable and not name.startswith("/"):
            listed = ", ".join(removable) or "none"
            wrong = (
                f"'{name}' is not a path, and no graph or sensor that is there; those are {listed}"
            )
            raise SpecError(f"{where}: {wrong}")


def _check_new(checkpoint: Checkpoint, earlier: Iterable[Checkpoint], where: str) -> None:
    """Refuse an id, file, graph or sensor that an earlier checkpoint has already."""
    for other in earlier:
        taken = {other.id, other.file, *other.new, *other.new_sensors}
        own = (checkpoint.id, checkpoint.file, *checkpoint.new, *checkpoint.new_sensors)
        for name in own:
            if name in taken:
                raise SpecError(f"{where}: '{name}' is of checkpoint '{other.key}' already")
