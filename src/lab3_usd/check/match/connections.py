"""Single connections: whether they are live, fit their ports, or run in a circle."""

from __future__ import annotations

from collections.abc import Mapping

from lab3_usd.check.match.result import Roles
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, can_connect


def is_live(live: Mapping[str, Node], source: str) -> bool:
    """Whether a connection's source is a port that exists on a live node.

    A wire from another node's input brings the value there, but no signal.
    """
    path, _, port = source.rpartition(".")
    node = live.get(path)
    if node is None or not node.has_port(port):
        return False
    known = None if node.type is None else node.type.port(port)
    if known is None or known.is_source:
        return True
    return port.startswith(INPUT) and not known.is_execution and not known.is_target


def types_fit(live: Mapping[str, Node], node: Node, port: str, source: str) -> bool:
    """Whether what comes from a live source can go into this input."""
    path, _, source_port = source.rpartition(".")
    other = live[path]
    ends = (
        None if other.type is None else other.type.port(source_port),
        None if node.type is None else node.type.port(port),
    )
    return ends[0] is None or ends[1] is None or can_connect(ends[0], ends[1])


def closes_cycle(roles: Roles, node: Node, port: str, source: str) -> bool:
    """Whether an execution wire lets a node trigger itself."""
    known = None if node.type is None else node.type.port(port)
    if known is None or not known.is_execution:
        return False
    start = source.rpartition(".")[0]
    return _reaches(roles, node.path, start)


def _reaches(roles: Roles, start: str, goal: str) -> bool:
    """Whether execution that runs in node `start` goes on to node `goal`."""
    nodes = () if roles.graph is None else roles.graph.nodes
    reached, frontier = {start}, [start]
    while frontier:
        here = frontier.pop()
        if here == goal:
            return True
        for node in nodes:
            if node.path not in reached and _triggered_by(node, here):
                reached.add(node.path)
                frontier.append(node.path)
    return False


def _triggered_by(node: Node, path: str) -> bool:
    if node.type is None:
        return False
    return any(
        source.rpartition(".")[0] == path
        for port in node.type.ports.values()
        if port.is_execution and not port.is_source
        for source in node.sources(port.name)
    )
