"""What a composed prim says itself, without what its schemas add.

usd-core parses every schema that it has, once in a process, when it is first asked for a property
that no layer holds or for the type of one. That takes as long as judging a stage. What is asked
here does without.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pxr import Sdf, Usd

from lab3_usd.spec.catalog import Value
from lab3_usd.stage.read.plain_values import plain_value

RELATIONSHIP = "rel"
_VALUE = "default"


def authored_names(prim: Usd.Prim) -> list[str]:
    """Return the names of the properties that a layer holds, sorted.

    Raises:
        Tf.ErrorException: one has no name, as in a binary file with flipped bits.
    """
    names = sorted(prim.GetPrimIndex().ComputePrimPropertyNames())
    if names and not names[0]:
        prim.GetAuthoredProperties()  # tells of the damage
    return names


def authored_data(prim: Usd.Prim, name: str) -> Any:  # noqa: ANN401 - whatever usd-core returns
    """Return the value that a layer gives to an attribute, None where none does."""
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute.HasAuthoredMetadata(_VALUE) else None


def authored_value(prim: Usd.Prim, name: str) -> Value | None:
    """Return the same value as plain data."""
    return plain_value(authored_data(prim, name))


def authored_targets(prim: Usd.Prim, name: str) -> tuple[str, ...]:
    """Return the prims that a relationship leads to, none where there is no such relationship."""
    relationship = prim.GetRelationship(name)
    if not relationship.HasAuthoredTargets():
        return ()
    return tuple(map(str, relationship.GetTargets()))


def property_specs(prim: Usd.Prim, name: str) -> Iterator[Any]:
    """Yield what layers say of a property, the strongest first."""
    for spec in prim.GetPrimStack():
        found = spec.layer.GetPropertyAtPath(spec.path.AppendProperty(name))
        if found:
            yield found


def authored_type(prim: Usd.Prim, name: str) -> str:
    """Return the declared type of an attribute, `rel` for a relationship."""
    spec = next(property_specs(prim, name), None)
    return str(spec.typeName) if isinstance(spec, Sdf.AttributeSpec) else RELATIONSHIP


def authored_custom_data(prim: Usd.Prim, name: str, *keys: str) -> Any:  # noqa: ANN401
    """Return what the strongest layer has under nested keys in a property's custom data."""
    for spec in property_specs(prim, name):
        value = spec.GetInfo("customData")
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if value is not None:
            return value
    return None
