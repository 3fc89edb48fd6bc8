"""Loads `ros.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.data import data_folder, lab_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec import ros
from lab3_usd.spec.files import ROS
from lab3_usd.spec.load.records import record, records
from lab3_usd.spec.yaml_file import read_yaml

_ByName = dict[str, dict[str, Any]]


class _RosFile(Struct, forbid_unknown_fields=True):
    system: ros.SystemSpec
    topics: _ByName = {}
    lifecycle: ros.LifecycleSpec = ros.LifecycleSpec("", {})
    nodes: dict[str, ros.HandoutReference] = {}
    forbidden_nodes: ros.ForbiddenNodes = ros.ForbiddenNodes((), "")
    goal: ros.GoalSpec | None = None
    evidence: _ByName | None = None  # as in the bundled lab
    commands: tuple[dict[str, Any], ...] = ()
    navigation: ros.NavigationSpec | None = None


def load_ros(folder: Path | None = None) -> ros.RosSpec:
    """Load `ros.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    folder = folder if folder is not None else lab_folder()
    said = record(read_yaml(folder / ROS), _RosFile, ROS)
    kinds = records(_evidence(said), ros.EvidenceKind, f"{ROS}: evidence")
    return ros.RosSpec(
        system=said.system,
        topics=records(said.topics, ros.TopicSpec, f"{ROS}: topics"),
        lifecycle=said.lifecycle,
        nodes=said.nodes,
        forbidden_nodes=said.forbidden_nodes,
        goal=said.goal,
        kinds=kinds,
        commands=tuple(
            _command(command, kinds, f"{ROS}: command {number}")
            for number, command in enumerate(said.commands, start=1)
        ),
        navigation=said.navigation,
    )


def _evidence(said: _RosFile) -> _ByName:
    """Return how diagnostic commands are written: as in the bundled lab where nothing is said."""
    if said.evidence is not None:
        return said.evidence
    evidence: _ByName = read_yaml(data_folder("graphs") / ROS)["evidence"]
    return evidence


def _command(
    entry: Mapping[str, Any], kinds: Mapping[str, ros.EvidenceKind], where: str
) -> ros.Command:
    name = entry.get("kind")
    if not isinstance(name, str) or name not in kinds:
        message = f"{where}: there is no kind {name!r}; known are {', '.join(kinds)}"
        raise SpecError(message)
    return record({**entry, "kind": kinds[name]}, ros.Command, f"{where} ({name})")
