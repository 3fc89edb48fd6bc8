"""What a composed prim says itself, without what its schemas add.

usd-core parses every schema that it has, once in a process, when it is first asked for a property
that no layer holds or for the type of one. That takes as long as judging a stage. Here the layers
are asked what they hold, and the stage only for values, sources and targets that are there.
"""

from __future__ import annotations

from typing import Any

from pxr import Sdf, Usd

from lab3_usd.spec.catalog import Value
from lab3_usd.stage.read.plain_values import plain_value

RELATIONSHIP = "rel"
_WITH_VARIABLES = {Sdf.AssetPath, Sdf.AssetPathArray}  # of which the stage makes a path
_VALUE, _SOURCES = "default", "connectionPaths"


def authored_data(prim: Usd.Prim, name: str) -> Any:  # noqa: ANN401 - whatever usd-core returns
    """Return the value that a layer gives to one attribute of a prim, None where none does."""
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute.HasAuthoredMetadata(_VALUE) else None


class AuthoredProperty:
    """A property of a prim as its layers have it; one that none of them has holds nothing."""

    __slots__ = ("_name", "_prim", "specs")

    def __init__(self, prim: Usd.Prim, name: str, specs: list[Any]) -> None:
        """Take what the layers have, the strongest first."""
        self._prim = prim
        self._name = name
        self.specs = specs

    @property
    def _is_relationship(self) -> bool:
        return bool(self.specs) and type(self.specs[0]) is Sdf.RelationshipSpec

    def _says(self, field: str) -> bool:
        """Whether a layer gives this to an attribute; a stronger relationship hides it."""
        if self._is_relationship:
            return False
        for spec in self.specs:  # noqa: SIM110 - a generator takes three times as long
            if spec.HasInfo(field):
                return True
        return False

    @property
    def type(self) -> str:
        """The declared type of an attribute, `rel` for a relationship, '' for neither."""
        if self._is_relationship:
            return RELATIONSHIP
        return str(self.specs[0].typeName) if self.specs else ""

    def value(self) -> Value | None:
        """Return the value that a layer gives to an attribute, None where none does."""
        if len(self.specs) == 1 and type(self.specs[0]) is Sdf.AttributeSpec:
            alone = self.specs[0].default  # of one layer, which needs no composition
            if type(alone) not in _WITH_VARIABLES:
                return plain_value(alone)
        if not self._says(_VALUE):
            return None
        return plain_value(self._prim.GetAttribute(self._name).Get())

    def sources(self) -> tuple[str, ...]:
        """Return the properties that an attribute is connected to."""
        if not self._says(_SOURCES):
            return ()
        return tuple(map(str, self._prim.GetAttribute(self._name).GetConnections()))

    def targets(self) -> tuple[str, ...]:
        """Return the prims that a relationship leads to."""
        if not self._is_relationship:
            return ()
        return tuple(map(str, self._prim.GetRelationship(self._name).GetTargets()))

    def custom_data(self, *keys: str) -> Any:  # noqa: ANN401
        """Return what the strongest layer has under nested keys of the custom data."""
        for spec in self.specs:
            value = spec.GetInfo("customData")
            for key in keys:
                value = value.get(key) if isinstance(value, dict) else None
            if value is not None:
                return value
        return None


class AuthoredProperties:
    """The properties of a prim that a layer holds."""

    __slots__ = ("_prim", "_sites")

    def __init__(self, prim: Usd.Prim) -> None:
        """Look at the layers that say something of a prim."""
        self._prim = prim
        self._sites = [(spec.layer, spec.path) for spec in prim.GetPrimStack()]

    def names(self) -> list[str]:
        """Return their names, sorted.

        Raises:
            Tf.ErrorException: one has no name, as in a binary file with flipped bits.
        """
        names = sorted(self._prim.GetPrimIndex().ComputePrimPropertyNames())
        if names and not names[0]:
            self._prim.GetAuthoredProperties()  # tells of the damage
        return names

    def __getitem__(self, name: str) -> AuthoredProperty:
        """Return the property of this name, also one that a damaged file does not list."""
        specs = []
        for layer, path in self._sites:
            spec = layer.GetPropertyAtPath(path.AppendProperty(name))
            if spec is not None:
                specs.append(spec)
        return AuthoredProperty(self._prim, name, specs)
