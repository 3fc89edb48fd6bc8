"""Rules about wires that hold with and without a lab: dead ones, types, cycles, second sources."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.fold import absent_above, of_one_cause
from lab3_usd.check.match.rule_inputs import (
    GraphsSubject,
    GraphSubject,
    Kind,
    LintSubject,
    WireFault,
)
from lab3_usd.check.registry import rule
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.likely_names import did_you_mean, likely_port
from lab3_usd.facts.stalled_nodes import is_needed
from lab3_usd.facts.wires import (
    Connection,
    connection,
    connections,
    cycle_of,
    fed_inputs,
    find_cycles,
    sublayer_with_source,
    why_dead,
)
from lab3_usd.isaac.node_types import NodeType, can_connect, differ_in_role
from lab3_usd.isaac.release_changes import GonePort
from lab3_usd.model.changes import Connect, Edit, RenameProperty
from lab3_usd.model.finding import Problem, Severity, node_title, short_source
from lab3_usd.model.stage import Node, StageModel, once_per_stage

_MOST_REWIRED = 100


def _faults(subject: GraphsSubject, *kinds: str) -> Iterator[tuple[WireFault, Connection]]:
    """Yield the faulty wires of some kinds."""
    live = live_nodes(subject.stage)
    faults = (
        subject.wire_faults if isinstance(subject, GraphSubject) else _by_themselves(subject.stage)
    )
    for fault in faults:
        if fault.kind in kinds and fault.actual is not None:
            yield fault, connection(fault.node, fault.port, fault.actual, live)


@once_per_stage
def _by_themselves(stage: StageModel) -> tuple[WireFault, ...]:
    """Return what is wrong with the wires of a stage, whatever they are for."""
    faults = []
    fed: dict[tuple[str, str], str] = {}
    for wire in connections(stage):
        if not wire.has_source:
            kind: Kind = "dead" if is_needed(wire.node, wire.port, stage) else "leftover"
            faults.append(WireFault(kind, wire.node, wire.port, None, wire.path))
        elif wire.is_live and not wire.is_compatible:
            faults.append(WireFault("incompatible", wire.node, wire.port, None, wire.path))
        elif wire.is_live and wire.brings_data:
            first = fed.setdefault((wire.node.path, wire.port), wire.path)
            if first != wire.path:
                faults.append(WireFault("second", wire.node, wire.port, first, wire.path))
    faults += [
        WireFault("cycle", wire.node, wire.port, None, wire.path) for wire in find_cycles(stage)
    ]
    return tuple(faults)


def source_shown(fault: WireFault) -> str:
    """Return the source that is there, with its whole path when it stands in another graph."""
    graph = fault.node.path.rpartition("/")[0]
    is_here = fault.actual is None or fault.actual.startswith(f"{graph}/")
    return short_source(fault.actual) if is_here else str(fault.actual)


def connect_hint(fault: WireFault) -> str:
    """Say which wire to draw, and which one to delete where an input would keep both."""
    port = fault.port.partition(":")[2]
    wire = f"drag a wire from {short_source(fault.expected)} to {port} of {node_title(fault.node)}"
    keeps_both = fault.node.type is not None and fault.port in fault.node.type.execution_inputs
    if fault.actual is None or not keeps_both:
        return wire
    first = f"delete the wire from {source_shown(fault)}"
    graph = fault.node.path.rpartition("/")[0]
    own = (item for item in fault.node.sources(fault.port) if item.startswith(f"{graph}/"))
    is_there = short_source(fault.expected) in map(short_source, own)
    return first if is_there else f"{first}, and {wire}"


@rule(
    "K20",
    "dangling-wire",
    formerly="wire-from-nowhere",
    counted=("wire with an unknown source", "wires with unknown sources"),
)
def dangling_wire(subject: LintSubject) -> Iterator[Problem]:
    """The source node of a wire does not exist.

    Why: Isaac Sim drops such a wire when it opens the stage. The input then has no source: without
    its execution wire a node never computes, without data it uses the value in the file, else the
    default. It is an error where the node needs the input and has neither; a warning where a value
    or a harmless default is there, where another wire feeds it, and where a sublayer of the stage
    is missing, which may have the node.

    Fix: drag a new wire from the node that should feed this input, or delete the wire.

    Example: `inputs:timeStamp` is connected to `isaac_read_simulation_time_01`, which was deleted.

    Basis: Kit's interface connects attributes of existing nodes. Its code is not public.
    """
    stage = subject.stage
    problems = (
        (_dead_wire(fault, wire, subject), absent_above(wire.source_prim.rpartition("/")[0], stage))
        for fault, wire in _faults(subject, "dead", "leftover")
        if wire.source is None and wire.node.has_port(wire.port)  # else K21 says it
    )
    yield from of_one_cause(problems, "wires", stage)


@rule("K21", "unknown-port")
def unknown_port(subject: LintSubject) -> Iterator[Problem]:
    """A wire ends at a port that its node type lacks.

    Why: Isaac Sim drops such a wire when it opens the stage, whatever the file declares. Ports were
    renamed between releases, and a Constant node has no output: its wire starts at its input. It is
    a warning where the input has a value or a harmless default, or another wire feeds it.

    Fix: drag a new wire between existing ports.

    Example: a wire from `constant_token.outputs:value`; the port is `inputs:value`.

    Basis: Ports are those of Isaac Sim's source; all wires in NVIDIA's own scripts pass this rule
    (`benchmarks/script_wires.py`). Kit's code is not public: ports of its nodes are those of
    NVIDIA's documentation of 5.1, so that another one is a warning.
    """
    for fault, wire in _faults(subject, "dead", "leftover"):
        if wire.source is not None and wire.source.type is not None:
            yield _dead_wire(fault, wire, subject)
    for wire in connections(subject.stage):
        source, kind = wire.source, wire.node.type
        out = wire.source_port
        if source is not None and source.type is not None and leaves_out(source.type, out):
            lost = lost_port(source.type, out, subject, is_source=True)
            yield Problem(
                wire.node.path,
                f"{wire.port} is connected to {source.name}.{out}, a port that "
                f"{source.type.ui_name} does not have{lost.words}",
                property=wire.port,
                expected=lost.right,
                actual=wire.path,
                related=(source.path,),
                severity="warning",
            )
        if kind is not None and (kind.port(wire.port) is None or leaves_out(kind, wire.port)):
            lost = lost_port(kind, wire.port, subject, is_source=False)
            yield Problem(
                wire.node.path,
                f"{wire.port} is connected, but {kind.ui_name} has no such port{lost.words}",
                property=wire.port,
                expected=lost.right,
                actual=wire.port,
                severity="warning" if kind.is_documented else None,
                hint=_hint_in_script(lost, subject),
                fix=_other_port(wire, lost, subject),
            )


class LostPort(Struct, frozen=True):
    """A port that a type lacks, and the `right` one, None where none is near.

    `releases` says which releases have it and what does now what it did; nothing does for one that
    `is_idle`.
    """

    right: str | None
    releases: str = ""
    is_idle: bool = False

    @property
    def words(self) -> str:
        """What a message says of it; a name that some release has is no misspelling."""
        return self.releases or did_you_mean(self.right)


def lost_port(kind: NodeType, port: str, subject: GraphsSubject, *, is_source: bool) -> LostPort:
    """Return what takes the place of a port that a type lacks."""
    platform = subject.platform
    releases = platform.releases_with(kind.type, port)
    if not releases:
        names = [name for name, other in kind.ports.items() if other.is_source == is_source]
        short = port.partition(":")[2]
        same = [name for name in names if name.partition(":")[2] == short]
        return LostPort(same[0] if same else likely_port(port, names))
    gone = platform.changes.gone(kind.type, port) or GonePort()
    now = gone.to if kind.port(gone.to) is not None else ""
    instead = f", {now} now" if now else f": {gone.by}" if gone.by else ""
    return LostPort(now or None, f"; {platform.named(releases)} has it{instead}", gone.drop)


def leaves_out(kind: NodeType, port: str) -> bool:
    """Whether the documentation of a type, all of which is read, has no such port."""
    return kind.is_documented and not kind.is_open and kind.listed(port) is None


@rule("W03", "dead-source", scope="graph")
def dead_source(subject: GraphSubject) -> Iterator[Problem]:
    """The source of an input does not exist.

    Why: the connection carries no data, and Isaac Sim may drop it when it loads the stage. The
    input is effectively not connected. This happens when a node is deleted or renamed outside the
    editor, or when the type has no such port: a Constant Token gives its value from `inputs:value`.

    Fix: delete the connection and drag a new one from the port named here. A leftover beside a good
    connection can stay, or can be removed with Disconnect.

    Example: `make_array.inputs:input0` connected to `constant_left_joint.outputs:value`.
    """
    from lab3_usd.check.demands import with_demand
    from lab3_usd.check.match.conformance import right_once_renamed
    from lab3_usd.check.message_suffixes import without_wire

    for fault, wire in _faults(subject, "dead"):
        problem = _dead_wire(fault, wire, subject)
        message = f"{problem.message}, expected {short_source(fault.expected)}"
        message += without_wire(subject, fault.wire)
        if fault in right_once_renamed(subject):
            problem = replace(problem, assumes=(*problem.assumes, (subject.spec.path, None)))
        yield with_demand(replace(problem, message=message, hint=connect_hint(fault)), subject)


@rule("W11", "leftover-wire", scope="graph", severity="warning")
def leftover_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A wire leads to a deleted node or port.

    Why: it carries no data, and Isaac Sim may drop it when it loads the stage. It does no harm, but
    shows that a node was deleted or renamed after it had been connected.

    Fix: right-click the input and choose Disconnect, or leave it.

    Example: a second source `isaac_read_simulation_time_01` of a deleted node.
    """
    from lab3_usd.check.demands import with_demand

    for fault, wire in _faults(subject, "leftover"):
        yield with_demand(_dead_wire(fault, wire, subject), subject)


def _dead_wire(fault: WireFault, wire: Connection, subject: GraphsSubject) -> Problem:
    """Return the problem of a wire that nothing can be the source of."""
    is_fed = (wire.node.path, wire.port) in fed_inputs(subject.stage)
    problem = Problem(
        wire.node.path,
        f"{wire.port} is connected to {source_shown(fault)}, ",
        property=wire.port,
        expected=fault.expected,
        actual=wire.path,
        severity="warning" if fault.kind == "leftover" and subject.stage.build is None else None,
        assumes=((wire.node.path, wire.port),) if fault.wire is not None else (),
        fix=_rewiring(wire) if is_fed else (),
    )
    if wire.source is not None:
        return _with_port(problem, wire.source, wire, subject)
    reason = why_dead(wire, subject.stage) if wire.source_prim else "is a prim, not a port"
    if reason is None:
        message = f"{problem.message}which may be in an asset that cannot be found"
        return replace(problem, message=message, severity="note")
    sublayer = sublayer_with_source(wire, subject.stage)
    message = f"{problem.message}which {reason}"
    message += f" (unless {sublayer} defines it)" if sublayer else ""
    message += "; the input has another source" if is_fed else ""
    severity: Severity | None = "warning" if sublayer else problem.severity
    return replace(problem, message=message, severity=severity)


def _with_port(problem: Problem, source: Node, wire: Connection, subject: GraphsSubject) -> Problem:
    """Say which port a source lacks, and which was likely meant."""
    kind, target, fix = source.type, wire.node.type, problem.fix
    if kind is None:
        return replace(problem, message=f"{problem.message}which is not a port of it")
    if source.has_port(wire.source_port):
        return replace(problem, message=f"{problem.message}an input, which sends no signal")
    lost = lost_port(kind, wire.source_port, subject, is_source=True)
    port = None if target is None else target.listed(wire.port)
    if lost.right and port and can_connect(kind.ports[lost.right], port):
        fix = _rewiring(wire, f"{source.path}.{lost.right}")
    elif lost.is_idle:
        fix = _rewiring(wire)
    words = lost.releases if problem.expected else lost.words
    return replace(
        problem,
        message=f"{problem.message}a port that {kind.ui_name} does not have{words}",
        expected=problem.expected or lost.right,
        related=(source.path,),
        hint=_hint_in_script(lost, subject),
        fix=fix,
    )


def _hint_in_script(lost: LostPort, subject: GraphsSubject) -> str | None:
    """Say how to repair the name of a port in a script, None for a stage."""
    if subject.stage.build is None:
        return None
    return f"write {lost.right or 'the name of a port that the node has'}"


def _rewiring(wire: Connection, *meant: str) -> tuple[Edit, ...]:
    """Return what puts another source in place of a wire's, or takes it out.

    Nothing where the input is unknown, or has so many wires that nobody drew them.
    """
    kind, sources = wire.node.type, wire.node.sources(wire.port)
    port = None if kind is None else kind.port(wire.port)
    if port is None or len(sources) > _MOST_REWIRED:
        return ()
    at = sources.index(wire.path)
    rest = (*sources[:at], *meant, *sources[at + 1 :])
    return (Connect(wire.node.path, port.name, port.usd_type, rest),)


def _other_port(wire: Connection, lost: LostPort, subject: GraphsSubject) -> tuple[Edit, ...]:
    """Return what moves a wire to the port that was meant, or takes out one that does nothing."""
    node = wire.node
    if lost.right:
        is_free = lost.right not in node.ports or subject.stage.build is not None
        return (RenameProperty(node.path, wire.port, lost.right),) if is_free else ()
    usd_type = node.ports[wire.port].usd_type
    return (Connect(node.path, wire.port, usd_type),) if lost.is_idle else ()


@rule("K22", "incompatible-types", formerly="types-that-do-not-fit")
@rule("W09", "incompatible-wire", scope="graph")
def incompatible_types(subject: GraphsSubject) -> Iterator[Problem]:
    """A wire joins incompatible types.

    Why: OmniGraph converts between numbers of one shape and between string and token. It rejects
    other wires when the stage is opened, and the input has no source. Types that differ only in
    their role, such as a vector and three plain numbers, may be accepted: a warning.

    Fix: delete the wire, and connect a port of the right type or insert a node that converts.

    Example: `outputs:linearVelocity`, a vector, is connected to `inputs:linearVelocity`, a number.

    Basis: NVIDIA's documentation of attribute types. Kit's code is not public; all wires in
    NVIDIA's own scripts pass this rule (`benchmarks/script_wires.py`).
    """
    for fault, wire in _faults(subject, "incompatible"):
        if wire.ports is None:
            continue
        source, target = wire.ports
        yield Problem(
            wire.node.path,
            f"{wire.port} expects {target.ogn_type}, but {source_shown(fault)} provides "
            f"{source.ogn_type}",
            property=wire.port,
            expected=target.ogn_type,
            actual=source.ogn_type,
            related=(wire.source_prim,),
            severity="warning" if differ_in_role(source, target) else None,
        )


@rule("K23", "wire-cycle", severity="warning", formerly="ring-of-wires")
@rule("W08", "execution-cycle", scope="graph")
def wire_cycle(subject: GraphsSubject) -> Iterator[Problem]:
    """Wires of one kind form a cycle.

    Why: a graph is evaluated in the order of its wires, and a cycle has no order. Isaac Sim may
    drop the wire that closes it, skip the nodes, or never finish: what it does in an Action Graph
    is not documented. Without a lab it is a warning; a lab asks for one source.

    Fix: delete the wire named here.

    Example: Exec Out of the second node is connected to Exec In of the first.

    Basis: a wire that closes a cycle of data was seen to be dropped in graphs that Isaac Sim makes
    for sensors. Kit's code is not public.
    """
    for fault, wire in _faults(subject, "cycle"):
        paths = cycle_of(wire, live_nodes(subject.stage))
        names = [path.rpartition("/")[2] for path in (*paths, *paths[:1])]
        yield Problem(
            wire.node.path,
            f"{wire.kind} wires form a cycle: {' -> '.join(names)}",
            property=wire.port,
            expected=fault.expected,
            actual=wire.path,
            related=paths,
            hint=f"delete the wire from {source_shown(fault)}",
        )


@rule("K24", "multiple-sources", severity="warning", formerly="two-sources")
@rule("W04", "second-source", scope="graph")
def multiple_sources(subject: GraphsSubject) -> Iterator[Problem]:
    """An input has a second source.

    Why: a data input uses one of its sources, and no public document says which. An execution input
    runs the node once for each source, which a lab may forbid and any other stage may want.

    Fix: select the wire from the source named here in the Action Graph editor and delete it.

    Example: `inputs:timeStamp` is connected to two Isaac Read Simulation Time nodes.

    Basis: Kit's interface gives an input one value. Its code is not public: without a lab it is a
    warning; a lab asks for one source.
    """
    for fault, wire in _faults(subject, "second"):
        yield Problem(
            wire.node.path,
            f"{wire.port} is also connected to {source_shown(fault)}, expected one source",
            property=wire.port,
            expected=fault.expected,
            actual=fault.actual,
            hint=f"delete the wire from {source_shown(fault)}",
        )
