"""The frames that form cycles, so that they have no root."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lab3_usd.check.tf.frames import Edge


def frames_in_cycles(edges: Iterable[Edge]) -> list[str]:
    """Return the frames that stay when those without parents or children are taken away.

    Ends are taken away again and again, parents first; what is left are cycles and what lies
    between two of them, in the order of the edges.
    """
    pairs = [(edge.parent, edge.child) for edge in edges]
    names = dict.fromkeys(name for pair in pairs for name in pair)
    gone = _ends(list(names), pairs)
    gone |= _ends(list(names), [(child, parent) for parent, child in pairs])
    return [name for name in names if name not in gone]


def _ends(names: Sequence[str], pairs: Sequence[tuple[str, str]]) -> set[str]:
    """Return the frames that nothing is above of, once those above them are gone."""
    waiting = dict.fromkeys(names, 0)
    below: dict[str, list[str]] = {}
    for parent, child in pairs:
        waiting[child] += 1
        below.setdefault(parent, []).append(child)
    ahead = [name for name, count in waiting.items() if not count]
    ends = set()
    while ahead:
        name = ahead.pop()
        ends.add(name)
        for child in below.get(name, ()):
            waiting[child] -= 1
            if not waiting[child]:
                ahead.append(child)
    return ends
