"""Repairs that rules share: what makes a property of a node right, and what ends its harm."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.check.match.conformance import setting_matches, source_path
from lab3_usd.check.match.subject import GraphSubject, StageSubject
from lab3_usd.check.ros.topics import likely_name
from lab3_usd.model.changes import (
    ClearValue,
    Connect,
    Edit,
    RemovePrim,
    RenameProperty,
    Retarget,
    SetValue,
)
from lab3_usd.model.finding import Severity
from lab3_usd.model.stage import Node, PortState
from lab3_usd.spec.catalog import Catalog, NodeType, Port
from lab3_usd.spec.graph import NodeSpec

TYPE, VERSION = "node:type", "node:typeVersion"


def edits_at(subject: GraphSubject, *properties: str) -> tuple[Edit, ...]:
    """Return what makes properties right, given by their paths, of nodes that play a role."""
    return tuple(edit for path in properties for edit in _site_edits(subject, path))


def _site_edits(subject: GraphSubject, path: str) -> Iterator[Edit]:
    prim, _, name = path.partition(".")
    role, node = subject.roles.role_of.get(prim), subject.live_nodes.get(prim)
    if role is None:
        retyped = subject.roles.retyped.items()
        role = next((role for role, stand_in in retyped if stand_in.path == prim), None)
    if role is not None and node is not None:
        yield from _property_edits(subject, role, node, name)


def edits_in_stage(whole: StageSubject, prim: str, name: str | None) -> tuple[Edit, ...]:
    """Return what makes a property of a node right by every graph in which it plays a role."""
    graphs = whole.graphs if name else ()
    return tuple(edit for subject in graphs for edit in edits_at(subject, f"{prim}.{name}"))


def edits_of_harm(
    whole: StageSubject, prim: str, name: str | None = None, severity: Severity | None = None
) -> tuple[Edit, ...]:
    """Return what ends the harm that a node does: one without a role is removed if it is sure."""
    extra = (node.path for roles in whole.roles.values() for node in roles.extra)
    is_removed = severity in {None, "error"} and prim in extra
    return (RemovePrim(prim),) if is_removed else edits_in_stage(whole, prim, name)


def _property_edits(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[Edit]:
    """Yield what makes one property of a node right; nothing where it is."""
    spec = subject.spec.nodes[role]
    port = spec.type.port(name)
    if name in {TYPE, VERSION}:
        yield from _type_edits(spec, node)
    elif port is None:
        yield from _unknown_port_edits(subject, role, node, name)
    elif port.is_target:
        yield from _target_edits(spec, node, name)
    else:
        yield from _renaming(spec, node, name)
        yield from _wire_edits(subject, role, node, port)
        yield from _value_edits(subject, role, node, port)


def _type_edits(spec: NodeSpec, node: Node) -> Iterator[Edit]:
    if node.type_name != spec.type.type:
        yield SetValue(node.path, TYPE, "token", spec.type.type)
    if node.version != spec.type.version:
        yield SetValue(node.path, VERSION, "int", spec.type.version)


def modern_types(nodes: Iterable[Node], catalog: Catalog) -> Iterator[Edit]:
    """Yield the names that the types of nodes have now, where they are of an earlier release."""
    for node in nodes:
        now = catalog.modern(node.type_name)
        if now != node.type_name:
            yield SetValue(node.path, TYPE, "token", now)


def _unknown_port_edits(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[Edit]:
    """Yield what makes a port right that the type does not have: its name, else no connection."""
    kind = subject.spec.nodes[role].type
    likely = likely_name(name, [*kind.ports])
    if likely is not None and _misspelt(kind, node, likely) == name:
        yield from _property_edits(subject, role, node, likely)
    elif node.sources(name):
        yield Connect(node.path, name, "token")


def _renaming(spec: NodeSpec, node: Node, name: str) -> Iterator[Edit]:
    written = _misspelt(spec.type, node, name)
    if written is not None:
        yield RenameProperty(node.path, written, name)


def _misspelt(kind: NodeType, node: Node, name: str) -> str | None:
    """Return the property that was likely meant to be a port which the node does not have."""
    unknown = [port for port in node.ports if kind.port(port) is None]
    written = likely_name(name, unknown) if name not in node.ports else None
    return written if written and likely_name(written, [*kind.ports]) == name else None


def _target_edits(spec: NodeSpec, node: Node, name: str) -> Iterator[Edit]:
    asked = next((target.prims for target in spec.targets if target.port == name), ())
    if node.targets(name) != asked:
        yield Retarget(node.path, name, asked)


def _wire_edits(subject: GraphSubject, role: str, node: Node, port: Port) -> Iterator[Edit]:
    actual = node.sources(port.name)
    asked = tuple(_sources(subject, role, node, port.name))
    if actual != asked:
        yield Connect(node.path, port.name, port.usd_type, asked)


def _sources(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[str]:
    """Yield what an input should be connected to; an optional connection stays."""
    for wire in (*subject.spec.wires, *subject.spec.optional_wires):
        source = subject.roles.node_of[wire.source.role]
        if (wire.target.role, wire.target.port) == (role, name) and source is not None:
            path = source_path(source, wire)
            if wire in subject.spec.wires or path in node.sources(name):
                yield path


def _value_edits(subject: GraphSubject, role: str, node: Node, port: Port) -> Iterator[Edit]:
    spec, state = subject.spec.nodes[role], node.state(port.name)
    setting = next((each for each in spec.settings if each.port == port.name), None)
    if setting is not None:
        is_typed = state is None or state.usd_type in {"", port.usd_type}
        if not is_typed or not setting_matches(node, setting, node.value(port.name)):
            yield SetValue(node.path, port.name, port.usd_type, setting.value)
    elif state is not None and not _is_left_alone(subject, role, state, port):
        yield ClearValue(node.path, port.name)


def _is_left_alone(subject: GraphSubject, role: str, state: PortState, port: Port) -> bool:
    """Whether an input that the handout does not set has no value of its own, or is connected."""
    is_connected = any(wire.target.port == port.name for wire in subject.spec.wires_into(role))
    return is_connected or state.value is None or state.value == port.default
