"""Rules about transforms that never change, and the topic on which tf2 keeps them."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.lint.bodies import moving_source
from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import effective_value
from lab3_usd.check.ros.topics import Endpoint, endpoints
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node

_STATIC, _MOVING = "/tf_static", "/tf"


@rule("K57", "static-transforms", scope="lint")
def static_transforms(subject: LintSubject) -> Iterator[Problem]:
    """Transforms are sent once where they move, or again and again on `/tf_static`.

    Why: with Static Publisher on, a transform is sent at the first tick alone, and kept for those
    who ask for kept messages. tf2 asks for them on `/tf_static`, and there takes no others. What is
    sent once never moves again: a robot stays where it was at the first tick.

    Fix: enable Static Publisher for `/tf_static` only, and for transforms that never change. What
    an odometry computes belongs on `/tf`, with Static Publisher off.

    Example: a Publish Raw Transform Tree on `/tf_static` with Static Publisher off.
    """
    for endpoint in endpoints(subject.stage, subject.lab):
        ports = None if endpoint.node.type is None else endpoint.node.type.tf
        if not (endpoint.runs and endpoint.topic and endpoint.qos and ports and ports.static):
            continue
        is_once = effective_value(endpoint.node, ports.static, subject.live) is True
        is_kept = endpoint.qos.durability == "transient_local"
        is_for_static = endpoint.topic.endswith(_STATIC)
        moves = moving_source(endpoint.node, subject) if is_for_static else None
        if moves is not None and (is_once or not is_kept):
            yield _moving(endpoint, moves, ports.static if is_once else None)
        elif not is_kept if is_for_static else is_once:
            how = "without keeping it for tf2" if is_for_static else "once, at the first tick"
            yield Problem(
                endpoint.node.path,
                f"publishes {endpoint.topic} {how}",
                property=ports.static,
                expected=str(is_for_static),
                actual=str(is_once),
                severity=None if endpoint.sure else "warning",
            )


def _moving(endpoint: Endpoint, moves: Node, switch: str | None) -> Problem:
    """Say that what moves belongs on another topic; `switch` is on where it is sent once."""
    topic = str(endpoint.topic)
    belongs = topic.removesuffix(_STATIC) + _MOVING
    how = "once, at the first tick" if switch else "without keeping it for tf2"
    return Problem(
        endpoint.node.path,
        f"publishes {topic} {how}; the pose from {moves.path} changes and belongs on {belongs}",
        property=switch or endpoint.port,
        expected="False" if switch else belongs,
        actual="True" if switch else topic,
        related=(moves.path,),
        severity=None if endpoint.sure else "warning",
    )
