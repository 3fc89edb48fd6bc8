"""What differs between the graphs of two stages: graphs, nodes, values, wires and targets."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lab3_usd.diff.pairs import GraphPair, StagePairs
from lab3_usd.model.changes import StageChange
from lab3_usd.model.formatting import display, format_paths, node_title
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.catalog import INPUT, Value
from lab3_usd.spec.graph_form import GraphForm

_PRECISION = 1e-6  # of a number that a file holds in single precision
_TYPE, _VERSION, _NAMESPACE = "node:type", "node:typeVersion", "isaac:namespace"


def graph_changes(pairs: StagePairs, form: GraphForm) -> Iterator[StageChange]:
    """Yield the changes graph by graph; of a graph that came or went, one."""
    for pair in pairs.graphs:
        if pair.before is None or pair.after is None:
            yield from _whole_graph(pair)
            continue
        yield from _attributes(pair.before, pair.after, form)
        for was, now in pair.nodes:
            yield from _node_changes(was, now, pairs)


def _whole_graph(pair: GraphPair) -> Iterator[StageChange]:
    if pair.after is not None:
        yield StageChange("graph", "added", pair.after.path, now=_counted(pair.after))
    elif pair.before is not None:
        yield StageChange("graph", "removed", pair.before.path, was=_counted(pair.before))


def _counted(graph: GraphModel) -> str:
    wires = sum(len(port.sources) for node in graph.nodes for port in node.ports.values())
    return f"{len(graph.nodes)} nodes, {wires} wires"


def _attributes(before: GraphModel, after: GraphModel, form: GraphForm) -> Iterator[StageChange]:
    if before.path != after.path:
        yield StageChange("graph", "changed", after.path, "path", before.path, after.path)
    unwritten = {each.name: each.unwritten for each in form.attributes}
    for name in sorted({*before.attributes, *after.attributes}):
        was = before.attributes.get(name, unwritten.get(name))
        now = after.attributes.get(name, unwritten.get(name))
        if not same_plain_value(was, now):
            yield StageChange("graph", "changed", after.path, name, display(was), display(now))


def _node_changes(was: Node | None, now: Node | None, pairs: StagePairs) -> Iterator[StageChange]:
    if was is not None and now is not None:
        yield from _itself(was, now, pairs)
        for name in _inputs(was, now):
            yield from _input(was, now, name, pairs)
    elif was is not None:
        yield StageChange("node", "removed", was.path, was=node_title(was))
    elif now is not None:
        yield StageChange("node", "added", now.path, now=node_title(now))
        yield from _new_inputs(now)


def _itself(was: Node, now: Node, pairs: StagePairs) -> Iterator[StageChange]:
    if now.name != was.name:
        yield StageChange("node", "changed", now.path, "path", pairs.path(was.path), now.path)
    told = {
        _TYPE: (was.type_name, now.type_name),
        _VERSION: (was.version, now.version),
        _NAMESPACE: (was.own_namespace, now.own_namespace),
    }
    for name, (before, after) in told.items():
        if before != after:
            yield StageChange("node", "changed", now.path, name, display(before), display(after))


def _inputs(*nodes: Node) -> list[str]:
    names = {name for node in nodes for name in node.ports if name.startswith(INPUT)}
    return sorted(names)


def _new_inputs(node: Node) -> Iterator[StageChange]:
    for name in _inputs(node):
        state = node.ports[name]
        if state.value is not None and not state.sources:
            yield StageChange("value", "added", node.path, name, now=display(state.value))
        for source in state.sources:
            yield StageChange("wire", "added", node.path, name, now=source)
        if state.targets:
            yield StageChange("target", "added", node.path, name, now=format_paths(state.targets))


def _input(was: Node, now: Node, name: str, pairs: StagePairs) -> Iterator[StageChange]:
    sources = {pairs.source(each): None for each in was.sources(name)}
    yield from (
        StageChange("wire", "removed", now.path, name, was=each)
        for each in sources
        if each not in now.sources(name)
    )
    yield from (
        StageChange("wire", "added", now.path, name, now=each)
        for each in now.sources(name)
        if each not in sources
    )
    before, after = was.value(name), now.value(name)
    is_hidden = was.sources(name) and now.sources(name)  # the wires bring the value
    if not is_hidden and not same_plain_value(before, after):
        yield StageChange("value", "changed", now.path, name, display(before), display(after))
    targets = tuple(map(pairs.path, was.targets(name)))
    if sorted(targets) != sorted(now.targets(name)):
        shown = (format_paths(targets), format_paths(now.targets(name)))
        yield StageChange("target", "changed", now.path, name, *shown)


def same_plain_value(was: Value | None, now: Value | None) -> bool:
    """Whether two values are the same up to single precision."""
    if isinstance(was, tuple) and isinstance(now, tuple):
        return len(was) == len(now) and all(map(same_plain_value, was, now))
    if isinstance(was, bool) or isinstance(now, bool):
        return was is now
    if isinstance(was, (int, float)) and isinstance(now, (int, float)):
        return was == now or math.isclose(was, now, rel_tol=_PRECISION)
    return was == now
