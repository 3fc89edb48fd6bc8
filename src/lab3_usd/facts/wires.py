"""The wires of a stage: what is at the source of each, what is wrong with it, and wire cycles."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.reaching_values import Nodes, is_source, live_sources, may_give
from lab3_usd.facts.tree import is_acyclic
from lab3_usd.isaac.node_types import INPUT, Dynamic, NodeType, Port, can_connect, without_role
from lab3_usd.model.stage import Node, StageModel, absence_reason, once_per_stage

Kind = Literal["execution", "data"]
_NONE: frozenset[str] = frozenset()


class Connection(Struct, frozen=True, eq=False):
    """A wire into a node; `source` is None where no live node is there.

    `source_prim` and `source_port` are the parts of `path`, from where the wire comes.
    `has_source` is whether the port there exists, and something can come from it; `is_live`
    whether the ports at both ends exist, whatever their types; `is_compatible` whether their types,
    where they are known, can be joined; `brings_data` whether the input is known to take data,
    whatever the source gives. `kind` is what the wire carries, and `ports` are the ports at both
    ends; both are None where one is not known.
    """

    node: Node
    port: str
    path: str
    source: Node | None
    source_prim: str
    source_port: str
    has_source: bool
    is_live: bool
    is_compatible: bool
    brings_data: bool
    kind: Kind | None
    ports: tuple[Port, Port] | None


@once_per_stage
def connections(stage: StageModel) -> tuple[Connection, ...]:
    """Return every wire into a live node, in the order of nodes and ports."""
    live = live_nodes(stage)
    return tuple(wire for node in live.values() for wire in connections_of(node, live))


@once_per_stage
def fed_inputs(stage: StageModel) -> frozenset[tuple[str, str]]:
    """Return the inputs that a wire from an existing port feeds, each by its node and name."""
    wires = connections(stage)
    return frozenset((wire.node.path, wire.port) for wire in wires if wire.has_source)


def connections_of(node: Node, live: Nodes) -> Iterator[Connection]:
    """Yield every wire into a node, in the order of its ports."""
    for name, state in node.ports.items():
        for path in state.sources:
            yield connection(node, name, path, live)


def connection(node: Node, port: str, path: str, live: Nodes) -> Connection:
    """Return the wire that enters a node at a port and comes from the property at `path`."""
    prim, _, source_port = path.rpartition(".")
    source = live.get(prim)
    if source is not None and source.type is not None and node.type is not None:
        given = _followed_type(source, source_port, live)
        ends = _ends(
            source.type, source_port, node.type, port, given, _element_type(node, port, live)
        )
    else:
        has_source = source is not None and is_source(source, source_port)
        is_live = has_source and node.has_port(port)
        ends = (has_source, is_live, True, _brings_data(node.type, port), None, None)
    return Connection(node, port, path, source, prim, source_port, *ends)


def _brings_data(kind: NodeType | None, name: str) -> bool:
    port = None if kind is None or not kind.is_known_port(name) else kind.port(name)
    return port is not None and not port.is_execution


@lru_cache(maxsize=8192)
def _ends(
    source: NodeType, source_port: str, target: NodeType, port: str, given: str, taken: str
) -> tuple[bool, bool, bool, bool, Kind | None, tuple[Port, Port] | None]:
    """Return what the last fields of a connection say, which the types at its ends tell.

    `given` is the type that the source's output takes from its inputs, `taken` that of an element
    of the array that the target makes; '' where the types of the nodes say it or nothing does.
    """
    start, end, ports = source.port(source_port), target.port(port), None
    has_source = start is not None and may_give(start)
    is_live = has_source and end is not None
    is_known = source.is_known_port(source_port) and target.is_known_port(port)
    if is_known and start is not None and end is not None:
        end = replace(end, ogn_type=taken) if taken else end
        ports = (replace(start, ogn_type=given) if given else start, end)
    kind: Kind | None = None
    if is_live and ports is not None:
        kind = "execution" if ports[1].is_execution else "data"
    is_compatible = ports is None or can_connect(*ports)
    return has_source, is_live, is_compatible, _brings_data(target, port), kind, ports


def _followed_type(node: Node, output: str, live: Nodes, behind: frozenset[str] = _NONE) -> str:
    """Return the type of an output that follows the inputs of its node, '' for another one.

    An array has the type that is set, or its first element's. An output and the only input of its
    node list their types in the same order (Break 3-Vector: a vector gives a number, an array of
    vectors an array of numbers). `behind` are the nodes from which the wires were followed to here.
    """
    kind = node.type
    port = None if kind is None else kind.ports.get(output) or kind.listed(output)
    if kind is None or port is None or not port.is_union:
        return ""
    if kind.dynamic is not None:
        return _array_type(node, kind, kind.dynamic, live, behind)
    if not port.accepts:
        return ""
    inputs = [each for name, each in kind.ports.items() if name.startswith(INPUT) and each.is_union]
    if len(inputs) != 1 or len(inputs[0].accepts) != len(port.accepts):
        return ""
    fed = _fed_type(node, inputs[0].name, live, behind)
    for number, accepted in enumerate(inputs[0].accepts if fed else ()):
        if without_role(accepted) == without_role(fed):
            return port.accepts[number]
    return ""


def _array_type(
    node: Node, kind: NodeType, dynamic: Dynamic, live: Nodes, behind: frozenset[str]
) -> str:
    port = kind.input(dynamic.array)
    if port is None or node.sources(port.name):
        return ""
    value = node.value(port.name)
    if value not in port.allowed:  # which Isaac Sim takes for none
        return ""
    if value != port.default:
        return str(value)
    fed = _fed_type(node, f"{INPUT}{dynamic.prefix}0", live, behind)
    return f"{fed}[]" if fed else ""


def _element_type(node: Node, port: str, live: Nodes) -> str:
    """Return the type of an element of the array that a node makes, '' where it is not set.

    Where no element has it, the type of the array is the wrong one: its other end tells that.
    """
    dynamic = None if node.type is None else node.type.dynamic
    stem = "" if dynamic is None else INPUT + dynamic.prefix
    if node.type is None or dynamic is None or not port.removeprefix(stem).isdecimal():
        return ""
    element = _array_type(node, node.type, dynamic, {}, _NONE).removesuffix("[]")
    inputs = (name for name in node.ports if name.removeprefix(stem).isdecimal())
    return element if element in {_fed_type(node, name, live, _NONE) for name in inputs} else ""


def _fed_type(node: Node, port: str, live: Nodes, behind: frozenset[str]) -> str:
    """Return the type of the only output that is wired to an input, '' where it is not known."""
    sources = live_sources(node, port, live)
    if len(sources) != 1 or node.path in behind:
        return ""
    source, output = sources[0]
    fed = None if source.type is None else source.type.listed(output)
    if fed is None or not fed.is_union:
        return "" if fed is None else fed.ogn_type
    return _followed_type(source, output, live, behind | {node.path})


def why_dead(wire: Connection, stage: StageModel) -> str | None:
    """Say why there is no node at the source of a wire, None if that is unknown."""
    path = wire.source_prim
    if stage.unknown_node(path) or stage.platform.graph.ignores(path):
        return None
    if any(node.path == path for node in stage.orphans):
        return "is outside every graph"
    for graph in stage.graphs:
        if not graph.active and any(node.path == path for node in graph.nodes):
            return f"is in the graph {graph.path}, which is not in the scene"
        for absent in graph.absent:
            if absent.path == path:
                return f"is {absent.reason}"
    return absence_reason(stage, path) if stage.prim(path) is None else "is not a node"


def sublayer_with_source(wire: Connection, stage: StageModel) -> str | None:
    """Return the missing sublayer that could hold the source of a wire, which nothing else has."""
    path = wire.source_prim
    sublayers = (asset.asset for asset in stage.unresolved if asset.kind == "sublayer")
    sublayer = next(sublayers, None)
    if sublayer is None:
        return None
    paths = {node.path for graph in stage.graphs for node in graph.nodes}
    paths |= {prim.path for graph in stage.graphs for prim in graph.absent}
    if path in stage.prims or path in paths or any(node.path == path for node in stage.orphans):
        return None
    return sublayer


def cycle_of(wire: Connection, live: Nodes) -> tuple[str, ...]:
    """Return the nodes that lead from the one where a wire ends to the one where it begins.

    Only wires of its kind count. There are none where it closes no cycle.
    """
    if wire.kind is None:
        return ()
    after: dict[str, str] = {wire.source_prim: ""}
    ahead = [wire.source_prim]
    while ahead and wire.node.path not in after:
        current = ahead.pop(0)
        for other in connections_of(live[current], live):
            if other.kind == wire.kind and other.source_prim not in after:
                after[other.source_prim] = current
                ahead.append(other.source_prim)
    path = wire.node.path if wire.node.path in after else ""
    cycle = []
    while path:
        cycle.append(path)
        path = after[path]
    return tuple(cycle)


def find_cycles(stage: StageModel) -> Iterator[Connection]:
    """Yield a wire of one cycle for each set of nodes that lead to each other."""
    kinds: dict[Kind, list[Connection]] = {"execution": [], "data": []}
    for wire in connections(stage):
        if wire.kind is not None:
            kinds[wire.kind].append(wire)
    for wires in kinds.values():
        if is_acyclic([(wire.source_prim, wire.node.path) for wire in wires]):
            continue
        reported: set[str] = set()
        for wire in wires:
            cycle = () if wire.node.path in reported else cycle_of(wire, live_nodes(stage))
            if cycle and reported.isdisjoint(cycle):
                reported.update(cycle)
                yield wire
