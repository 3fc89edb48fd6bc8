"""The shape of a tree of frames: its roots, and what tf2 cannot make a tree of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from msgspec import Struct

from lab3_usd.check.tf.frames import Edge, frames_in_cycles

_NONE: Mapping[str, str] = MappingProxyType({})


class TreeFault(Struct, frozen=True):
    """Something that tf2 cannot make a tree of, at one frame."""

    frame: str
    kind: str
    message: str


def tree_faults(edges: Sequence[Edge], reserved: Mapping[str, str] = _NONE) -> list[TreeFault]:
    """Return what is wrong with a tree, in the order of the frames.

    `reserved` are the frames that only something outside the stage may place, with its name.
    """
    faults = []
    ring = set(frames_in_cycles(edges))
    for frame, above in _by_child(edges).items():
        names = list(dict.fromkeys(edge.parent for edge in above if edge.parent != frame))
        if frame in reserved:
            faults.append(TreeFault(frame, "reserved", f"only {reserved[frame]} may place it"))
        if len(names) > 1:
            faults.append(
                TreeFault(frame, "two parents", f"{len(names)} parents: {', '.join(names)}")
            )
        for name in names:
            times = len({edge.publisher for edge in above if edge.parent == name})
            if times > 1:
                faults.append(
                    TreeFault(frame, "published twice", f"{times} publishers below {name}")
                )
        if any(edge.parent == frame for edge in above):
            faults.append(TreeFault(frame, "own parent", "its own parent"))
        elif frame in ring:
            faults.append(TreeFault(frame, "ring", "part of a cycle"))
    return faults


def roots(edges: Sequence[Edge]) -> list[str]:
    """Return the frames below no other, then one frame of every ring that hangs below none."""
    children = by_parent(edges)
    placed = _by_child(edges)
    tops = [name for name in children if name not in placed]
    reached: set[str] = set()
    for top in [*tops, *children]:
        if top not in reached and top not in tops:
            tops.append(top)
        ahead = [top]
        while ahead:
            name = ahead.pop()
            if name not in reached:
                reached.add(name)
                ahead.extend(edge.child for edge in children.get(name, ()))
    return tops


def _by_child(edges: Sequence[Edge]) -> dict[str, list[Edge]]:
    edges_by_child: dict[str, list[Edge]] = {}
    for edge in edges:
        edges_by_child.setdefault(edge.child, []).append(edge)
    return edges_by_child


def by_parent(edges: Sequence[Edge]) -> dict[str, list[Edge]]:
    """Return the transforms below each frame, in their order."""
    children: dict[str, list[Edge]] = {}
    for edge in edges:
        children.setdefault(edge.parent, []).append(edge)
    return children
