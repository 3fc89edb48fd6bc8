"""Words for nodes, ports and values in messages."""

from __future__ import annotations

from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import Value
from lab3_usd.spec.graph import NodeSpec

MOST_ITEMS = 12  # of a list; whoever reads a message wants no more
MOST_LETTERS = 200


def display(value: Value | None) -> str:
    """Return a value as a person would read it in the Property panel, in one line."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, float):
        return f"{value:.7g}"  # as many digits as a float32 holds
    if isinstance(value, tuple):
        return f"[{_first(tuple(display(item) for item in value[: MOST_ITEMS + 1]), len(value))}]"
    return _quoted(value) if isinstance(value, str) else str(value)


def _quoted(text: str) -> str:
    """Return a text in quotes; what cannot be seen is written as Python writes it."""
    short = text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}..."
    return f"'{short}'" if short.isprintable() else repr(short)


def _first(items: tuple[str, ...], count: int) -> str:
    more = count - MOST_ITEMS
    return ", ".join(items) if more <= 0 else f"{', '.join(items[:MOST_ITEMS])} and {more} more"


def short_source(path: str | None) -> str:
    """Return `node.outputs:port` of a full property path."""
    return "nothing" if path is None else path.rpartition("/")[2]


def role_title(node: NodeSpec) -> str:
    """Return a node's title as the handout writes it."""
    return node.type.handout_name


def node_title(node: Node) -> str:
    """Return a node's title in the editor, else its type as saved."""
    name = node.type_name or "a node without a type"
    return name if node.type is None else node.type.handout_name


def format_paths(paths: tuple[str, ...]) -> str:
    """Return prim paths in one line."""
    return _first(paths, len(paths)) if paths else "no prim"
