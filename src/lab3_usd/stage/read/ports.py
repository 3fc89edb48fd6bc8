"""Reads the ports of one node prim."""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Sdf, Usd

from lab3_usd.model.stage import PortState
from lab3_usd.spec.catalog import INPUT, OUTPUT, NodeType, Port, Value
from lab3_usd.stage.read.plain_values import plain_value

_TOKEN = Sdf.ValueTypeNames.Token


class DamagedError(ValueError):
    """A prim holds what no program writes."""


def property_names(prim: Usd.Prim) -> list[str]:
    """Return the names of the properties that the composed prim declares.

    Raises:
        DamagedError: one has no name, as in a binary file with flipped bits.
    """
    names: list[str] = prim.GetAuthoredPropertyNames()
    if "" in names:
        message = f"{prim.GetPath()} has a property without a name"
        raise DamagedError(message)
    return names


def read_ports(prim: Usd.Prim, kind: NodeType | None) -> Mapping[str, PortState]:
    """Return the ports that the composed prim declares, by full name; `kind` is its node type.

    Of outputs only the names count: what flows through them is made at run time.
    """
    ports = {}
    for name in property_names(prim):
        if name.startswith(OUTPUT):
            ports[name] = PortState(name)
        elif name.startswith(INPUT):
            attribute = prim.GetAttribute(name)
            if attribute:
                known = None if kind is None else kind.port(name)
                ports[name] = _input(name, attribute, known)
            else:
                targets = prim.GetRelationship(name).GetTargets()
                ports[name] = PortState(name, "rel", targets=tuple(map(str, targets)))
    return ports


def _input(name: str, attribute: Usd.Attribute, known: Port | None) -> PortState:
    sources: tuple[str, ...] = ()
    if attribute.HasAuthoredConnections():
        sources = tuple(map(str, attribute.GetConnections()))
    value = plain_value(attribute.Get())
    if value is None and not sources and _is_extended(attribute, known):
        value = _value_in_metadata(attribute)
    # The type of a port without a value says nothing that a rule asks about.
    kind = "" if value is None else str(attribute.GetTypeName())
    return PortState(name, kind, value, sources)


def _is_extended(attribute: Usd.Attribute, known: Port | None) -> bool:
    """Whether a port takes values of several types, which files declare as a token."""
    return attribute.GetTypeName() == _TOKEN if known is None else known.is_union


def _value_in_metadata(attribute: Usd.Attribute) -> Value | None:
    """Return the literal of an extended port, which Kit keeps beside the attribute's value."""
    if not attribute.HasAuthoredCustomDataKey("omni"):
        return None
    return plain_value(attribute.GetCustomDataByKey("omni:graph:attrValue"))
