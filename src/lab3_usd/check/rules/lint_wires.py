"""Rules about wires: dead ones, ports that no type has, types that do not fit, rings, doubles."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.check.ros.execution import has_side_effects, is_nothing
from lab3_usd.check.ros.quantities import quantity_of
from lab3_usd.check.ros.running import LintSubject
from lab3_usd.check.ros.topics import did_you_mean, likely_name
from lab3_usd.check.ros.wires import (
    Connection,
    connections,
    differ_in_role,
    find_cycles,
    sublayer_with_source,
    why_dead,
)
from lab3_usd.model.changes import Connect, Edit, RenameProperty
from lab3_usd.model.finding import Problem, display
from lab3_usd.spec.catalog import INPUT, OUTPUT, NodeType, Port, can_connect


@rule(
    "K20",
    "dangling-wire",
    scope="lint",
    formerly="wire-from-nowhere",
    counted=("wire of unknown source", "wires of unknown source"),
)
def dead_source(subject: LintSubject) -> Iterator[Problem]:
    """A wire comes from a node that is not there.

    Why: Isaac Sim drops such a wire when it opens the stage. The input then has no source: without
    its execution wire a node never computes, without data it works on zeros. Where a sublayer of
    the stage is missing, the node may be in it: a warning.

    Fix: drag a new wire from the node that should feed this input, or delete the wire.

    Example: `inputs:timeStamp` is wired from `isaac_read_simulation_time_01`, which was deleted.

    Basis: Kit's code, which is not public. Its interface connects attributes of nodes that are
    there.
    """
    for wire in connections(subject):
        if wire.source is not None:
            continue
        reason = why_dead(wire, subject) if wire.source_prim else "is a prim, not a port"
        others = [source for source in wire.node.sources(wire.port) if source != wire.path]
        is_fed = any(source.rpartition(".")[0] in subject.live for source in others)
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
        sublayer = sublayer_with_source(wire, subject)
        yield Problem(
            wire.node.path,
            f"{wire.port} is wired from {name}, which {reason}"
            f"{'; another source feeds it' if is_fed else ''}"
            f"{f', unless {sublayer} has it' if sublayer else ''}",
            property=wire.port,
            actual=wire.path,
            severity="warning" if is_fed or sublayer else None,
            fix=_rewiring(wire, *others) if is_fed else (),
        )


def _input(wire: Connection) -> Port | None:
    return None if wire.node.type is None else wire.node.type.port(wire.port)


def _rewiring(wire: Connection, *sources: str) -> tuple[Edit, ...]:
    """Return what gives the input of a wire these sources; nothing where the input is unknown."""
    port = _input(wire)
    return (Connect(wire.node.path, port.name, port.usd_type, sources),) if port else ()


@rule("K21", "unknown-port", scope="lint")
def unknown_port(subject: LintSubject) -> Iterator[Problem]:
    """A wire leaves from, or ends at, a port that the node type does not have.

    Why: Isaac Sim drops such a wire when it opens the stage, whatever the file declares. Ports were
    renamed between releases, and a Constant node has no output: its wire leaves from its input.

    Fix: drag a new wire between the ports that the node has now.

    Example: a wire from `constant_token.outputs:value`; the port is `inputs:value`.

    Basis: Kit's code, which is not public. Ports are those of Isaac Sim's source; the wires
    that NVIDIA's own scripts write all pass this rule (`benchmarks/script_wires.py`).
    """
    for wire in connections(subject):
        source = wire.source
        if source is not None and not source.has_port(wire.source_port) and source.type is not None:
            near = meant_port(wire.source_port, source.type, is_source=True)
            port, meant = _input(wire), f"{source.path}.{near}"
            sources = wire.node.sources(wire.port)
            fits = near and port and can_connect(source.type.ports[near], port)
            yield Problem(
                wire.node.path,
                f"{wire.port} is wired from {source.name}.{wire.source_port}, a port that "
                f"{source.type.ui_name} does not have{_known_of_old(wire, subject)}"
                f"{did_you_mean(near)}",
                property=wire.port,
                expected=near,
                actual=wire.path,
                related=(source.path,),
                fix=_rewiring(wire, *(meant if path == wire.path else path for path in sources))
                if fits
                else (),
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
    releases = subject.types.releases_with(kind.type, port)
    return f"; Isaac Sim {', '.join(releases)} has it" if releases else ""


@rule("K22", "incompatible-types", scope="lint", formerly="types-that-do-not-fit")
def incompatible_wire(subject: LintSubject) -> Iterator[Problem]:
    """A wire joins two ports whose types do not go together.

    Why: OmniGraph converts between numbers of one shape and between string and token. It refuses
    other wires when the stage is opened, and the input has no source. Types that hold the same
    numbers for another purpose, as a vector and three plain numbers, may still be taken: a warning.

    Fix: wire a port of the right type, or put a node between that converts.

    Example: `outputs:linearVelocity`, a vector, is wired into `inputs:linearVelocity`, a number.

    Basis: NVIDIA's documentation of attribute types. Kit's code is not public; the wires that
    NVIDIA's own scripts write all pass this rule (`benchmarks/script_wires.py`).
    """
    for wire in connections(subject):
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
def ring_of_wires(subject: LintSubject) -> Iterator[Problem]:
    """Wires of one kind lead round in a ring.

    Why: execution that comes back to its start never ends, and data that needs itself is never
    computed: OmniGraph leaves nodes of a ring out.

    Fix: delete the wire that closes the ring.

    Example: Exec Out of the second node is wired into Exec In of the first.

    Basis: a graph is evaluated in the order of its wires, which a cycle does not have. Kit's
    code is not public.
    """
    for ring in find_cycles(subject):
        yield Problem(
            ring.node.path,
            f"{ring.kind} wires form a cycle: {' -> '.join(ring.names)}",
            property=ring.port,
            related=ring.paths,
        )


@rule("K24", "multiple-sources", scope="lint", formerly="two-sources")
def two_sources(subject: LintSubject) -> Iterator[Problem]:
    """Two live wires feed one data input.

    Why: a data input takes one value. Which of two sources wins is not said anywhere; only
    execution inputs may have several.

    Fix: delete the wrong wire.

    Example: `inputs:timeStamp` is wired from two Isaac Read Simulation Time nodes.

    Basis: Kit's interface gives an input one value. Its code is not public.
    """
    fed: dict[tuple[str, str], list[Connection]] = {}
    for wire in connections(subject):
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
    counted=("value under a wire", "values under wires"),
)
def value_under_a_wire(subject: LintSubject) -> Iterator[Problem]:
    """An input is wired and holds a value too.

    Why: the wire wins. The value looks as if it counted, and counts again as soon as the wire is
    deleted.

    Fix: clear the value, if it misleads.

    Example: `inputs:jointNames` holds two names and is wired from Make Array.

    Basis: Kit's code, which is not public; a saved stage keeps the value beside the wire.
    """
    for wire in connections(subject):
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
    """A node is triggered only when a message arrives.

    Why: Exec Out of a subscriber fires when a new message came, and stays silent otherwise. What
    hangs on it stops when the sender stops: a publisher sends nothing, a limit of acceleration is
    not followed to its end.

    Fix: trigger the node from On Playback Tick; a subscriber keeps the last message.

    Example: a ROS2 Publish Odometry whose Exec In is wired from ROS2 Subscribe Twist.
    """
    judged: set[str] = set()
    for wire in connections(subject):
        kind = None if wire.source is None else wire.source.type
        ends = wire.ports
        if kind is None or ends is None or not ends[1].is_execution or wire.node.path in judged:
            continue
        if kind.role == "subscriber" and wire.source_port.startswith(OUTPUT) and _has_pace(wire):
            others = [source for source in wire.node.sources(wire.port) if source != wire.path]
            if not others:
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
    """A wire brings another quantity than the input is meant for.

    Why: numbers of any meaning go through a wire. A speed in the place of a position, or sideways
    speed in that of forward speed, gives no error: the robot does something else than it is told.

    Fix: wire the output, or the component of the vector, that the input is meant for.

    Example: `linear.y` is wired into `inputs:linearVelocity` of a Differential Controller.
    """
    for node in subject.live.values():
        meant = None if node.type is None else subject.types.quantities.get(node.type.type)
        for short, quantities in meant.takes.items() if meant is not None else ():
            port = INPUT + short
            given = quantity_of(node, port, subject)
            if given is not None and given.name not in quantities:
                yield Problem(
                    node.path,
                    f"{port} takes {' or '.join(quantities)}, and {given.maker.name} gives "
                    f"{given.name}",
                    property=port,
                    expected=" or ".join(quantities),
                    actual=given.name,
                    related=(given.maker.path,),
                )
