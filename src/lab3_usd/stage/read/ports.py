"""Reads the ports of one node prim."""

from __future__ import annotations

from collections.abc import Mapping

from lab3_usd.model.stage import PortState
from lab3_usd.spec.catalog import INPUT, OUTPUT, NodeType, Value
from lab3_usd.stage.read.plain_values import plain_value
from lab3_usd.stage.read.properties import RELATIONSHIP, AuthoredProperties, AuthoredProperty


def read_ports(properties: AuthoredProperties, kind: NodeType | None) -> Mapping[str, PortState]:
    """Return the ports among the properties of a prim, by full name; `kind` is its node type.

    Of outputs only the names count: what flows through them is made at run time.
    """
    ports = {}
    for name in properties.names():
        if name.startswith(OUTPUT):
            ports[name] = PortState(name)
        elif name.startswith(INPUT):
            ports[name] = _input(name, properties[name], kind)
    return ports


def _input(name: str, found: AuthoredProperty, kind: NodeType | None) -> PortState:
    value, sources = found.value(), found.sources()
    if value is None and not sources:
        if found.type == RELATIONSHIP:
            return PortState(name, RELATIONSHIP, targets=found.targets())
        value = _value_in_metadata(name, found, kind)
    # The type of a port without a value says nothing that a rule asks about.
    return PortState(name, "" if value is None else found.type, value, sources)


def _value_in_metadata(
    name: str, attribute: AuthoredProperty, kind: NodeType | None
) -> Value | None:
    """Return the literal of an extended port, which Kit keeps beside the attribute's value."""
    known = None if kind is None else kind.port(name)
    # Files declare a port that takes values of several types as a token.
    is_extended = attribute.type == "token" if known is None else known.is_union
    if not is_extended:
        return None
    return plain_value(attribute.custom_data("omni", "graph", "attrValue"))
