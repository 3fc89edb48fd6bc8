"""Reads a whole scene as plain data, where it is made of nothing but its own prims."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from msgspec import Struct
from pxr import Gf, Sdf, Usd

from lab3_usd.model.prims import Matrix
from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors
from lab3_usd.stage.read.prim_transforms import local_transform

_MOST_PRIMS = 500
_MOST_NUMBERS = 64  # of one value: a mesh is no text for people
_DERIVED = ("xformOp", "extent")  # what poses and shapes say already


class PlainPrim(Struct, frozen=True):
    """A prim: `local` is its place in its parent, None where it has none of its own.

    `values` are by name the type (None where USD knows it) and the value of what is authored.
    """

    path: str
    type: str
    apis: tuple[str, ...] = ()
    doc: str = ""
    local: Matrix | None = None
    values: tuple[tuple[str, str | None, Any], ...] = ()
    targets: tuple[tuple[str, tuple[str, ...]], ...] = ()


class PlainScene(Struct, frozen=True):
    """The prims of a scene, parents before children; `reason` says why there are none."""

    default_prim: str = ""
    prims: tuple[PlainPrim, ...] = ()
    reason: str = ""


@quiet()
def read_plain_scene(path: Path, without: Collection[str]) -> PlainScene:
    """Read a scene except for the prims at and below the paths `without`.

    Raises:
        StageError: the stage cannot be read.
    """
    with stage_errors(str(path)):
        stage = open_stage(path)
        default = stage.GetDefaultPrim()
        prims: list[PlainPrim] = []
        for prim in prims_but(stage, without):
            reason = _not_plain(prim)
            if not reason and len(prims) == _MOST_PRIMS:
                reason = f"the scene has more than {_MOST_PRIMS} prims"
            if reason:
                return PlainScene(reason=reason)
            prims.append(_plain_prim(prim))
        if not default:
            return PlainScene(reason="the stage has no default prim")
        return PlainScene(default.GetName(), tuple(prims))


def prims_but(stage: Usd.Stage, without: Collection[str]) -> Iterator[Usd.Prim]:
    """Yield the prims of a stage but those at and below the paths that patterns name."""
    walk = iter(Usd.PrimRange.Stage(stage))
    for prim in walk:
        if any(fnmatchcase(str(prim.GetPath()), pattern) for pattern in without):
            walk.PruneChildren()
        else:
            yield prim


def _not_plain(prim: Usd.Prim) -> str:
    """Return why a prim cannot be written as one of its own, '' where it can."""
    path, own = prim.GetPath(), prim.GetStage().GetRootLayer()
    reasons = {
        "has no type": not prim.GetTypeName(),
        "brings in an asset": prim.HasAuthoredReferences()
        or prim.HasAuthoredPayloads()
        or prim.HasVariantSets(),
        "comes from another file or prim": any(
            spec.layer != own or spec.path != path for spec in prim.GetPrimStack()
        ),
        "does not stand in its parent": local_transform(prim)[1],
    }
    reason = next((reason for reason, holds in reasons.items() if holds), "")
    if reason:
        return f"{path} {reason}"
    for attribute in prim.GetAuthoredAttributes():
        value = attribute.Get()
        if isinstance(value, (Sdf.AssetPath, Sdf.AssetPathArray, Gf.Matrix4d)):
            return f"{path}.{attribute.GetName()} is a file or a matrix"
        if not isinstance(value, str) and hasattr(value, "__len__") and len(value) > _MOST_NUMBERS:
            return f"{path}.{attribute.GetName()} has more than {_MOST_NUMBERS} entries"
    return ""


def _plain_prim(prim: Usd.Prim) -> PlainPrim:
    names = set(prim.GetPrimDefinition().GetPropertyNames())
    has_place = prim.GetAttribute("xformOpOrder").HasAuthoredValue()
    values: list[tuple[str, str | None, Any]] = []
    for attribute in prim.GetAuthoredAttributes():
        name, value = attribute.GetName(), attribute.Get()
        if not name.startswith(_DERIVED) and value is not None:
            uniform = attribute.GetVariability() == Sdf.VariabilityUniform
            kind = f"{'uniform ' if uniform else ''}{attribute.GetTypeName()}"
            values.append((name, None if name in names else kind, _plain(value)))
    return PlainPrim(
        path=str(prim.GetPath()),
        type=str(prim.GetTypeName()),
        apis=tuple(prim.GetPrimTypeInfo().GetAppliedAPISchemas()),
        doc=prim.GetDocumentation() if prim.HasAuthoredDocumentation() else "",
        local=local_transform(prim)[0] if has_place else None,
        values=tuple(values),
        targets=tuple(
            (each.GetName(), paths)
            for each in prim.GetAuthoredProperties()
            if (paths := paths_of(each))
        ),
    )


def paths_of(each: Usd.Property) -> tuple[str, ...]:
    """Return what a relationship leads to, or an attribute is connected to."""
    is_attribute = isinstance(each, Usd.Attribute)
    return tuple(map(str, each.GetConnections() if is_attribute else each.GetTargets()))


def _plain(value: Any) -> Any:
    """Return a value as YAML holds it; quaternions have the real part first."""
    if isinstance(value, (Gf.Quatf, Gf.Quatd, Gf.Quath)):
        return [value.GetReal(), *value.GetImaginary()]
    if isinstance(value, (str, bool, int, float)):
        return value
    return [_plain(item) for item in value]
