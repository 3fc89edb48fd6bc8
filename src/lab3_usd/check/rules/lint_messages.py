"""Rules about nodes that have messages and services of any type."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.domains import are_surely_one, domain_of
from lab3_usd.facts.endpoints import namespace_of, ros_name
from lab3_usd.facts.execution_order import nodes_of
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.wires import connections
from lab3_usd.isaac.messages import NAMED, why_no_message, why_no_service
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node


def _names_message(kind: NodeType) -> bool:
    """Whether nodes of a type name their message or service."""
    return all(name in kind.ports for name in NAMED)


def _named(node: Node, subject: LintSubject) -> tuple[str, str, str] | None:
    """Return package, folder and name of the message or service of a node, None for none."""
    if node.type is None or not _names_message(node.type):
        return None
    package, folder, name = (str(effective_value(node, n, subject.live) or "") for n in NAMED)
    return (package, folder, name) if package and folder and name else None


@rule("K18", "unknown-message", scope="lint")
def unknown_message(subject: LintSubject) -> Iterator[Problem]:
    """A generic node names an impossible message or service.

    Why: Isaac Sim logs that it does not exist or is not available in the ROS 2 environment, and
    nothing is sent or received. A package that ROS 2 Humble does not have may be somebody's own.

    Fix: give package, subfolder and name as `ros2 interface list` shows them, without an ending.

    Example: `inputs:messageName = "Float32.msg"`, or the package `geometry_msg`.
    """
    for node in nodes_of(_names_message, subject.stage):
        named = _named(node, subject)
        if named is None or node.type is None:
            continue
        why = (why_no_service if node.type.role == "service" else why_no_message)(*named)
        if why:
            yield Problem(
                node.path,
                f"{'/'.join(named)} does not exist: {why}",
                property=NAMED[2],
                actual="/".join(named),
            )


@rule("K19", "service-types", scope="lint")
def service_types(subject: LintSubject) -> Iterator[Problem]:
    """Nodes of one service have different types.

    Why: ROS 2 connects only clients and servers of one type. A response of another type than its
    request is written into the memory of a message that it is not.

    Fix: give all nodes of the service the same package and name.

    Example: the request is `std_srvs/srv/SetBool`, and its response `std_srvs/srv/Trigger`.
    """
    types = {
        node.path: (node, "/".join(named))
        for node in nodes_of(lambda kind: kind.role == "service", subject.stage)
        for named in [_named(node, subject)]
        if named is not None
    }
    for wire in connections(subject.stage) if types else ():
        kind = wire.node.type
        if wire.source is None or kind is None or wire.port not in kind.ports or kind.services:
            continue  # a response has no name: it gets its server
        first, second = types.get(wire.source.path), types.get(wire.node.path)
        if wire.kind == "data" and first and second and first[1] != second[1]:
            yield _differ(second, first, "answers")
    for first, second in combinations(types.values(), 2):
        one, other = (_service(node, subject) for node, _ in (first, second))
        domains = [domain_of(node, subject.live, subject.platform) for node, _ in (first, second)]
        if one and one == other and first[1] != second[1] and are_surely_one(domains):
            yield _differ(second, first, f"has {one} in common with")


def _differ(second: tuple[Node, str], first: tuple[Node, str], does: str) -> Problem:
    (node, kind), (other, expected) = second, first
    return Problem(
        node.path,
        f"its type is {kind}, and it {does} {other.path}, which has {expected}",
        property=NAMED[2],
        expected=expected,
        actual=kind,
        related=(other.path,),
    )


def _service(node: Node, subject: LintSubject) -> str:
    """Return the full name of the service of a node, '' where it has none or a wire brings it."""
    port = next(iter(node.type.services if node.type is not None else ()), "")
    written = effective_value(node, port, subject.live) if port else None
    if not isinstance(written, str):
        return ""
    space = namespace_of(node, subject.stage, subject.live)
    return ros_name(space, written) or ""
