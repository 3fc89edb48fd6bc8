"""Rules about wires: every required one, from the right port, and only those."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.conformance import rightly_fed
from lab3_usd.check.match.rule_inputs import GraphSubject, WireFault
from lab3_usd.check.message_suffixes import without_wire
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import edits_at
from lab3_usd.check.rules.any_wire import connect_hint, source_shown
from lab3_usd.facts.execution_order import is_opened_first, signals_once
from lab3_usd.model.finding import Problem, short_source


def _faults(subject: GraphSubject, *kinds: str) -> Iterator[WireFault]:
    return (fault for fault in subject.wire_faults if fault.kind in kinds)


# Kinds of faults that one of another kind at the same input explains.
_RESTING = ("missing", "moved", "wrong", "foreign", "dead", "unasked")


def _problem(
    subject: GraphSubject, fault: WireFault, message: str, hint: str | None = None
) -> Problem:
    """Return a problem at the faulty input, whose repair is also that of the other input."""
    elsewhere = () if fault.elsewhere is None else (fault.elsewhere,)
    return Problem(
        prim=fault.node.path,
        property=fault.port,
        message=message,
        expected=fault.expected,
        actual=fault.actual,
        handout=None if fault.wire is None else fault.wire.handout,
        related=elsewhere,
        hint=hint,
        fix=edits_at(subject, f"{fault.node.path}.{fault.port}", *elsewhere),
        assumes=((fault.node.path, fault.port),) if fault.kind in _RESTING else (),
        covers=tuple(path.rpartition(".")[::2] for path in elsewhere),
    )


@rule("W01", "missing-wire", scope="graph")
def missing_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A required input is not connected.

    Why: without its execution connection a node never computes. Without data it uses zeros: a
    publisher without time stamps every message with 0. A publisher without a context uses the
    domain id in the environment variable `ROS_DOMAIN_ID`, or 0, not that of the graph's context.

    Fix: open the graph in Window > Graph Editors > Action Graph, drag from the source port to the
    input named here, and check that the connection stays.

    Example: `ros2_publish_clock.inputs:timeStamp` not connected: /clock stays at 0.
    """
    for fault in _faults(subject, "missing", "moved"):
        message = f"{fault.port} is not connected, expected {short_source(fault.expected)}"
        if fault.elsewhere is not None:
            message += f"; that wire goes into {short_source(fault.elsewhere)} instead"
        yield _problem(
            subject, fault, message + without_wire(subject, fault.wire), connect_hint(fault)
        )


def _explain(fault: WireFault, subject: GraphSubject) -> str:
    expected, actual = short_source(fault.expected), source_shown(fault)
    message = f"{fault.port} is connected to {actual}, expected {expected}"
    if fault.kind == "bypass":
        message += f"; the wire bypasses {expected.partition('.')[0]}"
    return message + _single_signal(fault, subject)


def _single_signal(fault: WireFault, subject: GraphSubject) -> str:
    """Say what a signal does that comes a single time; '' where it comes time and again."""
    prim, _, port = str(fault.actual).rpartition(".")
    source = subject.live_nodes.get(prim)
    if source is None or not signals_once(source, port, subject.live_nodes, subject.lab.platform):
        return ""
    if is_opened_first(fault.node):
        return ", which signals once after Play: that opens the topic, and nothing is ever sent"
    return ", which signals only once after Play"


@rule("W02", "wrong-source", scope="graph")
def wrong_source(subject: GraphSubject) -> Iterator[Problem]:
    """A required input has a wrong source.

    Why: the node computes with another quantity, which is often always zero: y instead of x of a
    vector, one output of a node instead of another. A wrong execution
    source runs the node at another time, or only once. A publisher that is triggered only once
    opens its topic and never sends.

    Fix: delete the connection in the Action Graph editor and drag a new one from the port named
    here.

    Example: {wheels?}`differential_controller.inputs:angularVelocity` connected to `outputs:x` of
    the angular vector: the robot never turns{else}`inputs:context` connected to the tick{/}.
    """
    for fault in _faults(subject, "wrong", "bypass"):
        message = _explain(fault, subject) + without_wire(subject, fault.wire)
        yield _problem(subject, fault, message, connect_hint(fault))


@rule("W05", "unasked-wire", scope="graph", severity="warning")
def unasked_wire(subject: GraphSubject) -> Iterator[Problem]:
    """The lab does not connect this input.

    Why: the graph in the handout works without this connection. Its data overrides a correct value
    or default. Where it brings the right value, as a constant or variable does, it is a note.

    Fix: delete the connection unless your instructor asked for it.

    Example: `ros2_publish_clock.inputs:queueSize` connected to a constant.
    """
    for fault in _faults(subject, "unasked"):
        source = source_shown(fault)
        message = f"{fault.port} is connected to {source}, which the handout does not ask for"
        problem = _problem(subject, fault, message)
        is_right = (fault.node.path, fault.port) in rightly_fed(subject)
        yield replace(problem, severity="note", fix=()) if is_right else problem


@rule("W06", "swapped-wires", scope="graph")
def swapped_wires(subject: GraphSubject) -> Iterator[Problem]:
    """Two inputs have each other's source.

    Why: every input is connected, but two quantities are exchanged. {wheels?}With the wheel names
    reversed the robot turns the wrong way. With linear and angular velocity exchanged it spins.{/}

    Fix: delete both connections and connect each source to the other input.

    Example: `make_array.inputs:input0` has the name of the right joint, `inputs:input1` that of the
    left.
    """
    for fault in _faults(subject, "swapped"):
        other = short_source(fault.elsewhere)
        message = (
            f"{fault.port} and {other} are exchanged: "
            f"{fault.port} is connected to {source_shown(fault)}, "
            f"expected {short_source(fault.expected)}"
        )
        yield _problem(
            subject, fault, message, f"exchange the two wires at {fault.port} and {other}"
        )


@rule("W07", "cross-graph-wire", scope="graph")
def cross_graph_wire(subject: GraphSubject) -> Iterator[Problem]:
    """The source of a required input is in another graph.

    Why: each Action Graph is evaluated separately. A context or time stamp of another graph may be
    read before it exists. The node then uses the domain id of the environment, or time stamp 0.

    Fix: connect the input to the node of that type in the same graph.

    Example: `inputs:context` of a node of {next_graph_name} connected to the context of
    {graph_name}.
    """
    for fault in _faults(subject, "foreign"):
        message = (
            f"{fault.port} is connected to {fault.actual}, which is not in this graph, "
            f"expected {short_source(fault.expected)}"
        )
        yield _problem(subject, fault, message, connect_hint(fault))


@rule("W10", "forbidden-wire", scope="graph")
def forbidden_wire(subject: GraphSubject) -> Iterator[Problem]:
    """The lab forbids this wire.

    Why: the execOut of a subscriber fires only when a message arrives. A controller driven by it
    runs at the rate of the messages and not at every update.

    Fix: delete the connection, and trigger the node from the tick of On Playback Tick.

    Example: `execOut` of the subscriber to `{commands}` connected to `execIn` of a controller.
    """
    for fault in _faults(subject, "forbidden"):
        actual = source_shown(fault)
        expected = "" if fault.expected is None else f", expected {short_source(fault.expected)}"
        message = f"{fault.port} is connected to {actual}, which the handout forbids{expected}"
        yield _problem(subject, fault, message, connect_hint(fault) if fault.expected else None)
