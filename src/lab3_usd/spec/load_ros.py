"""Loads `ros.yaml`, and the facts of the map out of `scene.yaml`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec import ros_spec as ros
from lab3_usd.spec.scene_spec import SCENE_FILE
from lab3_usd.spec.yaml_file import expect, known_keys, need, read_yaml

FILE = "ros.yaml"
_FIRST = "00"  # what names no checkpoint holds from the first on
_Plain = TypeVar("_Plain")


def load_ros(folder: Path | None = None) -> ros.RosSpec:
    """Load `ros.yaml` of `folder`, by default the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the part and the key.
    """
    return _load(folder if folder is not None else data_folder("graphs"))


def map_facts(scene: Mapping[str, Any]) -> ros.MapFacts:
    """Return the facts of the map out of a scene file that has been read.

    Raises:
        SpecError: a fact is missing or of another kind.
    """
    where = f"{SCENE_FILE}: map"
    spec = need(scene, "map", dict, SCENE_FILE)
    origin = need(spec, "origin", list, where)
    if len(origin) != 3:  # noqa: PLR2004 - x, y and yaw
        message = f"{where}: 'origin' is {origin!r}, expected x, y and yaw"
        raise SpecError(message)
    numbers = tuple(float(expect(n, (int, float), f"{where}: 'origin'")) for n in origin)
    return _plain(ros.MapFacts, {**spec, "origin": numbers}, where)


@lru_cache(maxsize=4)
def _load(folder: Path) -> ros.RosSpec:
    data = read_yaml(folder / FILE)
    lifecycle = need(data, "lifecycle", dict, FILE)
    forbidden = need(data, "forbidden_nodes", dict, FILE)
    kinds = {
        name: _plain(
            ros.EvidenceKind,
            {"narrowed_by": [], **kind, "name": name},
            f"{FILE}: evidence: {name}",
        )
        for name, kind in _mappings(data, "evidence")
    }
    return ros.RosSpec(
        system=_plain(ros.SystemSpec, need(data, "system", dict, FILE), f"{FILE}: system"),
        topics={name: _topic(name, spec) for name, spec in _mappings(data, "topics")},
        lifecycle_state=need(lifecycle, "state", str, f"{FILE}: lifecycle"),
        lifecycle=_places(need(lifecycle, "nodes", dict, f"{FILE}: lifecycle"), "lifecycle"),
        nodes=_places(need(data, "nodes", dict, FILE), "nodes"),
        forbidden_endings=tuple(need(forbidden, "endings", list, f"{FILE}: forbidden_nodes")),
        forbidden_handout=need(forbidden, "handout", str, f"{FILE}: forbidden_nodes"),
        goal=_goal(need(data, "goal", dict, FILE)),
        kinds=kinds,
        commands=tuple(_command(spec, kinds) for spec in need(data, "commands", list, FILE)),
        navigation=_navigation(need(data, "navigation", dict, FILE)),
    )


def _mappings(data: Mapping[str, Any], key: str) -> list[tuple[str, dict[str, Any]]]:
    section = need(data, key, dict, FILE)
    return [(name, expect(spec, dict, f"{FILE}: {key}: {name}")) for name, spec in section.items()]


_KINDS: dict[str, type | tuple[type, ...]] = {
    "str": str,
    "int": int,
    "float": (int, float),
    "bool": bool,
    "tuple": (list, tuple),
    "Mapping": dict,
}


def _plain(kind: type[_Plain], data: Mapping[str, Any], where: str) -> _Plain:
    """Make a record of `data`: lists become tuples, plain fields are checked by their type."""
    expected = {name: str(annotation) for name, annotation in kind.__annotations__.items()}
    known_keys(data, tuple(expected), where)
    values: dict[str, Any] = {}
    for name, annotation in expected.items():
        if name not in data and "None" in annotation:
            continue
        wanted = _KINDS.get(re.split(r"\W", annotation)[0], object)
        value = need(data, name, wanted, where)
        values[name] = tuple(value) if isinstance(value, list) else value
    return kind(**values)


def _since(spec: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Rename `from`, which Python keeps for itself."""
    rest = {key: value for key, value in spec.items() if key != "from"}
    return {**rest, "since": expect(spec.get("from", _FIRST), str, f"{where}: 'from'")}


def _topic(name: str, spec: Mapping[str, Any]) -> ros.TopicSpec:
    where = f"{FILE}: topics: {name}"
    data = {"optional": False, "subscribed": False, **_since(spec, where), "name": name}
    return _plain(ros.TopicSpec, data, where)


def _places(nodes: Mapping[str, Any], where: str) -> dict[str, ros.Place]:
    return {
        name: _plain(ros.Place, _since(spec, name), f"{FILE}: {where}: {name}")
        for name, spec in nodes.items()
    }


def _goal(spec: Mapping[str, Any]) -> ros.GoalSpec:
    return _plain(ros.GoalSpec, _since(spec, f"{FILE}: goal"), f"{FILE}: goal")


def _command(spec: Any, kinds: Mapping[str, ros.EvidenceKind]) -> ros.Command:  # noqa: ANN401
    where = f"{FILE}: commands"
    name = need(expect(spec, dict, where), "kind", str, where)
    if name not in kinds:
        message = f"{where}: there is no kind '{name}'; known are {', '.join(kinds)}"
        raise SpecError(message)
    data = {"of": "", "to": "", "extra": False, **_since(spec, where), "kind": kinds[name]}
    return _plain(ros.Command, data, f"{where}: {name}")


def _navigation(spec: Mapping[str, Any]) -> ros.NavigationSpec:
    where = f"{FILE}: navigation"
    names = need(spec, "parameters", dict, where)
    frames = tuple(
        tuple(need(frame, key, str, f"{where}: frames") for key in ("node", "name", "frame"))
        for frame in need(spec, "frames", list, where)
    )
    data = {**spec, "parameters": _plain(ros.ParameterNames, names, f"{where}: parameters")}
    return _plain(ros.NavigationSpec, {**data, "frames": frames}, where)
