"""Loads one graph spec from its YAML file, checked against the platform."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import GraphError, SpecError
from lab3_usd.isaac.graph import (
    CORNER,
    WIRE,
    checked_added,
    checked_path,
    checked_role,
    checked_targets,
    checked_value,
    input_of,
    make_wire,
    placed,
    refuse_second_sources,
)
from lab3_usd.isaac.messages import with_message
from lab3_usd.isaac.node_types import INPUT, NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import is_known_type, typed_value
from lab3_usd.spec.graph import EarlierValues, GraphSpec, NodeSpec, Setting, Target, Variable, Wire
from lab3_usd.yaml_file import as_record

# By the section of the handout, or all in that of the node or the graph.
_BySection = dict[str, tuple[str, ...]] | tuple[str, ...]
_Targets = dict[str, tuple[str, ...]]


class EarlierEntry(Struct, forbid_unknown_fields=True):
    """What a node has up to a checkpoint, where a later one changes it; `[]` is no target."""

    set: dict[str, Any] = {}
    targets: dict[str, tuple[str, ...]] = {}


class NodeEntry(Struct, forbid_unknown_fields=True, rename={"since": "from"}):
    """A node, by its role.

    `set` are values, `targets` prims, `keep` inputs that stay at their defaults, `ports` inputs
    that must be added. Targets in `frames_from: [targetPrims]` may be others, if checkpoints with
    `frames: true` find the frames that these give. `handout` is that of the graph unless given; a
    node without `at` is placed by its wires. `set`, `targets` and `keep` may name sections: `set:
    {B3: {domain_id: 0}}`. The checkpoint `from` adds a node, with its wires, to a graph that is
    there already; up to those in `until` it has other values. What a `literal: true` constant
    holds may be typed at the inputs that it is wired to, without the node.
    """

    type: str
    at: tuple[float, float] | None = None
    handout: str = ""
    set: dict[str, Any] = {}
    targets: dict[str, _Targets | tuple[str, ...]] = {}
    keep: _BySection = {}
    ports: tuple[str, ...] = ()
    frames_from: tuple[str, ...] = ()
    since: str = ""
    until: dict[str, EarlierEntry] = {}
    literal: bool = False


class VariableEntry(Struct, forbid_unknown_fields=True):
    """A variable of the graph: its USD type (`bool`, `double`, `float3`, `token[]`), its value."""

    type: str
    value: Any
    handout: str = ""


class GraphFile(Struct, forbid_unknown_fields=True):
    """An Action Graph. Wires may name sections of the handout: `wires: {B4: [...]}`.

    `variables` are those of the graph, by name: `running: {type: bool, value: true}`. Read Variable
    and Write Variable name them. `build` puts it at `path`; with `anywhere: true` students choose
    place and name.
    """

    graph: str
    path: str
    handout: str
    nodes: dict[str, NodeEntry]
    wires: _BySection
    optional_wires: _BySection = {}
    forbidden_wires: _BySection = {}
    variables: dict[str, VariableEntry] = {}
    anywhere: bool = False


@contextmanager
def _at(where: str) -> Iterator[None]:
    """Say where in the files a graph is wrong."""
    try:
        yield
    except GraphError as error:
        raise SpecError(f"{where}: {error}") from error


def parse_graph(data: Mapping[str, Any], platform: Platform, file: str) -> GraphSpec:
    """Build one graph spec.

    Raises:
        SpecError: names the file, the graph, the role and the port that are wrong.
    """
    content = as_record(data, GraphFile, file)
    where = f"{file}: {content.graph}"
    section = content.handout
    nodes = {
        role: _node(role, entry, platform, where, section) for role, entry in content.nodes.items()
    }
    wires = _wires(content.wires, nodes, where, section)
    with _at(where):
        refuse_second_sources(wires)
    for wire in wires:  # a literal is typed at the end of its wire
        node = nodes[wire.source.role]
        if node.literal and all(s.port != wire.source.port for s in node.settings):
            wrong = f"literal: {wire.source.port} is not set here, so that nobody can type it"
            raise SpecError(f"{where}: {node.role}: {wrong}")
    with _at(f"{where}: path"):
        path = checked_path(content.path)
    places = placed(nodes, wires)
    nodes = {
        role: replace(node, at=content.nodes[role].at or places[role])
        for role, node in nodes.items()
    }
    return GraphSpec(
        name=content.graph,
        path=path,
        handout=content.handout,
        nodes=nodes,
        wires=wires,
        optional_wires=_wires(content.optional_wires, nodes, where, section),
        forbidden_wires=_wires(content.forbidden_wires, nodes, where, section),
        variables=tuple(
            _variable(name, entry, where, section) for name, entry in content.variables.items()
        ),
        anywhere=content.anywhere,
    )


def _variable(name: str, entry: VariableEntry, graph: str, section: str) -> Variable:
    with _at(graph):
        where = f"{graph}: variables: {checked_role(name)}"
    if not is_known_type(entry.type):
        raise SpecError(f"{where}: '{entry.type}' is not the USD type of a value")
    value = typed_value(entry.value, entry.type, where)
    return Variable(name, entry.type, value, entry.handout or section)


def _sections(names: _BySection, section: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each section with the names that it has; those without are in the one that is given."""
    yield from names.items() if isinstance(names, dict) else ((section, names),)


def _flat(values: Mapping[str, Any], section: str) -> Iterator[tuple[str, str, Any]]:
    """Yield section, name and value: a mapping holds those of the section that is its name."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from ((name, inner, content) for inner, content in value.items())
        else:
            yield section, name, value


def _node(role: str, entry: NodeEntry, platform: Platform, graph: str, section: str) -> NodeSpec:
    section = entry.handout or section
    with _at(graph):
        checked_role(role)
    with _at(f"{graph}: {role}"):
        node_type = platform.types.get(entry.type)
        if node_type is None:
            raise GraphError(f"'{entry.type}' is not a node type")
        written = {INPUT + short: value for _, short, value in _flat(entry.set, section)}
        node_type = with_message(node_type, written)
        added = checked_added(node_type, entry.ports)
        frames_from = [input_of(node_type, short) for short in entry.frames_from]
        for port in frames_from:
            if not port.is_target:
                raise GraphError(f"{port.name}: is not a relationship, it gives no frames")
        settings = tuple(_settings(entry.set, node_type, section))
        targets = tuple(_targets(entry.targets, node_type, section))
        keep = tuple(
            (input_of(node_type, short).name, named)
            for named, names in _sections(entry.keep, section)
            for short in names
        )
        ports_set = [*(setting.port for setting in settings), *(target.port for target in targets)]
        for name, count in Counter(ports_set).items():
            if count > 1:
                raise GraphError(f"{name} is set twice")
        until = {
            checkpoint: EarlierValues(
                tuple(_settings(earlier.set, node_type, section)),
                tuple(_targets(earlier.targets, node_type, section)),
            )
            for checkpoint, earlier in entry.until.items()
        }
    return NodeSpec(
        role=role,
        type=node_type,
        at=entry.at or CORNER,
        handout=section,
        settings=settings,
        targets=targets,
        keep=keep,
        grown=added,
        frames_from=tuple(port.name for port in frames_from),
        since=entry.since,
        until=until,
        literal=entry.literal,
    )


def _settings(values: Mapping[str, Any], kind: NodeType, section: str) -> Iterator[Setting]:
    for named, short, value in _flat(values, section):
        port = input_of(kind, short)
        yield Setting(port.name, checked_value(port, value), named)


def _targets(aims: Mapping[str, Any], kind: NodeType, section: str) -> Iterator[Target]:
    for named, short, prims in _flat(aims, section):
        port = input_of(kind, short)
        yield Target(port.name, checked_targets(port, prims), named)


def _wires(
    lines: _BySection, nodes: Mapping[str, NodeSpec], where: str, section: str
) -> tuple[Wire, ...]:
    wires = []
    for named, texts in _sections(lines, section):
        for text in texts:
            with _at(f"{where}: wire '{text}'"):
                wires.append(_wire(text, named, nodes))
    return tuple(wires)


def _wire(text: str, section: str, nodes: Mapping[str, NodeSpec]) -> Wire:
    match = WIRE.match(text)
    if match is None:
        raise GraphError("is not written 'role.port -> role.port'")
    for role in (match[1], match[3]):
        if role not in nodes:
            raise GraphError(f"there is no role '{role}'")
    source, target = (nodes[role].node for role in (match[1], match[3]))
    wire = make_wire(source, match[2], target, match[4])
    return Wire(wire.source, wire.target, section)
