"""Checkpoints, policy and TF frames out of `checkpoints.yaml`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lab3_usd.errors import SpecError
from lab3_usd.spec.spec import Checkpoint, FrameSpec, GraphSpec, Policy
from lab3_usd.spec.yaml_file import expect, known_keys, need, texts

FILE = "checkpoints.yaml"
SENSORS = ("lidar", "camera")
_ADDS = ("graphs", "sensors", "frames", "topics", "localization")
COUNT = 9


def parse_checkpoints(
    data: Mapping[str, Any], graphs: Mapping[str, GraphSpec]
) -> dict[str, Checkpoint]:
    """Return the nine checkpoints in order, each with all that the earlier ones added.

    Raises:
        SpecError: a checkpoint is missing, or names a graph or sensor that does not exist.
    """
    specs = need(data, "checkpoints", dict, FILE)
    found: dict[str, Checkpoint] = {}
    previous: Checkpoint | None = None
    for number in range(max(COUNT, len(specs))):
        checkpoint_id = f"{number:02}"
        if checkpoint_id not in specs:
            message = f"{FILE}: checkpoint '{checkpoint_id}' is missing"
            raise SpecError(message)
        previous = _checkpoint(checkpoint_id, specs[checkpoint_id], previous, graphs)
        _check_new(previous, found.values())
        found[checkpoint_id] = previous
    return found


def _check_new(checkpoint: Checkpoint, earlier: Iterable[Checkpoint]) -> None:
    """Refuse a file, graph or sensor that an earlier checkpoint has already."""
    where = f"{FILE}: checkpoint '{checkpoint.id}'"
    for other in earlier:
        taken = {other.file, *other.new, *other.new_sensors}
        for name in (checkpoint.file, *checkpoint.new, *checkpoint.new_sensors):
            if name in taken:
                message = f"{where}: '{name}' is of checkpoint '{other.id}' already"
                raise SpecError(message)


def _checkpoint(
    checkpoint_id: str,
    spec: Mapping[str, Any],
    previous: Checkpoint | None,
    graphs: Mapping[str, GraphSpec],
) -> Checkpoint:
    where = f"{FILE}: checkpoint '{checkpoint_id}'"
    known_keys(expect(spec, dict, where), ("file", "title", "part", "adds"), where)
    adds = need(spec, "adds", dict, where)
    known_keys(adds, _ADDS, f"{where}: adds")
    new = _named(adds, "graphs", tuple(graphs), where)
    new_sensors = _named(adds, "sensors", SENSORS, where)
    return Checkpoint(
        id=checkpoint_id,
        file=need(spec, "file", str, where),
        title=need(spec, "title", str, where),
        part=need(spec, "part", str, where),
        graphs=(*(previous.graphs if previous else ()), *new),
        new=new,
        sensors=(*(previous.sensors if previous else ()), *new_sensors),
        new_sensors=new_sensors,
        frames=_from_here(adds, "frames", previous is not None and previous.frames),
        topics=_from_here(adds, "topics", previous is not None and previous.topics),
        localization=_from_here(
            adds, "localization", previous is not None and previous.localization
        ),
    )


def _from_here(adds: Mapping[str, Any], key: str, before: bool) -> bool:  # noqa: FBT001 - a value
    return before or bool(adds.get(key))


def _named(
    adds: Mapping[str, Any], key: str, known: tuple[str, ...], where: str
) -> tuple[str, ...]:
    names = texts(adds, key, where, optional=True)
    for name in names:
        if name not in known:
            message = f"{where}: {key}: there is no '{name}'; known are {', '.join(known)}"
            raise SpecError(message)
    return names


def parse_policy(data: Mapping[str, Any]) -> Policy:
    """Return what holds for every graph.

    Raises:
        SpecError: something is missing or of another kind.
    """
    where = f"{FILE}: policy"
    spec = need(data, "policy", dict, FILE)
    stamp = need(spec, "stamp_reset", dict, where)
    return Policy(
        keep_default=texts(spec, "keep_default", where),
        namespace=need(spec, "namespace", str, where),
        namespace_attribute=need(spec, "namespace_attribute", str, where),
        stamp_ports=texts(stamp, "ports", where),
        stamp_with=need(stamp, "with", str, where),
        tree_topics=texts(spec, "tree_topics", where),
        tick=need(spec, "tick", str, where),
    )


def _edge(text: str, where: str) -> tuple[str, str]:
    parent, arrow, child = str(text).partition(" -> ")
    if not (parent and arrow and child):
        message = f"{where}: {text!r} is not written 'parent -> child'"
        raise SpecError(message)
    return parent, child


def parse_frames(data: Mapping[str, Any]) -> FrameSpec:
    """Return the TF tree that the lab asks for.

    Raises:
        SpecError: something is missing or not written `parent -> child`.
    """
    where = f"{FILE}: frames"
    spec = need(data, "frames", dict, FILE)
    forbidden = need(spec, "forbidden", dict, where)
    localization = need(spec, "localization", dict, where)
    return FrameSpec(
        handout=need(spec, "handout", str, where),
        edges=tuple(_edge(text, where) for text in need(spec, "edges", list, where)),
        deeper_under=need(spec, "deeper_under", str, where),
        forbidden_edge=(
            need(forbidden, "parent", str, where),
            need(forbidden, "child", str, where),
        ),
        forbidden_nodes=texts(forbidden, "nodes", where),
        forbidden_handout=need(forbidden, "handout", str, where),
        localization_edge=_edge(need(localization, "edge", str, where), where),
        localization_by=need(localization, "by", str, where),
        localization_from=need(localization, "from", str, where),
        localization_handout=need(localization, "handout", str, where),
        chain=texts(localization, "chain", where),
    )
