"""Answers of usd-core about prims of an open stage, which few rules ask for."""

from __future__ import annotations

from typing import Any

from pxr import Sdf

from lab3_usd.isaac.values import Value
from lab3_usd.model.prims import Details, Matrix
from lab3_usd.model.traction import BINDING
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.prims import PrimReader
from lab3_usd.stage.read.properties import CENTIMETRES, plain_value, prim_at, stage_number

_TEXTS = {"string", "token", "asset"}  # whose values look alike, and are read by their type alone


class StageDetails(Details):
    """What the schemas and the composition of a stage say of its prims."""

    def __init__(self, reader: PrimReader) -> None:
        """Keep the stage open."""
        self._reader = reader
        self._stage = reader.stage

    def fallback(self, path: str, name: str) -> Value | None:
        """Return what the schema of a prim gives an attribute that has no value."""
        attribute = self._attribute(path, name)
        return plain_value(attribute.Get()) if attribute and attribute.HasFallbackValue() else None

    def is_file(self, path: str, name: str) -> bool:
        """Whether an attribute names a file."""
        attribute = self._attribute(path, name)
        return bool(attribute) and attribute.GetTypeName() == Sdf.ValueTypeNames.Asset

    def variant(self, path: str, variants: str) -> str:
        """Return which one of a prim's set of variants is selected, '' for none."""
        prim = prim_at(self._stage, path)
        return str(prim.GetVariantSets().GetVariantSelection(variants)) if prim else ""

    def other_type(self, path: str, name: str, asked: str) -> tuple[str, str] | None:
        """Return the type that a layer gives an attribute, and the one in which it is read."""
        attribute = self._attribute(path, name)
        stack = attribute.GetPropertyStack() if attribute else ()
        holding = (spec for spec in stack if isinstance(spec, Sdf.AttributeSpec))
        spec = next((spec for spec in holding if spec.HasInfo("default")), None)
        if spec is None:
            return None
        declared = attribute.GetPrim().GetPrimDefinition().GetSchemaAttributeSpec(name)
        wanted = Sdf.ValueTypeNames.Find(asked) if declared is None else declared.typeName
        written = spec.typeName
        is_text = {str(written.scalarType), str(wanted.scalarType)} <= _TEXTS
        return (str(written), str(wanted)) if is_text and written != wanted else None

    def local(self, path: str) -> Matrix | None:
        """Return the transform of a prim in its parent; None where none is authored."""
        prim = prim_at(self._stage, path)
        return self._reader.transforms.of(prim, path)[0] if prim else None

    def origin(self, path: str) -> tuple[float, float, float] | None:
        """Return where the origin of a prim is in the world, in metres; None without a prim."""
        prim = prim_at(self._stage, path)
        if not prim:
            return None
        metres = stage_number(self._stage.GetMetadata("metersPerUnit"), CENTIMETRES)
        x, y, z = self._reader.transforms.world(prim)[12:15]
        return (x * metres, y * metres, z * metres)

    def material(self, path: str, binding: str) -> str:
        """Return the material with which USD draws a prim, or lets it slide; '' for none."""
        from pxr import UsdShade

        prim = prim_at(self._stage, path)
        purpose = binding.removeprefix(BINDING).removeprefix(":")
        if not prim or ":" in purpose:  # a collection binds others than the prim
            return ""
        with quiet():  # USD takes a binding without its schema, and warns of it
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
        return str(material.GetPath()) if material else ""

    def _attribute(self, path: str, name: str) -> Any:
        prim = prim_at(self._stage, path)
        return prim.GetAttribute(name) if prim else None
