"""The boxes of an Action Graph: titles, rows, roles, and the findings that mark them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.isaac.graph import PortRef
from lab3_usd.isaac.node_types import INPUT, NodeType, Port
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import SEVERITIES, Finding
from lab3_usd.model.stage import GraphModel, Node, Unknown
from lab3_usd.report.picture.model import (
    Box,
    Curve,
    End,
    Family,
    Kind,
    Row,
    Side,
    State,
    clip_end,
    clip_path,
    is_port,
    sized,
    state_word,
)
from lab3_usd.spec.graph import GraphSpec, NodeSpec


class SiteFindings(Struct, frozen=True):
    """The findings at each prim, by property (None for the prim itself), the gravest first."""

    at: Mapping[str, Mapping[str | None, Sequence[Finding]]] = field(default_factory=dict)

    def state(self, prim: str, prop: str | None = None) -> State:
        """Return how the site is drawn: wrong for an error, warned for a warning, else ok.

        Properties that are no ports (a node's type) count for the node.
        """
        severities = {finding.severity for finding in self._findings(prim, prop)}
        if "error" in severities:
            return "wrong"
        return "warned" if "warning" in severities else "ok"

    def note(self, prim: str, prop: str | None = None) -> str:
        """Return the messages at the site, one per line."""
        return "\n".join(finding.message for finding in self._findings(prim, prop))

    def _findings(self, prim: str, prop: str | None) -> Sequence[Finding]:
        properties = self.at.get(prim, {})
        if prop is not None:
            return properties.get(prop, ())
        others = sorted(name for name in properties if name is not None and not is_port(name))
        return [finding for name in (None, *others) for finding in properties.get(name, ())]

    def expected(self, prim: str, prop: str) -> str | None:
        """Return what the site should hold, where an error or warning says it."""
        for finding in self._findings(prim, prop):
            if finding.severity != "note" and finding.expected is not None:
                return finding.expected
        return None

    def ports(self, prim: str) -> list[str]:
        """Return the ports of a prim that a finding names, in order."""
        return sorted(prop for prop in self.at.get(prim, ()) if prop is not None and is_port(prop))


def findings_by_site(findings: Iterable[Finding]) -> SiteFindings:
    """Sort findings by site; one that names a second port, as of exchanged values, is at both."""
    by_site: dict[str, dict[str | None, list[Finding]]] = {}

    def add(finding: Finding, prim: str, prop: str | None) -> None:
        by_site.setdefault(prim, {}).setdefault(prop, []).append(finding)

    for finding in findings:
        add(finding, finding.prim, finding.property)
        name = finding.prim.rpartition("/")[2]
        for prim, dot, port in (site.rpartition(".") for site in finding.related):
            if dot:
                twin = replace(finding, message=f"{name}: {finding.message}", expected=None)
                add(twin, prim, port)
    for properties in by_site.values():
        for members in properties.values():
            members.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    return SiteFindings(by_site)


class NodeRoles(Struct, frozen=True):
    """The key of each role's box; `missing` are the keys of the roles that no node has.

    `nodes` are the nodes of the file by path. `unassigned` are the paths of those that have no
    role and stand in for none.
    """

    box_keys: Mapping[str, str] = field(default_factory=dict)
    missing: frozenset[str] = frozenset()
    nodes: Mapping[str, Node] = field(default_factory=dict)
    unassigned: frozenset[str] = frozenset()

    def end(self, port: PortRef) -> End:
        """Return the end of a wire of the spec."""
        return End(self.box_keys[port.role], port.port)


def assigned_roles(
    spec: GraphSpec | None, roles: Roles | None, graph: GraphModel | None
) -> NodeRoles:
    """Return the roles of a stage's graph; without roles or spec none is assigned or missing."""
    nodes = {} if graph is None else {node.path: node for node in graph.nodes}
    if spec is None or (roles is None and graph is not None):
        return NodeRoles(nodes=nodes)
    folder = spec.path if graph is None else graph.path
    box_keys: dict[str, str] = {}
    missing = []
    for role in spec.nodes:
        # A node of another type in the place of a role is drawn as wrong.
        node = None if roles is None else roles.node_of.get(role) or roles.retyped.get(role)
        if node is not None and node.path in nodes:
            box_keys[role] = node.path
            continue
        key = f"{folder}/{role}"
        while key in nodes:  # a node of another type may have the name already
            key += "_missing"
        box_keys[role] = key
        missing.append(key)
    playing = set(box_keys.values())
    stand_ins = {} if roles is None else roles.equivalents
    unassigned = frozenset(path for path in nodes if path not in playing and path not in stand_ins)
    return NodeRoles(box_keys, frozenset(missing), nodes, unassigned)


MOST_LABEL = 44
MOST_NOTE = 400
MOST_LINES = 24
MOST_VALUE = 34  # characters of a value in a box; the pointer resting on it reads more
MOST_PRIMS = 12


class BoxSubject(Struct, frozen=True):
    """The node that one box shows: its spec (None without a role), itself, and its wires.

    `kind` is that of the picture.
    """

    key: str
    spec: NodeSpec | None
    node: Node | None
    arriving: Mapping[str, State]
    leaving: Mapping[str, State]
    findings: SiteFindings = field(default_factory=SiteFindings)
    every_port: bool = False
    kind: Kind = "graph"

    @property
    def type(self) -> NodeType | None:
        """The node's own type; that of its role where there is no node."""
        if self.node is not None:
            return self.node.type
        return None if self.spec is None else self.spec.type

    def port(self, name: str) -> Port | None:
        """The port of the node's type; for an unknown type that of its role."""
        port = None if self.type is None else self.type.port(name)
        return port if port is not None or self.spec is None else self.spec.type.port(name)


def _rows(subject: BoxSubject, names: Iterable[str], *, is_missing: bool) -> Iterator[Row]:
    """Yield a row for every port that is drawn; the box says for all its rows that it is missing.

    A port without a value, a wire and a fault is drawn where every one is asked for.
    """
    for name in names:
        port = subject.port(name)
        state = subject.findings.state(subject.key, name)
        wire = subject.arriving.get(name, "ok")
        if (state, wire) in {("wrong", "missing"), ("warned", "extra")} or state == "ok":
            state = wire
        value, muted = _value(subject, name, port)
        is_wired = name in subject.arriving or name in subject.leaving
        is_execution = port is not None and port.is_execution
        shown = "ok" if is_missing else state
        if not (value or is_wired or is_execution or shown != "ok" or subject.every_port):
            continue
        expected = subject.findings.expected(subject.key, name) if state != "ok" and value else None
        yield Row(
            port=name,
            label=clip_end(bare_port(name), MOST_LABEL),
            side=_side(subject, name, port),
            execution=is_execution,
            wired=is_wired,
            value=value,
            expected=() if expected is None else (clip_end(_unquoted(expected), MOST_LABEL),),
            state=shown,
            note=subject.findings.note(subject.key, name) or _whole_value(subject, name),
            muted=muted,
        )


def _port_names(subject: BoxSubject) -> list[str]:
    """Name the ports in the order of the type; then those that only the file or wires have."""
    names = dict.fromkeys([] if subject.type is None else subject.type.ports)
    if subject.spec is not None and subject.type is subject.spec.type:
        names |= dict.fromkeys(subject.spec.grown)
    if subject.type is None and subject.node is not None:
        names |= dict.fromkeys(subject.node.ports)
    names |= dict.fromkeys([*subject.arriving, *subject.leaving])
    return list(names | dict.fromkeys(subject.findings.ports(subject.key)))


def _side(subject: BoxSubject, name: str, port: Port | None) -> Side:
    if name in subject.arriving and name in subject.leaving:
        return "both"
    if name in subject.leaving or (port is not None and port.is_source):
        return "out"
    if name.startswith(INPUT) or name in subject.arriving:
        return "in"
    return "out"


def _value(subject: BoxSubject, name: str, port: Port | None) -> tuple[tuple[str, ...], bool]:
    """Return the lines to show for an input, and whether it is an unset default.

    An attribute is shown where it matters: a wire takes its place.
    """
    if not name.startswith(INPUT) or (port is not None and port.is_execution):
        return (), False
    required = _required_value(subject.spec, name)
    node = subject.node
    targets = () if node is None else node.targets(name)
    if node is None or targets:
        return (prim_lines(targets) if targets else required), False
    if port is not None and port.is_target:
        return (prim_lines(()) if required else ()), True
    state, value = node.state(name), node.value(name)
    is_default = state is None or state.value is None
    if value is None:
        return (("not set",) if required else ()), True
    if name in subject.arriving and not required:
        return (), False
    matters = required or subject.every_port or not is_default
    matters = matters or subject.findings.state(subject.key, name) != "ok"
    return (value_line(value) if matters else ()), is_default


def _required_value(spec: NodeSpec | None, name: str) -> tuple[str, ...]:
    if spec is None:
        return ()
    for setting in spec.settings:
        if setting.port == name:
            return value_line(setting.value)
    for target in spec.targets:
        if target.port == name:
            return prim_lines(target.prims)
    return ()


def _whole_value(subject: BoxSubject, name: str) -> str:
    """Return the value at a length that the row has no room for."""
    state = None if subject.node is None else subject.node.state(name)
    if state is None:
        return ""
    if state.targets:
        return "\n".join(clip_path(prim, MOST_NOTE) for prim in state.targets[:MOST_LINES])
    return "" if state.value is None else clip_end(value_text(state.value), MOST_NOTE)


def _unquoted(text: str) -> str:
    """Return a value as rows show it, without the quotes that it has in messages."""
    quoted = len(text) > 2 and text[0] == text[-1] == "'"  # noqa: PLR2004 - the two quotes
    return text[1:-1] if quoted else text


def bare_port(name: str) -> str:
    """Return a port's name without `inputs:` or `outputs:`."""
    return name.partition(":")[2] or name


def value_text(value: Value | Unknown) -> str:
    """Write a value as short as it stays readable."""
    if isinstance(value, Unknown):
        return f"{{{value.why}}}"
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, tuple):
        return f"[{', '.join(value_text(part) for part in value)}]"
    return str(value) if value != "" else '""'


def value_line(value: Value) -> tuple[str, ...]:
    """Return a value as the one line of a row."""
    return (clip_end(value_text(value), MOST_VALUE),)


def prim_lines(prims: tuple[str, ...]) -> tuple[str, ...]:
    """Return the targets of a relationship, one line each."""
    lines = [clip_path(prim, MOST_VALUE) for prim in prims[:MOST_PRIMS]]
    if len(prims) > MOST_PRIMS:
        lines.append(f"and {len(prims) - MOST_PRIMS} more")
    return tuple(lines) or ("no prim",)


MOST_TITLE = 44


Ends = Mapping[str, Mapping[str, State]]  # the ports of each box with a wire, and their states


def wire_ends(curves: Sequence[Curve]) -> tuple[Ends, Ends]:
    """Return the ports where wires arrive and those where they leave, with their worst state."""
    arriving: dict[str, dict[str, State]] = {}
    leaving: dict[str, dict[str, State]] = {}
    for curve in curves:
        for ends, end in ((arriving, curve.target), (leaving, curve.source)):
            ports = ends.setdefault(end.key, {})
            if ports.get(end.port, "ok") == "ok":
                ports[end.port] = curve.state
    return arriving, leaving


def wires_into(nodes: Iterable[Node]) -> Iterator[tuple[End, End, bool]]:
    """Yield the ends of each wire that leads into nodes, and whether it carries execution."""
    for node in nodes:
        for name, state in node.ports.items():
            port = None if node.type is None else node.type.port(name)
            for source in state.sources:
                prim, _, output = source.rpartition(".")
                is_execution = port is not None and port.is_execution
                yield End(prim, output), End(node.path, name), is_execution


def node_box(subject: BoxSubject, state: State) -> Box:
    """Return the box of a node, sized but not placed."""
    names = _port_names(subject)
    rows = [*_rows(subject, names, is_missing=state == "missing")]
    settings = tuple(row for row in rows if row.value)
    ports = [row for row in rows if not row.value]
    hidden = len(names) - len(rows)
    position = None if subject.spec is None else subject.spec.at
    box = Box(
        key=subject.key,
        title=clip_end(_title(subject), MOST_TITLE),
        subtitle=_subtitle(subject, state),
        family=family(subject.type),
        inputs=tuple(row for row in ports if row.side != "out"),
        outputs=tuple(row for row in ports if row.side == "out"),
        settings=settings,
        more=f"+ {hidden} more port{'s' * (hidden > 1)}" if hidden else "",
        state=state,
        note=subject.findings.note(subject.key),
        at=position if subject.node is None else subject.node.position,
    )
    return sized(box)


def absent_box(key: str, ports: Sequence[str], reason: str, state: State) -> Box:
    """Return the box at the end of wires that come from no node of the graph."""
    outputs = tuple(
        Row(port, clip_end(bare_port(port), MOST_TITLE), "out", wired=True, state=state)
        for port in ports
    )
    title = clip_end(key.rpartition("/")[2], MOST_TITLE)
    return sized(Box(key, title, reason, "absent", outputs=outputs, state=state, note=key))


def family(node_type: NodeType | None) -> Family:
    """Return what kind of node it is, which colours its header."""
    if node_type is None:
        return "absent"
    if node_type.role:
        return "ros"
    signals = [port for port in node_type.ports.values() if port.is_execution]
    if not signals:
        return "data"
    return "action" if any(not port.is_source for port in signals) else "event"


def _title(subject: BoxSubject) -> str:
    if subject.type is not None:
        return subject.type.ui_name
    type_name = "" if subject.node is None else subject.node.type_name
    return type_name.rpartition(".")[2] or "node without a type"


def _subtitle(subject: BoxSubject, state: State) -> str:
    name = clip_end(subject.key.rpartition("/")[2], MOST_TITLE)
    if state == "missing" and subject.spec is not None:
        return f"{subject.spec.role} · missing"
    if subject.spec is not None and subject.type is not subject.spec.type:
        return f"{name} · expected {subject.spec.type.ui_name}"
    return name if state == "ok" else f"{name} · {state_word(state, subject.kind)}"
