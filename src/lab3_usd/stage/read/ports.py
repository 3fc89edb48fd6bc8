"""Reads the ports of one node prim."""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Sdf, Usd

from lab3_usd.model.stage import PortState
from lab3_usd.spec.catalog import INPUT, OUTPUT, NodeType, Port, Value
from lab3_usd.stage.read.plain_values import plain_value

Properties = Mapping[str, Usd.Property]
_TOKEN = Sdf.ValueTypeNames.Token


def declared_properties(prim: Usd.Prim) -> Properties:
    """Return the properties that the composed prim declares, by name.

    To ask for all at once takes half as long as asking for one after the other, and so does asking
    for all names, which come in the same order.

    Raises:
        Tf.ErrorException: one has no name or no type, as in a binary file with flipped bits.
    """
    names = prim.GetAuthoredPropertyNames()
    return dict(zip(names, prim.GetAuthoredProperties(), strict=True))


def declared_value(properties: Properties, name: str) -> Value | None:
    """Return the value of one of these attributes, None where there is none."""
    found = properties.get(name)
    return plain_value(found.Get()) if isinstance(found, Usd.Attribute) else None


def read_ports(properties: Properties, kind: NodeType | None) -> Mapping[str, PortState]:
    """Return the ports among the properties of a prim, by full name; `kind` is its node type.

    Of outputs only the names count: what flows through them is made at run time.
    """
    ports = {}
    for name, found in properties.items():
        if name.startswith(OUTPUT):
            ports[name] = PortState(name)
        elif name.startswith(INPUT):
            if isinstance(found, Usd.Attribute):
                known = None if kind is None else kind.port(name)
                ports[name] = _input(name, found, known)
            else:
                ports[name] = PortState(name, "rel", targets=tuple(map(str, found.GetTargets())))
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
