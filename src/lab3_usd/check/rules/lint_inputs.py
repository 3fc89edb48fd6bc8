"""Rules about inputs that get nothing: nodes that work on zeros, and arrays with gaps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.missing_wires import likely_wire, lost_constant, wire_hint
from lab3_usd.check.registry import rule
from lab3_usd.facts.arrays import array_items
from lab3_usd.facts.articulations import commands
from lab3_usd.facts.execution_order import nodes_of
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.facts.stalled_nodes import is_nothing, is_wired, unmet_needs
from lab3_usd.isaac.behaviour import Need
from lab3_usd.isaac.node_types import INPUT, NUMBERS
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.stage import Node

_MOST = 4  # inputs that a message lists


@rule("K10", "unset-input", scope="lint", formerly="works-on-zeros")
def unset_input(subject: LintSubject) -> Iterator[Problem]:
    """A required input is neither connected nor set.

    Why: an input without a wire and a value is 0 or empty. A publisher without a time stamps every
    message with 0, a helper without a render product publishes nothing, a controller without a
    wheel radius outputs no command. A constant time is no better. Isaac Sim reports nothing, or
    logs a line at every update. In a file with graphs but neither robot nor sensor, another stage
    may supply the prims: a warning.

    Fix: connect the input to the node that computes it, or set it in the Property panel.

    Example: `ros2_publish_odometry.inputs:timeStamp` without a wire.
    """
    needs = subject.platform.needs
    for node in nodes_of(lambda kind: kind.type in needs, subject.stage):
        if not (subject.runs(node.path) or is_wired(node, subject.stage)):
            continue
        for need in unmet_needs(node, subject.platform, subject.live):
            may_be_filled = subject.is_module and any(
                node.type is not None and node.type.ports[INPUT + name].is_target
                for name in need.inputs
                if node.has_port(INPUT + name)
            )
            inputs = [name for name in need.inputs if node.has_port(f"inputs:{name}")]
            names = ", ".join(f"inputs:{name}" for name in inputs)
            fixed, is_zero = _fixed_input(node, inputs, need, subject)
            unset = f"{names} is not connected and has no value"
            unset = f"none of {names} is connected or set" if len(inputs) > 1 else unset
            wire = likely_wire(node, f"inputs:{inputs[0]}", subject) if len(inputs) == 1 else ()
            wire = () if fixed else wire
            expected = "a wire or a value"
            if fixed:
                useful = "a value that changes" if need.changing else "another value"
                expected = "a value above 0" if need.positive else useful
            yield Problem(
                node.path,
                (fixed or unset) + (f": {need.effect}" if is_zero else ""),
                property=f"inputs:{inputs[0]}",
                expected=expected,
                hint=wire_hint(wire),
                fix=wire,
                likely=True,
                severity="warning" if need.severity == "warning" or may_be_filled else None,
                rests_on=subject.stage.unknown_inputs(node),
            )


def _fixed_input(
    node: Node, names: list[str], need: Need, subject: LintSubject
) -> tuple[str, bool]:
    """Say which of some inputs has a useless value, '' for none, and whether that is nothing."""
    for port in (INPUT + name for name in names):
        value = effective_value(node, port, subject.live)
        if value is None:
            continue
        if node.sources(port) or (need.changing and not is_nothing(value)):
            return f"{port} is always {display(value)}", need.positive or is_nothing(value)
        state = node.state(port)
        if state is not None and state.value not in {None, "", ()}:  # written, and as good as none
            return f"{port} is {display(value)}", True
    return "", True


def _has_numbers(node: Node, ports: Iterable[str], subject: LintSubject) -> bool:
    """Whether a node makes an array of numbers, by its values and the types of its wires."""
    for port in ports:
        if isinstance(effective_value(node, port, subject.live), (int, float)):
            return True
        for source, name in live_sources(node, port, subject.live):
            declared = None if source.type is None else source.type.port(name)
            if declared is not None and declared.usd_type in NUMBERS:
                return True
    return False


def _listed(ports: tuple[str, ...]) -> str:
    """Return inputs with their verb, as the beginning of a sentence."""
    if len(ports) == 1:
        return f"{ports[0]} is"
    return f"{', '.join(ports[:_MOST])}{' and others' if len(ports) > _MOST else ''} are"


@rule("K11", "array-gaps", scope="lint", formerly="array-with-gaps")
def array_gaps(subject: LintSubject) -> Iterator[Problem]:
    """An array has an empty element, or inputs beyond its size.

    Why: an element that is neither connected nor set is empty. No joint has an empty name, so the
    controller moves nothing. Inputs beyond the size of the array are ignored.

    Fix: connect the input named here, or correct the array's size in the Property panel.

    Example: `joint_name_array.inputs:input0` lost its wire, while `input1` has one.

    Basis: Make Array is a node of Kit, whose code is not public; its page describes one input for
    each element. An empty joint name is rejected in `articulation.py:767`. Gaps in an array of
    numbers are a warning: `test_articulation_controller.py:320-360` of v6.0.1 commands with some.
    """
    for command in commands(subject.stage):
        port = command.ports.joints
        if "" in (command.names or ()) and not command.node.sources(port):
            yield Problem(
                command.node.path,
                f"{port} has an empty element, and no joint has an empty name",
                property=port,
                expected="names of joints",
            )
    for node in nodes_of(lambda kind: kind.dynamic, subject.stage):
        items = array_items(node)
        if items is None:
            continue
        for port in items.filled:
            if effective_value(node, port, subject.live) == "":
                yield Problem(
                    node.path,
                    f"{port} is connected to an empty text: an element of the array is empty",
                    property=port,
                    expected="a text",
                    assumes=tuple(
                        (source.path, name)
                        for source, name in live_sources(node, port, subject.live)
                    ),
                )
        if items.filled:
            has_numbers = _has_numbers(node, items.filled, subject)
            if items.empty:
                port = items.empty[0]
                wire = lost_constant(node, port, subject) if len(items.empty) == 1 else ()
                yield Problem(
                    node.path,
                    f"{_listed(items.empty)} not connected and without a value: "
                    "the array has an empty element there",
                    property=port,
                    expected="a wire or a value",
                    severity="warning" if has_numbers else None,
                    hint=wire_hint(wire),
                    fix=wire,
                    likely=True,
                    rests_on=subject.stage.unknown_inputs(node),
                )
        if items.beyond:
            yield Problem(
                node.path,
                f"{_listed(items.beyond)} ignored: {items.count_port} is {items.count}",
                property=items.count_port,
                actual=str(items.count),
                severity="warning",
                rests_on=subject.stage.unknown_inputs(node),
                assumes=((node.path, items.count_port),),
            )
