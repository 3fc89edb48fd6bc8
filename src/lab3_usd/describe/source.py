"""Reads the stage that a lab is described after, with the node types and sensors that it has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.describe.catalog import unknown_types, with_types
from lab3_usd.model.physics import BODY_API, is_joint
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.scene import ANYWHERE
from lab3_usd.stage.read.prims import Authored, authored_attributes
from lab3_usd.stage.read.reader import read_stage

_PLAIN_TYPES = ("", "Xform", "Scope")


class Source(Struct, frozen=True):
    """A stage, and the bundled lab with every node type of the stage in its catalog.

    `unknown` are the types that no catalog has, as they are described. `sensors` are the prims that
    may be sensors, `authored` what the stage writes at each.
    """

    stem: str
    stage: StageModel
    lab: Lab
    unknown: Mapping[str, Any]
    sensors: tuple[Prim, ...]
    authored: Mapping[str, Authored]


def read_source(path: Path, lab: Lab, types: Catalog) -> Source:
    """Read a stage; `lab` is the bundled one, `types` the catalog of all public node types.

    Raises:
        StageError: the stage cannot be read.
    """
    lab = replace(lab, catalog=types)
    stage = read_stage(path, lab)
    unknown = unknown_types(stage.nodes())
    lab = replace(lab, catalog=with_types(types, unknown))
    found = {prim.path: prim.type for prim in _sensors(stage, lab)}
    # The place of a prim of a type that USD does not know is read where a lab has such a sensor.
    draft = next(iter(lab.sensors.values()))
    drafts = {kind: replace(draft, type=kind) for kind in found.values()}
    scene = replace(lab.scene, sensors={**lab.sensors, **drafts})
    stage = read_stage(path, replace(lab, scene=scene))
    return Source(
        stem=path.stem,
        stage=stage,
        lab=lab,
        unknown=unknown,
        sensors=tuple(stage.prims[each] for each in found),
        authored=authored_attributes(path, found),
    )


def _sensors(stage: StageModel, lab: Lab) -> Iterator[Prim]:
    """Yield what graphs read that is no body, then prims of the types that are always sensors."""
    targets = (
        path
        for graph in stage.graphs
        for node in graph.nodes
        for state in node.ports.values()
        for path in state.targets
    )
    for path in dict.fromkeys(targets):
        prim = stage.prim(path)
        if prim is not None and prim.type not in _PLAIN_TYPES and not _is_part(prim):
            yield prim
    for spec in lab.sensors.values():
        if spec.recognised == ANYWHERE:
            yield from (prim for prim in stage.of_type(spec.type) if prim.present)


def _is_part(prim: Prim) -> bool:
    return BODY_API in prim.apis or is_joint(prim)
