"""Describes the sensors of a stage: the prims that graphs read, and those of known sensor types."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import to_builtins

from lab3_usd.describe.robot import plain, pose
from lab3_usd.describe.source import Source
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.prims import Prim
from lab3_usd.model.transform_math import IDENTITY, camera_axes
from lab3_usd.spec.catalog import Value
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import SensorSpec
from lab3_usd.spec.values import is_known_type

_OTHER = re.compile(r"(physics|physx|drive|node|kind|visibility|xformOp|purpose|ui)")
# What of a known kind is the same in every lab.
_TAKEN_OVER = ("recognised", "required_api", "scan", "rate_api")


def targets_of(graph: GraphSpec) -> Iterator[str]:
    """Yield the prims that the nodes of a graph name."""
    for node in graph.nodes.values():
        for target in node.targets:
            yield from target.prims


def describe_sensors(
    source: Source, sections: Mapping[str, str], robot: str
) -> dict[str, dict[str, Any]]:
    """Describe the sensors on the robot by short names; `sections` are the handout's by path."""
    found: dict[str, dict[str, Any]] = {}
    for prim in source.sensors:
        if not is_at_or_below(prim.path, robot):
            continue
        known = _known(prim.type, source.lab)
        kind = known.kind if known else _word(prim.type)
        taken = sum(each["kind"] == kind for each in found.values())
        name = kind if not taken else f"{kind}_{taken + 1}"
        found[name] = _sensor(source, prim, kind, sections[prim.path])
    return found


def _known(type_name: str, lab: Lab) -> SensorSpec | None:
    """Return what the bundled lab says of a sensor of this type, None where it has none."""
    return next((each for each in lab.sensors.values() if each.type == type_name), None)


def _word(type_name: str) -> str:
    """Return a kind for a type without rules of its own: imu for IsaacImuSensor."""
    words = re.findall(r"[A-Z][a-z0-9]*|[a-z0-9]+", type_name)
    inner = words[1:-1] if len(words) > 2 else words[-1:]  # noqa: PLR2004 - vendor, word, Sensor
    return "_".join(inner).lower() or "sensor"


def _sensor(source: Source, prim: Prim, kind: str, section: str) -> dict[str, Any]:
    known = _known(prim.type, source.lab)
    data: dict[str, Any] = {
        "kind": kind,
        "path": prim.path,
        "type": prim.type,
        "handout": section,
        "pose": {**pose(prim.local, source.stage.meters_per_unit), "handout": section},
    }
    same = {} if known is None else to_builtins(known)
    data |= {key: same[key] for key in _TAKEN_OVER if same.get(key)}
    if "scan" in data:
        data["scan"]["handout"] = section
    if same.get("looks"):
        along, up = camera_axes(prim.local or IDENTITY)
        data["looks"] = {"along": plain(along), "up": plain(up)}
        data["default_handout"] = section
    if prim.apis:
        data["apis"] = list(prim.apis)
    attributes = {
        name: _attribute(said, same.get("attributes"), name, section)
        for name, said in sorted(source.authored[prim.path].items())
        if not _OTHER.match(name) and is_known_type(said[0])
    }
    return data | ({"attributes": attributes} if attributes else {})


def _attribute(
    authored: tuple[str, Value], known: Mapping[str, Any] | None, name: str, section: str
) -> dict[str, Any]:
    """Describe an attribute: of a known kind those are required that the bundled lab requires."""
    kind, value = authored
    data = {"type": kind, "value": _single(value) if kind.startswith("float") else value}
    if known is None:
        return {**data, "required": True, "handout": section}
    said = known.get(name, {})
    kept = {key: said[key] for key in ("required", "unset", "schema") if said.get(key)}
    return {**data, **kept, "handout": section} if kept else data


def _single(value: Value) -> Value:
    """Return numbers of single precision as they were typed: 0.1 for 0.10000000149."""
    if isinstance(value, tuple):
        return tuple(_single(each) for each in value)
    return float(f"{value:.7g}") if isinstance(value, float) else value
