"""Compares two stages: graphs, scene, topics and frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TypeVar

from msgspec import Struct

from lab3_usd.facts.endpoints import Endpoint, endpoints
from lab3_usd.facts.frames import published_edges
from lab3_usd.isaac.graph_form import GraphForm
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.changes import EDITS, PARTS, StageChange, StageDiff
from lab3_usd.model.finding import display, format_paths, node_title
from lab3_usd.model.stage import GraphModel, Node, StageModel, same_value
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.compare.scenes import metadata_changes, scene_changes
from lab3_usd.stage.read.opening import open_stage, stage_errors
from lab3_usd.stage.read.stage_reader import read_model

_Part = TypeVar("_Part", GraphModel, Node)
_ALIKE = 0.5  # the share of node types that tells a graph under another name


class GraphPair(Struct, frozen=True):
    """A graph before and after; None where there is none.

    `nodes` are its nodes before and after in the same way.
    """

    before: GraphModel | None
    after: GraphModel | None
    nodes: tuple[tuple[Node | None, Node | None], ...]


class StagePairs(Struct, frozen=True, dict=True):
    """The graphs of two stages in pairs, and the new paths of what has another path now."""

    graphs: tuple[GraphPair, ...]
    paths: Mapping[str, str]

    @cached_property
    def is_unmoved(self) -> bool:
        """Whether everything has the path that it had."""
        return all(before == after for before, after in self.paths.items())

    def path(self, before: str) -> str:
        """Return the path in the second stage of what has this path in the first."""
        if before in self.paths:
            return self.paths[before]
        above, _, name = before.rpartition("/")
        return f"{self.path(above)}/{name}" if above else before

    def source(self, before: str) -> str:
        """Return a property path of the first stage as the second names it."""
        prim, _, name = before.rpartition(".")
        return f"{self.path(prim)}.{name}"


def pair_stages(before: StageModel, after: StageModel) -> StagePairs:
    """Find the graphs and nodes of one stage in another."""
    ours, theirs = _active(before), _active(after)
    pairs = list(_paired(ours, theirs, lambda graph: graph.path, _alike_graph))
    moved = {
        was.path: now.path
        for was, now in pairs
        if was is not None and now is not None and was.path != now.path
    }
    graphs = tuple(_graph_pair(was, now, moved) for was, now in pairs)
    pairs_of_nodes = chain.from_iterable(pair.nodes for pair in graphs)
    nodes = {
        was.path: now.path for was, now in pairs_of_nodes if was is not None and now is not None
    }
    return StagePairs(graphs, moved | nodes)


def _active(stage: StageModel) -> list[GraphModel]:
    """Return the graphs that are part of the scene, and the nodes outside of every graph as one."""
    graphs = [graph for graph in stage.graphs if graph.active]
    if stage.orphans:
        graphs.append(GraphModel("", active=True, attributes={}, nodes=stage.orphans))
    return graphs


def _paired(
    before: Iterable[_Part],
    after: Iterable[_Part],
    path_now: Callable[[_Part], str],
    twin_of: Callable[[_Part, Collection[_Part]], _Part | None],
) -> Iterator[tuple[_Part | None, _Part | None]]:
    """Yield parts of two stages in pairs: by their paths, then by what is alike of the others."""
    left = {part.path: part for part in after}
    gone = []
    for part in before:
        if path_now(part) in left:
            yield part, left.pop(path_now(part))
        else:
            gone.append(part)
    for part in gone:
        twin = twin_of(part, left.values())
        yield part, None if twin is None else left.pop(twin.path)
    yield from ((None, part) for part in left.values())


def _alike_graph(graph: GraphModel, others: Collection[GraphModel]) -> GraphModel | None:
    twin = max(others, key=lambda other: _similarity(graph, other), default=None)
    return twin if twin is not None and _similarity(graph, twin) >= _ALIKE else None


def _alike_node(node: Node, others: Collection[Node]) -> Node | None:
    return max(
        (other for other in others if other.type_name == node.type_name),
        key=lambda other: sum(other.state(name) == own for name, own in node.ports.items()),
        default=None,
    )


def _similarity(before: GraphModel, after: GraphModel) -> float:
    """Return the share of node types that two graphs have in common; a name counts as well."""
    types = [{node.type_name for node in graph.nodes} for graph in (before, after)]
    either, both = types[0] | types[1], types[0] & types[1]
    return (len(both) / len(either) if either else 0.0) + (before.name == after.name) * _ALIKE


def _graph_pair(
    before: GraphModel | None, after: GraphModel | None, moved: Mapping[str, str]
) -> GraphPair:
    if before is None or after is None:
        nodes = [(node, None) for node in before.nodes] if before is not None else []
        added = [(None, node) for node in after.nodes] if after is not None else []
        return GraphPair(before, after, (*nodes, *added))
    folder = moved.get(before.path, before.path)

    def path_now(node: Node) -> str:
        return folder + node.path.removeprefix(before.path)

    pairs = _paired(before.nodes, after.nodes, path_now, _alike_node)
    return GraphPair(before, after, tuple(pairs))


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
    unwritten = {attribute.name: attribute.unwritten for attribute in form.attributes}
    for name in sorted({*before.attributes, *after.attributes}):
        was = before.attributes.get(name, unwritten.get(name))
        now = after.attributes.get(name, unwritten.get(name))
        if not same_value(was, now, near_zero=0.0):
            yield StageChange("graph", "changed", after.path, name, display(was), display(now))


def _node_changes(was: Node | None, now: Node | None, pairs: StagePairs) -> Iterator[StageChange]:
    if was is not None and now is not None:
        yield from _itself(was, now, pairs)
        is_same = was.type is now.type and was.version == now.version and was.ports == now.ports
        if is_same and pairs.is_unmoved:  # as of most nodes
            return
        for name in _inputs(was, now):
            yield from _input(was, now, name, pairs)
    elif was is not None:
        yield StageChange("node", "removed", was.path, was=node_title(was))
    elif now is not None:
        yield StageChange("node", "added", now.path, now=node_title(now))
        yield from _new_inputs(now)


def _itself(was: Node, now: Node, pairs: StagePairs) -> Iterator[StageChange]:
    if now.name != was.name:
        folder = pairs.path(was.path.rpartition("/")[0])
        yield StageChange("node", "changed", now.path, "path", f"{folder}/{was.name}", now.path)
    facts = {
        _TYPE: (was.saved_type, now.saved_type),
        _VERSION: (was.version, now.version),
        _NAMESPACE: (was.own_namespace, now.own_namespace),
    }
    for name, (before, after) in facts.items():
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
    sources = {pairs.source(source): None for source in was.sources(name)}
    yield from (
        StageChange("wire", "removed", now.path, name, was=source)
        for source in sources
        if source not in now.sources(name)
    )
    yield from (
        StageChange("wire", "added", now.path, name, now=source)
        for source in now.sources(name)
        if source not in sources
    )
    before, after = was.value(name), now.value(name)
    is_hidden = was.sources(name) and now.sources(name)  # the wires bring the value
    if not is_hidden and not same_value(before, after, near_zero=0.0):
        yield StageChange("value", "changed", now.path, name, display(before), display(after))
    targets = tuple(map(pairs.path, was.targets(name)))
    if sorted(targets) != sorted(now.targets(name)):
        shown = (format_paths(targets), format_paths(now.targets(name)))
        yield StageChange("target", "changed", now.path, name, *shown)


class Comparison(Struct, frozen=True):
    """The differences between two stages, and how their graphs are paired."""

    diff: StageDiff
    pairs: StagePairs


def compare_stages(before: Path, after: Path, lab: Lab) -> Comparison:
    """Compare two stages as they are composed, payloads loaded.

    Raises:
        StageError: one of the files cannot be opened.
    """
    stages = [open_stage(path) for path in (before, after)]
    was, now = (
        read_model(stage, lab.platform, str(path))
        for stage, path in zip(stages, (before, after), strict=True)
    )
    pairs = pair_stages(was, now)
    with stage_errors(f"{before} or {after}"):
        scene = (
            *metadata_changes(stages[0], stages[1]),
            *scene_changes(stages[0], stages[1], lab, pairs.path),
        )
    changes = [
        *graph_changes(pairs, lab.platform.graph),
        *_stage_changes(was, now),
        *scene,
        *_topic_changes(was, now, pairs),
        *_frame_changes(was, now),
    ]
    ordered = sorted(
        changes,
        key=lambda each: (PARTS.index(each.part), each.path, each.property, EDITS.index(each.edit)),
    )
    return Comparison(StageDiff(str(before), str(after), tuple(ordered)), pairs)


def _stage_changes(before: StageModel, after: StageModel) -> Iterator[StageChange]:
    """Yield what differs of the stages as wholes: units, assets that are not found, animation."""
    for name in ("up_axis", "meters_per_unit", "kilograms_per_unit"):
        was, now = getattr(before, name), getattr(after, name)
        if was != now:
            yield StageChange("scene", "changed", "/", name, str(was), str(now))
    absent = [
        {(asset.prim, asset.asset) for asset in stage.unresolved} for stage in (before, after)
    ]
    for prim, asset in absent[0] - absent[1]:
        yield StageChange("scene", "removed", prim, "asset not found", was=asset)
    for prim, asset in absent[1] - absent[0]:
        yield StageChange("scene", "added", prim, "asset not found", now=asset)
    moves = [
        {(attribute.prim, attribute.property): attribute for attribute in stage.moving}
        for stage in (before, after)
    ]
    for key in moves[0].keys() | moves[1].keys():
        values = [move[key].then if key in move else "" for move in moves]
        if values[0] != values[1]:
            yield StageChange("scene", "changed", key[0], f"{key[1]} (animated)", *values)


def _topic_changes(
    before: StageModel, after: StageModel, pairs: StagePairs
) -> Iterator[StageChange]:
    """Yield the topics that came, went or are not what they were."""
    ours = {
        (pairs.path(endpoint.node.path), endpoint.port): endpoint for endpoint in endpoints(before)
    }
    theirs = {(endpoint.node.path, endpoint.port): endpoint for endpoint in endpoints(after)}
    for place, was in ours.items():
        if place not in theirs:
            yield StageChange("topic", "removed", _name(was), was=_words(was))
            continue
        now, old = _facts(theirs[place]), _facts(was)
        for fact in old:
            if old[fact] != now[fact]:
                name = _name(theirs[place])
                yield StageChange("topic", "changed", name, fact, old[fact], now[fact])
    for place, endpoint in theirs.items():
        if place not in ours:
            yield StageChange("topic", "added", _name(endpoint), now=_words(endpoint))


def _name(endpoint: Endpoint) -> str:
    return endpoint.topic or endpoint.written


def _words(endpoint: Endpoint) -> str:
    return f"{endpoint.node.path} {endpoint.direction} {endpoint.type or 'an unknown type'}"


def _facts(endpoint: Endpoint) -> dict[str, str]:
    return {
        "name": _name(endpoint),
        "type": endpoint.type or "unknown",
        "frames": ", ".join(endpoint.frames) or "none",
        "qos": "unknown" if endpoint.qos is None else str(endpoint.qos),
        "rate": endpoint.rate if endpoint.runs else "never",
    }


def _frame_changes(before: StageModel, after: StageModel) -> Iterator[StageChange]:
    """Yield the transforms that came or went, as often as they did."""
    ours, theirs = _transforms(before), _transforms(after)
    for child, words in (ours - theirs).elements():
        yield StageChange("frame", "removed", child, was=words)
    for child, words in (theirs - ours).elements():
        yield StageChange("frame", "added", child, now=words)


def _transforms(stage: StageModel) -> Counter[tuple[str, str]]:
    edges = published_edges(stage)
    return Counter((edge.child, f"{edge.parent} -> {edge.child} on {edge.topic}") for edge in edges)
