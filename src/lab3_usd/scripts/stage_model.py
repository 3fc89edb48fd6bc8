"""Makes the stage that a script leaves: the same plain data that a file of a stage gives."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from msgspec.structs import replace

from lab3_usd.facts.endpoints import namespaces_above
from lab3_usd.facts.likely_names import likely_name
from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.messages import NAMED, with_named_message
from lab3_usd.isaac.node_types import INPUT, NodeType, Port
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value as PlainValue
from lab3_usd.model.build import Build, Span
from lab3_usd.model.compounds import Compounds, compounds_of, opened_nodes
from lab3_usd.model.prims import NameFilter, Prim, Prims, of_any_name
from lab3_usd.model.stage import (
    GraphModel,
    GraphVariable,
    Node,
    PortState,
    StageModel,
    Unknown,
    UnresolvedAsset,
)
from lab3_usd.scripts.values import (
    External,
    Handles,
    Items,
    Text,
    UnknownValueError,
    Value,
    as_text,
    plain,
)
from lab3_usd.scripts.world import BuiltGraph, BuiltNode, BuiltPort, World

SCENE = "the scene that the script loads"
_REL = "rel"
_NUMBERS = ("bool", "uchar", "int", "uint", "int64", "uint64", "half", "float", "double")
_REALS = ("half", "float", "double")
_TEXTS = ("string", "token")
_STAND_IN = re.compile(r"\{([^{}]*)\}")


class _Overlay(Prims):
    """The prims of a scene, with the graphs that a script adds."""

    def __init__(self, below: Prims, more: Mapping[str, Prim]) -> None:
        super().__init__(more)
        self._below = below

    def __getitem__(self, path: str) -> Prim:
        return self._prims[path] if path in self._prims else self._below[path]

    def __iter__(self) -> Iterator[str]:
        yield from self._below
        yield from (path for path in self._prims if path not in self._below)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def of_type(self, asked: NameFilter) -> Iterable[Prim]:
        return self._below.of_type(asked)

    def with_api(self, asked: NameFilter) -> Iterable[Prim]:
        return self._below.with_api(asked)

    def named(self, asked: NameFilter) -> Iterable[Prim]:
        return self._below.named(asked)

    def below(
        self, top: str, asked: NameFilter = of_any_name, left_out: frozenset[str] = frozenset()
    ) -> Iterable[Prim]:
        return self._below.below(top, asked, left_out)


def modelled(world: World, platform: Platform, scene: StageModel | None) -> StageModel:
    """Return the stage that a script leaves, over a scene or without one.

    Where there is no scene, what prims it has is unknown.
    """
    if scene is None:
        for path in ("/", *sorted(world.outside)):
            world.missing[path] = UnresolvedAsset(path, SCENE, "script")
    graphs = [
        _graph(graph, world, platform)
        for graph in world.graphs.values()
        if graph.is_ours or any(world.nodes_of(graph.path))
    ]
    graphs = _opened(graphs, platform)
    made = [*world.nodes.values(), *world.changed.values()]
    build = Build(
        faults=tuple(world.faults),
        places=dict(_places(world)),
        created=frozenset(_created(world, made)),
        quiet=frozenset(
            (node.path, name) for node in made for name, port in node.ports.items() if port.is_quiet
        ),
    )
    prims = {graph.path: Prim(graph.path, platform.graph.type, ()) for graph in graphs}
    if scene is None:
        return StageModel(
            platform=platform,
            up_axis="Z",
            meters_per_unit=1.0,
            kilograms_per_unit=1.0,
            graphs=tuple(graphs),
            prims=prims,
            unresolved=tuple(world.missing.values()),
            build=build,
        )
    own: dict[str, GraphModel] = {}
    for graph in graphs:
        names = tuple(name for _, name in namespaces_above(graph.path, scene))
        nodes = (replace(node, namespaces=names) for node in graph.nodes)
        own[graph.path] = replace(graph, nodes=tuple(nodes)) if names else graph
    kept = [
        _changed_graph(graph, own.pop(graph.path, None), world)
        for graph in scene.graphs
        if world.has_scene_graph(graph.path)
    ]
    below = scene.prims if isinstance(scene.prims, Prims) else Prims(scene.prims)
    return replace(
        scene,
        graphs=(*kept, *own.values()),
        prims=_Overlay(below, prims),
        unresolved=(*scene.unresolved, *world.missing.values()),
        build=build,
    )


def _opened(graphs: list[GraphModel], platform: Platform) -> list[GraphModel]:
    """Return graphs with the nodes of their compounds.

    A compound stays a node where something is wired to a port that it does not have.
    """
    nodes = {node.path: node for graph in graphs for node in graph.nodes}
    types = {path: node.type_name for path, node in nodes.items()}
    inner = compounds_of([g.path for g in graphs], types, platform.building.compound)
    if not inner:
        return graphs
    fed = {f"{path}.{n}": state.sources for path in inner for n, state in nodes[path].ports.items()}
    compounds = Compounds(inner, fed)
    opened = {node.path: node for node in opened_nodes(nodes.values(), compounds)}
    for node in map(nodes.__getitem__, inner):
        if node.type is not None and any(node.type.port(name) is None for name in node.ports):
            opened[node.path] = node
    by_graph = {graph.path: [node.path for node in graph.nodes] for graph in graphs}
    graph_paths = [*by_graph]
    compounds.move(by_graph)
    return [
        replace(
            graph,
            nodes=tuple(opened[path] for path in by_graph[graph.path] if path in opened),
            inner=compounds.within(graph.path, graph_paths),
        )
        for graph in graphs
        if graph.path in by_graph
    ]


def _created(world: World, made: Iterable[BuiltNode]) -> Iterator[tuple[str, str]]:
    """Yield the ports that a script creates, and those that nodes of its scene have."""
    for scene_node in world.scene.nodes.values():
        yield from ((scene_node.path, name) for name in scene_node.ports)
    for node in made:
        yield from ((node.path, name) for name, port in node.ports.items() if port.is_made)


def _places(world: World) -> Iterator[tuple[tuple[str, str | None, str | None], Span]]:
    for graph in world.graphs.values():
        yield (graph.path, None, None), graph.at
    for node in world.nodes.values():
        yield (node.path, None, None), node.at
    for node in (*world.nodes.values(), *world.changed.values()):
        for name, port in node.ports.items():
            for source, at in port.sources.items():
                yield (node.path, name, source), at
            if port.at is not None or port.sources:
                yield (node.path, name, None), port.at or next(iter(port.sources.values()))


def _graph(graph: BuiltGraph, world: World, platform: Platform) -> GraphModel:
    form = platform.graph.evaluation
    building = platform.building
    attributes: dict[str, PlainValue] = {
        attribute.name: attribute.value for attribute in platform.graph.attributes
    }
    attributes[form.evaluator] = _setting(graph.evaluator, {}, building.evaluator)
    attributes[form.stage] = _setting(
        graph.stage, building.stages, platform.graph.value(form.stage) or ""
    )
    attributes[form.mode] = _setting(
        graph.mode, building.modes, platform.graph.value(form.mode) or ""
    )
    if graph.is_evaluated and attributes[form.stage] in form.on_demand:
        attributes[form.stage] = "evaluated by the script"
    if graph.rest is not None:
        what = f"{graph.rest.why} in line {graph.rest.line}"
        world.missing[graph.path] = UnresolvedAsset(graph.path, what, "script")
    nodes = tuple(
        _node(node, platform, world, is_open=graph.rest is not None)
        for node in world.nodes_of(graph.path)
    )
    variables = dict(_variables(graph, platform))
    for own, variable in variables.items():
        if variable.value is not None:
            attributes[VARIABLE + own] = variable.value
    return GraphModel(graph.path, True, attributes, nodes, variables)  # noqa: FBT003 - is active


def _variables(graph: BuiltGraph, platform: Platform) -> Iterator[tuple[str, GraphVariable]]:
    """Yield the variables of a graph; one whose value is unknown has none."""
    for name, built in graph.variables.items():
        written = built.type.text if isinstance(built.type, Text) else ""
        usd_type = platform.usd_types.get(written, written)
        value = None if built.value is None else _plain_value(built.value, graph.at[0])
        readable = None if isinstance(value, Unknown) else value
        yield (
            name,
            GraphVariable(usd_type, None if readable is None else _as_stored(readable, usd_type)),
        )


def _changed_graph(graph: GraphModel, more: GraphModel | None, world: World) -> GraphModel:
    """Return a graph of the scene with what a script writes into it.

    A dictionary that creates it anew replaces it.
    """
    built = world.graphs.get(graph.path)
    if more is not None and built is not None and built.is_ours:
        return more
    new = {node.path: node for node in (() if more is None else more.nodes)}
    kept = (
        _changed_node(node, world)
        for node in graph.nodes
        if node.path not in new and not world.is_removed(node.path)
    )
    if more is not None:
        graph = replace(
            graph,
            variables={**graph.variables, **more.variables},
            attributes={**more.attributes, **graph.attributes},
        )
    return replace(graph, nodes=(*kept, *new.values()))


def _changed_node(node: Node, world: World) -> Node:
    """Return a node of the scene with the values and wires that a script gives it."""
    built = world.changed.get(node.path)
    if built is None:
        return node
    ports = dict(node.ports)
    for name, port in built.ports.items():
        before, given = node.state(name), _state(name, port, node.type, built, world)
        old = () if before is None or "" in port.cut else before.sources
        sources = dict.fromkeys((*(path for path in old if path not in port.cut), *given.sources))
        is_given = port.value is not None
        ports[name] = replace(
            given if is_given or before is None else before, sources=tuple(sources)
        )
    return replace(node, ports=ports)


def _setting(
    value: str | Unknown | None, names: Mapping[str, str], default: PlainValue
) -> PlainValue:
    if isinstance(value, Unknown):
        return f"{{{value.why}}}"
    return default if value is None else names.get(value, value)


def _node(node: BuiltNode, platform: Platform, world: World, *, is_open: bool) -> Node:
    written = platform.building.compound if node.is_compound else _type_name(node, world)
    name = platform.type_name(written)
    kind = platform.types.get(name)
    if kind is not None and kind.grows_by_message:
        named = (full for full in NAMED if full in node.ports)
        parts = {full: _state(full, node.ports[full], kind, node, world) for full in named}
        kind = with_named_message(kind, parts)
    if kind is not None and node.is_compound:  # whose ports are those that are promoted
        kind = replace(kind, grows={}, is_documented=False)
    made = {
        full: Port(full, "any", "token")
        for full, port in node.ports.items()
        if kind is not None and (port.is_made or full in node.promoted) and kind.port(full) is None
    }
    if kind is not None and made:
        kind = replace(kind, ports={**kind.ports, **made})
    ports = {full: _state(full, port, kind, node, world) for full, port in node.ports.items()}
    ports.update(dict(_meant(ports, kind)))
    return Node(
        path=node.path,
        type_name=name,
        type=kind,
        version=None,
        ports=ports,
        is_local=not is_open,
        written_type="" if written == name else written,
    )


def _type_name(node: BuiltNode, world: World) -> str:
    value = node.type
    if isinstance(value, Text) and value.unknown is None:
        return value.text
    text = as_text(value, node.at).text
    world.unread[value if isinstance(value, Unknown) else Unknown(text.strip("{}"), node.at[0])] = (
        None
    )
    return text


def _meant(
    ports: Mapping[str, PortState], kind: NodeType | None
) -> Iterator[tuple[str, PortState]]:
    """Yield the ports that misspelt ones were likely meant to be, with what these hold."""
    if kind is None:
        return
    for name, state in ports.items():
        if kind.port(name) is None and name.startswith(INPUT):
            inputs = [each for each in kind.ports if each.startswith(INPUT)]
            short = name.partition(":")[2]
            near = likely_name(name, inputs) or likely_name(INPUT + short, inputs)
            if near is not None and near not in ports:
                what = state.value if state.value is not None else Unknown(name, 1)
                is_signal = kind.ports[near].is_execution or bool(state.sources)
                yield (
                    near,
                    PortState(near, "", None if is_signal else what, state.sources, state.targets),
                )


def _state(
    name: str, built: BuiltPort, kind: NodeType | None, node: BuiltNode, world: World
) -> PortState:
    """Return a port with its value or targets and the sources of its wires."""
    sources = tuple(built.sources)
    if built.value is None:
        return PortState(name, sources=sources)
    port = None if kind is None else kind.port(name)
    line = node.at[0] if built.at is None else built.at[0]
    value = built.value
    first = value.items[0] if isinstance(value, Items) and value.items else value
    is_path = isinstance(first, Handles) or (isinstance(first, Text) and first.is_path)
    if port.is_target if port is not None else is_path:
        return PortState(
            name, _REL, targets=tuple(_targets(built.value, line, world)), sources=sources
        )
    plain = _plain_value(value, line)
    if isinstance(plain, Unknown):
        world.unread[plain] = None
        return PortState(name, "", plain, sources)
    usd_type = _usd_type(plain, port)
    if port is not None and usd_type == port.usd_type:
        plain = _as_stored(plain, port.usd_type)
    return PortState(name, usd_type, plain, sources)


def _targets(value: Value, line: int, world: World) -> Iterator[str]:
    """Yield the prims that a value names; one that is unknown has a path that no scene has."""
    items = (
        [*value.items, *([value.rest] if value.rest else [])]
        if isinstance(value, Items)
        else [value]
    )
    for item in items:
        text = as_text(item, (line, 0, line, 0))
        path = text.text if text.text.startswith("/") else f"/{text.text}"
        if text.unknown is not None or isinstance(item, (Unknown, External)):
            what = text.unknown or Unknown(text.text.strip("{}"), line)
            world.unread[Unknown(what.why, line)] = None
            world.missing.setdefault(
                path, UnresolvedAsset(path, f"{what.why} in line {line}", "script")
            )
        yield path


def _plain_value(value: Value, line: int) -> PlainValue | Unknown:
    try:
        plain_value = plain(value)
    except UnknownValueError:
        if isinstance(value, Text):
            stand_in = _STAND_IN.fullmatch(value.text)
            return Unknown(stand_in[1] if stand_in else value.text, line)
        if isinstance(value, Unknown):
            return Unknown(value.why, line)
        if isinstance(value, External):
            return Unknown(value.name, line)
        rest = value.rest if isinstance(value, Items) else None
        return Unknown(rest.why if rest else "...", line)
    return Unknown("...", line) if isinstance(plain_value, dict) else _frozen(plain_value)


def _frozen(value: Any) -> PlainValue:
    if isinstance(value, (list, tuple)):
        return tuple(_frozen(item) for item in value)
    result: PlainValue = value
    return result


def _usd_type(value: PlainValue, port: Port | None) -> str:
    """Return the type that a value has: the port's, except for one that it can surely not hold."""
    if port is None or port.is_union:
        return "token" if isinstance(value, str) else "double"
    if isinstance(value, str) and port.usd_type in _NUMBERS:
        return "string"
    if isinstance(value, (int, float)) and port.usd_type in _TEXTS:
        return (
            "bool" if isinstance(value, bool) else type(value).__name__.replace("float", "double")
        )
    return port.usd_type


def _as_stored(value: PlainValue, usd_type: str) -> PlainValue:
    if isinstance(value, tuple):
        return tuple(_as_stored(item, usd_type.removesuffix("[]").rstrip("234")) for item in value)
    if isinstance(value, int) and usd_type in _REALS:
        return float(value)
    return bool(value) if usd_type == "bool" and isinstance(value, int) else value
