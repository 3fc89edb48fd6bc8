"""Fills the holes of recipes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from lab3_usd.errors import GraphError
from lab3_usd.isaac.graph import Graph, Node, Wire, graph_node, make_graph, make_wire
from lab3_usd.isaac.node_types import INPUT, NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.recipes import Recipe, RecipeNode

_HOLE, _NOT = "$", "!"
_PARTS = "."  # between the parts of the name of a type, which the name of a hole does not have


def filled(
    recipe: Recipe, path: str, values: Mapping[str, Any], platform: Platform
) -> tuple[Graph, frozenset[str]]:
    """Return the graph of a recipe with its holes filled, and the roles that may be shared.

    Raises:
        GraphError: the release lacks a type or port of the recipe, or a value is wrong.
    """
    nodes: dict[str, list[Node]] = {}
    shared: set[str] = set()
    for role, entry in recipe.nodes.items():
        if all(_is_met(name, values, platform) for name in entry.when):
            nodes[role] = list(_nodes(role, entry, values, platform))
            shared |= {node.role for node in nodes[role]} if entry.shared else set()
    wires = [wire for text in recipe.wires for wire in _wires(text, nodes)]
    return make_graph(path, (n for several in nodes.values() for n in several), wires), frozenset(
        shared
    )


def _is_met(condition: str, values: Mapping[str, Any], platform: Platform) -> bool:
    """Whether a hole is filled, or the release has a node type, or the contrary."""
    name = condition.removeprefix(_NOT)
    holds = name in platform.types if _PARTS in name else bool(values.get(name))
    return holds != condition.startswith(_NOT)


def _nodes(
    role: str, entry: RecipeNode, values: Mapping[str, Any], platform: Platform
) -> Iterator[Node]:
    items: Iterable[Mapping[str, Any]] = values.get(entry.each) or () if entry.each else ({},)
    for number, item in enumerate(items):
        name = item.get("name", f"{number:02}" if number else "") if entry.each else ""
        own = {**values, "item": item}
        kind = _type(entry.type, platform)
        # Switches of a release that let a path win over the prim that a node names are off.
        given: dict[str, Any] = {
            name.removeprefix(INPUT): False
            for name, port in platform.changes.ports.get(kind.type, {}).items()
            if port.off_for and name in kind.ports
        }
        given |= {port: _value(value, own) for port, value in entry.set.items()}
        aims = {port: _value(value, own) for port, value in entry.targets.items()}
        try:
            yield graph_node(
                f"{role}_{name}" if name else role,
                kind,
                {port: value for port, value in given.items() if value is not None},
                {
                    port: (aim,) if isinstance(aim, str) else tuple(aim)
                    for port, aim in aims.items()
                    if aim
                },
                added=entry.ports,
            )
        except GraphError as error:
            raise GraphError(f"{role}: {error}") from error


def _type(name: str, platform: Platform) -> NodeType:
    """Return a type of a release.

    Raises:
        GraphError: the release has none of this name, or another one under its former name.
    """
    kind, written = platform.types.get(name), platform.written_name(name)
    if kind is None:
        releases = platform.releases_of(name)
        there = f"; it is in {', '.join(releases)}" if releases else ""
        raise GraphError(f"Isaac Sim {platform.release} has no {name}{there}")
    if platform.type_name(written) != name:
        raise GraphError(
            f"{written} is another node there than {name} of Isaac Sim {platform.names.before} "
            "and later"
        )
    return kind


def _value(value: Any, values: Mapping[str, Any]) -> Any:
    """Return a value with its holes filled, None where nothing fills the hole."""
    if isinstance(value, str) and value.startswith(_HOLE):
        name, _, key = value.removeprefix(_HOLE).partition(".")
        filling = values.get(name)
        return filling.get(key) if key and filling is not None else filling
    if isinstance(value, (list, tuple)):
        return tuple(_value(entry, values) for entry in value)
    return value


def _wires(text: str, nodes: Mapping[str, list[Node]]) -> Iterator[Wire]:
    """Yield the wires that a line stands for: one for each node, none without one of the two."""
    (source, out), (target, into) = (end.split(".") for end in text.split(" -> "))
    starts, ends = nodes.get(source, ()), nodes.get(target, ())
    if len(starts) == len(ends):
        couples = list(zip(starts, ends, strict=True))
    else:
        couples = [(start, end) for start in starts for end in ends]
    for start, end in couples:
        yield make_wire(start, out, end, into)
