"""Names of types and attributes that no schema of USD has, and that are like one that it has."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path

from msgspec import Struct
from pxr import Sdf, Tf, Usd

from lab3_usd.facts.likely_names import near_name
from lab3_usd.stage.read.opening import open_stage

_ALIKE = 0.85
SHADER = "info:id"
_TYPES = Sdf.ValueTypeNames
_TURNS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
_POSES = {  # as Isaac Sim's own editor writes them
    **dict.fromkeys(("xformOp:translate", "xformOp:scale"), _TYPES.Double3),
    **dict.fromkeys((f"xformOp:rotate{axes}" for axes in _TURNS), _TYPES.Double3),
    **dict.fromkeys((f"xformOp:rotate{axis}" for axis in "XYZ"), _TYPES.Double),
    "xformOp:orient": _TYPES.Quatd,
}


class Misnomer(Struct, frozen=True):
    """A name of a type, schema or property that is likely misspelt; `meant` is known."""

    prim: str
    property: str
    written: str
    meant: str


def misnomers(path: Path, types: Collection[str]) -> Iterator[Misnomer]:
    """Yield the names of a stage that are likely misspelt, in the order of its prims.

    `types` are prim types beside those of USD's own schemas. A name that is like no known one may
    be of an extension.

    Raises:
        StageError: the file cannot be opened.
    """
    stage = open_stage(path)  # which ends with the last name of it
    for prim in stage.TraverseAll():
        place, kind = str(prim.GetPath()), str(prim.GetTypeName())
        meant = likely_schema(kind, types)
        if meant is not None:
            yield Misnomer(place, "", kind, meant)
            continue
        for name in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
            meant = likely_api(name)
            if meant is not None:
                yield Misnomer(place, "apis", name, meant)
        for name in prim.GetAuthoredPropertyNames():
            meant = likely_property(prim, name)
            if meant is not None:
                yield Misnomer(place, name, name, meant)


def likely_schema(name: str, types: Collection[str]) -> str | None:
    """Return the type that is like a name which no schema has; None for a known or strange one."""
    schemas = {*_own_types(), *types}
    if not name or name in schemas:
        return None
    return near_name(name, sorted(schemas), _ALIKE)


def likely_property(prim: Usd.Prim, name: str) -> str | None:
    """Return the property that is like a name which the schemas of a prim do not have.

    Of a prim whose type no schema of USD has, nothing is known.
    """
    if prim.GetTypeName() not in _own_types():
        return None
    names = prim.GetPrimDefinition().GetPropertyNames()
    if name in names:
        return None
    return near_name(name, names, _ALIKE)


def likely_api(name: str) -> str | None:
    """Return the applied schema that is like a name which USD does not have, with its instance.

    Of those that begin as Isaac Sim's own do, USD knows none.
    """
    stem, colon, instance = name.partition(":")
    if stem in _own_apis() or stem.startswith(_OF_ISAAC):
        return None
    meant = near_name(stem, sorted(_own_apis()), _ALIKE)
    return None if meant is None else f"{meant}{colon}{instance}"


_OF_ISAAC = ("Physx", "Isaac", "Omni")


def known_type(prim: Usd.Prim, name: str) -> Sdf.ValueTypeName | None:
    """Return the type of an attribute by the schemas of a prim, or by the shader that it is."""
    spec = prim.GetPrimDefinition().GetSchemaAttributeSpec(name)
    if spec is not None:
        return spec.typeName
    pose = _POSES.get(":".join(name.split(":")[:2]))
    if pose is not None:
        return pose
    shader = prim.GetAttribute(SHADER)
    if not shader:
        return None
    from pxr import Sdr

    node = Sdr.Registry().GetShaderNodeByIdentifier(shader.Get() or "")
    place, _, port = name.partition(":")
    find = {"inputs": "GetShaderInput", "outputs": "GetShaderOutput"}.get(place, "")
    attribute = getattr(node, find)(port) if node and find else None
    return attribute.GetTypeAsSdfType().GetSdfType() if attribute else None


@cache
def _own_apis() -> frozenset[str]:
    registry = Usd.SchemaRegistry()
    kinds = Tf.Type.FindByName("UsdAPISchemaBase").GetAllDerivedTypes()
    return frozenset(str(registry.GetSchemaTypeName(kind)) for kind in kinds)


@cache
def _own_types() -> frozenset[str]:
    """Return the types of USD's own schemas that prims can have."""
    registry = Usd.SchemaRegistry()
    kinds = Tf.Type.FindByName("UsdTyped").GetAllDerivedTypes()
    return frozenset(
        str(registry.GetSchemaTypeName(kind)) for kind in kinds if registry.IsConcrete(kind)
    )
