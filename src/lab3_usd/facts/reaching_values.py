"""What reaches an input: over wires that are taken, and through nodes that compute it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache

from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType, Port, drops_wire
from lab3_usd.isaac.pure_nodes import (
    PURE_NODES,
    NoOutputError,
    absorbing,
    last_part,
    makes_text,
    term_names,
)
from lab3_usd.isaac.values import Value
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import Node

Nodes = Mapping[str, Node]
Variables = Mapping[str, Mapping[str, Value]]
Sources = tuple[tuple[Node, str], ...]


class LiveNodes(dict[str, Node]):
    """Live nodes of a stage by path, and which feed their inputs or trigger them, found once."""

    __slots__ = ("fed", "triggers", "variables")

    def __init__(self, nodes: Iterable[Node], variables: Variables) -> None:
        """Take all live nodes of a stage, or some, and the variables of its graphs."""
        super().__init__((node.path, node) for node in nodes)
        self.variables = variables
        self.fed: dict[tuple[Node, str], Sources] = {}
        self.triggers: dict[Node, Sources] = {}


def live_sources(node: Node, port: str, live: Nodes) -> Sources:
    """Return the nodes and ports that really feed an input: what the application drops does not.

    It drops dead wires, those to ports that a type does not have, and those between types that do
    not convert. Of a wire that it may take, nothing is left out.
    """
    state = node.ports.get(port)
    if state is None or not state.sources:
        return ()
    fed = live.fed if type(live) is LiveNodes else {}
    if (sources := fed.get((node, port))) is not None:
        return sources
    ends = []
    for path in state.sources:
        prim, _, source_port = path.rpartition(".")
        source = live.get(prim)
        if source is not None and is_taken(source, source_port, node, port):
            ends.append((source, source_port))
    fed[node, port] = sources = tuple(ends)
    return sources


def is_taken(source: Node, source_port: str, node: Node, port: str) -> bool:
    """Whether the application may take a wire between two nodes that are there."""
    if source.type is not None and node.type is not None:
        return _is_taken(source.type, source_port, node.type, port)
    return is_source(source, source_port) and node.has_port(port)


@lru_cache(maxsize=8192)
def _is_taken(source: NodeType, source_port: str, target: NodeType, port: str) -> bool:
    start, end = source.port(source_port), target.port(port)
    if start is None or end is None or not may_give(start):
        return False
    is_known = source.is_known_port(source_port) and target.is_known_port(port)
    return not (is_known and drops_wire(start, end))


def is_source(node: Node, port: str) -> bool:
    """Whether a wire can leave from a port of a node.

    From an input, as every constant has one, a wire brings the value there, but no signal.
    """
    if not node.has_port(port):
        return False
    declared = None if node.type is None else node.type.port(port)
    return declared is None or may_give(declared)


def may_give(port: Port) -> bool:
    """Whether a wire can leave from a port: an output, or an input that holds data."""
    if port.is_source:
        return True
    return port.name.startswith(INPUT) and not port.is_execution and not port.is_target


def effective_value(node: Node, port: str, live: Nodes, depth: int = 8) -> Value | None:
    """Return the value that reaches an input; None where a wire brings an unknown one.

    A wire from an input of another node, as every constant has it, brings the value there. `depth`
    ends the search where inputs feed each other in a ring.
    """
    state = node.ports.get(port)
    if state is None or not state.sources:
        return node.value(port)
    wired = live_sources(node, port, live)
    if not wired:
        return node.value(port)
    source, source_port = wired[0]
    if len(wired) > 1 or not depth:
        return None
    if source_port.startswith(INPUT):
        return effective_value(source, source_port, live, depth - 1)
    return _given(source, source_port, live, depth - 1)


class _UnknownError(Exception):
    """What reaches an input is unknown."""


def _given(node: Node, output: str, live: Nodes, depth: int) -> Value | None:
    """Return the value that a node gives at an output, None where it is unknown."""
    if node.type is None:
        return None
    if node.type.variable:
        return _variable(node, node.type, live, depth)
    name = last_part(node.type.type)
    function = PURE_NODES.get(name)
    if function is None:
        return None
    is_text = makes_text(name)

    def read(short: str) -> Value:
        value = listed_value(node, INPUT + short, live, depth)
        if value is None or (is_text and type(value) not in (str, int)):
            raise _UnknownError
        return value

    names = {port.removeprefix(INPUT) for port in node.ports if port.startswith(INPUT)}
    try:
        value: Value | None = function(read, names).get(output.removeprefix(OUTPUT))
    except NoOutputError:
        return None
    except _UnknownError:
        terms = (effective_value(node, INPUT + t, live, depth) for t in term_names(names))
        return absorbing(name, terms)
    return value


def _variable(node: Node, kind: NodeType, live: Nodes, depth: int) -> Value | None:
    """Return the value of a variable that no node sets, None for another one."""
    name, graph, path = (*kind.variable, "", "")[:3]
    if type(live) is not LiveNodes or not graph or node.sources(path) or node.value(path):
        return None
    around = (above for above in upwards(node.path) if above in live.variables)
    own = live.variables.get(next(iter(node.targets(graph)), next(around, "")), {})
    return own.get(f"{VARIABLE}{effective_value(node, name, live, depth)}")


def listed_value(node: Node, port: str, live: Nodes, depth: int = 8) -> Value | None:
    """Return the value that reaches an input, also as a node makes it of numbered inputs."""
    made = live_sources(node, port, live)
    maker = made[0][0] if len(made) == 1 else node
    dynamic = None if maker is node or maker.type is None else maker.type.dynamic
    if dynamic is None:
        return effective_value(node, port, live, depth)
    count = effective_value(maker, INPUT + dynamic.count, live, depth) if depth else None
    if not isinstance(count, int):
        return None  # how many they are comes over a wire
    names = [f"{INPUT}{dynamic.prefix}{number}" for number in range(min(count, len(maker.ports)))]
    items = [effective_value(maker, name, live, depth - 1) for name in names]
    return None if None in items else tuple(item for item in items if item is not None)
