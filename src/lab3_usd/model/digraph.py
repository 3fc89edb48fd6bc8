"""Graphs of names that lead to each other."""

from __future__ import annotations

from collections.abc import Iterable


def is_acyclic(pairs: Iterable[tuple[str, str]]) -> bool:
    """Whether no name leads back to itself."""
    from graphlib import CycleError, TopologicalSorter  # noqa: PLC0415 - after start-up

    order: TopologicalSorter[str] = TopologicalSorter()
    for before, after in pairs:
        order.add(after, before)
    try:
        order.prepare()
    except CycleError:
        return False
    return True
