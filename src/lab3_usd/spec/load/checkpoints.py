"""Loads checkpoints, policy and TF frames from `checkpoints.yaml`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.errors import SpecError
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CHECKPOINTS, Checkpoint, FrameSpec, Handout, Policy
from lab3_usd.spec.yaml_file import record

_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


def is_checkpoint_id(text: str) -> bool:
    """Whether a checkpoint may be called so."""
    return _ID.fullmatch(text) is not None


class _Additions(Struct, forbid_unknown_fields=True):
    """What a checkpoint adds to the one before."""

    graphs: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    frames: bool = False
    topics: bool = False
    localization: bool = False


class CheckpointEntry(Struct, forbid_unknown_fields=True):
    """A checkpoint as the file describes it; `name` is what stands for {name} in `files`."""

    name: str
    title: str
    part: str
    adds: _Additions


class CheckpointsFile(Struct, forbid_unknown_fields=True):
    """What `checkpoints.yaml` holds: the checkpoints in order, and what holds for all of them."""

    title: str
    files: str
    policy: Policy
    frames: FrameSpec
    checkpoints: dict[str, Any]  # one by one, so that a missing one is said first
    handout: Handout = Handout()


class CheckpointFile(Struct, frozen=True):
    """What `checkpoints.yaml` says: each checkpoint by its id, policy and TF frames.

    `files` is the pattern of the stages' names: `Lab3_{id}_{name}`.
    """

    title: str
    files: str
    entries: Mapping[str, CheckpointEntry]
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
    content = record(data, CheckpointsFile, CHECKPOINTS)
    if "{id}" not in content.files:
        wrong = f"'{content.files}' does not hold {{id}}, which tells stages apart"
        raise SpecError(f"{CHECKPOINTS}: files: {wrong}")
    return CheckpointFile(
        content.title,
        content.files,
        _entries(content.checkpoints),
        content.policy,
        content.frames,
        content.handout,
    )


def _entries(specs: Mapping[str, Any]) -> dict[str, CheckpointEntry]:
    if not specs:
        raise SpecError(f"{CHECKPOINTS}: checkpoints: there is none")
    found = {}
    for checkpoint_id, spec in specs.items():
        where = f"{CHECKPOINTS}: checkpoint '{checkpoint_id}'"
        if not is_checkpoint_id(str(checkpoint_id)):
            raise SpecError(f"{where}: an id is letters, digits, _ and -, in quotation marks")
        found[checkpoint_id] = record(spec, CheckpointEntry, where)
    return found


def _file_of(content: CheckpointFile, checkpoint_id: str, entry: CheckpointEntry) -> str:
    """Return the name of a checkpoint's stage, without ending."""
    return content.files.replace("{id}", checkpoint_id).replace("{name}", entry.name)


def accumulate(
    content: CheckpointFile, graphs: Mapping[str, GraphSpec], sensors: tuple[str, ...]
) -> dict[str, Checkpoint]:
    """Return the checkpoints in order, each with all that the earlier ones added.

    Raises:
        SpecError: one names a graph or sensor that does not exist, or that is there already.
    """
    found: dict[str, Checkpoint] = {}
    previous = Checkpoint("", "", "", "", (), (), (), ())
    for checkpoint_id, entry in content.entries.items():
        where = f"{CHECKPOINTS}: checkpoint '{checkpoint_id}'"
        _check_known(entry.adds.graphs, tuple(graphs), f"{where}: graphs")
        _check_known(entry.adds.sensors, sensors, f"{where}: sensors")
        previous = _checkpoint(
            checkpoint_id, _file_of(content, checkpoint_id, entry), entry, previous
        )
        _check_new(previous, found.values(), where)
        found[checkpoint_id] = previous
    return found


def _checkpoint(
    checkpoint_id: str, file: str, entry: CheckpointEntry, previous: Checkpoint
) -> Checkpoint:
    adds = entry.adds
    return Checkpoint(
        id=checkpoint_id,
        file=file,
        title=entry.title,
        part=entry.part,
        graphs=(*previous.graphs, *adds.graphs),
        new=adds.graphs,
        sensors=(*previous.sensors, *adds.sensors),
        new_sensors=adds.sensors,
        frames=previous.frames or adds.frames,
        topics=previous.topics or adds.topics,
        localization=previous.localization or adds.localization,
    )


def _check_known(names: Iterable[str], known: tuple[str, ...], where: str) -> None:
    for name in names:
        if name not in known:
            raise SpecError(f"{where}: there is no '{name}'; known are {', '.join(known)}")


def _check_new(checkpoint: Checkpoint, earlier: Iterable[Checkpoint], where: str) -> None:
    """Refuse a file, graph or sensor that an earlier checkpoint has already."""
    for other in earlier:
        taken = {other.file, *other.new, *other.new_sensors}
        for name in (checkpoint.file, *checkpoint.new, *checkpoint.new_sensors):
            if name in taken:
                raise SpecError(f"{where}: '{name}' is of checkpoint '{other.id}' already")
