"""Reads the ports of one node prim."""

from __future__ import annotations

from collections.abc import Mapping

from pxr import Usd

from lab3_usd.model.stage import PortState
from lab3_usd.spec.catalog import INPUT, OUTPUT, NodeType, Value
from lab3_usd.stage.read.plain_values import plain_value
from lab3_usd.stage.read.properties import (
    RELATIONSHIP,
    authored_custom_data,
    authored_names,
    authored_targets,
    authored_type,
    authored_value,
)


def read_ports(prim: Usd.Prim, kind: NodeType | None) -> Mapping[str, PortState]:
    """Return the ports of a prim by full name; `kind` is its node type, None for an unknown one.

    Of outputs only the names count: what flows through them is made at run time.
    """
    ports = {}
    for name in authored_names(prim):
        if name.startswith(OUTPUT):
            ports[name] = PortState(name)
        elif name.startswith(INPUT):
            ports[name] = _input(name, prim, kind)
    return ports


def _input(name: str, prim: Usd.Prim, kind: NodeType | None) -> PortState:
    attribute, value = prim.GetAttribute(name), authored_value(prim, name)
    sources: tuple[str, ...] = ()
    if attribute.HasAuthoredConnections():
        sources = tuple(map(str, attribute.GetConnections()))
    if value is None and not sources:
        value = _value_in_metadata(prim, name, kind)
        if value is None and authored_type(prim, name) == RELATIONSHIP:
            return PortState(name, RELATIONSHIP, targets=authored_targets(prim, name))
    # The type of a port without a value says nothing that a rule asks about.
    return PortState(name, "" if value is None else authored_type(prim, name), value, sources)


def _value_in_metadata(prim: Usd.Prim, name: str, kind: NodeType | None) -> Value | None:
    """Return the literal of an extended port, which Kit keeps beside the attribute's value."""
    if not prim.GetAttribute(name).HasAuthoredCustomDataKey("omni"):
        return None
    value = plain_value(authored_custom_data(prim, name, "omni", "graph", "attrValue"))
    return value if value is not None and _is_extended(prim, name, kind) else None


def _is_extended(prim: Usd.Prim, name: str, kind: NodeType | None) -> bool:
    """Whether a port takes values of several types, which files declare as a token."""
    known = None if kind is None else kind.port(name)
    return authored_type(prim, name) == "token" if known is None else known.is_union
