"""What is wrong with the nodes and wires of one graph: each fault once, best explained.

A missing or retyped node silences the wires that touch it: the node's own finding speaks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct, field

from lab3_usd.check.match.conformance import is_fed, source_path, source_paths
from lab3_usd.check.match.rule_inputs import GraphSubject, Kind, Roles, WireFault
from lab3_usd.facts.wires import Connection, connection, cycle_of
from lab3_usd.model.stage import (
    ELSEWHERE,
    OUTSIDE,
    AbsentPrim,
    Node,
    StageModel,
    nodes_outside_graphs,
)
from lab3_usd.spec.graph import GraphSpec, NodeSpec, Wire


def missing_roles(spec: GraphSpec, roles: Roles) -> list[NodeSpec]:
    """Return the roles that no node plays and no node of another type stands in for."""
    if roles.graph is None:
        return []
    return [
        node
        for role, node in spec.nodes.items()
        if roles.node_of[role] is None and role not in roles.retyped
    ]


def absent_nodes(spec: GraphSpec, roles: Roles, stage: StageModel) -> dict[str, AbsentPrim]:
    """Pair missing roles with prims of their type that are in the file but not in the graph.

    A prim that is named like a role is that role's before it may be another's.
    """
    outside = (
        AbsentPrim(node.path, node.type_name, OUTSIDE) for node in nodes_outside_graphs(stage)
    )
    offers = [*(() if roles.graph is None else roles.graph.absent), *outside]
    absent: dict[str, AbsentPrim] = {}
    for must_be_named in (True, False):
        for role in missing_roles(spec, roles):
            for offer in offers if role.role not in absent else ():
                is_named = offer.path.endswith(f"/{role.role}")
                fits = stage.platform.get(offer.type_name) is role.type
                if fits and (is_named or not must_be_named):
                    absent[role.role] = offer
                    offers.remove(offer)
                    break
    return absent


def in_another_graph(spec: NodeSpec, subject: GraphSubject) -> AbsentPrim | None:
    """Return the only node of a type that is in another graph, and that no other role asks for."""
    roles = [node for graph in subject.lab.graphs.values() for node in graph.nodes.values()]
    candidates = [
        node
        for graph in subject.stage.graphs
        for node in (() if graph is subject.roles.graph else graph.nodes)
        if node.type is spec.type
    ]
    if len(candidates) != 1 or sum(role.type is spec.type for role in roles) != 1:
        return None
    return AbsentPrim(candidates[0].path, candidates[0].type_name, ELSEWHERE)


class _Work(Struct):
    """The graph under diagnosis, and the connections that one fault has: no other has them."""

    spec: GraphSpec
    roles: Roles
    live_nodes: Mapping[str, Node]
    taken: set[tuple[str, str, str]] = field(default_factory=set)


def faulty_wires(spec: GraphSpec, roles: Roles, live: Mapping[str, Node]) -> tuple[WireFault, ...]:
    """Return every faulty wire of a graph; `live` holds the live nodes of the stage by path."""
    work = _Work(spec, roles, live)
    wires, open_wires, shared = list[Wire](), list[Wire](), list[Wire]()
    for wire in spec.wires:
        source, target = roles.node_of[wire.source.role], roles.node_of[wire.target.role]
        if source is None or target is None:
            continue
        wires.append(wire)
        if not is_fed(source, target, wire, roles.equivalents):
            open_wires.append(wire)
        elif len(target.sources(wire.target.port)) > 1:
            shared.append(wire)
    faults = [*_forbidden(work, wires), *_swaps(work, open_wires)]
    wrong = [fault for wire in open_wires for fault in _wrong(work, wire)]
    faults += wrong
    faulty = {fault.wire for fault in wrong}
    unfed = [wire for wire in open_wires if wire not in faulty]
    # A wire that strayed on its own node explains that node's input before any other.
    for wire in unfed:
        _, target = _ends(work, wire)
        strayed = None if target.sources(wire.target.port) else _moved(work, wire, [target])
        if strayed is not None:
            faulty.add(wire)
            faults.append(strayed)
    faults += [_unfed(work, wire) for wire in unfed if wire not in faulty]
    faults += [fault for wire in shared for fault in _seconds(work, wire)]
    faults += _unasked(work)
    return tuple(faults)


def _has_both_ends(work: _Work, wire: Wire) -> bool:
    node_of = work.roles.node_of
    return node_of[wire.source.role] is not None and node_of[wire.target.role] is not None


def _ends(work: _Work, wire: Wire) -> tuple[Node, Node]:
    source, target = work.roles.node_of[wire.source.role], work.roles.node_of[wire.target.role]
    assert source is not None  # noqa: S101 - only wires with both ends come here
    assert target is not None  # noqa: S101
    return source, target


def _accepted(work: _Work, wire: Wire) -> list[str]:
    """Return the property paths that may feed a wire: the role's node and its stand-ins."""
    source, _ = _ends(work, wire)
    return source_paths(source, wire, work.roles.equivalents)


def _forbidden(work: _Work, wires: list[Wire]) -> Iterator[WireFault]:
    """Find the wires that the handout forbids, whatever else feeds the input."""
    for wire in work.spec.forbidden_wires:
        source, target = (work.roles.node_of[end.role] for end in (wire.source, wire.target))
        if source is None or target is None:
            continue
        port, actual = wire.target.port, source_path(source, wire)
        if actual not in target.sources(port):
            continue
        work.taken.add((target.path, port, actual))
        instead = [demand for demand in wires if demand.target == wire.target]
        expected = _accepted(work, instead[0])[0] if instead else None
        yield WireFault("forbidden", target, port, expected, actual, [*instead, wire][0])


def _swaps(work: _Work, open_wires: list[Wire]) -> Iterator[WireFault]:
    """Find pairs of inputs that are fed by each other's source."""
    wires: set[Wire] = set()
    for index, first in enumerate(open_wires):
        for second in open_wires[index + 1 :]:
            if first in wires or second in wires or first.source == second.source:
                continue
            if _feeds(work, second, first) and _feeds(work, first, second):
                wires |= {first, second}
                _, target = _ends(work, first)
                _, second_target = _ends(work, second)
                yield WireFault(
                    "swapped", target, first.target.port,
                    _accepted(work, first)[0], _accepted(work, second)[0], first,
                    f"{second_target.path}.{second.target.port}",
                )  # fmt: skip


def _feeds(work: _Work, source_of: Wire, into: Wire) -> bool:
    """Whether the input of wire `into` is fed by the source of the other wire."""
    _, target = _ends(work, into)
    actual = target.sources(into.target.port)
    return any(path in actual for path in _accepted(work, source_of))


def _wrong(work: _Work, wire: Wire) -> Iterator[WireFault]:
    """Explain an input that is fed, but by something else."""
    source, target = _ends(work, wire)
    port = wire.target.port
    actual = next(
        (path for path in target.sources(port) if _wire(work, target, port, path).has_source), None
    )
    if actual is not None:
        path, expected = actual.rpartition(".")[0], _accepted(work, wire)[0]
        inside = () if work.roles.graph is None else [node.path for node in work.roles.graph.nodes]
        passed = _passed_by(work, wire, actual)
        if path != source.path and work.roles.graph is not None and path not in inside:
            yield WireFault("foreign", target, port, expected, actual, wire)
        elif passed is not None:
            yield WireFault("bypass", target, port, expected, actual, wire, passed or None)
        else:
            yield WireFault("wrong", target, port, expected, actual, wire)


def _passed_by(work: _Work, wire: Wire, actual: str) -> str | None:
    """Return the unconnected input of the earlier node that this wire bypasses.

    '' if that input is connected after all, None if the wire bypasses no node.
    """
    for earlier in work.spec.wires_into(wire.source.role):
        if _has_both_ends(work, earlier) and actual in _accepted(work, earlier):
            source, node = _ends(work, earlier)
            is_there = is_fed(source, node, earlier, work.roles.equivalents)
            return "" if is_there else f"{node.path}.{earlier.target.port}"
    return None


def _unfed(work: _Work, wire: Wire) -> WireFault:
    """Explain an input that nothing live feeds: wired elsewhere, from nothing, or not at all."""
    _, target = _ends(work, wire)
    port, expected = wire.target.port, _accepted(work, wire)[0]
    dead = target.sources(port)
    if dead:
        return WireFault("dead", target, port, expected, dead[0], wire)
    matched = [node for node in work.roles.node_of.values() if node is not None]
    moved = _moved(work, wire, matched)
    return moved or WireFault("missing", target, port, expected, None, wire)


def _moved(work: _Work, wire: Wire, nodes: list[Node]) -> WireFault | None:
    """Find an input of these nodes that the wire goes into instead."""
    _, target = _ends(work, wire)
    expected = _accepted(work, wire)
    for node in nodes:
        for port, state in sorted(node.ports.items()):
            for source in state.sources:
                is_known = source not in expected or (node.path, port, source) in work.taken
                if is_known or _is_asked(work, node, port, source):
                    continue
                work.taken.add((node.path, port, source))
                elsewhere = f"{node.path}.{port}"
                return WireFault(
                    "moved", target, wire.target.port, expected[0], None, wire, elsewhere
                )
    return None


def _is_asked(work: _Work, node: Node, port: str, source: str) -> bool:
    """Whether some wire of the spec, required or optional, is exactly this connection."""
    for wire in (*work.spec.wires, *work.spec.optional_wires):
        if wire.target.port != port or work.roles.node_of[wire.target.role] is not node:
            continue
        if _has_both_ends(work, wire) and source in _accepted(work, wire):
            return True
    return False


def _seconds(work: _Work, wire: Wire) -> Iterator[WireFault]:
    """Find further sources on an input that has its right one."""
    _, target = _ends(work, wire)
    port = wire.target.port
    accepted = _accepted(work, wire)
    # A node with the same settings may take the first one's place, not stand beside it.
    right = next(path for path in accepted if path in target.sources(port))
    for actual in target.sources(port):
        if actual == right or (target.path, port, actual) in work.taken:
            continue
        work.taken.add((target.path, port, actual))
        kind = _needless_kind(work, target, port, actual) or "second"
        yield WireFault(kind, target, port, accepted[0], actual, wire)


def _needless_kind(work: _Work, node: Node, port: str, source: str) -> Kind | None:
    wire = _wire(work, node, port, source)
    if not wire.has_source:
        return "leftover"
    if not wire.is_compatible:
        return "incompatible"
    is_cycle = wire.kind == "execution" and cycle_of(wire, work.live_nodes)
    return "cycle" if is_cycle else None


def _wire(work: _Work, node: Node, port: str, source: str) -> Connection:
    return connection(node, port, source, work.live_nodes)


def _unasked(work: _Work) -> Iterator[WireFault]:
    """Find wires into inputs that the handout leaves alone."""
    inputs = work.spec.wired_inputs
    for role, node in work.roles.node_of.items():
        if node is None:
            continue
        free = [
            name
            for name, state in node.ports.items()
            if state.sources and (role, name) not in inputs and name.startswith("inputs:")
        ]
        for port in sorted(free):
            for source in node.sources(port):
                if (node.path, port, source) in work.taken:
                    continue
                if not _is_asked(work, node, port, source):
                    kind = _needless_kind(work, node, port, source) or "unasked"
                    yield WireFault(kind, node, port, None, source)
