"""Why a node never computes, and which others wait for it."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.ros.running import (
    event_of,
    is_opened_first,
    is_switched_on,
    live_sources,
    shut_gate,
    signal_inputs,
    signal_sources,
    signals_once,
)
from lab3_usd.model.stage import GraphModel, Node
from lab3_usd.spec.catalog import INPUT


class Stop(Struct, frozen=True, eq=False):
    """A node at which signals end: why it gets none, and the nodes that wait for it.

    `reason` is one of unwired (nothing is wired into `port`), broken (only what does not exist),
    once (its only signal comes a single time), off (what signals it is switched off), shut (it
    waits behind a gate that lets nothing through).
    """

    node: Node
    port: str
    reason: str
    cause: str
    waiting: tuple[Node, ...]


def stops(graph: GraphModel, subject: LintSubject) -> Iterator[Stop]:
    """Yield the nodes of an evaluated graph that no signal reaches, each with those behind it.

    A node that waits for one of those is not told again.
    """
    live = subject.live
    idle = [node for node in graph.nodes if node.path in live and _is_idle(node, subject)]
    for node in idle:
        ahead = [source for source in signal_sources(node, live) if source.path != node.path]
        if any(not subject.runs(source.path) for source in ahead):
            continue
        waiting = tuple(_behind(node, idle, subject))
        port = signal_inputs(node)[0]
        written = any(node.sources(each) for each in signal_inputs(node))
        if not ahead:
            reason = "broken" if written else "unwired"
            yield Stop(node, port, reason, "", waiting)
        else:
            reason, cause = _held_by(node, subject)
            yield Stop(node, port, reason, cause, waiting)


def _is_idle(node: Node, subject: LintSubject) -> bool:
    """Whether a node of a known type waits for a signal that never comes."""
    if node.type is None or subject.runs(node.path) or event_of(node, subject.lab) is not None:
        return False
    return bool(signal_inputs(node))


def _held_by(node: Node, subject: LintSubject) -> tuple[str, str]:
    """Return why the signals of nodes that run do not reach this one, and which node is it."""
    live = subject.live
    for port in signal_inputs(node):
        for source, out in live_sources(node, port, live):
            if not is_switched_on(source, live):
                return "off", source.path
            if shut_gate(source, live, subject.lab):
                return "shut", source.path
            if is_opened_first(node) and signals_once(source, out, live, subject.lab):
                return "once", source.path
    return "broken", ""


def _behind(first: Node, idle: list[Node], subject: LintSubject) -> Iterator[Node]:
    """Yield the idle nodes that would run if this one did, in the order of the graph."""
    reached = {first.path}
    is_growing = True
    while is_growing:
        new = {
            node.path
            for node in idle
            if node.path not in reached
            and any(source.path in reached for source in signal_sources(node, subject.live))
        }
        reached |= new
        is_growing = bool(new)
    return (node for node in idle if node.path in reached and node is not first)


def has_job(node: Node) -> bool:
    """Whether a node talks to ROS or moves joints: it is there for a purpose of its own."""
    return node.type is not None and (bool(node.type.role) or node.type.drives is not None)


def feeds(node: Node, subject: LintSubject) -> list[Node]:
    """Return the nodes into which something is wired from this one."""
    prefix = f"{node.path}."
    found = []
    for other in subject.live.values():
        sources = (source for state in other.ports.values() for source in state.sources)
        if other.path != node.path and any(each.startswith(prefix) for each in sources):
            found.append(other)
    return found


def is_wired(node: Node, subject: LintSubject) -> bool:
    """Whether anything is wired into a node or out of it."""
    return any(node.sources(port) for port in node.ports) or bool(feeds(node, subject))


def short(port: str) -> str:
    """Return the name of a port as people write it."""
    return port.removeprefix(INPUT)
