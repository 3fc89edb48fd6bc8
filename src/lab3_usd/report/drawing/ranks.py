"""Which column each box stands in, and which wires run against the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

Edge = tuple[str, str]


def backward(keys: Sequence[str], edges: Sequence[Edge]) -> frozenset[int]:
    """Return the places in `edges` of those that close a circle, seen from the first keys."""
    outgoing: dict[str, list[int]] = {key: [] for key in keys}
    for place, (source, _) in enumerate(edges):
        outgoing[source].append(place)
    found: set[int] = set()
    done: set[str] = set()
    for key in keys:
        if key not in done:
            _walk(key, outgoing, edges, (done, found))
    return frozenset(found)


def _walk(
    start: str,
    outgoing: dict[str, list[int]],
    edges: Sequence[Edge],
    result: tuple[set[str], set[int]],
) -> None:
    # An own stack instead of recursion: a damaged file may hold a chain of thousands of nodes.
    done, found = result
    open_keys = {start}
    stack: list[tuple[str, Iterator[int]]] = [(start, iter(outgoing[start]))]
    while stack:
        key, places = stack[-1]
        place = next(places, None)
        if place is None:
            stack.pop()
            open_keys.discard(key)
            done.add(key)
            continue
        target = edges[place][1]
        if target in open_keys:
            found.add(place)
        elif target not in done:
            open_keys.add(target)
            stack.append((target, iter(outgoing[target])))


def ranks(keys: Sequence[str], edges: Sequence[Edge]) -> dict[str, int]:
    """Return the column of each key, from 0; `edges` form no circle and always lead rightward.

    A box that feeds others stands right before the first of them, one that feeds none as far
    left as it can: that keeps wires short.
    """
    import networkx as nx  # noqa: PLC0415 - kept out of start-up

    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_nodes_from(keys)
    graph.add_edges_from(edges)
    generations = [list(group) for group in nx.topological_generations(graph)]
    rank = {key: column for column, group in enumerate(generations) for key in group}
    for group in reversed(generations):
        for key in group:
            following = [rank[other] for other in graph.successors(key)]
            if following:
                rank[key] = min(following) - 1
    first = min(rank.values(), default=0)
    return {key: rank[key] - first for key in keys}
