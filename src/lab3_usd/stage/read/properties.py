"""What a composed prim says itself, without what its schemas add.

usd-core parses every schema that it has, once in a process, when it is first asked for a property
that no layer holds or for the type of one. That takes as long as judging a stage. Here the layers
are asked what they hold, and the stage only for values, sources and targets that are there.

Methods of prims and attributes are called on the class, here and wherever it is done for each
prim: called on the object, usd-core first looks whether that is still valid, in Python's way of
finding an attribute, which takes longer than most answers. So the prim must be one of the stage:
without that look, a prim that is none ends the process.
"""

from __future__ import annotations

from typing import Any

from msgspec import Struct
from pxr import Sdf, Tf, Usd

from lab3_usd.spec.catalog import Value
from lab3_usd.stage.read.plain_values import plain_value

RELATIONSHIP = "rel"
_WITH_VARIABLES = {Sdf.AssetPath, Sdf.AssetPathArray}  # of which the stage makes a path
_VALUE, _SOURCES = "default", "connectionPaths"


def authored_data(prim: Usd.Prim, name: str) -> Any:  # noqa: ANN401 - whatever usd-core returns
    """Return the value that a layer gives to one attribute of a prim, None where none does."""
    attribute = Usd.Prim.GetAttribute(prim, name)
    if not Usd.Attribute.HasAuthoredMetadata(attribute, _VALUE):
        return None
    return Usd.Attribute.Get(attribute)


def targets_of(relationship: Usd.Relationship) -> list[Sdf.Path]:
    """Return where a relationship leads: nowhere if it is none, or if a layer has an attribute.

    Whatever layers say, what a schema calls a relationship is one; usd-core then fails to compose.

    Raises:
        Tf.ErrorException: the file is damaged there.
    """
    if not relationship:
        return []
    try:
        targets: list[Sdf.Path] = Usd.Relationship.GetTargets(relationship)
    except Tf.ErrorException:
        if all(type(each) is Sdf.RelationshipSpec for each in relationship.GetPropertyStack()):
            raise
        return []
    return targets


class AuthoredProperty(Struct, frozen=True, eq=False):
    """A property of a prim as its layers have it, the strongest first; without any, it is empty."""

    prim: Usd.Prim
    name: str
    specs: list[Any]

    @property
    def _is_relationship(self) -> bool:
        return bool(self.specs) and type(self.specs[0]) is Sdf.RelationshipSpec

    def _says(self, field: str) -> bool:
        """Whether a layer gives this to an attribute; a stronger relationship hides it."""
        for spec in self.specs:
            if spec.HasInfo(field):
                return not self._is_relationship
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
        return plain_value(Usd.Attribute.Get(Usd.Prim.GetAttribute(self.prim, self.name)))

    def sources(self) -> tuple[str, ...]:
        """Return the properties that an attribute is connected to."""
        if not self._says(_SOURCES):
            return ()
        attribute = Usd.Prim.GetAttribute(self.prim, self.name)
        return tuple(map(str, Usd.Attribute.GetConnections(attribute)))

    def targets(self) -> tuple[str, ...]:
        """Return the prims that a relationship leads to."""
        if not self._is_relationship:
            return ()
        relationship = Usd.Prim.GetRelationship(self.prim, self.name)
        return tuple(map(str, Usd.Relationship.GetTargets(relationship)))

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
        self._sites = [
            (spec.layer.GetPropertyAtPath, spec.path.AppendProperty)
            for spec in Usd.Prim.GetPrimStack(prim)
        ]

    def names(self) -> list[str]:
        """Return their names, sorted.

        Raises:
            Tf.ErrorException: one has no name, as in a binary file with flipped bits.
        """
        names = sorted(Usd.Prim.GetPrimIndex(self._prim).ComputePrimPropertyNames())
        if names and not names[0]:
            Usd.Prim.GetAuthoredProperties(self._prim)  # tells of the damage
        return names

    def __getitem__(self, name: str) -> AuthoredProperty:
        """Return the property of this name, also one that a damaged file does not list."""
        specs = []
        for property_at, path_of in self._sites:
            spec = property_at(path_of(name))
            if spec is not None:
                specs.append(spec)
        return AuthoredProperty(self._prim, name, specs)
