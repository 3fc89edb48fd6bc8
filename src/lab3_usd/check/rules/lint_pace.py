"""Rules about the pace of sensors: what triggers their helpers, and how often."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.execution_order import (
    event_of,
    gate_step,
    nodes_of,
    signal_inputs,
    signal_sources,
)
from lab3_usd.facts.reaching_values import live_sources
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node

_HELPER, _SUBSCRIBER = "helper", "subscriber"


@rule("K91", "gated-sensor", scope="lint", severity="warning")
def gated_sensor(subject: LintSubject) -> Iterator[Problem]:
    """A gate precedes the helper of a sensor.

    Why: the first signal starts the sensor's writer, which then publishes each picture, whatever
    signals come. The gate delays the start, and slows nothing down.

    Fix: set Frame Skip Count of the helper, or the tick rate of the sensor, and remove the gate.

    Example: an Isaac Simulation Gate with step 10 before a ROS2 Camera Helper.

    Basis: `OgnROS2CameraHelper.py` attaches its writer once; IsaacSim issue 346.
    """
    for node in _helpers(subject):
        for gate in _ahead(node, subject):
            step = gate_step(gate, subject.live, subject.platform)
            if step > 1:
                yield Problem(
                    node.path,
                    f"{gate.name} passes one of {step} signals, but {subject.title(node)} "
                    "publishes each picture once it is started",
                    property=signal_inputs(node)[0],
                    related=(gate.path,),
                )
                break


@rule("K92", "sensor-waits-for-message", scope="lint", severity="warning")
def sensor_waits_for_message(subject: LintSubject) -> Iterator[Problem]:
    """A sensor waits for the first message of a subscriber.

    Why: a subscriber signals when a message has come. Until then there is no render product, and no
    scan or image is published.

    Fix: trigger the render product and the helper by On Playback Tick.

    Example: Exec Out of the subscriber of `/cmd_vel` triggers Isaac Create Render Product.

    Basis: `OgnROS2SubscribeTwist.cpp`: the execution output is set for a message that was taken.
    """
    for node in _helpers(subject):
        fed = [
            source for port in node.ports for source, _ in live_sources(node, port, subject.live)
        ]
        products = [source for source in fed if source.type and source.type.product]
        for waiting in (node, *products):
            ahead = [*_ahead(waiting, subject)]
            subscriber = next((s for s in ahead if s.type and s.type.role == _SUBSCRIBER), None)
            if subscriber is not None and not any(
                source.type is None or event_of(source, subject.platform) is not None
                for source in ahead  # which signals by itself, or may
            ):
                yield Problem(
                    node.path,
                    f"publishes nothing before the first message of {subscriber.name}, which alone "
                    f"triggers {waiting.name}",
                    related=tuple(dict.fromkeys((subscriber.path, waiting.path))),
                    assumes=tuple((node.path, port) for port in signal_inputs(node)),
                )
                break


def _helpers(subject: LintSubject) -> Iterator[Node]:
    helpers = nodes_of(lambda kind: kind.role == _HELPER, subject.stage)
    return (node for node in helpers if subject.runs(node.path))


def _ahead(node: Node, subject: LintSubject) -> Iterator[Node]:
    """Yield the nodes whose signals reach a node, nearest first, up to subscribers."""
    seen, waiting = {node.path}, [node]
    for current in waiting:
        for source in signal_sources(current, subject.live):
            if source.path not in seen:
                seen.add(source.path)
                yield source
                if source.type is None or source.type.role != _SUBSCRIBER:
                    waiting.append(source)
