"""Action Graphs that are to be written: nodes with values, targets and places, and their wires.

Whoever makes one here has it checked against a release of Isaac Sim: types, ports, values, wires.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import GraphError, SpecError
from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.messages import with_message
from lab3_usd.isaac.node_types import INPUT, NodeType, Port, can_connect
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value, typed_value

CORNER, _STEP = (50.0, 50.0), (350.0, 150.0)  # of the graph editor's canvas, in its units
WIRE = re.compile(r"^(\w+)\.(\w+) -> (\w+)\.(\w+)$")  # as descriptions of graphs write it
_ROLE = re.compile(r"^[A-Za-z_]\w*$")
_PATH = re.compile(r"^(/[A-Za-z_]\w*)+$")
_ALIKE = 0.6
_COMMON_PREFIX = "Ogn"


class Node(Struct, frozen=True):
    """One node of a graph: its name there, its type, and what differs from the type's defaults.

    `values` and `targets` are by full names of inputs, as files have them; `added` are the dynamic
    inputs that are made with it. `place` is where the graph editor shows it.
    """

    role: str
    type: NodeType
    values: Mapping[str, Value] = {}
    targets: Mapping[str, tuple[str, ...]] = {}
    added: tuple[str, ...] = ()
    place: tuple[float, float] = CORNER


class PortRef(Struct, frozen=True):
    """A port of a role; `port` is the full name in a file (`inputs:execIn`)."""

    role: str
    port: str

    @property
    def short(self) -> str:
        """`role.port` as people write it."""
        return f"{self.role}.{self.port.partition(':')[2]}"


class Wire(Struct, frozen=True):
    """A connection from a source port to the input that it feeds."""

    source: PortRef
    target: PortRef

    def __str__(self) -> str:
        """Write the wire as descriptions of graphs do."""
        return f"{self.source.short} -> {self.target.short}"


class Variable(Struct, frozen=True):
    """A variable of a graph: its USD type and the value with which it starts."""

    name: str
    usd_type: str
    value: Value

    @property
    def attribute(self) -> str:
        """The attribute of the graph that holds it."""
        return f"{VARIABLE}{self.name}"


class Graph(Struct, frozen=True):
    """An Action Graph at a path: nodes by role, and wires between them.

    A wire may begin at a role that is not among the nodes: a node that the stage has there already.
    """

    path: str
    nodes: Mapping[str, Node]
    wires: tuple[Wire, ...] = ()
    variables: tuple[Variable, ...] = ()


def checked_path(path: str) -> str:
    """Return the path of a prim.

    Raises:
        GraphError: it is no absolute path.
    """
    if not _PATH.match(path):
        raise GraphError(f"{path!r} is not the absolute path of a prim")
    return path


def checked_role(role: str) -> str:
    """Return the name of a node.

    Raises:
        GraphError: no prim can have it.
    """
    if not _ROLE.match(role):
        raise GraphError(f"'{role}' cannot be the name of a prim")
    return role


def type_named(name: str, platform: Platform) -> NodeType:
    """Return the node type of a name: whole, or its last part where one type has that.

    Raises:
        GraphError: there is no such type, or several have the short name.
    """
    node_type = platform.types.get(name)
    if node_type is not None:
        return node_type
    kinds = [kind for kind in platform.types if "." not in name and _short(kind) == _short(name)]
    if len(kinds) == 1:
        return platform.types[kinds[0]]
    if kinds:
        raise GraphError(f"'{name}' is the short name of several types: {', '.join(sorted(kinds))}")
    near = near_name(name, platform.types if "." in name else map(_short, platform.types))
    raise GraphError(f"'{name}' is not a node type{near}")


def _short(name: str) -> str:
    return name.rpartition(".")[2].removeprefix(_COMMON_PREFIX)


def near_name(name: str, names: Iterable[str]) -> str:
    """Return the end of a sentence that offers the known name that is nearest, '' for none."""
    from difflib import get_close_matches

    near = get_close_matches(name, sorted(set(names)), 1, _ALIKE)
    return f"; did you mean '{near[0]}'?" if near else ""


def graph_node(
    role: str,
    kind: NodeType,
    values: Mapping[str, Any],
    targets: Mapping[str, Iterable[str]] | None = None,
    *,
    added: Iterable[str] = (),
    place: tuple[float, float] = CORNER,
) -> Node:
    """Return a node with values and targets by short names of inputs.

    A node whose ports follow from the message that it names has those of that message.

    Raises:
        GraphError: the name, an input or a value is wrong; the text opens with the input.
    """
    checked_role(role)
    kind = with_message(kind, {INPUT + name: value for name, value in values.items()})
    checked = {INPUT + name: checked_value(input_of(kind, name), values[name]) for name in values}
    aims = {
        INPUT + name: checked_targets(input_of(kind, name), paths)
        for name, paths in (targets or {}).items()
    }
    return Node(role, kind, checked, aims, checked_added(kind, added), place)


def input_of(kind: NodeType, short: str) -> Port:
    """Return an input of a type.

    Raises:
        GraphError: the type has none of this name.
    """
    port = kind.input(short) or (kind.port(INPUT + short) if kind.grows else None)
    if port is None:
        inputs = [name.removeprefix(INPUT) for name in kind.ports if name.startswith(INPUT)]
        raise GraphError(f"{kind.type} has no input '{short}'{near_name(short, inputs)}")
    return port


def checked_value(port: Port, value: Any) -> Value:
    """Return a value as an input takes it.

    Raises:
        GraphError: the input takes no values, or not this one.
    """
    if port.is_execution or port.is_target:
        raise GraphError(f"{port.name}: is not a value, but {port.ogn_type}")
    try:
        checked = typed_value(value, port.usd_type, port.name)
    except SpecError as error:
        raise GraphError(str(error)) from error
    if port.allowed and checked not in port.allowed:
        raise GraphError(f"{port.name} is {value!r}, expected one of {', '.join(port.allowed)}")
    return checked


def checked_targets(port: Port, paths: Iterable[str]) -> tuple[str, ...]:
    """Return the prims that a relationship of a node names.

    Raises:
        GraphError: it is no relationship, or one of them is no path.
    """
    if not port.is_target:
        raise GraphError(f"{port.name}: is {port.ogn_type}, not a relationship")
    try:
        return tuple(checked_path(path) for path in paths)
    except GraphError as error:
        raise GraphError(f"{port.name}: {error}") from error


def checked_added(kind: NodeType, names: Iterable[str]) -> tuple[str, ...]:
    """Return the full names of inputs that are added to a node.

    Raises:
        GraphError: the type has no such input, or every node of it has it.
    """
    ports = [input_of(kind, name) for name in names]
    for port in ports:
        if port.name in kind.ports:
            raise GraphError(f"{port.name}: is on every node, it cannot be added")
    return tuple(port.name for port in ports)


def make_wire(source: Node, out: str, target: Node, into: str) -> Wire:
    """Return the wire from an output, or a constant, to an input, both by their short names.

    Raises:
        GraphError: one of the two is not there, or they carry what cannot be connected.
    """
    start = source.type.source(out)
    if start is None:
        outputs = [p.short for p in source.type.ports.values() if p.is_source]
        raise GraphError(f"{source.type.type} has no output '{out}'{near_name(out, outputs)}")
    end = _wire_end(target, into)
    if not can_connect(start, end):
        raise GraphError(f"{start.ogn_type} cannot be wired to {end.ogn_type}")
    return Wire(PortRef(source.role, start.name), PortRef(target.role, end.name))


def _wire_end(node: Node, short: str) -> Port:
    if node.type.input(short) is None and node.type.source(short) is not None:
        raise GraphError(f"'{short}' of {node.type.type} is an output, a wire ends at an input")
    port = input_of(node.type, short)
    if not node.type.grows and port.name not in (*node.type.ports, *node.added):
        raise GraphError(f"{port.name} does not exist until 'ports' of {node.role} names it")
    return port


def make_graph(path: str, nodes: Iterable[Node], wires: Iterable[Wire] = ()) -> Graph:
    """Return a graph whose nodes are placed in the editor by their wires.

    Raises:
        GraphError: the path is none, two nodes have one name, or two wires end at one input.
    """
    listed, connected = tuple(nodes), tuple(wires)
    for role, count in Counter(node.role for node in listed).items():
        if count > 1:
            raise GraphError(f"{path} has two nodes of the name '{role}'")
    refuse_second_sources(connected)
    places = placed({node.role: node.type for node in listed}, connected)
    by_role = {node.role: replace(node, place=places[node.role]) for node in listed}
    return Graph(checked_path(path), by_role, connected)


def refuse_second_sources(wires: Iterable[Wire]) -> None:
    """Refuse a second wire into one input.

    Raises:
        GraphError: two wires end at one input.
    """
    fed: dict[PortRef, Wire] = {}
    for wire in wires:
        if wire.target in fed:
            raise GraphError(f"wire '{wire}': '{fed[wire.target]}' ends at that input already")
        fed[wire.target] = wire


def placed(roles: Iterable[str], wires: Iterable[Wire]) -> dict[str, tuple[float, float]]:
    """Return a place for each node: a column for each step from those without a wire.

    A cycle of wires ends where it would begin anew.
    """
    columns = dict.fromkeys(roles, 0)
    inner = [w for w in wires if w.source.role in columns and w.target.role in columns]
    for _ in tuple(columns):
        for wire in inner:
            step, target = columns[wire.source.role] + 1, wire.target.role
            columns[target] = min(max(columns[target], step), len(columns) - 1)
    rows: Counter[int] = Counter()
    places = {}
    for role, column in columns.items():
        places[role] = (CORNER[0] + column * _STEP[0], CORNER[1] + rows[column] * _STEP[1])
        rows[column] += 1
    return places
