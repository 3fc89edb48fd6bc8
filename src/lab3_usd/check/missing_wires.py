"""The wires that were left out of a graph, where one alone can be meant."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject, ModelSubject
from lab3_usd.facts.execution_order import event_of, live_nodes, live_sources, run_states
from lab3_usd.isaac.node_types import OUTPUT
from lab3_usd.model.changes import Connect, Edit
from lab3_usd.model.stage import Node

_CONTEXT = f"{OUTPUT}context"
_SUBSCRIBER = "subscriber"


def execution_wire(node: Node, port: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the wire that triggers a node that nothing triggers.

    It comes from the one node that computes what this one takes and signals when it has, or from
    the one event of the graph where no other node of it signals anything to this one's makers.
    """
    inputs = () if node.type is None else node.type.execution_inputs
    makers = {maker.path: maker for maker in _makers(node, subject)}
    if len(inputs) != 1 or len(makers) > 1:
        return ()
    sources = [*makers.values()] or _events(node, subject)
    outputs = [path for source in sources for path in _signals(source)]
    return _connect(node, port, outputs)


def _makers(node: Node, subject: LintSubject) -> Iterator[Node]:
    """Yield the running nodes that give data to a node and a signal when they have computed."""
    for port in node.ports:
        for source, _ in live_sources(node, port, subject.live):
            kind = source.type
            is_paced = kind is not None and kind.role != _SUBSCRIBER and kind.execution_inputs
            if is_paced and subject.runs(source.path) and any(_signals(source)):
                yield source


def _events(node: Node, subject: ModelSubject) -> list[Node]:
    """Return the events of a node's graph that surely fire at every update."""
    states = run_states(subject.stage, subject.platform)
    usual = subject.platform.graph.value(subject.platform.graph.evaluation.stage)
    return [
        other
        for other in _beside(node, subject)
        if event_of(other, subject.platform) == usual and states.get(other.path) == "runs"
    ]


def _beside(node: Node, subject: ModelSubject) -> Iterator[Node]:
    graph = node.path.rpartition("/")[0]
    live = live_nodes(subject.stage, subject.platform)
    return (other for other in live.values() if other.path.rpartition("/")[0] == graph)


def _signals(node: Node) -> Iterator[str]:
    """Yield the outputs that carry signals."""
    for name, port in () if node.type is None else node.type.ports.items():
        if port.is_execution and name.startswith(OUTPUT):
            yield f"{node.path}.{name}"


def step_wire(node: Node, port: str, subject: ModelSubject) -> tuple[Edit, ...]:
    """Return the wire that gives a node the length of a step, from the one event of its graph."""
    deltas = subject.platform.deltas
    outputs = [
        f"{event.path}.{OUTPUT}{deltas[event.type_name]}"
        for event in _events(node, subject)
        if event.type_name in deltas
    ]
    return _connect(node, port, outputs)


def context_wire(node: Node, port: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the wire from the one context of a node's graph."""
    outputs = [
        f"{other.path}.{_CONTEXT}"
        for other in _beside(node, subject)
        if other.type is not None and _CONTEXT in other.type.ports
    ]
    return _connect(node, port, outputs)


def _connect(node: Node, port: str, outputs: list[str]) -> tuple[Edit, ...]:
    known = None if node.type is None else node.type.port(port)
    if known is None or len(outputs) != 1:
        return ()
    return (Connect(node.path, port, known.usd_type, tuple(outputs)),)
