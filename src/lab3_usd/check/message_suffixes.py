"""Suffixes of messages: the node as the editor shows it, and that a fault is harmless."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.match.conformance import source_path
from lab3_usd.check.match.rule_inputs import GraphSubject
from lab3_usd.facts.wires import connection
from lab3_usd.isaac.graph import PortRef
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Finding, node_title
from lab3_usd.model.stage import Node, same_value
from lab3_usd.spec.graph import GraphSpec, Setting, Wire

_THE_NODE = "the node"
_STILL_DRIVES = "; the robot may still drive"
_STILL_WORKS = "; the graph may still work"


def with_named_nodes(findings: Iterable[Finding], nodes: Mapping[str, Node]) -> Iterator[Finding]:
    """Yield findings; the hint of one about a node says which node of which graph.

    `nodes` are those of the stage by path. Of two alike in one graph the name of the prim stands
    in brackets behind the title.
    """
    alike = Counter((_graph(path), node_title(node)) for path, node in nodes.items())
    graphs = {*map(_graph, nodes)}
    for finding in findings:
        node = nodes.get(finding.prim)
        if node is None or not finding.hint:
            yield finding
            continue
        title, hint = node_title(node), finding.hint
        path, _, name = finding.prim.rpartition("/")
        shown = f"{title} ({name})" if alike[path, title] > 1 else title
        if f"{title} (" not in hint:
            hint = hint.replace(title, shown, 1)
        if shown not in hint:
            hint = hint.replace(_THE_NODE, shown, 1)
        graph = shown_graph(path, graphs)
        yield replace(finding, hint=hint if graph in hint else f"in {graph}, {hint}")


def _graph(path: str) -> str:
    return path.rpartition("/")[0]


def shown_graph(path: str, graphs: Iterable[str]) -> str:
    """Return the name of a graph as the editor shows it, its path where another has that name."""
    name = path.rpartition("/")[2]
    alike = any(graph != path and graph.rpartition("/")[2] == name for graph in graphs)
    return path if alike else name


def note_if_harmless(subject: GraphSubject, role: str) -> str:
    """Return how to end the message about a missing node: '' where the graph needs it."""
    wires = [wire for wire in subject.spec.wires if wire.source.role == role]
    is_supplied_otherwise = bool(wires) and all(
        _is_supplied_otherwise(subject, wire) for wire in wires
    )
    return _harmless(subject) if is_supplied_otherwise else ""


def without_wire(subject: GraphSubject, wire: Wire | None) -> str:
    """Return how to end the message about a wire that is not there: '' where it is needed."""
    is_needless = wire is not None and _is_supplied_otherwise(subject, wire)
    return _harmless(subject) if is_needless else ""


def with_setting(subject: GraphSubject, role: str, setting: Setting, value: Value | None) -> str:
    """Return how to end the message about a wrong value: '' where it makes a difference."""
    return _harmless(subject) if is_idle_choice(subject, role, setting, value) else ""


def is_idle_choice(subject: GraphSubject, role: str, setting: Setting, value: Value | None) -> bool:
    """Whether a value is another choice of a node that gives on what comes in by each of them."""
    port = subject.spec.nodes[role].type.port(setting.port)
    return port is not None and value in port.allowed and _unchanged(subject, role)


def _harmless(subject: GraphSubject) -> str:
    drives = any(node.type.drives is not None for node in subject.spec.nodes.values())
    return _STILL_DRIVES if drives else _STILL_WORKS


def _is_supplied_otherwise(subject: GraphSubject, wire: Wire) -> bool:
    """Whether the input gets what the wire would bring, as a value or past the wire's node."""
    target, port = subject.roles.node_of[wire.target.role], wire.target.port
    if target is None:
        onward = [after for after in subject.spec.wires if after.source.role == wire.target.role]
        return bool(onward) and all(_is_supplied_otherwise(subject, after) for after in onward)
    live = subject.live_nodes
    sources = [
        source
        for source in target.sources(port)
        if connection(target, port, source, live).has_source
    ]
    if sources:
        return set(sources) <= _sources_past(subject, wire.source.role)
    value = target.value(port)
    drives = None if target.type is None else target.type.drives
    if drives is not None and port == drives.joints and value in (None, ()):
        return True  # it commands every joint then
    given = _given(subject.spec, wire.source)
    return given is not None and same_value(value, given)


def _unchanged(subject: GraphSubject, role: str) -> bool:
    """Whether the node gives on what comes in."""
    is_in_metres = same_value(subject.stage.meters_per_unit, 1.0)
    return is_in_metres and bool(subject.spec.nodes[role].type.same_in_metres)


def _sources_past(subject: GraphSubject, role: str) -> set[str]:
    """Return the sources that bring the same as the node of a role, without it."""
    if not _unchanged(subject, role):
        return set()
    sources = set()
    for wire in subject.spec.wires_into(role):
        source = subject.roles.node_of[wire.source.role]
        if source is not None and wire.target.port in subject.spec.nodes[role].type.same_in_metres:
            sources.add(source_path(source, wire))
    return sources


def _given(spec: GraphSpec, source: PortRef) -> Value | None:
    """Return the value that a wire of the spec brings, None where it is known at run time only."""
    node = spec.nodes[source.role]
    if source.port.startswith(INPUT):  # a constant
        return next(
            (setting.value for setting in node.settings if setting.port == source.port), None
        )
    if node.type.dynamic is None:
        return None
    first = INPUT + node.type.dynamic.prefix
    items = {
        wire.target.port: _given(spec, wire.source)
        for wire in spec.wires_into(source.role)
        if wire.target.port.startswith(first)
    }
    values = [items[port] for port in sorted(items)]
    return None if None in values else tuple(value for value in values if value is not None)
