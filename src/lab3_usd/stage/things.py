"""Reads what the layers of a stage themselves say of its prims, without what assets bring."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.isaac.values import Value
from lab3_usd.model.transforms import (
    AXES,
    Vector,
    decompose,
    euler_angles,
    rotation_difference,
)
from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors
from lab3_usd.stage.read.plain_scene import paths_of, prims_but
from lab3_usd.stage.read.prim_transforms import ORDER, TransformCache
from lab3_usd.stage.read.properties import CENTIMETRES, plain_value, stage_number
from lab3_usd.stage.schema_names import known_type

_MOST = 16  # numbers of a value: the points of a mesh are nothing that a person asks for
_SCALE, TURN = "xformOp:scale", "xformOp:rotateXYZ"
_LEAST_TURN = 0.01  # degrees
_UNSAID = ("xformOp*", "extent", "extentsHint", "primvars:st*", "normals", "points", "faceVertex*")
_UNSAID_TYPES = ("matrix", "quat", "timecode", "opaque", "group")


class Thing(Struct, frozen=True):
    """What the layers of a stage say of a prim: `type` is '' where an asset defines it.

    `values` hold beside a value its type, '' where USD knows it; a turn is about X, Y and Z,
    however it is written. `place` is the origin in the world
    in metres, None for a prim that is not placed itself. `assets` are those that it refers to,
    which are all there if they are `resolved`.
    """

    type: str
    apis: tuple[str, ...]
    values: dict[str, tuple[str, Value]]
    targets: dict[str, tuple[str, ...]]
    variants: dict[str, str]
    place: Vector | None
    assets: tuple[str, ...]
    resolved: bool


@quiet()
def read_things(path: Path, without: Collection[str], unsaid: Collection[str]) -> dict[str, Thing]:
    """Return the things of a stage by path, but those at and below the paths `without`.

    Properties that match the patterns `unsaid` are left out.

    Raises:
        StageError: the stage cannot be read.
    """
    with stage_errors(str(path)):
        stage = open_stage(path)
        reader = _Reader(stage, (*_UNSAID, *unsaid))
        own = (prim for prim in prims_but(stage, without) if reader.is_own(prim.GetPrimStack()))
        return {str(prim.GetPath()): reader.thing(prim) for prim in own}


class _Reader:
    """Reads things of one stage."""

    def __init__(self, stage: Usd.Stage, unsaid: Collection[str]) -> None:
        """Look at the stage's own layers."""
        self._own = set(stage.GetLayerStack(includeSessionLayers=False))
        self._unsaid = unsaid
        self._transforms = TransformCache()
        self._metres = stage_number(stage.GetMetadata("metersPerUnit"), CENTIMETRES)

    def is_own(self, specs: list[Any]) -> bool:
        """Whether a layer of the stage itself says something."""
        return any(spec.layer in self._own for spec in specs)

    def thing(self, prim: Usd.Prim) -> Thing:
        """Return what is said of a prim."""
        own = [spec for spec in prim.GetPrimStack() if spec.layer in self._own]
        is_defined = any(spec.specifier == Sdf.SpecifierDef for spec in own)
        is_placed = self.is_own(prim.GetAttribute(ORDER).GetPropertyStack())
        x, y, z = self._transforms.world(prim)[12:15]
        metres = self._metres
        chosen = [spec.variantSelections for spec in reversed(own)]  # what layers select, by sets
        return Thing(
            type=str(prim.GetTypeName()) if is_defined else "",
            apis=tuple(prim.GetPrimTypeInfo().GetAppliedAPISchemas()) if is_defined else (),
            values={**dict(self._values(prim)), **(self._turn(prim) if is_placed else {})},
            targets=dict(self._targets(prim)),
            variants={name: choice for each in chosen for name, choice in each.items() if choice},
            place=(x * metres, y * metres, z * metres) if is_placed else None,
            assets=tuple(dict.fromkeys(name for _, name in _assets(own))),
            resolved=all(
                Path(Sdf.ComputeAssetPathRelativeToLayer(layer, name)).exists()
                for layer, name in _assets(own)
            ),
        )

    def _turn(self, prim: Usd.Prim) -> dict[str, tuple[str, Value]]:
        """Return by how much a prim is turned in its parent, nothing where it is not."""
        local, _ = self._transforms.of(prim, str(prim.GetPath()))
        rotation = AXES if local is None else decompose(local).rotation
        is_turned = rotation_difference(rotation, AXES) > _LEAST_TURN
        return {TURN: ("", euler_angles(rotation))} if is_turned else {}

    def _said(self, properties: list[Any]) -> Iterator[Any]:
        for each in properties:
            is_unsaid = any(fnmatchcase(each.GetName(), name) for name in self._unsaid)
            is_said = each.GetName() == _SCALE or not is_unsaid
            if is_said and self.is_own(each.GetPropertyStack()):
                yield each

    def _values(self, prim: Usd.Prim) -> Iterator[tuple[str, tuple[str, Value]]]:
        for attribute in self._said(prim.GetAuthoredAttributes()):
            kind = str(attribute.GetTypeName())
            value = plain_value(attribute.Get(), _MOST)
            if (attribute.GetName(), value) == (_SCALE, (1.0, 1.0, 1.0)):
                continue
            if value is not None and not kind.startswith(_UNSAID_TYPES):
                is_known = known_type(prim, attribute.GetName()) is not None
                yield attribute.GetName(), ("" if is_known else kind, value)

    def _targets(self, prim: Usd.Prim) -> Iterator[tuple[str, tuple[str, ...]]]:
        for each in self._said(prim.GetAuthoredProperties()):
            paths = paths_of(each)
            if paths or isinstance(each, Usd.Relationship):
                yield each.GetName(), paths


def _assets(specs: list[Any]) -> Iterator[tuple[Sdf.Layer, str]]:
    for spec in specs:
        for key in ("references", "payload"):
            listed = spec.GetInfo(key).GetAppliedItems()
            yield from ((spec.layer, item.assetPath) for item in listed if item.assetPath)
