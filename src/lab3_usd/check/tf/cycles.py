"""The frames that form cycles, so that they have no root."""

from __future__ import annotations

from collections.abc import Iterable

from lab3_usd.check.tf.frames import Edge
from lab3_usd.model.digraph import is_acyclic


def frames_in_cycles(edges: Iterable[Edge]) -> list[str]:
    """Return the frames of cycles, and of what lies between two of them, as the edges name them."""
    pairs = [(edge.parent, edge.child) for edge in edges]
    if is_acyclic(pairs):
        return []
    import networkx as nx  # noqa: PLC0415 - only where there is a cycle

    graph = nx.DiGraph(pairs)
    parts = nx.strongly_connected_components(graph)
    rings = {name for part in parts if len(part) > 1 for name in part}
    rings.update(nx.nodes_with_selfloops(graph))
    below = rings.union(*(nx.descendants(graph, name) for name in rings))
    above = rings.union(*(nx.ancestors(graph, name) for name in rings))
    return [name for name in graph if name in above and name in below]
