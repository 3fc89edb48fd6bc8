"""Loads `ros.yaml`, and the facts of the map out of `scene.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec import ros_spec as ros
from lab3_usd.spec.records import record, records
from lab3_usd.spec.scene_spec import SCENE_FILE
from lab3_usd.spec.yaml_file import read_yaml

FILE = "ros.yaml"
_ByName = dict[str, dict[str, Any]]


class _Lifecycle(Struct, forbid_unknown_fields=True):
    state: str
    nodes: dict[str, ros.Place]


class _ForbiddenNodes(Struct, forbid_unknown_fields=True):
    endings: tuple[str, ...]
    handout: str


class _FrameEntry(Struct, forbid_unknown_fields=True):
    node: str
    name: str
    frame: str


class _RosFile(Struct, forbid_unknown_fields=True):
    system: ros.SystemSpec
    topics: _ByName
    lifecycle: _Lifecycle
    nodes: dict[str, ros.Place]
    forbidden_nodes: _ForbiddenNodes
    goal: ros.GoalSpec
    evidence: _ByName
    commands: tuple[dict[str, Any], ...]
    navigation: dict[str, Any]


def load_ros(folder: Path | None = None) -> ros.RosSpec:
    """Load `ros.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    folder = folder if folder is not None else data_folder("graphs")
    said = record(read_yaml(folder / FILE), _RosFile, FILE)
    kinds = records(said.evidence, ros.EvidenceKind, f"{FILE}: evidence")
    return ros.RosSpec(
        system=said.system,
        topics=records(said.topics, ros.TopicSpec, f"{FILE}: topics"),
        lifecycle_state=said.lifecycle.state,
        lifecycle=said.lifecycle.nodes,
        nodes=said.nodes,
        forbidden_endings=said.forbidden_nodes.endings,
        forbidden_handout=said.forbidden_nodes.handout,
        goal=said.goal,
        kinds=kinds,
        commands=tuple(
            _command(command, kinds, f"{FILE}: command {number}")
            for number, command in enumerate(said.commands, start=1)
        ),
        navigation=_navigation(said.navigation),
    )


def map_facts(scene: Mapping[str, Any]) -> ros.MapFacts:
    """Return the facts of the map out of a scene file that has been read.

    Raises:
        SpecError: a fact is missing or of another kind.
    """
    return record(scene["map"], ros.MapFacts, f"{SCENE_FILE}: map")


def _command(
    entry: Mapping[str, Any], kinds: Mapping[str, ros.EvidenceKind], where: str
) -> ros.Command:
    name = entry.get("kind")
    if not isinstance(name, str) or name not in kinds:
        message = f"{where}: there is no kind {name!r}; known are {', '.join(kinds)}"
        raise SpecError(message)
    return record({**entry, "kind": kinds[name]}, ros.Command, f"{where} ({name})")


def _navigation(data: Mapping[str, Any]) -> ros.NavigationSpec:
    where = f"{FILE}: navigation"
    frames = record(data.get("frames"), tuple[_FrameEntry, ...], f"{where}: 'frames'")
    triples = [[each.node, each.name, each.frame] for each in frames]
    return record({**data, "frames": triples}, ros.NavigationSpec, where)
