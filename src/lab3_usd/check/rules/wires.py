"""Rules about wires: every required one, from the right port, and only those."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.all_the_same import without_wire
from lab3_usd.check.finding import Problem
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.limits import stopping_limits
from lab3_usd.check.rules.settings import settings_of
from lab3_usd.check.running import is_opened_first, signals_once
from lab3_usd.check.say import short_source
from lab3_usd.check.subject import GraphSubject
from lab3_usd.check.wire_fault import WireFault, connect_hint, source_shown, wire_problem


def _faults(subject: GraphSubject, *kinds: str) -> Iterator[WireFault]:
    return (fault for fault in subject.wire_faults if fault.kind in kinds)


@rule("W01", "missing-wire", scope="graph")
def missing_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A required input is not wired.

    Why: without its execution wire a node never computes; without data it works on zeros: a
    publisher without time stamps everything 0. One without a context is in the domain that the
    environment names in `ROS_DOMAIN_ID`, else in 0, whatever the graph's context says.

    Fix: open the graph in Window > Graph Editors > Action Graph, drag from the source port to the
    input named here, and look that a wire stays attached.

    Example: `ros2_publish_clock.inputs:timeStamp` without a wire makes /clock stand at 0.
    """
    for fault in _faults(subject, "missing", "moved"):
        message = f"{fault.port} is not wired, expected {short_source(fault.expected)}"
        if fault.elsewhere is not None:
            message += f"; that wire goes into {short_source(fault.elsewhere)} instead"
        yield wire_problem(fault, message + without_wire(subject, fault.wire), connect_hint(fault))


def _explain(fault: WireFault, subject: GraphSubject) -> str:
    expected, actual = short_source(fault.expected), source_shown(fault)
    message = f"{fault.port} is wired from {actual}, expected {expected}"
    if fault.kind == "bypass":
        message += f"; the wire goes past {expected.partition('.')[0]}"
    return message + _told_once(fault, subject)


def _told_once(fault: WireFault, subject: GraphSubject) -> str:
    """Say what a signal does that comes a single time; '' where it comes time and again."""
    prim, _, port = str(fault.actual).rpartition(".")
    source = subject.live.get(prim)
    if source is None or not signals_once(source, port, subject.live, subject.lab):
        return ""
    if is_opened_first(fault.node):
        return ", which signals once after Play: that opens the topic, and nothing is ever sent"
    return ", which signals only once after Play"


@rule("W02", "wrong-source", scope="graph")
def wrong_source(subject: GraphSubject) -> Iterator[Problem]:
    """A required input is wired from the wrong node or port.

    Why: the node computes with another quantity, often one that is always zero: y instead of x
    of a velocity, a vector that was not scaled, the linear velocity for the angular one. An
    execution input runs the node at another moment, or once: a publisher that is signalled a single
    time opens its topic and never sends.

    Fix: delete the wire in the Action Graph editor and drag a new one from the port named here.

    Example: `differential_controller.inputs:angularVelocity` wired from `outputs:x` of the angular
    vector: the robot never turns.
    """
    for fault in _faults(subject, "wrong", "bypass"):
        message = _explain(fault, subject) + without_wire(subject, fault.wire)
        yield wire_problem(fault, message, connect_hint(fault))


@rule("W03", "dead-source", scope="graph")
def dead_source(subject: GraphSubject) -> Iterator[Problem]:
    """An input is wired from a node or port that does not exist.

    Why: nothing can come over such a wire, and Isaac Sim may drop it when it loads the stage: the
    input is as good as not wired. Deleting or renaming a node outside the editor leaves these, and
    so does a port that the type lacks: a Constant Token gives its value from `inputs:value`.

    Fix: delete the wire and drag a new one from the port named here; a leftover beside a good
    wire can be left or removed with Disconnect.

    Example: `make_array.inputs:input0` wired from `constant_left_joint.outputs:value`.
    """
    for fault in _faults(subject, "dead"):
        expected, actual = short_source(fault.expected), source_shown(fault)
        message = f"{fault.port} is wired from {actual}, which does not exist, expected {expected}"
        yield wire_problem(fault, message + without_wire(subject, fault.wire), connect_hint(fault))


@rule("W04", "second-source", scope="graph")
def second_source(subject: GraphSubject) -> Iterator[Problem]:
    """A required input has a second source beside the right one.

    Why: a data input takes one of its sources, and no public source says which; an execution input
    may run the node once for each.

    Fix: select the wire from the source named here in the Action Graph editor and delete it.

    Example: `ros2_publish_clock.inputs:timeStamp` fed by two Isaac Read Simulation Time nodes.
    """
    for fault in _faults(subject, "second"):
        actual = source_shown(fault)
        message = f"{fault.port} is also wired from {actual}, expected one source"
        yield wire_problem(fault, message, f"delete the wire from {actual}")


@rule("W05", "unasked-wire", scope="graph", severity="warning")
def unasked_wire(subject: GraphSubject) -> Iterator[Problem]:
    """An input is wired that the handout does not wire.

    Why: the handout's graph works without this wire; what comes over it overrides a value or a
    default that was right.

    Fix: delete the wire unless your instructor asked for it.

    Example: `differential_controller.inputs:maxLinearSpeed` wired from a constant.
    """
    # A wire that makes a value wrong, or reaches what must keep its default, is told as that.
    told = {(each.node.path, each.setting.port) for each in settings_of(subject) if not each.met}
    players = [node for node in subject.roles.node_of.values() if node is not None]
    told |= {(n.path, port) for n in players for port, _ in stopping_limits(subject.live, n)}
    kept = subject.lab.policy.keep_default
    for fault in _faults(subject, "unasked"):
        if (fault.node.path, fault.port) not in told and fault.port.partition(":")[2] not in kept:
            message = (
                f"{fault.port} is wired from {source_shown(fault)}, which the handout does not ask"
            )
            yield wire_problem(fault, message)


@rule("W06", "swapped-wires", scope="graph")
def swapped_wires(subject: GraphSubject) -> Iterator[Problem]:
    """Two inputs are fed by each other's source.

    Why: everything is connected, and two quantities trade places: with the wheel names reversed
    the robot turns the wrong way, with linear and angular velocity crossed it spins.

    Fix: delete both wires and connect each to the other input.

    Example: `make_array.inputs:input0` from the right joint's name, `inputs:input1` from the left.
    """
    for fault in _faults(subject, "swapped"):
        other = short_source(fault.elsewhere)
        message = (
            f"{fault.port} and {other} are wired the wrong way round: "
            f"{fault.port} is wired from {source_shown(fault)}, "
            f"expected {short_source(fault.expected)}"
        )
        yield wire_problem(fault, message, f"exchange the two wires at {fault.port} and {other}")


@rule("W07", "cross-graph-wire", scope="graph")
def cross_graph_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A required input is wired from a node of another graph.

    Why: each Action Graph is evaluated by itself; a context or time stamp from another graph may
    be read before it is made, and the node may use the environment's domain, or stamp 0.

    Fix: wire it from the node of that type in the same graph.

    Example: `ROS_Drive/ros2_subscribe_twist.inputs:context` from `ROS_Clock/ros2_context`.
    """
    for fault in _faults(subject, "foreign"):
        message = (
            f"{fault.port} is wired from {fault.actual}, which is not in this graph, "
            f"expected {short_source(fault.expected)}"
        )
        yield wire_problem(fault, message, connect_hint(fault))


@rule("W08", "execution-cycle", scope="graph")
def execution_cycle(subject: GraphSubject) -> Iterator[Problem]:
    """Execution wires run in a circle.

    Why: a node that triggers itself has no order in which it could be evaluated. What Isaac Sim
    does then is not public: it may skip the nodes, or not come to an end.

    Fix: delete the execution wire named here.

    Example: a publisher's execOut wired back to the node that triggers it.
    """
    for fault in _faults(subject, "cycle"):
        actual = source_shown(fault)
        message = f"{fault.port} is wired from {actual}, which this node itself triggers"
        yield wire_problem(fault, message, f"delete the wire from {actual}")


@rule("W09", "incompatible-wire", scope="graph")
def incompatible_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A wire joins two ports whose types do not go together.

    Why: nothing useful comes over it, and Isaac Sim may drop it when it loads the stage.

    Fix: delete the wire.

    Example: the tick of On Playback Tick wired into a queue size.
    """
    for fault in _faults(subject, "incompatible"):
        actual = source_shown(fault)
        message = f"{fault.port} cannot take what comes from {actual}"
        yield wire_problem(fault, message, f"delete the wire from {actual}")


@rule("W10", "forbidden-wire", scope="graph")
def forbidden_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A wire that the handout forbids is there.

    Why: a subscriber's execOut fires only when a message comes, so that a controller driven by it
    runs at the rate of the messages and not every frame.

    Fix: delete the wire, and trigger the node from the tick of On Playback Tick.

    Example: `ros2_subscribe_twist.outputs:execOut` into `differential_controller.inputs:execIn`.
    """
    for fault in _faults(subject, "forbidden"):
        actual = source_shown(fault)
        expected = "" if fault.expected is None else f", expected {short_source(fault.expected)}"
        message = f"{fault.port} is wired from {actual}, which the handout forbids{expected}"
        yield wire_problem(fault, message, connect_hint(fault) if fault.expected else None)


@rule("W11", "leftover-wire", scope="graph", severity="warning")
def leftover_wire(subject: GraphSubject) -> Iterator[Problem]:
    """A wire from something that no longer exists was left behind.

    Why: nothing comes over it, and Isaac Sim may drop it when it loads the stage; it does no harm,
    but it shows that a node was deleted or renamed after it had been wired.

    Fix: right-click the input and choose Disconnect, or leave it.

    Example: a second source `isaac_read_simulation_time_01` of a deleted node.
    """
    for fault in _faults(subject, "leftover"):
        yield wire_problem(
            fault, f"{fault.port} has a leftover wire from {source_shown(fault)}, now gone"
        )
