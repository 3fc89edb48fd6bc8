"""The column of each box, and the wires that run backward."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from graphlib import TopologicalSorter

Edge = tuple[str, str]


def backward(keys: Sequence[str], edges: Sequence[Edge]) -> frozenset[int]:
    """Return the places in `edges` of those that close a cycle, seen from the first keys."""
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
    """Return the column of each key, from 0; `edges` form no cycle and always lead rightward.

    A box that feeds others stands right before the first of them, one that feeds none as far
    left as it can: that keeps wires short.
    """
    following: dict[str, list[str]] = {key: [] for key in keys}
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(keys, ()))
    for source, target in edges:
        sorter.add(target, source)
        following[source].append(target)
    rank = {key: column for column, group in enumerate(_generations(sorter)) for key in group}
    for key in reversed(rank):
        if following[key]:
            rank[key] = min(rank[other] for other in following[key]) - 1
    first = min(rank.values(), default=0)
    return {key: rank[key] - first for key in keys}


def _generations(sorter: TopologicalSorter[str]) -> Iterator[tuple[str, ...]]:
    """Yield the keys that nothing feeds, then those that only these feed, and so on."""
    sorter.prepare()
    while sorter.is_active():
        ready = sorter.get_ready()
        yield ready
        sorter.done(*ready)
