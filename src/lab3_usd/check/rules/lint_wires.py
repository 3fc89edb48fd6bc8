"""Rules about wires: dead ones, ports that no type has, types that do not fit, rings, doubles."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import commands, leaves_joints
from lab3_usd.facts.clocks import STAMP
from lab3_usd.facts.endpoints import did_you_mean, likely_name
from lab3_usd.facts.quantities import quantity_of
from lab3_usd.facts.stalled_nodes import has_side_effects, is_nothing, needs_of
from lab3_usd.facts.wires import (
    Connection,
    connections,
    differ_in_role,
    find_cycles,
    sublayer_with_source,
    why_dead,
)
from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType, Port, can_connect
from lab3_usd.model.changes import Connect, Edit, RenameProperty
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.stage import Node

_MOST_REWIRED = 100


@rule(
    "K20",
    "dangling-wire",
    scope="lint",
    formerly="wire-from-nowhere",
    counted=("wire with an unknown source", "wires with unknown sources"),
)
def dangling_wire(subject: LintSubject) -> Iterator[Problem]:
    """The source node of a wire does not exist.

    Why: Isaac Sim drops such a wire when it opens the stage. The input then has no source: without
    its execution wire a node never computes, without data it uses zeros. If a sublayer of the stage
    is missing, the node may be in it: a warning.

    Fix: drag a new wire from the node that should feed this input, or delete the wire.

    Example: `inputs:timeStamp` is connected to `isaac_read_simulation_time_01`, which was deleted.

    Basis: Kit's interface connects attributes of existing nodes. Its code is not public.
    """
    wires = list(connections(subject.stage, subject.platform))
    fed = {(wire.node.path, wire.port) for wire in wires if wire.source is not None}
    for wire in wires:
        if wire.source is not None:
            continue
        reason = (
            why_dead(wire, subject.stage, subject.platform)
            if wire.source_prim
            else "is a prim, not a port"
        )
        is_fed = (wire.node.path, wire.port) in fed
        name = (wire.source_prim or wire.path).rpartition("/")[2]
        if reason is None:
            yield Problem(
                wire.node.path,
                f"the source of {wire.port} is unknown: {wire.source_prim} may be in an asset that "
                "cannot be found",
                property=wire.port,
                actual=wire.path,
                severity="note",
            )
            continue
        sublayer = sublayer_with_source(wire, subject.stage)
        yield Problem(
            wire.node.path,
            f"{wire.port} is connected to {name}, which {reason}"
            f"{'; another source feeds it' if is_fed else ''}"
            f"{f', unless {sublayer} has it' if sublayer else ''}",
            property=wire.port,
            actual=wire.path,
            severity="warning" if is_fed or sublayer else None,
            fix=_rewiring(wire) if is_fed else (),
        )


def _input(wire: Connection) -> Port | None:
    return None if wire.node.type is None else wire.node.type.port(wire.port)


def _rewiring(wire: Connection, *meant: str) -> tuple[Edit, ...]:
    """Return what puts another source in place of a wire's, or takes it out.

    Nothing where the input is unknown, or has so many wires that nobody drew them.
    """
    port, sources = _input(wire), wire.node.sources(wire.port)
    if port is None or len(sources) > _MOST_REWIRED:
        return ()
    at = sources.index(wire.path)
    rest = (*sources[:at], *meant, *sources[at + 1 :])
    return (Connect(wire.node.path, port.name, port.usd_type, rest),)


@rule("K21", "unknown-port", scope="lint")
def unknown_port(subject: LintSubject) -> Iterator[Problem]:
    """A wire ends at a port that its node type lacks.

    Why: Isaac Sim drops such a wire when it opens the stage, whatever the file declares. Ports were
    renamed between releases, and a Constant node has no output: its wire starts at its input.

    Fix: drag a new wire between existing ports.

    Example: a wire from `constant_token.outputs:value`; the port is `inputs:value`.

    Basis: Ports are those of Isaac Sim's source; all wires in NVIDIA's own scripts pass this rule
    (`benchmarks/script_wires.py`). Kit's code is not public.
    """
    for wire in connections(subject.stage, subject.platform):
        source = wire.source
        if source is not None and not source.has_port(wire.source_port) and source.type is not None:
            near = meant_port(wire.source_port, source.type, is_source=True)
            port, meant = _input(wire), f"{source.path}.{near}"
            fits = near and port and can_connect(source.type.ports[near], port)
            yield Problem(
                wire.node.path,
                f"{wire.port} is connected to {source.name}.{wire.source_port}, a port that "
                f"{source.type.ui_name} does not have{_known_of_old(wire, subject)}"
                f"{did_you_mean(near)}",
                property=wire.port,
                expected=near,
                actual=wire.path,
                related=(source.path,),
                fix=_rewiring(wire, meant) if fits else (),
            )
        kind = wire.node.type
        if kind is not None and kind.port(wire.port) is None:
            near = meant_port(wire.port, kind, is_source=False)
            yield Problem(
                wire.node.path,
                f"{wire.port} is wired, and {kind.ui_name} has no such port"
                f"{_gone(kind, wire.port, subject)}{did_you_mean(near)}",
                property=wire.port,
                expected=near,
                actual=wire.port,
                fix=(RenameProperty(wire.node.path, wire.port, near),)
                if near and near not in wire.node.ports
                else (),
            )


def meant_port(written: str, kind: NodeType, *, is_source: bool) -> str | None:
    """Return the port of a type that was likely meant."""
    known = [name for name, port in kind.ports.items() if port.is_source == is_source]
    short = written.partition(":")[2]
    same = [name for name in known if name.partition(":")[2] == short]
    return same[0] if same else likely_name(written, known)


def _known_of_old(wire: Connection, subject: LintSubject) -> str:
    kind = None if wire.source is None else wire.source.type
    return "" if kind is None else _gone(kind, wire.source_port, subject)


def _gone(kind: NodeType, port: str, subject: LintSubject) -> str:
    releases = subject.platform.releases_with(kind.type, port)
    return f"; Isaac Sim {', '.join(releases)} has it" if releases else ""


@rule("K22", "incompatible-types", scope="lint", formerly="types-that-do-not-fit")
def incompatible_types(subject: LintSubject) -> Iterator[Problem]:
    """A wire joins incompatible types.

    Why: OmniGraph converts between numbers of one shape and between string and token. It rejects
    other wires when the stage is opened, and the input has no source. Types that differ only in
    their role, such as a vector and three plain numbers, may be accepted: a warning.

    Fix: connect a port of the right type, or insert a node that converts.

    Example: `outputs:linearVelocity`, a vector, is connected to `inputs:linearVelocity`, a number.

    Basis: NVIDIA's documentation of attribute types. Kit's code is not public; all wires in
    NVIDIA's own scripts pass this rule (`benchmarks/script_wires.py`).
    """
    for wire in connections(subject.stage, subject.platform):
        if wire.is_live and wire.ports is not None and not can_connect(*wire.ports):
            source, target = wire.ports
            yield Problem(
                wire.node.path,
                f"{wire.port} takes {target.ogn_type}, and {wire.source_prim.rpartition('/')[2]}."
                f"{wire.source_port} gives {source.ogn_type}",
                property=wire.port,
                expected=target.ogn_type,
                actual=source.ogn_type,
                related=(wire.source_prim,),
                severity="warning" if differ_in_role(source, target) else None,
            )


@rule("K23", "wire-cycle", scope="lint", formerly="ring-of-wires")
def wire_cycle(subject: LintSubject) -> Iterator[Problem]:
    """Wires of one kind form a cycle.

    Why: an execution cycle never ends, and data that depends on itself is never computed: OmniGraph
    skips the nodes of a cycle.

    Fix: delete the wire that closes the cycle.

    Example: Exec Out of the second node is connected to Exec In of the first.

    Basis: a graph is evaluated in the order of its wires, and a cycle has no order. Kit's code is
    not public.
    """
    for ring in find_cycles(subject.stage, subject.platform):
        yield Problem(
            ring.node.path,
            f"{ring.kind} wires form a cycle: {' -> '.join(ring.names)}",
            property=ring.port,
            related=ring.paths,
        )


@rule("K24", "multiple-sources", scope="lint", formerly="two-sources")
def multiple_sources(subject: LintSubject) -> Iterator[Problem]:
    """A data input has two live sources.

    Why: a data input has one value, and no documentation says which of two sources wins. Only
    execution inputs may have several sources.

    Fix: delete the wrong wire.

    Example: `inputs:timeStamp` is connected to two Isaac Read Simulation Time nodes.

    Basis: Kit's interface gives an input one value. Its code is not public.
    """
    fed: dict[tuple[str, str], list[Connection]] = {}
    for wire in connections(subject.stage, subject.platform):
        kind, port = wire.node.type, _input(wire)
        if kind is None or port is None or not kind.is_known_port(wire.port):
            continue
        if wire.is_live and not port.is_execution:
            fed.setdefault((wire.node.path, wire.port), []).append(wire)
    for (path, port_name), wires in fed.items():
        if len(wires) > 1:
            yield Problem(
                path,
                f"{port_name} has {len(wires)} sources: "
                + ", ".join(connection.path for connection in wires),
                property=port_name,
                expected="one source",
                actual=", ".join(connection.path for connection in wires),
            )


@rule(
    "K25",
    "value-and-wire",
    scope="lint",
    severity="note",
    formerly="value-under-a-wire",
    counted=("value overridden by a wire", "values overridden by wires"),
)
def value_and_wire(subject: LintSubject) -> Iterator[Problem]:
    """An input has a connection and a value.

    Why: the wire wins. The value looks effective, and takes effect again when the wire is deleted.

    Fix: clear the value if it is misleading.

    Example: `inputs:jointNames` holds two names and is connected to Make Array.

    Basis: a saved stage keeps the value beside the wire. Kit's code is not public.
    """
    for wire in connections(subject.stage, subject.platform):
        value = wire.node.ports[wire.port].value
        default = None if wire.node.type is None else wire.node.type.default(wire.port, None)
        if wire.is_live and value not in (None, default) and not is_nothing(value):
            yield Problem(
                wire.node.path,
                f"{wire.port} is wired, and its value {display(value)} does not count",
                property=wire.port,
                actual=display(value),
            )


@rule("K26", "driven-by-messages", scope="lint", severity="warning")
def driven_by_messages(subject: LintSubject) -> Iterator[Problem]:
    """A node runs only when a message arrives.

    Why: Exec Out of a subscriber fires only when a new message has arrived. The nodes behind it
    stop when the sender stops: a publisher sends nothing, and a limited acceleration is not
    completed.

    Fix: trigger the node from On Playback Tick; a subscriber keeps the last message.

    Example: a ROS2 Publish Odometry whose Exec In is connected to ROS2 Subscribe Twist.
    """
    judged: set[str] = set()
    for wire in connections(subject.stage, subject.platform):
        kind = None if wire.source is None else wire.source.type
        ends = wire.ports
        if kind is None or ends is None or not ends[1].is_execution or wire.node.path in judged:
            continue
        is_driven = kind.role == "subscriber" and wire.source_port.startswith(OUTPUT)
        is_alone = all(source == wire.path for source in wire.node.sources(wire.port))
        if is_driven and is_alone and _has_pace(wire):
            judged.add(wire.node.path)
            yield Problem(
                wire.node.path,
                f"{subject.title(wire.node)} executes only when a message arrives at "
                f"{wire.source_prim.rpartition('/')[2]}",
                property=wire.port,
                expected="a wire from On Playback Tick",
                actual=wire.path,
            )


def _has_pace(wire: Connection) -> bool:
    """Whether a node should compute at every update: it publishes, or works in time."""
    kind = wire.node.type
    if kind is None:
        return False
    limits = [wire.node.value(port) for port in kind.step_limits]
    return (has_side_effects(wire.node) and kind.role != "service" and not kind.drives) or any(
        limits
    )


@rule("K27", "another-quantity", scope="lint", severity="warning")
def another_quantity(subject: LintSubject) -> Iterator[Problem]:
    """A wire brings another quantity than its input expects.

    Why: a wire carries any number. A speed in place of a position, or a sideways speed in place of
    a forward speed, gives no error, but the robot does not follow its commands. It is an error
    where nothing moves: speeds as positions of joints whose drives have no stiffness, or as efforts
    against their damping. So is a time step as a time stamp: the time of the messages stands still,
    and no transform fits it.

    Fix: connect the output, or the component of the vector, that the input expects.

    Example: `linear.y` is connected to `inputs:linearVelocity` of a Differential Controller.
    """
    for node in subject.live.values():
        for port, quantities in _quantities(node, subject).items():
            given = quantity_of(node, port, subject.stage, subject.platform)
            if given is not None and given.name not in quantities:
                is_still = given.name == _STEP or (
                    given.name in _SPEEDS and _moves_nothing(node, port, subject)
                )
                yield Problem(
                    node.path,
                    f"{port} takes {' or '.join(quantities)}, and {given.maker.name} gives "
                    f"{given.name}",
                    property=port,
                    expected=" or ".join(quantities),
                    actual=given.name,
                    related=(given.maker.path,),
                    severity="error" if is_still else None,
                )


_TIME, _STEP = "the time", "a time step"
_SPEEDS = ("speeds of wheels", "speeds of joints")


def _quantities(node: Node, subject: LintSubject) -> dict[str, tuple[str, ...]]:
    """Return the quantities that the inputs of a node are meant for; a stamp that counts is one."""
    known = None if node.type is None else subject.platform.quantities.get(node.type.type)
    takes = {} if known is None else {INPUT + short: each for short, each in known.takes.items()}
    needed = {INPUT + name for need in needs_of(node, subject.platform) for name in need.inputs}
    return {**takes, STAMP: (_TIME,)} if STAMP in needed else takes


def _moves_nothing(node: Node, port: str, subject: LintSubject) -> bool:
    return any(
        command.node is node and leaves_joints(command, port, subject.stage, subject.platform)
        for command in commands(subject.stage, subject.platform)
    )
