"""The arrays that reach inputs, as nodes make them of single values."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.facts.reaching_values import Nodes, listed_value
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.values import Value
from lab3_usd.model.stage import Node


def listed_names(node: Node, port: str, live: Nodes) -> tuple[str, ...] | None:
    """Return the names that reach an input as a list, None where they are unknown."""
    value = list_at(node, port, live)
    is_known = value is not None and all(isinstance(item, str) for item in value)
    return tuple(map(str, value)) if is_known and value is not None else None


def list_at(node: Node, port: str, live: Nodes) -> tuple[Value, ...] | None:
    """Return the list that reaches an input, None where it is unknown."""
    value = listed_value(node, port, live)
    return value if isinstance(value, tuple) else None


class ArrayItems(Struct, frozen=True):
    """The inputs of a node that makes an array: those with something, those without, the rest.

    `beyond` are inputs with something that the size of the array leaves out.
    """

    count_port: str
    count: int
    filled: tuple[str, ...]
    empty: tuple[str, ...]
    beyond: tuple[str, ...]


def array_items(node: Node) -> ArrayItems | None:
    """Return what a node makes its array of, None for one that makes none or of a wired size."""
    dynamic = None if node.type is None else node.type.dynamic
    if dynamic is None:
        return None
    count_port = INPUT + dynamic.count
    count = node.value(count_port)
    if node.sources(count_port) or not isinstance(count, int) or isinstance(count, bool):
        return None
    stem = INPUT + dynamic.prefix
    inside = [f"{stem}{number}" for number in range(min(count, len(node.ports)))]
    states = {port: node.state(port) for port in inside}
    # An element is wired or set: an empty text is none.
    filled = tuple(
        port
        for port, state in states.items()
        if state and (state.sources or state.value not in (None, ""))
    )
    outside = (port for port in node.ports if port.startswith(stem) and port not in inside)
    return ArrayItems(
        count_port=count_port,
        count=count,
        filled=filled,
        empty=tuple(port for port in inside if port not in filled),
        beyond=tuple(
            port for port in outside if port[len(stem) :].isdecimal() and node.sources(port)
        ),
    )
