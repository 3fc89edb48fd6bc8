"""Loads one graph spec from its YAML file, checked against the platform."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.isaac.node_types import INPUT, NodeType, Port, can_connect
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import is_known_type, typed_value
from lab3_usd.spec.graph import (
    EarlierValues,
    GraphSpec,
    NodeSpec,
    PortRef,
    Setting,
    Target,
    Variable,
    Wire,
)
from lab3_usd.yaml_file import record

_WIRE = re.compile(r"^(\w+)\.(\w+) -> (\w+)\.(\w+)$")
_ROLE = re.compile(r"^[A-Za-z_]\w*$")
_PATH = re.compile(r"^(/[A-Za-z_]\w*)+$")
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
    that must be added, `frames_from` targets that are judged by the TF frames that they give.
    `handout` is that of the graph unless given; a node without `at` is placed by its wires. `set`,
    `targets` and `keep` may name sections: `set: {B3: {domain_id: 0}}`. The checkpoint `from` adds
    a node, with its wires, to a graph that is there already; up to those in `until` it has other
    values.
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

    def named_ports(self) -> Iterator[str]:
        """Yield every input that the entry names, whatever for."""
        for by_section in (self.set, self.targets):
            for name, inner in by_section.items():
                yield from inner if isinstance(inner, dict) else (name,)
        for _, names in _sections(self.keep, ""):
            yield from names
        yield from self.ports
        yield from self.frames_from
        for earlier in self.until.values():
            yield from (*earlier.set, *earlier.targets)


class VariableEntry(Struct, forbid_unknown_fields=True):
    """A variable of the graph: its USD type (`bool`, `double`, `float3`, `token[]`), its value."""

    type: str
    value: Any
    handout: str = ""


class GraphFile(Struct, forbid_unknown_fields=True):
    """An Action Graph. Wires may name sections of the handout: `wires: {B4: [...]}`.

    `variables` are those of the graph, by name: `running: {type: bool, value: true}`. Read Variable
    and Write Variable name them.
    """

    graph: str
    path: str
    handout: str
    nodes: dict[str, NodeEntry]
    wires: _BySection
    optional_wires: _BySection = {}
    forbidden_wires: _BySection = {}
    variables: dict[str, VariableEntry] = {}


def parse_graph(data: Mapping[str, Any], platform: Platform, file: str) -> GraphSpec:
    """Build one graph spec.

    Raises:
        SpecError: names the file, the graph, the role and the port that are wrong.
    """
    content = record(data, GraphFile, file)
    where = f"{file}: {content.graph}"
    section = content.handout
    nodes = {
        _role(role, where): _node(role, entry, platform, where, section)
        for role, entry in content.nodes.items()
    }
    wires = _wires(content.wires, nodes, where, section)
    _check_sources(wires, where)
    places = _places(nodes, wires)
    nodes = {
        role: replace(node, at=content.nodes[role].at or places[role])
        for role, node in nodes.items()
    }
    return GraphSpec(
        name=content.graph,
        path=_path(content.path, f"{where}: path"),
        handout=content.handout,
        nodes=nodes,
        wires=wires,
        optional_wires=_wires(content.optional_wires, nodes, where, section),
        forbidden_wires=_wires(content.forbidden_wires, nodes, where, section),
        variables=tuple(
            _variable(name, entry, where, section) for name, entry in content.variables.items()
        ),
    )


def _variable(name: str, entry: VariableEntry, graph: str, section: str) -> Variable:
    where = f"{graph}: variables: {_role(name, graph)}"
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


def _role(role: str, where: str) -> str:
    if not _ROLE.match(role):
        raise SpecError(f"{where}: '{role}' cannot be the name of a prim")
    return role


_CORNER, _STEP = (50.0, 50.0), (350.0, 150.0)  # of the graph editor's canvas, in its units


def _places(
    nodes: Mapping[str, NodeSpec], wires: tuple[Wire, ...]
) -> dict[str, tuple[float, float]]:
    """Return a place for each node: a column for each step from those that nothing is wired into.

    A ring of wires ends where it would begin anew.
    """
    columns = dict.fromkeys(nodes, 0)
    for _ in nodes:
        for wire in wires:
            source, target = columns[wire.source.role], wire.target.role
            columns[target] = min(max(columns[target], source + 1), len(nodes) - 1)
    rows: Counter[int] = Counter()
    places = {}
    for role, column in columns.items():
        places[role] = (_CORNER[0] + column * _STEP[0], _CORNER[1] + rows[column] * _STEP[1])
        rows[column] += 1
    return places


def _check_sources(wires: tuple[Wire, ...], where: str) -> None:
    """Refuse a second wire into one input: the lab has one source for each."""
    fed: dict[PortRef, Wire] = {}
    for wire in wires:
        if wire.target in fed:
            raise SpecError(
                f"{where}: wire '{wire}': '{fed[wire.target]}' ends at that input already"
            )
        fed[wire.target] = wire


def _path(path: str, where: str) -> str:
    if not _PATH.match(path):
        raise SpecError(f"{where}: {path!r} is not the absolute path of a prim")
    return path


def _node(role: str, entry: NodeEntry, platform: Platform, graph: str, section: str) -> NodeSpec:
    section = entry.handout or section
    where = f"{graph}: {role}"
    node_type = platform.types.get(entry.type)
    if node_type is None:
        raise SpecError(f"{where}: '{entry.type}' is not a node type")
    ports = {short: _input(node_type, short, where) for short in entry.named_ports()}
    _check_uses(entry, ports, node_type, where)
    settings = tuple(_settings(entry.set, ports, where, section))
    targets = tuple(_targets(entry.targets, ports, where, section))
    ports_set = [*(setting.port for setting in settings), *(target.port for target in targets)]
    for port, count in Counter(ports_set).items():
        if count > 1:
            raise SpecError(f"{where}: {port} is set twice")
    return NodeSpec(
        role=role,
        type=node_type,
        at=entry.at or _CORNER,
        handout=section,
        settings=settings,
        targets=targets,
        keep=tuple(
            (INPUT + short, named)
            for named, names in _sections(entry.keep, section)
            for short in names
        ),
        grown=tuple(INPUT + short for short in entry.ports),
        frames_from=tuple(INPUT + short for short in entry.frames_from),
        since=entry.since,
        until={
            checkpoint: EarlierValues(
                tuple(_settings(earlier.set, ports, where, section)),
                tuple(_targets(earlier.targets, ports, where, section)),
            )
            for checkpoint, earlier in entry.until.items()
        },
    )


def _input(node_type: NodeType, short: str, where: str) -> Port:
    port = node_type.input(short)
    if port is None:
        raise SpecError(f"{where}: {node_type.type} has no input '{short}'")
    return port


def _check_uses(
    entry: NodeEntry, ports: Mapping[str, Port], node_type: NodeType, where: str
) -> None:
    """Refuse an added port that every node has, and frames from anything but prims."""
    for short in entry.ports:
        if ports[short].name in node_type.ports:
            raise SpecError(f"{where}: {ports[short].name}: is on every node, it cannot be added")
    for short in entry.frames_from:
        if not ports[short].is_target:
            raise SpecError(
                f"{where}: {ports[short].name}: is not a relationship, it gives no frames"
            )


def _settings(
    values: Mapping[str, Any], ports: Mapping[str, Port], where: str, section: str
) -> Iterator[Setting]:
    for named, short, value in _flat(values, section):
        port = ports[short]
        place = f"{where}: {port.name}"
        if port.is_execution or port.is_target:
            raise SpecError(f"{place}: is no value, but {port.ogn_type}")
        checked = typed_value(value, port.usd_type, place)
        if port.allowed and checked not in port.allowed:
            raise SpecError(f"{place} is {value!r}, expected one of {', '.join(port.allowed)}")
        yield Setting(port.name, checked, named)


def _targets(
    aims: Mapping[str, Any], ports: Mapping[str, Port], where: str, section: str
) -> Iterator[Target]:
    for named, short, prims in _flat(aims, section):
        port = ports[short]
        if not port.is_target:
            raise SpecError(f"{where}: {port.name}: is {port.ogn_type}, not a relationship")
        checked = tuple(_path(path, f"{where}: {port.name}") for path in prims)
        yield Target(port.name, checked, named)


def _wires(
    lines: _BySection, nodes: Mapping[str, NodeSpec], where: str, section: str
) -> tuple[Wire, ...]:
    return tuple(
        _wire(text, named, nodes, where)
        for named, texts in _sections(lines, section)
        for text in texts
    )


def _wire(text: str, section: str, nodes: Mapping[str, NodeSpec], graph: str) -> Wire:
    where = f"{graph}: wire '{text}'"
    match = _WIRE.match(text)
    if match is None:
        raise SpecError(f"{where}: is not written 'role.port -> role.port'")
    for role in (match[1], match[3]):
        if role not in nodes:
            raise SpecError(f"{where}: there is no role '{role}'")
    source = nodes[match[1]].type.source(match[2])
    if source is None:
        raise SpecError(f"{where}: {nodes[match[1]].type.type} has no output '{match[2]}'")
    target = _wire_end(match[3], match[4], nodes, where)
    if not can_connect(source, target):
        raise SpecError(f"{where}: {source.ogn_type} cannot be wired to {target.ogn_type}")
    return Wire(PortRef(match[1], source.name), PortRef(match[3], target.name), section)


def _wire_end(role: str, short: str, nodes: Mapping[str, NodeSpec], where: str) -> Port:
    node_type = nodes[role].type
    target = node_type.input(short)
    if target is None:
        ends_at_output = node_type.source(short) is not None
        what = "is an output, a wire ends at an input" if ends_at_output else "is not there"
        raise SpecError(f"{where}: '{short}' of {node_type.type} {what}")
    if target.name not in (*node_type.ports, *nodes[role].grown):
        raise SpecError(f"{where}: {target.name} does not exist until 'ports' of {role} names it")
    return target
