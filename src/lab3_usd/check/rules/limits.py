"""The rule about acceleration limits that stop the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.match.rule_inputs import GraphSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import edits_at
from lab3_usd.facts.execution_order import effective_value
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Problem, display, role_title, short_source
from lab3_usd.model.physics import number
from lab3_usd.model.stage import Node


@rule("P11", "limit-without-time-step", scope="graph")
def limit_without_time_step(subject: GraphSubject) -> Iterator[Problem]:
    """An acceleration limit is set without a time step.

    Why: the controller needs the elapsed time to limit an acceleration. With a limit
    other than 0 and `dt` at 0 it skips every step, and the robot never moves.

    Fix: set the limit back to 0, or connect `deltaSeconds` of On Playback Tick to `dt`.

    Example: `maxAcceleration` 0.5 with nothing connected to `dt`.
    """
    for node, spec in subject.matched:
        for port, value in stopping_limits(subject.live_nodes, node):
            step = spec.type.time_step[0]
            message = f"{port} is {display(value)} while {step} is 0: the robot never moves"
            wires = ", ".join(map(short_source, node.sources(port)))
            first = f"delete the wire from {wires}, then " if wires else ""
            hint = f"{first}select {role_title(spec)} and set {port.partition(':')[2]} to 0"
            section = dict(spec.keep).get(port, spec.handout)
            fix = edits_at(subject, f"{node.path}.{port}")
            steps = tuple((node.path, name) for name in spec.type.time_step)
            yield Problem(
                node.path,
                message,
                port,
                "0",
                display(value),
                section,
                hint=hint,
                fix=fix,
                covers=steps,
            )


def stopping_limits(live: Mapping[str, Node], node: Node) -> Iterator[tuple[str, Value]]:
    """Yield the limits of a node, and their values, that keep it from computing anything."""
    for port in node.type.step_limits if node.type is not None else ():
        value = effective_value(node, port, live) if lacks_time_step(live, node) else None
        if value is not None and number(value) != 0:
            yield port, value


def unknown_limits(live: Mapping[str, Node], node: Node) -> list[str]:
    """Return the limits whose values come over wires, of a node that has no time step."""
    if node.type is None or not lacks_time_step(live, node):
        return []
    wired = (port for port in node.type.step_limits if node.sources(port))
    return [port for port in wired if effective_value(node, port, live) is None]


def lacks_time_step(live: Mapping[str, Node], node: Node) -> bool:
    """Whether the time step of a node that takes one is 0 or less."""
    for step in node.type.time_step if node.type is not None else ():
        seconds = effective_value(node, step, live)
        length = 0.0 if seconds is None else number(seconds)
        if (seconds is None and node.sources(step)) or (length is not None and length > 0):
            return False
    return node.type is not None and bool(node.type.time_step)
