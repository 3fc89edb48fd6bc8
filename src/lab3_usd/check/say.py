"""Words for nodes, ports and values in messages."""

from __future__ import annotations

from lab3_usd.check.model import Node
from lab3_usd.spec.catalog import Value
from lab3_usd.spec.spec import NodeSpec


def shown(value: Value | None) -> str:
    """Return a value as a person would read it in the Property panel."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, tuple):
        return "[" + ", ".join(shown(item) for item in value) + "]"
    return f"'{value}'" if isinstance(value, str) else str(value)


def short_source(path: str | None) -> str:
    """Return `node.outputs:port` of a full property path."""
    return "nothing" if path is None else path.rpartition("/")[2]


def titled(node: NodeSpec) -> str:
    """Return a node's title as the handout writes it."""
    return node.type.handout_name


def title_of(node: Node) -> str:
    """Return a node's title in the editor, else its type as saved."""
    return node.type_name if node.type is None else node.type.handout_name


def listed(paths: tuple[str, ...]) -> str:
    """Return prim paths in one line."""
    return ", ".join(paths) if paths else "no prim"
