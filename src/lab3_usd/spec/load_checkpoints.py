"""Checkpoints, policy and TF frames out of `checkpoints.yaml`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.errors import SpecError
from lab3_usd.spec.records import record
from lab3_usd.spec.spec import Checkpoint, FrameSpec, GraphSpec, Policy

FILE = "checkpoints.yaml"
SENSORS = ("lidar", "camera")
COUNT = 9


class _StampEntry(Struct, forbid_unknown_fields=True, rename={"agree": "with"}):
    ports: tuple[str, ...]
    agree: str


class _PolicyEntry(Struct, forbid_unknown_fields=True):
    handout: str
    keep_default: tuple[str, ...]
    namespace: str
    namespace_attribute: str
    stamp_reset: _StampEntry
    tree_topics: tuple[str, ...]
    tick: str


class _ForbiddenEntry(Struct, forbid_unknown_fields=True):
    parent: str
    child: str
    nodes: tuple[str, ...]
    handout: str


class _LocalizationEntry(Struct, forbid_unknown_fields=True, rename={"since": "from"}):
    edge: str
    by: str
    since: str
    chain: tuple[str, ...]
    handout: str


class _FramesEntry(Struct, forbid_unknown_fields=True):
    handout: str
    edges: tuple[str, ...]
    deeper_under: str
    forbidden: _ForbiddenEntry
    localization: _LocalizationEntry


class _Additions(Struct, forbid_unknown_fields=True):
    """What a checkpoint adds to the one before."""

    graphs: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    frames: bool = False
    topics: bool = False
    localization: bool = False


class _CheckpointEntry(Struct, forbid_unknown_fields=True):
    file: str
    title: str
    part: str
    adds: _Additions


class _CheckpointFile(Struct, forbid_unknown_fields=True):
    policy: _PolicyEntry
    frames: _FramesEntry
    checkpoints: dict[str, Any]  # one by one, so that a missing one is said first


def graph_names(data: Mapping[str, Any]) -> list[str]:
    """Name the graphs in the order in which the checkpoints add them.

    Raises:
        SpecError: a checkpoint is missing or wrong.
    """
    return [name for entry in _entries(data).values() for name in entry.adds.graphs]


def _entries(data: Mapping[str, Any]) -> dict[str, _CheckpointEntry]:
    specs = record(data, _CheckpointFile, FILE).checkpoints
    found = {}
    for number in range(max(COUNT, len(specs))):
        checkpoint_id = f"{number:02}"
        if checkpoint_id not in specs:
            message = f"{FILE}: checkpoint '{checkpoint_id}' is missing"
            raise SpecError(message)
        where = f"{FILE}: checkpoint '{checkpoint_id}'"
        found[checkpoint_id] = record(specs[checkpoint_id], _CheckpointEntry, where)
    return found


def parse_checkpoints(
    data: Mapping[str, Any], graphs: Mapping[str, GraphSpec]
) -> dict[str, Checkpoint]:
    """Return the nine checkpoints in order, each with all that the earlier ones added.

    Raises:
        SpecError: a checkpoint is missing, or names a graph or sensor that does not exist.
    """
    found: dict[str, Checkpoint] = {}
    previous = Checkpoint("", "", "", "", (), (), (), ())
    for checkpoint_id, entry in _entries(data).items():
        where = f"{FILE}: checkpoint '{checkpoint_id}'"
        _check_known(entry.adds.graphs, tuple(graphs), f"{where}: graphs")
        _check_known(entry.adds.sensors, SENSORS, f"{where}: sensors")
        previous = _checkpoint(checkpoint_id, entry, previous)
        _check_new(previous, found.values(), where)
        found[checkpoint_id] = previous
    return found


def _checkpoint(checkpoint_id: str, entry: _CheckpointEntry, previous: Checkpoint) -> Checkpoint:
    adds = entry.adds
    return Checkpoint(
        id=checkpoint_id,
        file=entry.file,
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
            message = f"{where}: there is no '{name}'; known are {', '.join(known)}"
            raise SpecError(message)


def _check_new(checkpoint: Checkpoint, earlier: Iterable[Checkpoint], where: str) -> None:
    """Refuse a file, graph or sensor that an earlier checkpoint has already."""
    for other in earlier:
        taken = {other.file, *other.new, *other.new_sensors}
        for name in (checkpoint.file, *checkpoint.new, *checkpoint.new_sensors):
            if name in taken:
                message = f"{where}: '{name}' is of checkpoint '{other.id}' already"
                raise SpecError(message)


def parse_policy(data: Mapping[str, Any]) -> Policy:
    """Return what holds for every graph.

    Raises:
        SpecError: something is missing or of another kind.
    """
    said = record(data, _CheckpointFile, FILE).policy
    return Policy(
        keep_default=said.keep_default,
        namespace=said.namespace,
        namespace_attribute=said.namespace_attribute,
        stamp_ports=said.stamp_reset.ports,
        stamp_with=said.stamp_reset.agree,
        tree_topics=said.tree_topics,
        tick=said.tick,
    )


def parse_frames(data: Mapping[str, Any]) -> FrameSpec:
    """Return the TF tree that the lab asks for.

    Raises:
        SpecError: something is missing or not written `parent -> child`.
    """
    said = record(data, _CheckpointFile, FILE).frames
    localization = said.localization
    return FrameSpec(
        handout=said.handout,
        edges=tuple(_edge(text) for text in said.edges),
        deeper_under=said.deeper_under,
        forbidden_edge=(said.forbidden.parent, said.forbidden.child),
        forbidden_nodes=said.forbidden.nodes,
        forbidden_handout=said.forbidden.handout,
        localization_edge=_edge(localization.edge),
        localization_by=localization.by,
        localization_from=localization.since,
        localization_handout=localization.handout,
        chain=localization.chain,
    )


def _edge(text: str) -> tuple[str, str]:
    parent, arrow, child = text.partition(" -> ")
    if not (parent and arrow and child):
        message = f"{FILE}: frames: {text!r} is not written 'parent -> child'"
        raise SpecError(message)
    return parent, child
