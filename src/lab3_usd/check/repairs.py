"""How to repair what rules found: a finding and the spec give the edits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.check.match.conformance import setting_matches, source_path
from lab3_usd.check.match.subject import GraphSubject
from lab3_usd.check.ros.topics import likely_name
from lab3_usd.check.tf.targets import NAME_OVERRIDE
from lab3_usd.model.changes import (
    Activate,
    AddGraph,
    AddNode,
    ClearValue,
    Connect,
    Edit,
    MovePrim,
    RemovePrim,
    RenameProperty,
    Retarget,
    SetValue,
    repair_by,
)
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import DEACTIVATED, OVER, Node, PortState
from lab3_usd.spec.catalog import Catalog, NodeType, Port
from lab3_usd.spec.graph import NodeSpec

TYPE, VERSION = "node:type", "node:typeVersion"


def property_edits(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[Edit]:
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
        yield from property_edits(subject, role, node, likely)
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


_GRAPH_PLACE = "G02"
_GRAPH_KIND = "G03"
_NAMESPACE = "P10"
_OLD_TYPES = "N06"
_MISSING_GRAPH = "G01"
_MISSING_NODE = "N01"
_UNWANTED = ("G04", "N02", "N07", "N08", "N09", "N12")


def with_repairs(
    findings: Iterable[Finding], subjects: Sequence[GraphSubject]
) -> Iterator[Finding]:
    """Yield the findings, those that have one right repair together with it."""
    for finding in findings:
        is_open = finding.severity != "note" and finding.fix is None
        edits = tuple(_edits(finding, subjects)) if is_open else ()
        yield replace(finding, fix=repair_by(edits)) if edits else finding


def _edits(finding: Finding, subjects: Sequence[GraphSubject]) -> Iterator[Edit]:
    if finding.rule in _UNWANTED or _is_of_extra_node(finding, subjects):
        yield RemovePrim(finding.prim)
    elif finding.rule == _GRAPH_PLACE:
        yield from _move(finding)
    elif finding.rule == _NAMESPACE or finding.property == NAME_OVERRIDE:
        yield ClearValue(finding.prim, finding.property or "")
    else:
        for subject in subjects:
            yield from _graph_edits(finding, subject)


def _is_of_extra_node(finding: Finding, subjects: Sequence[GraphSubject]) -> bool:
    """Whether an error tells what harm a node does that plays no role in the lab."""
    return finding.severity == "error" and any(
        node.path == finding.prim for subject in subjects for node in subject.roles.extra
    )


def _move(finding: Finding) -> Iterator[Edit]:
    if finding.expected is not None and finding.expected != finding.prim:
        yield MovePrim(finding.prim, finding.expected)


def _graph_edits(finding: Finding, subject: GraphSubject) -> Iterator[Edit]:
    graph, spec = subject.roles.graph, subject.spec
    if finding.rule == _MISSING_GRAPH and finding.prim == spec.path:
        yield from _missing_graph_edits(subject)
    elif graph is not None and finding.prim == graph.path:
        if finding.rule == _GRAPH_KIND:
            yield from _kind_edits(finding, subject)
        if finding.rule == _OLD_TYPES:
            yield from modern_types(graph.nodes, subject.lab.catalog)
        if finding.rule == _MISSING_NODE:
            yield from _node_edits(finding, subject)
    else:
        for site in _sites(finding):
            yield from _site_edits(site, subject)


def _missing_graph_edits(subject: GraphSubject) -> Iterator[Edit]:
    """Yield how to get a graph back; a prim of another kind at its path stays."""
    path = subject.spec.path
    there = subject.stage.prims.get(path)
    if there is None:
        yield AddGraph(path, subject.spec.name)
    elif not there.present:
        yield Activate(path)


def _kind_edits(finding: Finding, subject: GraphSubject) -> Iterator[Edit]:
    for attribute in subject.lab.catalog.graph.attributes:
        if attribute.name == finding.property:
            yield SetValue(finding.prim, attribute.name, attribute.usd_type, attribute.value)


def _node_edits(finding: Finding, subject: GraphSubject) -> Iterator[Edit]:
    """Yield how to get a missing node: one that is in the file is activated."""
    for role, spec in subject.spec.nodes.items():
        if f"({role}) is missing" not in finding.message or spec.type.type != finding.expected:
            continue
        if any(f" is {each}" in finding.message for each in (DEACTIVATED, OVER)):
            yield Activate(finding.related[0])
        elif not finding.related:
            yield AddNode(f"{finding.prim}/{role}", subject.spec.name, role)


def _sites(finding: Finding) -> Iterator[tuple[str, str]]:
    """Yield the properties that a finding names."""
    if finding.property:
        yield finding.prim, finding.property
    for each in finding.related:
        prim, dot, name = each.partition(".")
        if dot:
            yield prim, name


def _site_edits(site: tuple[str, str], subject: GraphSubject) -> Iterator[Edit]:
    path, name = site
    role, node = subject.roles.role_of.get(path), subject.live_nodes.get(path)
    if role is None:
        role = next((r for r, each in subject.roles.retyped.items() if each.path == path), None)
    if role is not None and node is not None:
        yield from property_edits(subject, role, node, name)
