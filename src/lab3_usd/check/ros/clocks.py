"""ROS contexts and clocks: which nodes use each context, and which clock stamps each message."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.check.ros.running import LintSubject, effective_value, live_sources
from lab3_usd.check.ros.topics import Endpoint, endpoints
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, OUTPUT

_CONTEXT = "context"
DOMAIN, FROM_ENVIRONMENT = "inputs:domain_id", "inputs:useDomainIDEnvVar"
_FIXED = "domain "
STAMP = "inputs:timeStamp"
_SYSTEM, _RESET = "inputs:useSystemTime", "inputs:resetSimulationTimeOnStop"
_READER_RESET = "inputs:resetOnStop"
CLOCK = "rosgraph_msgs/msg/Clock"


class ContextInput(Struct, frozen=True, eq=False):
    """The context of a node: what makes it, and whether anything is wired or set at all."""

    node: Node
    port: str
    contexts: tuple[Node, ...]
    is_set: bool


def context_inputs(subject: LintSubject) -> Iterator[ContextInput]:
    """Yield the context of every live node that takes one."""
    port = INPUT + _CONTEXT
    for node in subject.live.values():
        if node.type is not None and port in node.type.ports:
            contexts = tuple(source for source, _ in live_sources(node, port, subject.live))
            yield ContextInput(node, port, contexts, bool(node.sources(port) or node.value(port)))


def domains(subject: LintSubject) -> dict[str, list[Node]]:
    """Return the contexts that a node uses by the domain they name, in words."""
    by_domain: dict[str, list[Node]] = {}
    used = {
        node.path: node
        for context_input in context_inputs(subject)
        for node in context_input.contexts
    }
    for node in used.values():
        if node.type is None or OUTPUT + _CONTEXT not in node.type.ports:
            continue
        number = effective_value(node, DOMAIN, subject.live)
        if effective_value(node, FROM_ENVIRONMENT, subject.live) is True:
            words = f"the environment's domain, else domain {number}"
        else:
            words = f"{_FIXED}{number}"
        by_domain.setdefault(words, []).append(node)
    return by_domain


def domain_of(node: Node, subject: LintSubject) -> str:
    """Return the domain in which a node talks, as far as the stage tells."""
    sources = [source for source, _ in live_sources(node, INPUT + _CONTEXT, subject.live)]
    for words, contexts in domains(subject).items():
        if sources and sources[0] in contexts:
            return words
    return ""


def may_meet(one: str, other: str) -> bool:
    """Whether nodes of these domains may hear each other: the environment may name any."""
    return one == other or not (one.startswith(_FIXED) and other.startswith(_FIXED))


class Stamp(Struct, frozen=True, eq=False):
    """The clock of one topic; `port` is the input that chooses it.

    `restarts` is None where it is not known.
    """

    node: Node
    topic: str
    port: str
    clock: Literal["simulation", "system", "unknown"]
    restarts: bool | None
    is_clock: bool


def stamps(subject: LintSubject) -> Iterator[Stamp]:
    """Yield the clock of each topic that is published."""
    for endpoint in endpoints(subject.stage, subject.lab):
        if endpoint.runs and endpoint.direction == "publishes" and endpoint.topic:
            stamp = _stamp_of_helper(endpoint, subject) or _stamp_by_wire(endpoint, subject)
            if stamp is not None:
                yield stamp


def _stamp_of_helper(endpoint: Endpoint, subject: LintSubject) -> Stamp | None:
    """Return the clock of a node that reads the time by itself."""
    node, live = endpoint.node, subject.live
    if node.type is None or _SYSTEM not in node.type.ports:
        return None
    topic = str(endpoint.topic)
    if effective_value(node, _SYSTEM, live) is True:
        return Stamp(node, topic, _SYSTEM, "system", None, is_clock=False)
    restarts = effective_value(node, _RESET, live)
    known = restarts if isinstance(restarts, bool) else None
    return Stamp(node, topic, _RESET, "simulation", known, is_clock=False)


def _stamp_by_wire(endpoint: Endpoint, subject: LintSubject) -> Stamp | None:
    """Return the clock of a node whose time comes by a wire."""
    node = endpoint.node
    sources = list(live_sources(node, STAMP, subject.live))
    if not sources:
        return None
    source, _ = sources[0]
    is_clock, topic = endpoint.type == CLOCK, str(endpoint.topic)
    restarts = effective_value(source, _READER_RESET, subject.live)
    if source.type is None:
        return Stamp(node, topic, STAMP, "unknown", None, is_clock)
    if any("systemTime" in port for port in source.type.ports):
        return Stamp(node, topic, STAMP, "system", None, is_clock)
    if isinstance(restarts, bool):
        return Stamp(node, topic, STAMP, "simulation", restarts, is_clock)
    return Stamp(node, topic, STAMP, "unknown", None, is_clock)
