"""One graph spec out of its YAML file, held against the catalog."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import INPUT, Catalog, NodeType, Port
from lab3_usd.spec.compatible import compatible
from lab3_usd.spec.spec import GraphSpec, NodeSpec, PortRef, Setting, Target, Wire
from lab3_usd.spec.values import typed
from lab3_usd.spec.yaml_file import expect, known_keys, need, parts, texts

_GRAPH_KEYS = ("graph", "path", "handout", "nodes", "wires", "optional_wires", "forbidden_wires")
_NODE_KEYS = ("type", "at", "handout", "set", "targets", "keep", "ports", "frames_from")
_WIRE = re.compile(r"^(\w+)\.(\w+) -> (\w+)\.(\w+)$")
_ROLE = re.compile(r"^[A-Za-z_]\w*$")
_PATH = re.compile(r"^(/[A-Za-z_]\w*)+$")


def parse_graph(data: Mapping[str, Any], catalog: Catalog, file: str) -> GraphSpec:
    """Build one graph spec.

    Raises:
        SpecError: names the file, the graph, the role and the port that are wrong.
    """
    known_keys(data, _GRAPH_KEYS, file)
    name = need(data, "graph", str, file)
    where = f"{file}: {name}"
    nodes = {
        _role(role, where): _node(role, expect(spec, dict, f"{where}: {role}"), catalog, where)
        for role, spec in need(data, "nodes", dict, where).items()
    }
    wires = _wires(need(data, "wires", dict, where), nodes, where)
    _check_sources(wires, where)
    return GraphSpec(
        name=name,
        path=_path(need(data, "path", str, where), f"{where}: path"),
        handout=need(data, "handout", str, where),
        nodes=nodes,
        wires=wires,
        optional_wires=_wires(data.get("optional_wires", {}), nodes, where),
        forbidden_wires=_wires(data.get("forbidden_wires", {}), nodes, where),
    )


def _role(role: str, where: str) -> str:
    if not _ROLE.match(role):
        message = f"{where}: '{role}' cannot be the name of a prim"
        raise SpecError(message)
    return role


def _check_sources(wires: tuple[Wire, ...], where: str) -> None:
    """Refuse a second wire into one input: the lab has one source for each."""
    fed: dict[PortRef, Wire] = {}
    for wire in wires:
        if wire.target in fed:
            message = f"{where}: wire '{wire}': '{fed[wire.target]}' ends at that input already"
            raise SpecError(message)
        fed[wire.target] = wire


def _path(path: Any, where: str) -> str:  # noqa: ANN401
    if not isinstance(path, str) or not _PATH.match(path):
        message = f"{where}: {path!r} is not the absolute path of a prim"
        raise SpecError(message)
    return path


def _node(role: str, spec: Mapping[str, Any], catalog: Catalog, graph: str) -> NodeSpec:
    where = f"{graph}: {role}"
    known_keys(spec, _NODE_KEYS, where)
    type_name = need(spec, "type", str, where)
    node_type = catalog.types.get(type_name)
    if node_type is None:
        message = f"{where}: type '{type_name}' is not in the catalog"
        raise SpecError(message)
    ports = {short: node_type.input(short) for short in _named_ports(spec, where)}
    for short, port in ports.items():
        if port is None:
            message = f"{where}: {type_name} has no input '{short}'"
            raise SpecError(message)
    known = {short: port for short, port in ports.items() if port is not None}
    _check_uses(spec, known, node_type, where)
    return NodeSpec(
        role=role,
        type=node_type,
        at=_position(need(spec, "at", list, where), where),
        handout=need(spec, "handout", str, where),
        settings=tuple(_settings(spec, known, where)),
        targets=tuple(_targets(spec, known, where)),
        keep=tuple(
            (INPUT + short, section)
            for section in parts(spec, "keep", list, where, optional=True)
            for short in spec["keep"][section]
        ),
        grown=tuple(INPUT + short for short in texts(spec, "ports", where, optional=True)),
        frames_from=tuple(
            INPUT + short for short in texts(spec, "frames_from", where, optional=True)
        ),
    )


def _position(at: list[Any], where: str) -> tuple[float, float]:
    pair = typed(at, "float2", f"{where}: 'at'")
    assert isinstance(pair, tuple)  # noqa: S101 - a float2 is a pair
    return float(str(pair[0])), float(str(pair[1]))


def _named_ports(spec: Mapping[str, Any], where: str) -> Iterator[str]:
    """Yield every input that a node's entry names, whatever for."""
    for key in ("set", "targets"):
        for values in parts(spec, key, dict, where, optional=True).values():
            yield from values
    for section in parts(spec, "keep", list, where, optional=True):
        yield from texts(spec["keep"], section, f"{where}: 'keep'")
    yield from texts(spec, "ports", where, optional=True)
    yield from texts(spec, "frames_from", where, optional=True)


def _check_uses(
    spec: Mapping[str, Any], ports: Mapping[str, Port], node_type: NodeType, where: str
) -> None:
    """Refuse an added port that every node has, and frames from anything but prims."""
    for short in texts(spec, "ports", where, optional=True):
        if ports[short].name in node_type.ports:
            message = f"{where}: {ports[short].name}: is on every node, it cannot be added"
            raise SpecError(message)
    for short in texts(spec, "frames_from", where, optional=True):
        if not ports[short].is_target:
            message = f"{where}: {ports[short].name}: is no relationship, it gives no frames"
            raise SpecError(message)


def _settings(spec: Mapping[str, Any], ports: Mapping[str, Port], where: str) -> Iterator[Setting]:
    for section, values in spec.get("set", {}).items():
        for short, value in values.items():
            port = ports[short]
            place = f"{where}: {port.name}"
            if port.is_execution or port.is_target:
                message = f"{place}: is no value, but {port.ogn_type}"
                raise SpecError(message)
            checked = typed(value, port.usd_type, place)
            if port.allowed and checked not in port.allowed:
                message = f"{place} is {value!r}, expected one of {', '.join(port.allowed)}"
                raise SpecError(message)
            yield Setting(port.name, checked, section)


def _targets(spec: Mapping[str, Any], ports: Mapping[str, Port], where: str) -> Iterator[Target]:
    for section, values in spec.get("targets", {}).items():
        for short, prims in values.items():
            port = ports[short]
            if not port.is_target:
                message = f"{where}: {port.name}: is {port.ogn_type}, not a relationship"
                raise SpecError(message)
            paths = expect(prims, list, f"{where}: {port.name}")
            checked = tuple(_path(path, f"{where}: {port.name}") for path in paths)
            yield Target(port.name, checked, section)


def _wires(data: Mapping[str, Any], nodes: Mapping[str, NodeSpec], where: str) -> tuple[Wire, ...]:
    return tuple(
        _wire(text, section, nodes, where)
        for section, texts in expect(data, dict, f"{where}: wires").items()
        for text in expect(texts, list, f"{where}: wires: {section}")
    )


def _wire(text: str, section: str, nodes: Mapping[str, NodeSpec], graph: str) -> Wire:
    where = f"{graph}: wire '{text}'"
    match = _WIRE.match(str(text))
    if match is None:
        message = f"{where}: is not written 'role.port -> role.port'"
        raise SpecError(message)
    for role in (match[1], match[3]):
        if role not in nodes:
            message = f"{where}: there is no role '{role}'"
            raise SpecError(message)
    source = nodes[match[1]].type.source(match[2])
    if source is None:
        message = f"{where}: {nodes[match[1]].type.type} has no output '{match[2]}'"
        raise SpecError(message)
    target = _wire_end(match[3], match[4], nodes, where)
    if not compatible(source, target):
        message = f"{where}: {source.ogn_type} cannot be wired to {target.ogn_type}"
        raise SpecError(message)
    return Wire(PortRef(match[1], source.name), PortRef(match[3], target.name), section)


def _wire_end(role: str, short: str, nodes: Mapping[str, NodeSpec], where: str) -> Port:
    node_type = nodes[role].type
    target = node_type.input(short)
    if target is None:
        ends_at_output = node_type.source(short) is not None
        what = "is an output, a wire ends at an input" if ends_at_output else "is not there"
        message = f"{where}: '{short}' of {node_type.type} {what}"
        raise SpecError(message)
    if target.name not in (*node_type.ports, *nodes[role].grown):
        message = f"{where}: {target.name} is there only once 'ports' of {role} names it"
        raise SpecError(message)
    return target
