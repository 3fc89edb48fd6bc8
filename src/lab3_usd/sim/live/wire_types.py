"""The message types of ROS 2 Humble as types of DDS, made from the definitions of a type store."""

from __future__ import annotations

from functools import cache
from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct, types
from rosbags.interfaces import Nodetype

from lab3_usd.sim.bag.messages import STORE

_OF: Any = types  # the library types no subscripts of its own
_BASES: dict[str, Any] = {
    "bool": bool,
    "byte": types.byte,
    "char": types.uint8,
    "int8": types.int8,
    "uint8": types.uint8,
    "int16": types.int16,
    "uint16": types.uint16,
    "int32": types.int32,
    "uint32": types.uint32,
    "int64": types.int64,
    "uint64": types.uint64,
    "float32": types.float32,
    "float64": types.float64,
    "string": str,
}


def wire_topic(topic: str) -> str:
    """Return the name of a topic of ROS 2 on the wire: `rt/odom` for `/odom`."""
    return f"rt{topic}"


def wire_name(kind: str) -> str:
    """Return the name of a message type on the wire: `geometry_msgs::msg::dds_::Twist_`."""
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


@cache
def wire_type(kind: str) -> type[IdlStruct]:
    """Return the type of DDS that a message type of ROS 2 is on the wire."""
    _, fields = STORE.fielddefs[kind]
    name = wire_name(kind)
    made = {field: _field(*described) for field, described in fields}
    return make_idl_struct(name.rpartition(":")[2], name.replace("::", "."), made)


def _field(node: Nodetype, of: Any) -> Any:  # noqa: ANN401 - the library's description, its type
    if node is Nodetype.BASE:
        return _BASES[of[0]]
    if node is Nodetype.NAME:
        return wire_type(of)
    inner, length = of
    if node is Nodetype.ARRAY:
        return _OF.array[_field(*inner), length]
    return _OF.sequence[_field(*inner)]
