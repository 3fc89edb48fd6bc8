"""Rules about wires: dead ones, ports that no type has, types that do not fit, rings, doubles."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import commands, leaves_joints
from lab3_usd.facts.execution_order import nodes_of
from lab3_usd.facts.quantities import quantity_of
from lab3_usd.facts.stalled_nodes import has_side_effects, is_nothing, needs_of
from lab3_usd.facts.wires import Connection, connections
from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.stage import Node


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
    for wire in connections(subject.stage):
        value = wire.node.ports[wire.port].value
        default = None if wire.node.type is None else wire.node.type.default(wire.port, None)
        if wire.is_live and value not in (None, default) and not is_nothing(value):
            yield Problem(
                wire.node.path,
                f"{wire.port} is connected: its value {display(value)} is ignored",
                property=wire.port,
                actual=display(value),
                assumes=((wire.node.path, wire.port),),
            )


@rule("K28", "wired-literal", scope="lint", severity="warning")
def wired_literal(subject: LintSubject) -> Iterator[Problem]:
    """A wire leads into an input that must be set instead.

    Why: the documentation of the node calls the input literal only, as Array Size of Make Array.
    Isaac Sim may drop the wire, or read its value only once: what it does is not public.

    Fix: delete the wire and type the value.

    Example: `inputs:arraySize` of Make Array is connected to a Constant Int.

    Basis: NVIDIA's pages of the nodes. Kit's code is not public: a warning.
    """
    for wire in connections(subject.stage):
        port = None if wire.node.type is None else wire.node.type.port(wire.port)
        if wire.is_live and port is not None and port.literal_only:
            yield Problem(
                wire.node.path,
                f"{wire.port} of {subject.title(wire.node)} is to be set, and is connected",
                property=wire.port,
                actual=wire.path,
                related=(wire.source_prim,),
                assumes=((wire.node.path, wire.port),),
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
    for wire in connections(subject.stage):
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

    Why: a wire carries any number, so another quantity gives no message, but the robot does not
    follow its commands. It is an error where nothing moves: speeds as positions of joints whose
    drives have no stiffness, or as efforts against their damping. So is a time step as a time
    stamp: the time of the messages does not advance, and no transform fits it; a number of frames
    runs 60 times too fast.

    Fix: connect the output, or the component of the vector, that the input expects.

    Example: `linear.y` is connected to `inputs:linearVelocity` of a Differential Controller.
    """
    typed, needs = subject.platform.quantities, subject.platform.needs
    stamp = INPUT + subject.platform.ros.stamp
    meant = nodes_of(lambda kind: kind.type in typed or kind.type in needs, subject.stage)
    for node in meant:
        for port, quantities in _quantities(node, subject).items():
            given = quantity_of(node, port, subject.stage)
            if given is not None and given.name not in quantities:
                is_still = (given.name == _STEP and port == stamp) or (
                    given.name in _SPEEDS and _moves_nothing(node, port, subject)
                )
                yield Problem(
                    node.path,
                    f"{port} expects {' or '.join(quantities)}, but {given.maker.name} provides "
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
    quantity = None if node.type is None else subject.platform.quantities.get(node.type.type)
    takes = (
        {} if quantity is None else {INPUT + short: each for short, each in quantity.takes.items()}
    )
    needed = {
        INPUT + name
        for need in needs_of(node, subject.platform, subject.live)
        for name in need.inputs
    }
    stamp = INPUT + subject.platform.ros.stamp
    return {**takes, stamp: (_TIME,)} if stamp in needed else takes


def _moves_nothing(node: Node, port: str, subject: LintSubject) -> bool:
    return any(
        command.node is node and leaves_joints(command, port, subject.stage)
        for command in commands(subject.stage)
    )
