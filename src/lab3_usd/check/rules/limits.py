"""The rule about limits that stop the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.finding import Problem
from lab3_usd.check.met import setting_value
from lab3_usd.check.model import Node
from lab3_usd.check.physics import number
from lab3_usd.check.registry import rule
from lab3_usd.check.say import short_source, shown, titled
from lab3_usd.check.subject import GraphSubject
from lab3_usd.spec.catalog import Value


@rule("P11", "limit-without-time-step", scope="graph")
def limit_without_time_step(subject: GraphSubject) -> Iterator[Problem]:
    """An acceleration limit is set, and the time step that it needs is not wired.

    Why: a limit on how fast a speed changes needs to know how much time passes. With a limit
    other than 0 and `dt` at 0 the Differential Controller skips every step: the robot never moves.

    Fix: set the limit back to 0, or wire `deltaSeconds` of On Playback Tick to `dt`.

    Example: `maxAcceleration` 0.5 with nothing wired to `dt`.
    """
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        for port, value in stopping_limits(subject.live, node) if node is not None else ():
            if node is not None:
                step = spec.type.time_step[0]
                message = f"{port} is {shown(value)} while {step} is 0: the robot never moves"
                wires = ", ".join(map(short_source, node.sources(port)))
                first = f"delete the wire from {wires}, then " if wires else ""
                hint = f"{first}select {titled(spec)} and set {port.partition(':')[2]} to 0"
                section = dict(spec.keep).get(port, spec.handout)
                yield Problem(node.path, message, port, "0", shown(value), section, hint=hint)


def stopping_limits(live: Mapping[str, Node], node: Node) -> Iterator[tuple[str, Value]]:
    """Yield the limits of a node, and their values, that keep it from computing anything."""
    for step in node.type.time_step if node.type is not None else ():
        seconds = setting_value(live, node, step)
        length = 0.0 if seconds is None else number(seconds)
        if (seconds is None and node.sources(step)) or (length is not None and length > 0):
            return
        for port in node.type.step_limits if node.type is not None else ():
            value = setting_value(live, node, port)
            if value is not None and number(value) != 0:
                yield port, value
